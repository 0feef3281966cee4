//! A session in which the device restarted: each power-on has its own biases.

use mimu::calibration::verify::{PowerOn, Verification, verify_since};
use mimu::fit::{Fit, Options, fit};
use mimu::prepared::Prepared;
use mimu::signal::power_ons::PowerOns;
use mimu::signal::stillness::STILL_FACTOR;
use mimu::{Calibration, JudgementKind, Sensor};
use mimu_recording::{Batch, Recorded, Recording, Restart};
use mimu_rig::random::Random;
use mimu_tests::bench;
use mimu_tests::fleet::{Drawn, Judged, OF_IT, unit};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Standard deviations of the steps of gyro and accelerometer, raw: 0.1 deg/s and 5 mg.
const STEPS: [f64; 2] = [6.5, 82.0];
/// Time without samples while the device starts, s.
const PAUSE_S: f64 = 2.0;

/// The power-on with the true biases.
#[derive(Clone, Copy, PartialEq)]
enum TrueIn {
    First,
    Last,
}

/// A session by hand of a unit that restarts after so many dwells, and the raw steps of its biases.
fn session(
    drawn: &Drawn,
    after: &[usize],
    seed: u64,
    true_in: TrueIn,
) -> (Prepared, Vec<[f64; 6]>) {
    let folder = bench::written(&bench::hand_plan(24), &drawn.file, seed);
    let recording = Recording::open(&folder.path().join("recording")).expect("a recording");
    let mut all = Batch::default();
    let kept = recording.for_each_batch(
        |_| {},
        |batch| {
            all.t_s.extend(&batch.t_s);
            for (all, more) in all.raw.iter_mut().zip(&batch.raw) {
                all.extend(more);
            }
            Ok(())
        },
    );
    kept.expect("readable");
    let mut manifest = recording.manifest.clone();
    let whole = Prepared::of(manifest.clone(), &all, STILL_FACTOR).expect("readable");
    let mut random = Random::new(seed, "power-ons");
    let (mut recorded, mut all_steps) = (Recorded::default(), Vec::new());
    for after in after {
        let dwells = &whole.dwells.list;
        let before_s = after
            .checked_sub(1)
            .map_or(f64::NEG_INFINITY, |k| dwells[k].last_s);
        let at_s = 0.5 * (before_s + dwells[*after].start_s);
        let steps: [f64; 6] = std::array::from_fn(|c| STEPS[c / 3] * random.normal());
        let first = all.t_s.partition_point(|t| *t < at_s);
        for (channel, step) in all.raw.iter_mut().zip(steps) {
            let others = match true_in {
                TrueIn::First => &mut channel[first..],
                TrueIn::Last => &mut channel[..first],
            };
            others.iter_mut().for_each(|raw| *raw += step);
        }
        all_steps.push(steps);
        all.t_s[..first].iter_mut().for_each(|t| *t -= PAUSE_S);
        recorded.restarts.iter_mut().for_each(|r| r.t_s -= PAUSE_S);
        recorded.restarts.push(Restart {
            t_s: all.t_s[first],
            start: "power-on".into(),
        });
    }
    manifest.recorded = Some(recorded);
    let prepared = Prepared::of(manifest, &all, STILL_FACTOR).expect("readable");
    (prepared, all_steps)
}

fn judgement(fitted: &Fit) -> JudgementKind {
    let calibration = Calibration::of(fitted, &[], "2026-01-05T12:00:00Z").expect("a calibration");
    calibration.judgement.expect("judged").kind
}

#[test]
fn biases_that_step_at_a_restart_are_those_of_the_last_power_on_within_their_intervals() {
    let restarts: [&[usize]; 4] = [&[12], &[4], &[22], &[8, 16]];
    let one = |seed: u64| {
        let drawn = unit(3000 + seed, OF_IT);
        let after = restarts[seed as usize % restarts.len()];
        let (prepared, _) = session(&drawn, after, seed, TrueIn::Last);
        assert_eq!(prepared.power_ons.others(), after.len());
        let fitted = fit(prepared, Options::default()).expect("a fit");
        let told = fitted.warnings.iter().map(ToString::to_string);
        assert!(told.into_iter().any(|w| w.contains("the device restarted")));
        let mut judged = Judged::default();
        judged.add(&fitted, &drawn.truth);
        (judged, judgement(&fitted))
    };
    let all: Vec<_> = (0..24).into_par_iter().map(one).collect();
    let bad = all.iter().filter(|a| a.1 > JudgementKind::Untested).count();
    let judged = all
        .into_iter()
        .fold(Judged::default(), |sum, a| sum.merge(a.0));
    assert!(bad <= 1, "{bad} of 24 are judged wrong");
    for name in [
        "gyro scale",
        "gyro angle",
        "gyro bias",
        "accel scale",
        "accel angle",
        "accel bias",
    ] {
        let [inside, of] = judged.shares.of(name);
        // 72 values: four standard deviations of the share are 10 %.
        assert!(
            f64::from(inside) > 0.85 * f64::from(of),
            "{name}: {inside} of {of}"
        );
    }
}

#[test]
fn steps_that_nobody_tells_of_are_found_by_the_judgement() {
    let drawn = unit(3000, OF_IT);
    let (mut prepared, _) = session(&drawn, &[12], 0, TrueIn::Last);
    prepared.power_ons = PowerOns::default();
    for dwell in &mut prepared.dwells.list[..12] {
        for mean in &mut dwell.raw[Sensor::Accel.channels()] {
            mean.mean += 4.0 * STEPS[1];
        }
    }
    let fitted = fit(prepared, Options::default()).expect("a fit");
    assert!(judgement(&fitted) > JudgementKind::Untested);
}

/// A verification, by a session with these restarts, of a calibration whose scale factors are off by so many sigmas; and the true steps of the biases, SI.
fn verified(seed: u64, after: &[usize], off: f64) -> (Verification, Vec<[Vector3<f64>; 2]>) {
    let drawn = unit(3100 + seed, OF_IT);
    let (whole, _) = session(&drawn, &[], 2 * seed, TrueIn::First);
    let fitted = fit(whole, Options::default()).expect("a fit");
    let made = Calibration::of(&fitted, &[], "2026-01-05T12:00:00Z");
    let mut calibration = made.expect("a calibration");
    for sensor in Sensor::BOTH {
        let covariance = calibration.covariance(sensor).expect("known");
        let table = match sensor {
            Sensor::Gyro => &mut calibration.gyro,
            Sensor::Accel => &mut calibration.accel,
        };
        let table = table.as_mut().expect("calibrated");
        for axis in 0..3 {
            let sigma = covariance[(4 * axis, 4 * axis)].sqrt();
            let more = 1.0 + off * sigma / table.C[axis][axis];
            let row = table.C[axis].iter_mut().chain([&mut table.o[axis]]);
            row.for_each(|c| *c *= more);
        }
    }
    let (by, steps) = session(&drawn, after, 2 * seed + 1, TrueIn::First);
    let found = verify_since(&by, &calibration, PowerOn::Same).expect("a verification");
    let affine = [&drawn.file.unit.gyro_affine, &drawn.file.unit.accel_affine];
    let to_si = affine.map(|of| {
        let rows = of.as_ref().expect("a matrix").matrix;
        Matrix3::from_fn(|i, j| rows[i][j])
            .try_inverse()
            .expect("regular")
    });
    let in_si = |raw: &[f64; 6]| {
        [0, 1].map(|s| to_si[s] * Vector3::from_column_slice(&raw[3 * s..3 * s + 3]))
    };
    (found, steps.iter().map(in_si).collect())
}

/// Restarts in the middle, before the first dwell, and two of them.
const RESTARTS: [&[usize]; 3] = [&[12], &[0], &[8, 16]];

#[test]
fn a_verification_takes_the_bias_of_each_power_on_off_and_reports_it_within_its_interval() {
    for after in RESTARTS {
        let each = (0..16)
            .into_par_iter()
            .map(|seed| verified(seed, after, 0.0));
        let all: Vec<_> = each.collect();
        let bad = all
            .iter()
            .filter(|a| a.0.judgement.kind > JudgementKind::Untested);
        let (bad, mut inside, mut of) = (bad.count(), 0, 0);
        for (found, steps) in &all {
            for (s, (_, sensor)) in found.sensors.present().enumerate() {
                assert_eq!(sensor.bias_moved.len(), after.len());
                let mut truth = Vector3::zeros();
                for (moved, step) in sensor.bias_moved.iter().zip(steps) {
                    truth += step[s];
                    let off = (Vector3::from(moved.moved) - truth).abs();
                    inside += (0..3).filter(|k| off[*k] <= moved.half_width[*k]).count();
                    of += 3;
                }
                let taken = sensor.test.map_or(0.0, |test| test.count as f64 - test.dof);
                assert!(taken > 0.1 && taken < 3.1 * after.len() as f64, "{taken}");
            }
            let warned = found
                .warnings
                .iter()
                .filter(|w| w.to_string().contains("the bias is more by"));
            assert_eq!(warned.count(), 2 * after.len());
        }
        println!("{after:?}: {bad} judged wrong, {inside} of {of} within their intervals");
        assert!(bad <= 1, "{after:?}: {bad} of 16 are judged wrong");
        // 96 or 192 values: four standard deviations of the share are 9 and 6 %.
        assert!(inside * 100 > of * 85, "{after:?}: {inside} of {of}");
    }
}

#[test]
fn scale_factors_that_are_off_are_judged_wrong_whatever_the_restarts() {
    for after in [&[][..]].into_iter().chain(RESTARTS) {
        let each = (0..8)
            .into_par_iter()
            .map(|seed| verified(seed, after, 12.0).0);
        let bad = each
            .filter(|v| v.judgement.kind > JudgementKind::Untested)
            .count();
        assert!(bad >= 7, "{after:?}: {bad} of 8");
    }
}
