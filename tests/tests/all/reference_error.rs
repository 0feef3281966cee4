//! A table that errs as its certificate allows: the intervals that count its errors contain the truth, those that do not are too narrow.

use mimu::fit::{Cause, Fit, Options, fit};
use mimu::quantity::Sensor;
use mimu::result::budget::BudgetRow;
use mimu::result::fit::FitResult;
use mimu_recording::ReferenceError;
use mimu_rig::random::Random;
use mimu_rig::rig_file::{AffineFile, RigFile};
use mimu_tests::bench;
use mimu_tests::coverage::Tally;
use mimu_tests::says;

/// Half of a 95 % interval in standard deviations.
const HALF: f64 = 1.959_964;
const ARCSEC: f64 = 3600.0;

/// What the certificate says: a good table, an ordinary mount.
fn stated() -> ReferenceError {
    ReferenceError {
        rate: 2e-4,
        mounting_deg: 0.02,
        tilt_deg: 0.03,
        orthogonality_deg: 0.02,
        ..ReferenceError::default()
    }
}

/// A unit on a table whose errors are drawn by the certificate.
fn on_table(run: u64) -> (RigFile, [AffineFile; 2]) {
    let mut random = Random::new(run, "reference");
    let (gyro, accel) = (bench::gyro(&mut random), bench::accel(&mut random));
    let mut file = bench::clean(gyro.clone(), accel.clone());
    let stated = stated();
    let mut draw = |half: f64| random.normal() * half / HALF;
    // One way to each pose.
    file.table.middle_min_deg = 0.0;
    file.table.rate_scale_ppm = [draw(stated.rate) * 1e6, 0.0, 0.0];
    file.table.level_arcsec = [0; 2].map(|_| draw(stated.tilt_deg) * ARCSEC);
    file.table.nonorthogonality_arcsec = [0; 2].map(|_| draw(stated.orthogonality_deg) * ARCSEC);
    file.table.mounting_arcsec = [0; 3].map(|_| draw(stated.mounting_deg) * ARCSEC);
    (file, [gyro, accel])
}

/// Fits of the same recording, without and with the statement.
fn fits(run: u64, file: &RigFile) -> [Fit; 2] {
    let plan = bench::table_plan(None);
    [false, true].map(|states| {
        let prepared = bench::recorded(&plan, file, run);
        let prepared = match states {
            true => prepared.with_reference_error(stated()),
            false => prepared,
        };
        fit(prepared, Options::default()).expect("a fit")
    })
}

/// Tallies of gyro and accelerometer, without and with the statement.
fn tallied(runs: u64) -> [[Tally; 2]; 2] {
    let all: Vec<usize> = (0..12).collect();
    let mut tallies = ["not stated", "stated"].map(|name| {
        Sensor::BOTH.map(|sensor| Tally::new(format!("{sensor}, errors of the table {name}"), &all))
    });
    for run in 0..runs {
        let (file, truth) = on_table(run);
        // The bias of a session includes what the slow noise contributed.
        let wander = bench::wander(&bench::table_plan(None), &file, run);
        for (fit, tallies) in fits(run, &file).iter().zip(&mut tallies) {
            for (found, tally) in fit.sensors.iter().zip(tallies) {
                let sensor = found.sensor as usize;
                let mut truth = bench::parameters(&truth[sensor]);
                for (axis, by) in wander[sensor].iter().enumerate() {
                    truth[9 + axis] += by;
                }
                tally.add(&found.estimated.triad, &truth);
            }
        }
    }
    tallies
}

#[test]
fn intervals_that_count_the_errors_of_the_table_hold_the_truth() {
    let runs = 40;
    let [without, with] = tallied(runs);
    for tally in without.iter().chain(&with) {
        let [mean, low, high] = tally.summary();
        println!(
            "{:<40}{:>5} runs: 95 % intervals hold the truth in {:.1} % ({:.1} to {:.1} by parameter)",
            tally.name,
            tally.runs,
            100.0 * mean,
            100.0 * low,
            100.0 * high
        );
    }
    // Four sigmas of the number of runs, because 24 parameters are judged.
    let margin = |share: f64| 4.0 * (share * (1.0 - share) / runs as f64).sqrt();
    for tally in &with {
        let [_, low, high] = tally.summary();
        assert!(
            low > 0.93 - margin(0.93),
            "{}: {:?}",
            tally.name,
            tally.shares()
        );
        assert!(
            high < 0.97 + margin(0.97),
            "{}: {:?}",
            tally.name,
            tally.shares()
        );
    }
    for tally in &without {
        let [_, low, _] = tally.summary();
        assert!(
            low < 0.75,
            "{}: the errors are too small to matter",
            tally.name
        );
    }
}

/// The derivatives that need no bench: a scale factor errs as gravity or the rate, an angle as the mounting.
#[test]
fn what_no_pose_shows_widens_the_intervals_by_all_of_it() {
    let file = bench::drawn(1, "reference");
    let error = ReferenceError {
        gravity_mps2: 0.01,
        rate: 1e-3,
        mounting_deg: 0.05,
        ..ReferenceError::default()
    };
    let prepared = bench::recorded(&bench::table_plan(None), &file, 1).with_reference_error(error);
    let gravity = prepared.manifest.gravity_mps2;
    let found = FitResult::of(&fit(prepared, Options::default()).expect("a fit"));
    let row = |sensor: Sensor, name: &str| -> (BudgetRow, f64) {
        let of = found.sensors[sensor].as_ref().unwrap();
        let value = of.parameters.iter().find(|p| p.name == name).unwrap().value;
        let row = of.budget.iter().find(|row| row.name == name).unwrap();
        (row.clone(), value)
    };
    let sigma = |(row, _): &(BudgetRow, f64), cause: Cause| {
        let share = row
            .shares
            .iter()
            .find(|s| s.0 == cause)
            .map_or(0.0, |s| s.1);
        row.sigma * share.sqrt()
    };
    for (sensor, cause, relative) in [
        (Sensor::Accel, Cause::Gravity, 0.01 / HALF / gravity),
        (Sensor::Gyro, Cause::Rate, 1e-3 / HALF),
    ] {
        for axis in ["x", "y", "z"] {
            let row = row(sensor, &format!("scale_{axis}"));
            let expected = row.1 * relative;
            let off = sigma(&row, cause) / expected - 1.0;
            assert!(off.abs() < 1e-3, "{sensor} {axis}: {off:e}");
        }
    }
    // The x axis of the accelerometer is the sensor's, so that it turns with the mount: its direction errs about y and z.
    let angle = 0.05_f64.to_radians() / HALF;
    for name in ["misalignment_x", "misalignment_y", "misalignment_z"] {
        let row = row(Sensor::Gyro, name);
        let off = sigma(&row, Cause::Mounting) / angle - 1.0;
        assert!(off.abs() < 0.05, "{name}: {off}");
    }
}

/// By hand the assumed gravity errs, and with it every scale factor of the accelerometer by the same share.
#[test]
fn by_hand_intervals_that_count_the_error_of_gravity_hold_the_truth() {
    let stated = ReferenceError {
        gravity_mps2: 0.05,
        ..ReferenceError::default()
    };
    let places: Vec<usize> = vec![0, 3, 4, 6, 7, 8];
    let mut tallies =
        ["not stated", "stated"].map(|name| Tally::new(format!("gravity {name}"), &places));
    let runs = 60;
    for run in 0..runs {
        let mut random = Random::new(run, "gravity by hand");
        let (gyro, accel) = (bench::gyro(&mut random), bench::accel(&mut random));
        let file = bench::clean(gyro, accel.clone());
        let mut prepared = bench::recorded(&bench::hand_plan(20), &file, run);
        prepared.manifest.gravity_mps2 += random.normal() * stated.gravity_mps2 / HALF;
        let with = prepared.clone().with_reference_error(stated.clone());
        for (prepared, tally) in [prepared, with].into_iter().zip(&mut tallies) {
            let found = fit(prepared, Options::default()).expect("a fit");
            let found = found.sensor(Sensor::Accel).expect("an accelerometer");
            tally.add(&found.estimated.triad, &bench::parameters(&accel));
        }
    }
    let [without, with] = tallies.map(|tally| tally.summary());
    println!("not stated {without:?}, stated {with:?}");
    let margin = |share: f64| 4.0 * (share * (1.0 - share) / runs as f64).sqrt();
    let [mean, low, _] = with;
    assert!(low > 0.93 - margin(0.93) && mean > 0.92, "{with:?}");
    assert!(without[1] < 0.75, "{without:?}");
}

/// Each alone: an error that one of the sensors does not see leaves its intervals as they are.
#[test]
fn an_error_that_one_sensor_sees_changes_the_intervals_of_that_alone() {
    let file = bench::drawn(1, "reference");
    let none = ReferenceError::default;
    #[rustfmt::skip]
    let all = [
        (Sensor::Gyro, ReferenceError { rate: 1e-2,..none() }),
        (Sensor::Accel, ReferenceError { gravity_mps2: 0.1,..none() }),
        (Sensor::Accel, ReferenceError { tilt_deg: 0.5,..none() }),
        (Sensor::Accel, ReferenceError { level_deg: 0.5,..none() }),
    ];
    let widths = |error: ReferenceError| {
        let prepared = bench::recorded(&bench::table_plan(None), &file, 1);
        let fitted = fit(prepared.with_reference_error(error), Options::default()).expect("a fit");
        Sensor::BOTH.map(|sensor| {
            let triad = &fitted.sensor(sensor).expect("both").estimated.triad;
            triad.inverse_covariance.trace()
        })
    };
    let without = widths(none());
    for (sensor, error) in all {
        let with = widths(error.clone());
        for (k, each) in Sensor::BOTH.iter().enumerate() {
            let wider = with[k] / without[k];
            match *each == sensor {
                true => assert!(wider > 1.2, "{each}: {wider}, {error:?}"),
                false => assert!((wider - 1.0).abs() < 1e-6, "{each}: {wider}, {error:?}"),
            }
        }
    }
}

#[test]
fn errors_that_a_fit_cannot_count_are_refused_by_name() {
    let file = bench::drawn(1, "refused");
    let by_hand = bench::recorded(&bench::hand_plan(20), &file, 1);
    let refused = fit(by_hand.with_reference_error(stated()), Options::default());
    let said = refused.unwrap_err().to_string();
    says(
        &said,
        &["rate", "mounting_deg", "tilt_deg", "orthogonality_deg"],
    );
    assert!(said.contains("only gravity_mps2 applies"), "{said}");
}
