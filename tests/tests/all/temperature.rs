//! Temperature in fit and diagnosis: sweeps that no affine model follows, intervals of lags, given matrices, one pose, and the time since power-on.
//! The bench knows the truth.

use std::fmt::Write as _;

use mimu::calibration::Calibration;
use mimu::diagnose::decision::Accepted;
use mimu::diagnose::{Diagnosis, Recordings, diagnose};
use mimu::fit::{Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::warning::Warning;
use mimu_recording::Recorded;
use mimu_rig::random::Random;
use mimu_rig::rig_file::{EffectFile, RigFile, RigTruth};
use mimu_tests::bench;
use mimu_tests::says;
use rayon::prelude::*;

type Step = ([f64; 3], f64);

/// A plan of `steps` (body axis up, rate in deg/s), each `dwell_s` long at 50 Hz, while the chamber goes through `chamber_c`.
fn plan(steps: &[Step], dwell_s: f64, chamber_c: &[[f64; 2]]) -> String {
    let mut plan = format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = 50.0\ncarrier = \"table\"\nlead_in_s = 5.0\nchamber_c = {chamber_c:?}\n"
    );
    for (up, rate_dps) in steps {
        let _ = writeln!(
            plan,
            "[[step]]\nup = {up:?}\nrate_dps = {rate_dps:?}\ndwell_s = {dwell_s:?}"
        );
    }
    plan
}

/// Faces at rest, and each axis up at these rates.
fn faces(rates_dps: &[f64]) -> Vec<Step> {
    let mut steps = Vec::new();
    for axis in 0..3 {
        let up: [f64; 3] = std::array::from_fn(|i| f64::from(u8::from(i == axis)));
        steps.extend([(up, 0.0), (up.map(|u| -u), 0.0)]);
        steps.extend(rates_dps.iter().map(|r| (up, *r)));
    }
    steps
}

/// In an order drawn by the seed.
fn randomised(mut steps: Vec<Step>, seed: u64) -> Vec<Step> {
    let mut random = Random::new(seed, "order of the steps");
    for k in (1..steps.len()).rev() {
        steps.swap(k, (random.uniform() * (k + 1) as f64) as usize);
    }
    steps
}

/// A warmed-up unit whose thermometer is on its dies and that does not heat itself: the only lag is the effect's.
fn unit(effects: &[&str], seed: u64) -> RigFile {
    let mut file = bench::drawn(seed, "unit");
    file.thermal.on_before_s = Some(f64::INFINITY);
    file.thermal.die_lag_s = Some([1.0; 4]);
    file.thermal.die_heating_c = Some([0.0; 4]);
    let effect = |id: &&str| EffectFile {
        id: (*id).into(),
        parameters: Default::default(),
    };
    file.effect = effects.iter().map(effect).collect();
    RigTruth::resolve(&file, seed).expect("a rig").file
}

/// `file` with a parameter of its first effect.
fn with(mut file: RigFile, key: &str, value: impl Into<toml::Value>) -> RigFile {
    file.effect[0].parameters.insert(key.into(), value.into());
    file
}

fn recorded(plan: &str, file: &RigFile, seed: u64) -> Prepared {
    let prepared = bench::recorded(plan, file, seed);
    let noise = bench::noise_file(file, seed, prepared.condensed.period_s);
    prepared.with_noise(&noise).expect("its noise")
}

fn diagnosed(first: Prepared, given: Option<&Calibration>) -> Diagnosis {
    let recordings = Recordings {
        given,
        ..first.into()
    };
    diagnose(recordings, Options::IN_SAMPLE).expect("a diagnosis")
}

fn accepted(diagnosis: &Diagnosis) -> impl Iterator<Item = &Accepted> {
    let sensors = diagnosis.sensors.iter();
    sensors.flat_map(|s| &s.decision.accepted)
}

fn ids(diagnosis: &Diagnosis) -> Vec<String> {
    accepted(diagnosis)
        .map(|a| a.chosen.candidate.id())
        .collect()
}

/// 80 °C up and down during poses at rest, with six rates at the end: the bias changes by as much as the rates.
fn chamber(seed: u64) -> Prepared {
    let mut steps: Vec<Step> = Vec::new();
    for _ in 0..10 {
        steps.extend(faces(&[]));
    }
    for axis in 0..3 {
        let up: [f64; 3] = std::array::from_fn(|i| f64::from(u8::from(i == axis)));
        steps.extend([(up, 20.0), (up, -20.0)]);
    }
    let plan = plan(&steps, 5.0, &[[0.0, -20.0], [300.0, 60.0], [600.0, -20.0]]);
    let mut file = unit(&["gyro_thermal_bias"], seed);
    file.thermal.board_lag_s = Some(20.0);
    recorded(
        &plan,
        &with(file, "dps_per_c", vec![0.1, -0.12, 0.08]),
        seed,
    )
}

#[test]
fn a_sweep_that_moves_the_bias_by_more_than_the_rates_is_fitted_and_its_effect_is_named() {
    let prepared = chamber(1);
    let fitted = fit(prepared.clone(), Options::IN_SAMPLE).expect("a fit");
    let gyro = fitted.sensor(Sensor::Gyro).expect("recorded");
    // The warning shows that the residuals exceed the share of the inputs above which readings count as unrelated.
    let warned = gyro.warnings.iter().map(Warning::to_string);
    let mut warned = warned.filter(|w| w.contains("a model without temperature"));
    assert!(warned.next().is_some(), "{:?}", gyro.warnings);
    let found = diagnosed(prepared, None);
    assert!(
        ids(&found).contains(&"gyro_thermal_bias".into()),
        "{:?}",
        ids(&found)
    );
    let after = found.after.sensor(Sensor::Gyro).expect("recorded");
    assert!(
        after.rms() < 0.02 * gyro.rms(),
        "{} {}",
        after.rms(),
        gyro.rms()
    );
}

/// How often intervals contained the truth: lags and coefficients.
#[derive(Debug, Default)]
struct Held {
    lags: [u32; 2],
    coefficients: [u32; 2],
    unknown: u32,
}

fn count(into: &mut [u32; 2], held: bool) {
    into[0] += u32::from(held);
    into[1] += 1;
}

/// A unit with a lag of 20 to 110 s, on a table while the chamber warms by 20 °C and cools again.
fn lagging(seed: u64) -> (RigFile, Prepared) {
    let file = unit(&["gyro_thermal_lag"], seed);
    let file = with(file, "dps_per_c", vec![0.15, -0.1, 0.12]);
    let file = with(file, "lag_s", 20.0 + 10.0 * (seed % 10) as f64);
    let steps = randomised(
        [faces(&[-100.0, 100.0]), faces(&[-200.0, 200.0])].concat(),
        seed,
    );
    let ramp = [[0.0, 20.0], [60.0, 20.0], [160.0, 40.0], [260.0, 20.0]];
    let prepared = recorded(&plan(&steps, 6.0, &ramp), &file, seed);
    (file, prepared)
}

fn lags(seeds: u64) -> Held {
    let each = (0..seeds).into_par_iter().map(|seed| {
        let (file, prepared) = lagging(seed);
        let found = diagnosed(prepared, None);
        let mut lag = accepted(&found).filter(|a| a.chosen.candidate.id() == "gyro_thermal_lag");
        (lag.next().cloned(), file.effect[0].parameters.clone())
    });
    let mut held = Held::default();
    for (lag, truth) in each.collect::<Vec<_>>() {
        let Some(lag) = lag else {
            held.unknown += 1;
            continue;
        };
        let true_lag = truth["lag_s"].as_float().expect("a number");
        let interval = lag.effect.interval.expect("an interval");
        let above = interval.lower.is_none_or(|l| l <= true_lag);
        count(
            &mut held.lags,
            above && interval.upper.is_none_or(|u| true_lag <= u),
        );
        for (i, k) in lag
            .chosen
            .candidate
            .active
            .iter()
            .enumerate()
            .filter(|(_, k)| **k < 3)
        {
            let size = truth["dps_per_c"].as_array().expect("a list")[*k].as_float();
            let error = (lag.effect.values[i] - size.expect("a number").to_radians()).abs();
            let sigma = lag.covariance[(i, i)].sqrt();
            count(&mut held.coefficients, error <= 1.96 * sigma);
        }
    }
    held
}

fn share([held, of]: [u32; 2]) -> f64 {
    f64::from(held) / f64::from(of)
}

#[test]
fn intervals_of_a_lag_and_of_its_coefficients_hold_the_truth() {
    let held = lags(8);
    assert!(held.unknown <= 1, "{held:?}");
    // Three misses of eight have a probability of 1 in 200, and so have five of twenty-four.
    assert!(
        share(held.lags) >= 0.75 && share(held.coefficients) >= 0.8,
        "{held:?}"
    );
}

/// A calibration of `file` from a short recording at one temperature.
fn short(file: &RigFile, seed: u64) -> Calibration {
    let plan = plan(&faces(&[-60.0, 60.0]), 1.5, &[[0.0, 25.0]]);
    let fitted = fit(recorded(&plan, file, seed), Options::IN_SAMPLE).expect("a fit");
    Calibration::of(&fitted, &[], "2026-01-01T00:00:00Z").expect("a calibration")
}

#[test]
fn what_the_temperature_does_to_bias_and_scale_in_one_pose_is_named_together() {
    for (id, other) in [
        ("accel_thermal_scale", "accel_thermal_bias"),
        ("accel_thermal_bias", "accel_thermal_scale"),
    ] {
        let file = unit(&[id], 4);
        let steps = vec![([0.0, 0.0, 1.0], 0.0); 40];
        let chamber = [[0.0, 20.0], [150.0, 40.0], [300.0, 20.0]];
        let one_pose = recorded(&plan(&steps, 6.0, &chamber), &file, 4);
        let found = diagnosed(one_pose, Some(&short(&unit(&[], 4), 5)));
        let effect = accepted(&found).find(|a| a.chosen.candidate.sensor == Sensor::Accel);
        let effect = effect.expect("an effect");
        let mut named: Vec<String> = vec![effect.chosen.candidate.id()];
        named.push(effect.chosen.alternatives[0].id.clone());
        named.sort_unstable();
        let mut both = [id, other];
        both.sort_unstable();
        assert_eq!(named, both, "{id}");
        let notes = &found.sensors.iter().find(|s| s.sensor == Sensor::Accel);
        let notes = notes.expect("recorded").decision.notes.iter();
        let notes = notes
            .map(ToString::to_string)
            .collect::<Vec<_>>()
            .join("\n");
        says(&notes, &["fits as well, because the input along the axis"]);
    }
}

#[test]
fn at_many_poses_what_the_temperature_does_to_bias_and_scale_is_told_apart() {
    let file = unit(&["accel_thermal_scale"], 4);
    let steps = randomised(
        [faces(&[-100.0, 100.0]), faces(&[-200.0, 200.0])].concat(),
        4,
    );
    let chamber = [[0.0, 20.0], [150.0, 40.0], [300.0, 20.0]];
    let found = diagnosed(recorded(&plan(&steps, 6.0, &chamber), &file, 4), None);
    let scale = accepted(&found).find(|a| a.chosen.candidate.id() == "accel_thermal_scale");
    let others = &scale.expect("found").chosen.alternatives;
    assert!(
        others.iter().all(|o| o.id != "accel_thermal_bias"),
        "{others:?}"
    );
}

#[test]
fn a_warm_up_after_a_start_that_was_no_power_on_is_of_the_recording_alone() {
    let mut file = unit(&["gyro_warm_up"], 6);
    file.thermal.on_before_s = Some(0.0);
    let steps = randomised(
        [faces(&[-100.0, 100.0]), faces(&[-200.0, 200.0])].concat(),
        6,
    );
    let by_power = recorded(&plan(&steps, 12.0, &[[0.0, 25.0]]), &file, 6);
    let mut by_button = by_power.clone();
    by_button.manifest.power_on_s = None;
    by_button.manifest.recorded = Some(Recorded {
        start: Some("reset pin".into()),
        ..Recorded::default()
    });
    for (recording, of_unit) in [(by_power, true), (by_button, false)] {
        let found = diagnosed(recording, None);
        let warm_up = accepted(&found).find(|a| a.chosen.candidate.id() == "gyro_warm_up");
        assert_eq!(warm_up.expect("found").of_unit, of_unit);
        let gyro = found.sensors.iter().find(|s| s.sensor == Sensor::Gyro);
        let notes = gyro.expect("recorded").decision.notes.iter();
        let notes = notes
            .map(ToString::to_string)
            .collect::<Vec<_>>()
            .join("\n");
        assert_eq!(
            notes.contains("time since power-on is unknown"),
            !of_unit,
            "{notes}"
        );
    }
}
