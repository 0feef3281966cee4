//! The command on recordings as they should not be.
//!
//! The contract: either exit status 1 and one line on standard error, `mimu: PLACE: PROBLEM; REMEDY`, or exit status
//! 0 with a right result and, where something was wrong with the data, a warning that names it. Every case
//! damages one of two recordings of `generator` in one way.

use std::f64::consts::PI;
use std::fs;
use std::ops::Range;
use std::path::Path;
use std::process::Command;

mod answer;
mod generator;

use answer::*;
use generator::*;

/// One way to damage a recording, and the words that the answer must have.
type Case = (
    &'static str,
    fn() -> Samples,
    fn(&mut Samples),
    &'static [&'static str],
);

fn column_of_dwell(samples: &mut Samples, column: &str, dwells: &[usize]) {
    for &k in dwells {
        let rows = samples.dwells[k].clone();
        stick(samples, column, rows);
    }
}

/// The channel keeps its first value.
fn stick(samples: &mut Samples, column: &str, rows: Range<usize>) {
    let value = samples.rows[rows.start][samples.column(column)];
    samples.edit(column, rows, |_| value);
}

fn swap(samples: &mut Samples, a: &str, b: &str) {
    let (a, b) = (samples.column(a), samples.column(b));
    samples.names.swap(a, b);
}

fn swap_sensors(samples: &mut Samples) {
    for axis in ["x", "y", "z"] {
        swap(samples, &format!("gyro_{axis}"), &format!("accel_{axis}"));
    }
}

fn scale(samples: &mut Samples, prefix: &str, factor: f64) {
    for name in samples.names.clone() {
        if name.starts_with(prefix) {
            let all = samples.all();
            samples.edit(&name, all, |x| x * factor);
        }
    }
}

fn keep_every(samples: &mut Samples, nth: usize, from: usize) {
    let mut row = 0;
    samples.rows.retain(|_| {
        row += 1;
        row <= from || row % nth == 0
    });
}

#[test]
fn what_cannot_be_right_is_refused_in_one_line_and_leaves_no_file() {
    let cases: &[Case] = &[
        (
            "a channel without a number",
            by_hand,
            |s| {
                let all = s.all();
                s.edit("accel_y", all, |_| f64::NAN);
            },
            &["samples.csv, column accel_y", "empty"],
        ),
        (
            "an empty time",
            by_hand,
            |s| s.edit("t_s", 77..78, |_| f64::NAN),
            &["row 79, column t_s", "empty"],
        ),
        (
            "shuffled rows",
            by_hand,
            |s| {
                let mut random = Random(5);
                for i in (1..s.rows.len()).rev() {
                    s.rows.swap(i, random.bits() as usize % (i + 1));
                }
            },
            &["data row 2, t_s", "goes back", "sort"],
        ),
        (
            "one swapped pair",
            by_hand,
            |s| s.rows.swap(500, 501),
            &["data row 502, t_s", "from 5.01 s to 5 s"],
        ),
        (
            "two rows with one time",
            by_hand,
            |s| s.rows[101][0] = s.rows[100][0],
            &["data row 102, t_s", "the time 1 s"],
        ),
        (
            "a misspelt column",
            by_hand,
            |s| s.names[3] = "gyro_w".into(),
            &["row 1", "gyro_z is missing"],
        ),
        (
            "a column twice",
            by_hand,
            |s| s.names[3] = "gyro_y".into(),
            &["row 1", "\"gyro_y\" appears twice"],
        ),
        (
            "no time column",
            by_hand,
            |s| s.names[0] = "time".into(),
            &["row 1", "t_s is missing"],
        ),
        (
            "gyro for accelerometer",
            by_hand,
            swap_sensors,
            &["accel", "wrong columns"],
        ),
        (
            "gyro for accelerometer on the table",
            on_table,
            swap_sensors,
            &["gyro", "do not follow", "swapped"],
        ),
        (
            "one gyro axis for one of the accelerometer",
            by_hand,
            |s| swap(s, "gyro_x", "accel_x"),
            &["accel", "column accel_x"],
        ),
        (
            "the same on the table",
            on_table,
            |s| swap(s, "gyro_x", "accel_x"),
            &["do not follow", "swapped"],
        ),
        (
            "half at half the rate",
            by_hand,
            |s| {
                let half = s.rows.len() / 2;
                keep_every(s, 2, half);
            },
            &["data row 4417, t_s", "the rate is mixed"],
        ),
        (
            "twice the rate",
            by_hand,
            |s| s.set("sample_rate_hz", "200.0"),
            &["t_s", "sample_rate_hz = 200", "the first is 0.010000 s"],
        ),
        (
            "five per cent off the rate",
            by_hand,
            |s| s.set("sample_rate_hz", "95.0"),
            &["t_s", "0.010526 s"],
        ),
        (
            "milliseconds for seconds",
            by_hand,
            |s| scale(s, "t_s", 1000.0),
            &["t_s", "the first is 10.000000 s", "unit of t_s"],
        ),
        (
            "no such rate",
            by_hand,
            |s| s.set("sample_rate_hz", "1e300"),
            &["recording.toml, sample_rate_hz", "1e300"],
        ),
        (
            "a channel that is stuck",
            by_hand,
            |s| {
                let all = s.all();
                stick(s, "gyro_y", all);
            },
            &["samples.csv, column gyro_y", "stuck", "wiring"],
        ),
        (
            "a number that no sensor gives",
            by_hand,
            |s| s.edit("accel_x", 100..101, |_| 1e300),
            &["row 102, column accel_x", "too large"],
        ),
        (
            "rails in another unit",
            by_hand,
            |s| s.set("rails.accel", "[0.0, 3.3]"),
            &["accelerometer", "20 accel_x saturated"],
        ),
        (
            "five poses",
            || by_hand_at(5, 1, Random::direction),
            |_| {},
            &["accel", "4 of the 9", "5 still poses"],
        ),
        (
            "poses about one axis",
            || by_hand_at(20, 1, |_| [1.0, 0.0, 0.0]),
            |_| {},
            &["accel", "one plane across x", "x up, down and slanted"],
        ),
        (
            "no rates about z",
            || on_table_at(&[-90.0, 0.0, 90.0], &[0, 1]),
            |_| {},
            &["gyro", "P_xz", "inputs along z"],
        ),
        (
            "all inputs equal",
            on_table,
            |s| {
                for name in s.names.clone() {
                    if name.starts_with("ref_") {
                        let all = s.all();
                        s.edit(&name, all, |x| if x.is_nan() { x } else { 1.0 });
                    }
                }
            },
            &["gyro: all dwells have the same input"],
        ),
        (
            "one input with the wrong sign",
            on_table,
            |s| {
                let dwell = s.dwells[4].clone();
                s.edit("ref_rate_x_dps", dwell, |x| -x);
            },
            &["gyro", "do not follow", "dwell 4 the least"],
        ),
        (
            "hands that never rest",
            by_hand,
            |s| {
                let moving: Vec<usize> = (0..19)
                    .flat_map(|k| s.turn(k).start + 20..s.turn(k).end - 20)
                    .collect();
                s.rows = moving.iter().map(|&i| s.rows[i].clone()).collect();
                for (i, row) in s.rows.iter_mut().enumerate() {
                    row[0] = i as f64 / RATE_HZ;
                }
            },
            &["still"],
        ),
        (
            "gravity in g",
            by_hand,
            |s| s.set("gravity_mps2", "1.0"),
            &["recording.toml, gravity_mps2", "looks like g", "9.80665"],
        ),
        (
            "SI readings in g",
            by_hand,
            |s| {
                s.set("raw_unit", "\"SI\"");
                scale(s, "accel", 1.0 / 1640.0 / GRAVITY);
                scale(s, "gyro", 1.0 / 5000.0);
            },
            &["raw_unit = \"SI\"", "in g", "--scale accel="],
        ),
        (
            "known forces in g",
            on_table,
            |s| scale(s, "ref_force", 1.0 / GRAVITY),
            &["ref_force", "in g", "m/s²"],
        ),
        (
            "a table recording without its inputs",
            by_hand,
            |s| s.set("reference", "\"table\""),
            &["no usable dwell has a known input", "ref_ columns"],
        ),
        (
            "a table recording by gravity",
            on_table,
            |s| s.set("reference", "\"gravity\""),
            &["accel"],
        ),
        (
            "gravity without an accelerometer",
            by_hand,
            |s| {
                s.names.truncate(4);
                s.rows.iter_mut().for_each(|row| row.truncate(4));
            },
            &["no accelerometer"],
        ),
        (
            "a step for every row",
            on_table,
            |s| {
                let step = s.column("step");
                for (i, row) in s.rows.iter_mut().enumerate() {
                    row[step] = i as f64;
                }
            },
            &["6900 too short"],
        ),
        (
            "all steps in transit",
            on_table,
            |s| {
                let all = s.all();
                s.edit("step", all, |_| -1.0);
            },
            &["dwells", "in transit", "column step"],
        ),
        (
            "a fraction of a step",
            on_table,
            |s| s.edit("step", 90..91, |_| 1.5),
            &["row 92, column step", "1.5"],
        ),
        (
            "one row",
            by_hand,
            |s| s.rows.truncate(1),
            &["only one row"],
        ),
        (
            "a tenth of a second",
            by_hand,
            |s| s.rows.truncate(12),
            &["0.12 s", "record for longer"],
        ),
        (
            "an unknown key",
            by_hand,
            |s| s.set("sample_rate", "3"),
            &["recording.toml, line 7", "sample_rate"],
        ),
        (
            "a missing key",
            by_hand,
            |s| s.set("reference", ""),
            &["recording.toml", "reference", "add the key"],
        ),
        (
            "an unknown unit",
            by_hand,
            |s| s.set("raw_unit", "\"mV\""),
            &["recording.toml, line 6", "mV"],
        ),
    ];
    for (name, base, damage, words) in cases {
        println!("{name}");
        let mut samples = base();
        damage(&mut samples);
        let place = Place::with(&samples);
        let (calibration, json) = (place.text("cal.toml"), place.text("fit.json"));
        let run = mimu([
            "fit",
            &place.text("rec"),
            "-o",
            &calibration,
            "--json",
            &json,
        ]);
        run.refused(words);
        assert_eq!(place.names(), ["rec"], "{name}");
    }
}

#[test]
fn what_can_be_left_out_is_named_and_the_result_is_right() {
    let cases: &[Case] = &[
        (
            "a few empty cells",
            by_hand,
            |s| {
                s.edit("accel_y", 50..53, |_| f64::NAN);
                s.edit("gyro_x", 100..101, |_| f64::NAN);
            },
            &["3 samples of accel_y", "1 sample of gyro_x"],
        ),
        (
            "an empty cell in a turn",
            by_hand,
            |s| {
                let turn = s.turn(3).start + 50;
                s.edit("gyro_x", turn..turn + 1, |_| f64::NAN);
            },
            &["the turn from dwell 3 to 4", "samples are missing"],
        ),
        (
            "rows twice",
            by_hand,
            |s| {
                s.edit("accel_y", 100..101, |_| f64::NAN);
                for i in [900, 500, 100] {
                    s.rows.insert(i, s.rows[i].clone());
                }
            },
            &["3 rows are the same"],
        ),
        (
            "a rate that is one per cent off",
            by_hand,
            |s| s.set("sample_rate_hz", "99.0"),
            &["100.000 Hz", "99 Hz", "the stamps are used"],
        ),
        (
            "a gap in a dwell",
            by_hand,
            |s| {
                let from = s.dwells[4].start + 100;
                s.rows.drain(from..from + 50);
            },
            &["1 gap, 0.500 s", "data row 1897"],
        ),
        (
            "a gap in a dwell on the table",
            on_table,
            |s| {
                let from = s.dwells[4].start + 50;
                s.rows.drain(from..from + 40);
            },
            &["1 gap, 0.400 s"],
        ),
        (
            "a gap in a turn",
            by_hand,
            |s| {
                let from = s.turn(4).start + 50;
                s.rows.drain(from..from + 20);
            },
            &["1 gap", "the turn from dwell 4 to 5 is not used"],
        ),
        (
            "a day between two halves",
            by_hand,
            |s| {
                let second = s.rows.len() / 2..s.rows.len();
                s.edit("t_s", second, |t| t + 86400.0);
            },
            &["86400.000 s missing"],
        ),
        (
            "accelerometer stuck in dwells",
            by_hand,
            |s| column_of_dwell(s, "accel_y", &[3, 4, 9]),
            &["3 dwells (3, 4, 9)", "accel_y stuck"],
        ),
        (
            "gyro stuck in dwells",
            by_hand,
            |s| column_of_dwell(s, "gyro_y", &[3, 4, 9]),
            &["3 dwells (3, 4, 9)", "gyro_y stuck"],
        ),
        (
            "gyro stuck on the table",
            on_table,
            |s| column_of_dwell(s, "gyro_y", &[3, 4, 9]),
            &["3 dwells (3, 4, 9)", "gyro_y stuck"],
        ),
        (
            "gyro stuck in a third of a turn",
            by_hand,
            |s| {
                let from = s.turn(3).start + 50;
                stick(s, "gyro_y", from..from + 50);
            },
            &["the turn from dwell 3 to 4 is not used: gyro_y is stuck"],
        ),
        (
            "gyro stuck in the second half",
            by_hand,
            |s| {
                let half = s.rows.len() / 2..s.rows.len();
                stick(s, "gyro_y", half);
            },
            &["10 dwells", "gyro_y stuck"],
        ),
        (
            "accelerometer clipped",
            by_hand,
            |s| {
                let all = s.all();
                s.edit("accel_z", all, |u| u.min(14000.0));
            },
            &["accel_z: the highest value 14000", "accel_z saturated"],
        ),
        (
            "accelerometer clipped on the table",
            on_table,
            |s| {
                let all = s.all();
                s.edit("accel_z", all, |u| u.min(14000.0));
            },
            &["5 dwells (20, 21, 22, 23, 24)", "accel_z saturated"],
        ),
        (
            "half of the samples clipped",
            on_table,
            |s| {
                let all = s.all();
                s.edit("accel_z", all, |u| u.min(16302.0));
            },
            &["5 dwells (20, 21, 22, 23, 24)", "accel_z saturated"],
        ),
        (
            "gyro clipped in fast turns",
            by_hand,
            |s| {
                let all = s.all();
                s.edit("gyro_z", all, |u| u.clamp(-6000.0, 6000.0));
            },
            &["gyro_z: the lowest value -6000", "gyro_z is at its rail"],
        ),
        (
            "a declared rail",
            by_hand,
            |s| {
                let all = s.all();
                s.set("rails.accel", "[-32768.0, 14000.0]");
                s.edit("accel_z", all, |u| u.min(14000.0));
            },
            &["accel_z saturated"],
        ),
        (
            "readings beyond a declared rail",
            by_hand,
            |s| s.set("rails.accel", "[-32768.0, 14000.0]"),
            &["accel_z saturated"],
        ),
        (
            "vibration in one step",
            on_table,
            |s| {
                let column = s.column("accel_x");
                for (k, row) in s.rows[s.dwells[7].clone()].iter_mut().enumerate() {
                    row[column] += 400.0 * (k as f64).sin();
                }
            },
            &["1 dwell (7) is not used: not still enough for the accel"],
        ),
        (
            "one absurd sample in a turn",
            by_hand,
            |s| {
                let turn = s.turn(2).start + 70;
                s.edit("gyro_x", turn..turn + 1, |_| 32767.0);
            },
            &["gyro: 1 outlier (turn to dwell 3)"],
        ),
    ];
    for (name, base, damage, words) in cases {
        println!("{name}");
        let mut samples = base();
        damage(&mut samples);
        let result = Place::with(&samples).fit(&[]).json();
        warned(&result, words);
        right(&result);
    }
}

#[test]
fn what_only_its_owner_can_judge_is_a_warning() {
    let cases: &[Case] = &[
        (
            "two axes of the gyro swapped",
            by_hand,
            |s| swap(s, "gyro_x", "gyro_y"),
            &["gyro: the axes come out left-handed"],
        ),
        (
            "the same on the table",
            on_table,
            |s| swap(s, "gyro_x", "gyro_y"),
            &["gyro: the axes come out left-handed"],
        ),
        (
            "two axes of the accelerometer swapped",
            by_hand,
            |s| swap(s, "accel_x", "accel_y"),
            &["gyro: its axes are turned by 180 degrees"],
        ),
        (
            "all axes of the gyro in another order",
            on_table,
            |s| {
                swap(s, "gyro_x", "gyro_y");
                swap(s, "gyro_y", "gyro_z");
            },
            &["gyro: its axes are turned by 121 degrees against those of the ref_ columns"],
        ),
        (
            "degrees for radians",
            by_hand,
            |s| {
                s.set("raw_unit", "\"SI\"");
                scale(s, "accel", 1.0 / 1640.0);
                scale(s, "gyro", 180.0 / PI / 5000.0);
            },
            &["gyro: raw_unit = \"SI\"", "it is in deg/s"],
        ),
        (
            "counts for SI",
            by_hand,
            |s| s.set("raw_unit", "\"SI\""),
            &["accel: raw_unit = \"SI\"", "1632 times"],
        ),
        (
            "nothing but poses on the table",
            || on_table_at(&[0.0], &[0, 1, 2]),
            |_| {},
            &["gyro: all dwells have the same input, so it is not calibrated"],
        ),
    ];
    for (name, base, damage, words) in cases {
        println!("{name}");
        let mut samples = base();
        damage(&mut samples);
        warned(&Place::with(&samples).fit(&[]).json(), words);
    }
}

#[test]
fn a_clean_recording_gives_the_truth_within_its_intervals_and_no_warning() {
    for (samples, arguments) in [
        (by_hand(), vec![]),
        (by_hand(), vec!["--holdout", "blocks=0"]),
        (by_hand(), vec!["--holdout", "blocks=1000"]),
        (on_table(), vec![]),
        (on_table(), vec!["--holdout", "blocks=0"]),
        (on_table(), vec!["--method", "kalman"]),
        (on_table(), vec!["--method", "xu", "--holdout", "0"]),
    ] {
        let result = Place::with(&samples).fit(&arguments).json();
        right(&result);
        assert_eq!(warnings(&result), [""; 0], "{arguments:?}");
    }
}

#[test]
fn one_direction_is_enough_for_least_squares_and_refused_where_the_method_needs_two() {
    let place = Place::with(&on_table_at(&[0.0, 30.0, 90.0], &[0, 1, 2]));
    right(&place.fit(&[]).json());
    place.fit(&["--method", "xu"]).refused(&[
        "gyro",
        "opposite rates about x, y, z",
        "least-squares",
    ]);
    place
        .fit(&["--method", "six-positions"])
        .refused(&["scale factor and bias x", "+x and -x"]);
}

#[test]
fn steps_that_are_row_numbers_are_refused_before_they_fill_the_memory() {
    let mut samples = by_hand();
    samples.names.push("step".into());
    let rows = std::mem::take(&mut samples.rows);
    for i in 0..120_000 {
        let mut row = rows[i % rows.len()].clone();
        row[0] = i as f64 / RATE_HZ;
        row.push(i as f64);
        samples.rows.push(row);
    }
    let place = Place::with(&samples);
    place.fit(&[]).refused(&["column step", "every other row"]);
}

#[test]
fn a_sensor_that_is_not_there_cannot_be_fitted_alone() {
    let mut samples = by_hand();
    samples.names.drain(1..4);
    samples
        .rows
        .iter_mut()
        .for_each(|row| drop(row.drain(1..4)));
    let place = Place::with(&samples);
    assert!(place.fit(&[]).json()["sensors"]["gyro"].is_null());
    place
        .fit(&["--only", "gyro"])
        .refused(&["samples.csv", "no gyro", "leave --only out"]);
    let result = Place::with(&on_table()).fit(&["--only", "accel"]).json();
    assert!(result["sensors"]["gyro"].is_null() && distance(&result, "accel") < 2.0);
}

#[test]
fn times_may_begin_anywhere() {
    for offset in [-1000.0, 1.7e9] {
        let mut samples = by_hand();
        let all = samples.all();
        samples.edit("t_s", all, |t| t + offset);
        right(&Place::with(&samples).fit(&[]).json());
    }
}

#[test]
fn a_damaged_text_is_refused_with_its_row() {
    let text = on_table().csv();
    let lines: Vec<&str> = text.lines().collect();
    let cut = text.rfind(',').unwrap();
    let cases: Vec<(&str, Vec<u8>, &[&str])> = vec![
        ("no bytes", vec![], &["samples.csv", "empty"]),
        (
            "a header",
            format!("{}\n", lines[0]).into(),
            &["row 2", "a header and no row"],
        ),
        (
            "a header and empty lines",
            format!("{}\n\n \n", lines[0]).into(),
            &["no row"],
        ),
        (
            "cut in a row",
            text[..cut].into(),
            &["row 6901", "truncated"],
        ),
        // In the header and two rows: a column without a name, which the other rows lack.
        (
            "a cell too many",
            text.replacen('\n', ",\n", 3).into(),
            &["row 4", "14 cells and the header 15"],
        ),
        (
            "a cell too few",
            lines.join("\n").replacen(",-", "", 1).into(),
            &["row 2", "13 cells and the header 14"],
        ),
        (
            "a word",
            text.replacen("\n0.5,", "\n0.5x,", 1).into(),
            &["row 52, column t_s", "0.5x"],
        ),
        (
            "an infinite time",
            text.replacen("\n0.5,", "\ninf,", 1).into(),
            &["row 52, column t_s", "infinite"],
        ),
        (
            "decimal commas",
            text.replace(',', ";").replace('.', ",").into(),
            &["row 1", "t_s is missing", "mimu import"],
        ),
        (
            "a zero byte",
            [&b"t_s,gyro_x\0"[..], text.as_bytes()].concat(),
            &["not text"],
        ),
        (
            "another file",
            b"PAR1\0\0\0".to_vec(),
            &["not text", "samples.parquet"],
        ),
        ("one long line", vec![b'7'; 3 << 20], &["no line break"]),
    ];
    for (name, bytes, words) in cases {
        println!("{name}");
        let place = Place::with(&on_table());
        fs::write(place.recording().join("samples.csv"), bytes).unwrap();
        place.fit(&[]).refused(words);
    }
}

/// A recording with its samples as Parquet.
fn as_parquet(samples: &Samples) -> Place {
    let place = Place::with(samples);
    let csv = place.recording().join("samples.csv");
    let (csv, out) = (csv.display().to_string(), place.text("parquet"));
    let gravity = GRAVITY.to_string();
    let run = mimu([
        "import",
        &csv,
        "--rate-hz",
        "100",
        "--gravity",
        &gravity,
        "--raw-unit",
        "count",
        "--reference",
        "gravity",
        "-o",
        &out,
    ]);
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    fs::remove_dir_all(place.recording()).unwrap();
    fs::rename(place.path("parquet"), place.recording()).unwrap();
    place
}

#[test]
fn a_damaged_parquet_file_is_refused() {
    let place = as_parquet(&by_hand());
    right(&place.fit(&[]).json());
    let path = place.recording().join("samples.parquet");
    let good = fs::read(&path).unwrap();
    for length in [0, 4, 1000, good.len() / 2, good.len() - 1] {
        fs::write(&path, &good[..length]).unwrap();
        place.fit(&[]).refused(&["samples.parquet", "Parquet"]);
    }
    let mut broken = good.clone();
    broken[2000..6000].fill(0xa5);
    fs::write(&path, &broken).unwrap();
    place.fit(&[]).refused(&["samples.parquet", "write"]);
    fs::write(&path, "t_s,gyro_x\n").unwrap();
    place.fit(&[]).refused(&["samples.parquet", "Parquet"]);
}

#[test]
fn a_place_without_a_recording_is_named() {
    let place = Place::with(&by_hand());
    place.fit(&[]).json();
    let file = place.recording().join("samples.csv").display().to_string();
    mimu(["fit", &file]).refused(&["samples.csv", "a recording is a directory", "mimu import"]);
    mimu(["fit", &place.text("nowhere")]).refused(&["nowhere", "no such directory"]);
    fs::create_dir(place.path("bare")).unwrap();
    mimu(["fit", &place.text("bare")]).refused(&["bare", "no recording.toml", "mimu import"]);
    fs::write(place.recording().join("samples.parquet"), "").unwrap();
    place
        .fit(&[])
        .refused(&["both samples.csv and samples.parquet"]);
    fs::remove_file(place.recording().join("samples.parquet")).unwrap();
    fs::remove_file(place.recording().join("samples.csv")).unwrap();
    place
        .fit(&[])
        .refused(&["neither samples.csv nor samples.parquet"]);
    fs::create_dir(place.recording().join("samples.csv")).unwrap();
    place.fit(&[]).refused(&["samples.csv", "directory"]);
    fs::write(place.recording().join("recording.toml"), [0xff, 0xfe]).unwrap();
    place.fit(&[]).refused(&["recording.toml, line 1", "UTF-8"]);
}

#[test]
fn an_output_that_cannot_be_written_is_refused_before_anything_appears() {
    let place = Place::with(&by_hand());
    let recording = place.text("rec");
    let (missing, good) = (place.text("none/x.toml"), place.text("cal.toml"));
    let fit = |arguments: &[&str]| {
        let fixed = ["fit", recording.as_str()];
        mimu(fixed.into_iter().chain(arguments.iter().copied()))
    };
    fit(&["-o", &missing]).refused(&["none/x.toml", "folder does not exist", "create it"]);
    fit(&["-o", &good, "--json", &missing]).refused(&["none/x.toml", "folder does not exist"]);
    fit(&["-o", &recording]).refused(&["rec", "directory"]);
    fit(&["-o", &good, "--json", &good]).refused(&["cal.toml", "another result"]);
    let samples = place.recording().join("samples.csv");
    let before = fs::read(&samples).unwrap();
    fit(&["-o", &samples.display().to_string()]).refused(&["samples.csv", "an input"]);
    assert_eq!(fs::read(&samples).unwrap(), before);
    // The file system of the system itself, which refuses even its owner.
    if Path::new("/proc/version").exists() {
        fit(&["-o", "/proc/cal.toml"]).refused(&["/proc/cal.toml"]);
    }
    assert_eq!(place.names(), ["rec"]);
}

#[cfg(unix)]
#[test]
fn a_pipe_is_written_to_and_not_replaced() {
    use std::os::unix::fs::FileTypeExt as _;
    let place = Place::with(&by_hand());
    let pipe = place.path("pipe");
    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || fs::read_to_string(pipe).unwrap()
    });
    let run = mimu(["fit", &place.text("rec"), "-o", &place.text("pipe")]);
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    assert!(reader.join().unwrap().contains("mimu-calibration/1"));
    assert!(fs::metadata(pipe).unwrap().file_type().is_fifo());
}

#[test]
fn wrong_usage_has_status_2() {
    let place = Place::with(&by_hand());
    let recording = place.text("rec");
    for arguments in [
        &["--holdout", "blocks=1"][..],
        &["--holdout", "blocks=1000000000000"],
        &["--holdout", "blocks=99999999999999999999999"],
        &["--holdout", "four"],
        &["--still", "0"],
        &["--still", "nan"],
        &["--still", "-3"],
        &["--method", "guess"],
        &["--unknown"],
    ] {
        let run = mimu(
            ["fit", &recording]
                .into_iter()
                .chain(arguments.iter().copied()),
        );
        assert_eq!(run.status, Some(2), "{arguments:?}: {}", run.stderr);
        assert!(run.stdout.is_empty(), "{arguments:?}");
    }
    assert_eq!(mimu([""; 0]).status, Some(2));
}

#[test]
fn no_text_for_people_shows_a_number_that_is_none() {
    for samples in [
        by_hand(),
        on_table(),
        by_hand_at(9, 1, Random::direction),
        on_table_at(&[0.0], &[0, 1, 2]),
    ] {
        let mut odd = samples.clone();
        column_of_dwell(&mut odd, "accel_y", &[3]);
        odd.edit("accel_z", 0..300, |_| f64::NAN);
        for samples in [samples, odd] {
            let place = Place::with(&samples);
            let run = mimu([
                "fit",
                &place.text("rec"),
                "--dwells",
                "-o",
                &place.text("cal.toml"),
            ]);
            if run.status == Some(1) {
                run.refusal();
                continue;
            }
            let calibration = fs::read_to_string(place.path("cal.toml")).unwrap();
            let again = mimu([
                "verify",
                &place.text("rec"),
                "--calibration",
                &place.text("cal.toml"),
            ]);
            assert_eq!(again.status, Some(0), "{}", again.stderr);
            for text in [run.stdout, again.stdout, calibration] {
                for word in text.split(|c: char| !c.is_alphanumeric()) {
                    assert!(
                        !["nan", "inf"].contains(&word.to_lowercase().as_str()),
                        "{text}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_damaged_calibration_file_is_refused_with_its_place() {
    let place = Place::with(&by_hand());
    let path = place.text("cal.toml");
    let run = mimu(["fit", &place.text("rec"), "-o", &path]);
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    let good = fs::read_to_string(&path).unwrap();
    let verify = || mimu(["verify", &place.text("rec"), "--calibration", &path]);
    assert_eq!(verify().status, Some(0));
    let line = |start: &str| {
        good.lines()
            .find(|l| l.starts_with(start))
            .unwrap()
            .to_string()
    };
    let offset = line("o = ");
    let digit = offset.replacen("0.", "1.", 1);
    assert_ne!(offset, digit);
    let cut = good.find("[accel.judged]").unwrap();
    let cases: Vec<(String, &[&str])> = vec![
        (
            good.replacen("[gyro]\n", "[gyro]\nscale = 3\n", 1),
            &["cal.toml, line", "scale"],
        ),
        (
            good.replacen(&offset, "o = [nan, 0.0, 0.0]", 1),
            &["[gyro]", "not a number"],
        ),
        (good.replacen(&offset, &digit, 1), &["[gyro]", "edited"]),
        (
            good.replacen("calibration/1", "calibration/9", 1),
            &["calibration/9", "version of mimu"],
        ),
        (
            good.replacen("direction = \"raw to SI\"", "direction = \"SI to raw\"", 1),
            &["[gyro]", "SI to raw"],
        ),
        (
            good[..cut].to_string(),
            &["cal.toml, line", "judged", "cut"],
        ),
        (good[..good.len() - 9].to_string(), &["cal.toml, line"]),
        (String::new(), &["cal.toml", "missing field"]),
        (place.text("rec"), &["cal.toml, line 1"]),
    ];
    for (text, words) in cases {
        assert_ne!(text, good);
        fs::write(&path, text).unwrap();
        verify().refused(words);
    }
    fs::write(&path, [0xff, 0x00]).unwrap();
    verify().refused(&["cal.toml, line 1", "UTF-8"]);
    fs::remove_file(&path).unwrap();
    verify().refused(&["cal.toml", "no such file"]);
}

#[test]
fn a_recording_that_does_not_fit_its_calibration_is_told_apart() {
    let place = Place::with(&by_hand());
    let calibration = place.text("cal.toml");
    let run = mimu(["fit", &place.text("rec"), "-o", &calibration]);
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    let verify = |samples: &Samples| {
        samples.write(&place.path("other"));
        mimu([
            "verify",
            &place.text("other"),
            "--calibration",
            &calibration,
            "--json",
            "-",
        ])
    };
    let fresh = by_hand_at(12, 9, Random::direction);
    let result = verify(&fresh).json();
    assert_eq!(warnings(&result), [""; 0]);
    for sensor in ["gyro", "accel"] {
        let figure = |key: &str| result["sensors"][sensor][key].as_f64().unwrap();
        assert!(figure("rms") < 2.0 * figure("noise_floor"), "{result:#}");
        assert!(figure("rms_raw") > 5.0 * figure("rms"), "{result:#}");
    }
    let mut other = fresh.clone();
    other.set("device", "\"unit-8\"");
    warned(
        &verify(&other).json(),
        &["for \"unit-7\", the recording of \"unit-8\""],
    );
    warned(
        &verify(&by_hand()).json(),
        &["the recording that the calibration was made from"],
    );
    let mut other = fresh.clone();
    other.set("raw_unit", "\"V\"");
    verify(&other).refused(&["raw unit is V", "for count"]);
    let mut table = on_table();
    table.names.truncate(11);
    table.rows.iter_mut().for_each(|row| row.truncate(11));
    let gyro_only = verify(&table).json();
    assert!(gyro_only["sensors"]["accel"].is_null());
    verify(&by_hand_at(1, 1, Random::direction)).json();
    let mut blank = on_table();
    for name in blank.names.clone().iter().filter(|n| n.starts_with("ref_")) {
        let all = blank.all();
        blank.edit(name, all, |_| f64::NAN);
    }
    verify(&blank).refused(&["nothing to judge"]);
}

#[test]
fn an_import_that_fails_leaves_nothing_behind() {
    let place = Place::new();
    let mut table = on_table();
    table.rows.truncate(500);
    fs::write(place.path("good.csv"), table.csv()).unwrap();
    let word = table.csv().replacen("\n2.5,", "\n2.5,x", 1);
    fs::write(place.path("word.csv"), word).unwrap();
    fs::write(place.path("inputs.csv"), "step,turn_x_deg\n0,90\n0,180\n").unwrap();
    fs::write(place.path("bare.csv"), "1,2,3\n4,5,6\n").unwrap();
    let before = place.names();
    let import = |file: &str, arguments: &[&str]| {
        let (file, out) = (place.text(file), place.text("out"));
        let fixed = [
            "import",
            &file,
            "--raw-unit",
            "count",
            "--reference",
            "gravity",
            "-o",
            &out,
        ];
        mimu(fixed.into_iter().chain(arguments.iter().copied()))
    };
    let inputs = place.text("inputs.csv");
    let missing = place.text("none/x.json");
    import("word.csv", &[]).refused(&["word.csv, row 252, column step", "x"]);
    import("good.csv", &["--gravity", "1"]).refused(&["gravity", "looks like g"]);
    import("good.csv", &["--rate-hz", "nan"]).refused(&["not a sample rate", "--rate-hz"]);
    import("good.csv", &["--rate-hz", "1e-300"]).refused(&["sample_rate_hz", "1e-300"]);
    import("good.csv", &["--scale", "accel=1e300"]).refused(&["column accel_x", "too large"]);
    import("good.csv", &["--latitude", "91"]).refused(&["latitude_deg", "91"]);
    import("good.csv", &["--inputs", &inputs])
        .refused(&["inputs.csv, row 3, column step", "twice"]);
    import("good.csv", &["--json", &missing]).refused(&["none/x.json", "folder does not exist"]);
    import("bare.csv", &[]).refused(&["bare.csv", "--columns"]);
    import("bare.csv", &["--columns", "gyro_x,gyro_y,gyro_z"]).refused(&["bare.csv", "--rate-hz"]);
    import("nothing.csv", &[]).refused(&["nothing.csv", "no such file"]);
    assert_eq!(
        import("good.csv", &["--columns", "t_s,acc_x"]).status,
        Some(2)
    );
    assert_eq!(place.names(), before);
    assert_eq!(import("good.csv", &[]).status, Some(0));
    import("good.csv", &[]).refused(&["out", "exists already"]);
}
