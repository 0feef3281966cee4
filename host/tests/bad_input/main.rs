//! The command on recordings as they should not be.
//!
//! The contract: either exit status 1 and one line on standard error, `mimu: PLACE: PROBLEM; REMEDY`, or exit status
//! 0 with a right result and, where something was wrong with the data, a warning that names it. Every case
//! damages one of two recordings of `generator` in one way.

use std::f64::consts::PI;
use std::ops::Range;

mod answer;
mod files;
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
