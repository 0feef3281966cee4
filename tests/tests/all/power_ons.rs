//! A session in which the device restarted: each power-on has its own biases.

use mimu::fit::{Fit, Options, fit};
use mimu::prepared::Prepared;
use mimu::signal::power_ons::PowerOns;
use mimu::signal::stillness::STILL_FACTOR;
use mimu::{Calibration, JudgementKind, Sensor};
use mimu_recording::{Batch, Recorded, Recording, Restart};
use mimu_rig::random::Random;
use mimu_tests::bench;
use mimu_tests::fleet::{Drawn, Judged, OF_IT, unit};
use rayon::prelude::*;

/// Standard deviations of the steps of gyro and accelerometer, raw: 0.1 deg/s and 5 mg.
const STEPS: [f64; 2] = [6.5, 82.0];
/// Time without samples while the device starts, s.
const PAUSE_S: f64 = 2.0;

/// A session by hand of a unit that restarts after so many dwells. The true biases are those of the last power-on.
fn session(drawn: &Drawn, after: &[usize], seed: u64) -> Prepared {
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
    let mut recorded = Recorded::default();
    for after in after {
        let [before, next] = [after - 1, *after].map(|k| &whole.dwells.list[k]);
        let at_s = 0.5 * (before.last_s + next.start_s);
        let steps: [f64; 6] = std::array::from_fn(|c| STEPS[c / 3] * random.normal());
        let first = all.t_s.partition_point(|t| *t < at_s);
        for (channel, step) in all.raw.iter_mut().zip(steps) {
            channel[..first].iter_mut().for_each(|raw| *raw += step);
        }
        all.t_s[..first].iter_mut().for_each(|t| *t -= PAUSE_S);
        recorded.restarts.iter_mut().for_each(|r| r.t_s -= PAUSE_S);
        recorded.restarts.push(Restart {
            t_s: all.t_s[first],
            start: "power-on".into(),
        });
    }
    manifest.recorded = Some(recorded);
    Prepared::of(manifest, &all, STILL_FACTOR).expect("readable")
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
        let prepared = session(&drawn, after, seed);
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
    let mut prepared = session(&drawn, &[12], 0);
    prepared.power_ons = PowerOns::default();
    for dwell in &mut prepared.dwells.list[..12] {
        for mean in &mut dwell.raw[Sensor::Accel.channels()] {
            mean.mean += 4.0 * STEPS[1];
        }
    }
    let fitted = fit(prepared, Options::default()).expect("a fit");
    assert!(judgement(&fitted) > JudgementKind::Untested);
}
