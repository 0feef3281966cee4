//! The command on bad recordings.
//!
//! The contract: either exit status 1 and one line on standard error, `mimu: PLACE: PROBLEM; REMEDY`; or exit status 0, a right result, and a warning
//! that names any problem of the data. Every case damages one of two recordings of `generator` in one way.

use std::f64::consts::PI;

mod answer;
mod damage;
mod files;
pub mod generator;
mod left_out;
mod listed;
mod refused;

use answer::*;
use damage::*;
use generator::*;

#[test]
fn what_only_its_owner_can_judge_is_a_warning() {
    #[rustfmt::skip]
    let cases: &[Case] = &[
        ("two axes of the gyro swapped", by_hand, |s| swap(s, "gyro_x", "gyro_y"), &["gyro: the axes are left-handed"]),
        ("two axes of the accelerometer swapped", by_hand, |s| swap(s, "accel_x", "accel_y"), &["gyro: its axes are rotated by 180 degrees"]),
        ("all axes of the gyro in another order", on_table, |s| { swap(s, "gyro_x", "gyro_y"); swap(s, "gyro_y", "gyro_z") }, &["gyro: its axes are rotated by 121 degrees relative to those of the ref_ columns"]),
        ("degrees for radians", by_hand, |s| { s.in_si(); scale(s, "gyro", 180.0 / PI) }, &["gyro: raw_unit = \"SI\"", "they are in deg/s"]),
        ("counts for SI", by_hand, |s| s.set("raw_unit", "\"SI\""), &["accel: raw_unit = \"SI\"", "1632 times"]),
        // As an import with a factor of six digits writes 250 deg/s.
        ("the first rows at the full scale of a gyro in SI", by_hand, |s| { s.in_si(); s.rows[0][1..4].fill(250.0 * 0.0174533) }, &["gyro_y: 1 sample at 4.363325", "full scale"]),
        ("nothing but poses on the table", || on_table_at(&[0.0], &[0, 1, 2]), |_| {}, &["gyro: not calibrated: all dwells have the same input"]),
    ];
    for (name, base, damage, words) in cases {
        println!("{name}");
        let mut samples = base();
        damage(&mut samples);
        warned(&Place::with(&samples).fit(&[]).json(), words);
    }
}

fn beginning_at(offset_s: f64) -> Samples {
    let mut samples = by_hand();
    let all = samples.all();
    samples.edit("t_s", all, |t| t + offset_s);
    samples
}

#[test]
fn a_clean_recording_gives_the_truth_within_its_intervals_and_no_warning() {
    for (samples, arguments) in [
        (by_hand(), vec![]),
        (by_hand(), vec!["--holdout", "blocks=0"]),
        (by_hand(), vec!["--holdout", "blocks=1000"]),
        (on_table(), vec![]),
        (on_table(), vec!["--holdout", "blocks=0"]),
        // One direction of each rate is enough, and times may begin anywhere.
        (on_table_at(&[0.0, 30.0, 90.0], &[0, 1, 2]), vec![]),
        (beginning_at(-1000.0), vec![]),
        (beginning_at(1.7e9), vec![]),
    ] {
        let result = Place::with(&samples).fit(&arguments).json();
        right(&result);
        // The recordings have no latitude, which a fit names wherever gravity is the only reference.
        let others = |w: &String| !w.contains("latitude");
        let warnings: Vec<String> = warnings(&result).into_iter().filter(others).collect();
        assert_eq!(warnings, [""; 0], "{arguments:?}");
    }
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
        .refused(&["samples.csv", "no gyro", "fit the other sensor"]);
    let result = Place::with(&on_table()).fit(&["--only", "accel"]).json();
    assert!(result["sensors"]["gyro"].is_null() && distance(&result, "accel") < 2.0);
}
