//! The means are computed here from `u = P a + b` and normal errors, without any code of the fit.

use crate::warning::Warning;
use mimu_recording::{Columns, Manifest, PoseMean, PoseMeans, RawUnit, Reference};
use mimu_rig::random::Random;
use nalgebra::{Matrix3, Vector3};

use crate::fit::{Options, fit};
use crate::prepared::Prepared;
use crate::quantity::Sensor;

const G: f64 = 9.81;
/// Standard deviation of one sample, and how many make a mean.
const SD: f64 = 20.0;
const AVERAGED: u64 = 100;

/// Matrix in counts per m/s², lower triangular like the frame of a fit to gravity, and bias in counts.
fn truth() -> (Matrix3<f64>, Vector3<f64>) {
    let p = Matrix3::new(830.0, 0.0, 0.0, 11.0, 815.0, 0.0, -7.0, 4.0, 842.0);
    (p, Vector3::new(310.0, -120.0, 45.0))
}

/// Directions all over the sphere.
fn directions(n: usize) -> impl Iterator<Item = Vector3<f64>> {
    (0..n).map(move |i| {
        let z = 1.0 - (2 * i + 1) as f64 / n as f64;
        let (across, turn) = ((1.0 - z * z).sqrt(), 2.4 * i as f64);
        Vector3::new(across * turn.cos(), across * turn.sin(), z)
    })
}

/// `n` poses of an accelerometer, whose means err by `error` counts; `known`: with standard deviations and numbers of samples.
fn table(n: usize, reference: Reference, error: f64, known: bool, seed: u64) -> PoseMeans {
    let mut random = Random::new(seed, "means of poses");
    let (p, b) = truth();
    let poses = directions(n).map(|direction| {
        let force = G * direction;
        let u = p * force + b;
        let mut raw = [f64::NAN; 6];
        let mut input = [f64::NAN; 6];
        for axis in 0..3 {
            raw[3 + axis] = u[axis] + error * random.normal();
            input[3 + axis] = force[axis];
        }
        PoseMean {
            label: String::new(),
            raw,
            deviation: [if known { SD } else { f64::NAN }; 6],
            averaged: [known.then_some(AVERAGED); 6],
            reference: match reference {
                Reference::Table => input,
                Reference::Gravity | Reference::TurntableRate => [f64::NAN; 6],
            },
            temp_c: f64::NAN,
        }
    });
    let mut manifest = Manifest::new("unit", f64::NAN, G, RawUnit::Count, reference);
    manifest.means = true;
    let known_force = reference == Reference::Table;
    PoseMeans {
        manifest,
        place: "means.csv".into(),
        sha256: String::new(),
        poses: poses.collect(),
        columns: Columns {
            accel: true,
            reference: [false, false, false, known_force, known_force, known_force],
            ..Columns::default()
        },
    }
}

fn options() -> Options {
    Options {
        holdout_blocks: 0,
        ..Options::default()
    }
}

/// Share of the 95 % intervals that contain the truth, over `runs` tables.
fn coverage(reference: Reference, error: f64, known: bool, runs: u64) -> f64 {
    let (p, b) = truth();
    let c = p.try_inverse().unwrap();
    let o = -c * b;
    let (mut held, mut all) = (0, 0);
    for seed in 0..runs {
        let means = table(24, reference, error, known, seed);
        let fitted = fit(Prepared::of_means(&means).unwrap(), options()).unwrap();
        let triad = &fitted.sensor(Sensor::Accel).unwrap().estimated.triad;
        for (i, estimate) in triad.inverse_estimates().iter().enumerate() {
            let truth = if i < 9 { c[(i / 3, i % 3)] } else { o[i - 9] };
            // The frame is chosen so that elements above the diagonal are zero.
            if estimate.sigma > 0.0 {
                all += 1;
                held += usize::from((estimate.value - truth).abs() <= estimate.interval);
            }
        }
    }
    held as f64 / all as f64
}

#[test]
fn intervals_from_means_hold_the_truth_whether_the_table_knows_its_noise_or_not() {
    let white = SD / (AVERAGED as f64).sqrt();
    for reference in [Reference::Table, Reference::Gravity] {
        for (error, known, of) in [
            (white, true, "noise as the table says"),
            (white, false, "no standard deviations"),
            (5.0 * white, true, "means that repeat five times as badly"),
        ] {
            let share = coverage(reference, error, known, 150);
            println!("{reference}, {of}: {:.1} %", 100.0 * share);
            assert!((0.93..=0.97).contains(&share), "{reference}, {of}: {share}");
        }
    }
}

#[test]
fn the_noise_of_a_mean_is_that_of_the_table_and_without_one_it_is_unknown_and_the_scatter_is_all_there_is()
 {
    let noise_floor = |known| {
        let means = table(24, Reference::Table, 2.0, known, 1);
        let fitted = fit(Prepared::of_means(&means).unwrap(), options()).unwrap();
        let sensor = fitted.sensor(Sensor::Accel).unwrap();
        let extra = sensor.estimated.scatter[0].1.extra_variance;
        (sensor.noise_floor(), extra, fitted.warnings)
    };
    let (floor, _, warnings) = noise_floor(true);
    // 20 counts over the root of 100, in m/s² of about 829 counts.
    assert!((floor / (2.0 / 829.0) - 1.0).abs() < 0.02, "{floor}");
    assert!(
        warnings
            .iter()
            .any(|w| w.to_string().contains("assumed to be white"))
    );
    let (floor, extra, warnings) = noise_floor(false);
    // Unknown, not zero.
    assert!(floor.is_nan(), "{floor}");
    assert!((0.5..2.0).contains(&(extra.sqrt() / 2.0)), "{extra}");
    assert!(
        warnings
            .iter()
            .any(|w| w.to_string().contains("taken as the noise")),
        "{warnings:?}"
    );
}

#[test]
fn a_gyro_is_fitted_to_steps_of_known_rate_and_of_gravity_alone_is_refused_by_name() {
    let with_gyro = |rates: bool| {
        let reference = if rates {
            Reference::Table
        } else {
            Reference::Gravity
        };
        let mut means = table(24, reference, 0.0, true, 1);
        means.columns.gyro = true;
        for (pose, direction) in means.poses.iter_mut().zip(directions(24)) {
            for axis in 0..3 {
                // 50 counts per deg/s, and 7 counts.
                pose.raw[axis] = 7.0 + 50.0 * 90.0 * direction[axis];
                if rates {
                    pose.reference[axis] = 90.0 * direction[axis];
                }
            }
        }
        means
    };
    let fitted = fit(Prepared::of_means(&with_gyro(true)).unwrap(), options()).unwrap();
    let gyro = &fitted.sensor(Sensor::Gyro).unwrap().estimated.triad.inverse;
    let rate = gyro.apply(&Vector3::new(7.0 + 50.0, 7.0, 7.0));
    assert!(
        (rate - Vector3::new(1f64.to_radians(), 0.0, 0.0)).norm() < 1e-6,
        "{rate}"
    );

    let by_gravity = || Prepared::of_means(&with_gyro(false)).unwrap();
    let fitted = fit(by_gravity(), options()).unwrap();
    assert!(fitted.sensor(Sensor::Gyro).is_none() && fitted.sensor(Sensor::Accel).is_some());
    let says = Warning::MeansOfTurns.of(Sensor::Gyro);
    assert!(fitted.warnings.contains(&says), "{:?}", fitted.warnings);
    let only = Options {
        only: Some(Sensor::Gyro),
        ..options()
    };
    let error = fit(by_gravity(), only).unwrap_err().to_string();
    assert!(
        error.contains("turns calibrate the gyro; they need samples"),
        "{error}"
    );
}

#[test]
fn rows_without_a_mean_are_counted_and_left_out() {
    let mut means = table(24, Reference::Gravity, 1.0, true, 3);
    means.poses[5].raw[4] = f64::NAN;
    let fitted = fit(Prepared::of_means(&means).unwrap(), options()).unwrap();
    assert_eq!(fitted.sensor(Sensor::Accel).unwrap().dwells, 23);
    let says = |w: &Warning| w.to_string().contains("accel: 1 of 24 rows");
    assert!(fitted.warnings.iter().any(says), "{:?}", fitted.warnings);
}
