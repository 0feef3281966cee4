//! Effects removed from recordings with missing data: samples, a temperature, the time since power-on.

use std::sync::Arc;

use mimu::calibration::Calibration;
use mimu::diagnose::{Recordings, diagnose};
use mimu::effects::fitted::FittedEffect;
use mimu::effects::removal::{remove, remove_within};
use mimu::fit::Options;
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::blocks::Moments;
use mimu::signal::dwell::Fault;
use mimu_recording::RawUnit;

use super::unit::{SAG, fitted, named, prepared, record};
use crate::command::says;

/// Time constant of the warm-up.
const TIME_CONSTANT_S: f64 = 1200.0;

/// A recording, and its calibration with effects, given by id, the value of each coefficient and their number.
fn unit(effects: &[(&str, f64, usize)]) -> (Prepared, Calibration) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    record(&path, false, true);
    let effects: Vec<_> = effects
        .iter()
        .map(|(id, value, count)| {
            let mut effect: FittedEffect = named(id, &vec![*value; *count]);
            effect.parameter = match *id {
                "gyro_warm_up" => TIME_CONSTANT_S,
                id if id.ends_with("lag") => 60.0,
                _ => 0.0,
            };
            effect
        })
        .collect();
    let text = Calibration::of(&fitted(&path), &effects, "2026-01-01T00:00:00Z")
        .unwrap()
        .to_toml();
    (
        prepared(&path),
        Calibration::parse(&text, "cal.toml").unwrap(),
    )
}

fn fitted_effect(from: &Prepared, calibration: &Calibration) -> Prepared {
    let [gyro, accel] = Sensor::BOTH.map(|s| calibration.inverse(s).unwrap());
    remove(from, Some(&gyro), Some(&accel), calibration.effects()).unwrap()
}

#[test]
fn samples_that_are_missing_from_the_other_triad_do_not_make_an_error() {
    let (whole, calibration) = unit(&[("gyro_g_sensitivity", SAG, 9)]);
    let expected = fitted_effect(&whole, &calibration);
    let mut holes = whole.clone();
    let blocks = whole.dwells.list[5].blocks.clone();
    for at in blocks.start + 2..blocks.start + 5 {
        Arc::make_mut(&mut holes.condensed).blocks[at].raw[3..].fill(Moments::default());
    }
    let after = fitted_effect(&holes, &calibration);
    for axis in 0..3 {
        // A dwell has one force, so its blocks differ only by noise, 2.5 mm/s² per sample of 9.8 m/s².
        let off = |p: &Prepared| p.dwells.list[5].raw[axis].mean;
        let moved = (off(&whole) - off(&expected)).abs();
        assert!((off(&after) - off(&expected)).abs() < 1e-3 * moved);
        assert!(moved > 0.0);
    }
    // A dwell without any samples is left out, and this is reported.
    let mut hole = whole.clone();
    for at in blocks {
        Arc::make_mut(&mut hole.condensed).blocks[at].raw[3..].fill(Moments::default());
    }
    for mean in &mut hole.dwells.list[5].raw[3..] {
        mean.n = 0;
    }
    let after = fitted_effect(&hole, &calibration);
    assert_eq!(after.dwells.list[5].faults.gyro, Some(Fault::Missing(3)));
    let said = after.dwells.warnings[0].to_string();
    says(&said, &["accel_x missing", "gyro_g_sensitivity"]);
}

#[test]
fn a_lag_begins_at_the_first_temperature() {
    let (mut whole, calibration) = unit(&[("gyro_thermal_lag", 1e-3, 3)]);
    let first = whole.condensed.blocks[0].temp_c;
    for block in &mut Arc::make_mut(&mut whole.condensed).blocks {
        block.temp_c = first;
    }
    // At a constant temperature there is no lag, whatever the temperature and whenever it was first read.
    let mut late = whole.clone();
    for block in &mut Arc::make_mut(&mut late.condensed).blocks[..30] {
        block.temp_c.mean = f64::NAN;
    }
    let after = fitted_effect(&late, &calibration);
    for (a, b) in after.dwells.list.iter().zip(&late.dwells.list) {
        assert_eq!(a.raw, b.raw);
    }
}

#[test]
fn beyond_the_temperatures_of_the_calibration_an_effect_is_held_as_on_the_device() {
    const PER_K: f64 = 1e-3;
    let (mut whole, calibration) = unit(&[("gyro_thermal_bias", PER_K, 3)]);
    let [_, to] = calibration.limits().unwrap();
    let inverse = calibration.inverse(Sensor::Gyro).unwrap();
    let [gyro, accel] = Sensor::BOTH.map(|s| calibration.inverse(s).unwrap());
    let mut bias_at = |temp_c: f64| {
        for block in &mut Arc::make_mut(&mut whole.condensed).blocks {
            block.temp_c.mean = temp_c;
        }
        let effects = calibration.effects();
        let limits = calibration.limits();
        let after = remove_within(&whole, Some(&gyro), Some(&accel), effects, limits).unwrap();
        assert_eq!(
            after.condensed.blocks[0].temp_c.mean, temp_c,
            "what was read stays"
        );
        let [a, b] =
            [&after, &whole].map(|p| inverse.apply(&p.dwells.list[0].raw_mean(Sensor::Gyro)));
        (b - a).norm()
    };
    let [at_end, beyond, far] = [to, to + 5.0, to + 40.0].map(&mut bias_at);
    let per_k = (beyond - at_end) / 5.0;
    assert!((per_k / (PER_K * 3f64.sqrt()) - 1.0).abs() < 0.1, "{per_k}");
    assert!((far - beyond).abs() < 1e-9, "{far} {beyond}");
}

#[test]
fn what_goes_by_time_is_counted_from_power_on() {
    const WARM_UP: f64 = 1e-3;
    let (mut from, calibration) = unit(&[("gyro_warm_up", WARM_UP, 3)]);
    let begun = fitted_effect(&from, &calibration);
    let first_s = from.condensed.blocks[0].start_s;
    from.manifest.power_on_s = Some(first_s - 600.0);
    let on = fitted_effect(&from, &calibration);
    let inverse = calibration.inverse(Sensor::Gyro).unwrap();
    for (a, b) in begun.dwells.list.iter().zip(&on.dwells.list) {
        let less =
            inverse.apply(&b.raw_mean(Sensor::Gyro)) - inverse.apply(&a.raw_mean(Sensor::Gyro));
        let settled = |s: f64| WARM_UP * (-s / TIME_CONSTANT_S).exp();
        let s = a.start_s + 0.5 * a.duration_s - first_s;
        let expected = settled(s) - settled(s + 600.0);
        // Along the sensors' own directions, a few degrees from the body axes.
        assert!(
            less.iter().all(|m| (m / expected - 1.0).abs() < 0.1),
            "{less} {expected}"
        );
    }
}

#[test]
fn a_given_calibration_has_to_fit_the_recording() {
    let refusal = |first: Prepared, given: &Calibration| {
        let recordings = Recordings {
            first,
            more: Vec::new(),
            second: None,
            given: Some(given),
        };
        diagnose(recordings, Options::IN_SAMPLE)
            .unwrap_err()
            .to_string()
    };
    let (from, calibration) = unit(&[("gyro_thermal_bias", 1e-5, 6)]);
    let mut counts = from.clone();
    counts.manifest.raw_unit = RawUnit::Count;
    let said = refusal(counts, &calibration);
    says(&said, &["raw_unit is count", "[gyro]"]);
    let mut cold = from;
    for block in &mut Arc::make_mut(&mut cold.condensed).blocks {
        block.temp_c.mean = f64::NAN;
    }
    let said = refusal(cold, &calibration);
    says(
        &said,
        &["gyro_thermal_bias cannot be removed: temp_c is missing"],
    );
}
