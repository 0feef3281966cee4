//! Data that cannot be right is refused, and no file is left.

use super::answer::*;
use super::damage::*;
use super::generator::*;

#[test]
fn what_cannot_be_right_is_refused_in_one_line_and_leaves_no_file() {
    #[rustfmt::skip]
    let cases: &[Case] = &[
        ("a channel without a number", by_hand, |s| s.edit("accel_y", s.all(), |_| f64::NAN), &["samples.csv, column accel_y", "empty"]),
        ("one swapped pair", by_hand, |s| s.rows.swap(500, 501), &["data row 502, t_s", "from 5.01 s to 5 s"]),
        ("two rows with one time", by_hand, |s| s.rows[101][0] = s.rows[100][0], &["data row 102, t_s", "the time 1 s"]),
        ("gyro for accelerometer", by_hand, swap_sensors, &["accel", "wrong columns"]),
        ("gyro for accelerometer on the table", on_table, swap_sensors, &["gyro", "do not follow", "swapped"]),
        ("one gyro axis for one of the accelerometer", by_hand, |s| swap(s, "gyro_x", "accel_x"), &["accel", "column accel_x"]),
        ("half at half the rate", by_hand, |s| s.keep_every(2, s.rows.len() / 2), &["data row 4417, t_s", "the rate is mixed"]),
        ("twice the rate", by_hand, |s| s.set("sample_rate_hz", "200.0"), &["t_s", "sample_rate_hz = 200", "the first such interval is 0.010000 s"]),
        ("milliseconds for seconds", by_hand, |s| scale(s, "t_s", 1000.0), &["t_s", "the first such interval is 10.000000 s", "unit of t_s"]),
        ("a channel that is stuck", by_hand, |s| s.stick("gyro_y", s.all()), &["samples.csv, column gyro_y", "stuck", "wiring"]),
        ("rails in another unit", by_hand, |s| s.set("rails.accel", "[0.0, 3.3]"), &["accelerometer", "20 accel_x saturated"]),
        ("five poses", || by_hand_at(5, 1, Random::direction), |_| {}, &["accel", "4 of the 9", "5 still poses"]),
        ("poses about one axis", || by_hand_at(20, 1, |_| [1.0, 0.0, 0.0]), |_| {}, &["accel", "one plane perpendicular to x", "x up, down and slanted"]),
        ("no rates about z", || on_table_at(&[-90.0, 0.0, 90.0], &[0, 1]), |_| {}, &["gyro", "P_xz", "rates along z"]),
        ("all inputs equal", on_table, |s| s.edit_all("ref_", |x| if x.is_nan() { x } else { 1.0 }), &["gyro: not calibrated: all dwells have the same input"]),
        ("one input with the wrong sign", on_table, |s| s.edit("ref_rate_x_dps", s.dwells[4].clone(), |x| -x), &["gyro", "do not follow", "dwell 4 the least"]),
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
        ("SI readings in g", by_hand, |s| { s.in_si(); scale(s, "accel", 1.0 / GRAVITY) }, &["raw_unit = \"SI\"", "in g", "the factor accel=9.80665 (mimu import --scale)"]),
        ("known forces in g", on_table, |s| scale(s, "ref_force", 1.0 / GRAVITY), &["ref_force", "in g", "m/s²"]),
        ("a table recording without its inputs", by_hand, |s| s.set("reference", "\"table\""), &["no usable dwell has a known input", "ref_ columns"]),
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
        ("all steps in transit", on_table, |s| s.edit("step", s.all(), |_| -1.0), &["dwells", "in transit", "column step"]),
        ("one row", by_hand, |s| s.rows.truncate(1), &["only one row"]),
        ("a tenth of a second", by_hand, |s| s.rows.truncate(12), &["0.12 s", "record for longer"]),
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
