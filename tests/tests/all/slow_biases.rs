//! Biases that move slowly, by hand: a straight line is a drift, a curve is a warm-up, and a wander at random is neither.

use mimu::diagnose::decision::CorrelatesWith;
use mimu::diagnose::{Diagnosis, Verdict, diagnose};
use mimu::fit::Options;
use mimu::quantity::Sensor;
use mimu_rig::rig_file::{EffectFile, RigFile};
use mimu_tests::bench;
use mimu_tests::by_hand::{Grade, plan, unit};

fn with(file: &mut RigFile, id: &str, parameters: &[(&str, toml::Value)]) {
    let parameters = parameters.iter();
    file.effect.push(EffectFile {
        id: id.into(),
        parameters: parameters.map(|(k, v)| ((*k).into(), v.clone())).collect(),
    });
}

fn axes(values: [f64; 3]) -> toml::Value {
    toml::Value::Array(values.map(toml::Value::Float).into())
}

fn diagnosed(file: &RigFile, seed: u64) -> Diagnosis {
    let prepared = bench::recorded(&plan(seed), file, seed);
    diagnose(prepared.into(), Options::IN_SAMPLE).expect("a diagnosis")
}

fn ids(found: &Diagnosis) -> Vec<String> {
    found.effects.iter().map(|e| e.candidate.id()).collect()
}

/// 36 deg/s an hour are 24 times a typical warm-up of 20 minutes, but 120 times a typical drift.
#[test]
fn an_even_drift_is_named_a_drift_however_large_it_is() {
    let per_hour = [-36.0, 20.0, 28.0];
    let seed = 1;
    let mut file = unit(&[], Grade::Consumer, seed);
    file.thermal.on_before_s = Some(3600.0);
    with(
        &mut file,
        "gyro_bias_drift",
        &[("dps_per_hour", axes(per_hour))],
    );
    let found = diagnosed(&file, seed);
    assert_eq!(ids(&found), ["gyro_bias_drift"], "seed {seed}");
    assert_eq!(found.verdict, Verdict::Explained, "seed {seed}");
    let effect = &found.effects[0];
    for (k, truth) in per_hour.into_iter().enumerate() {
        let [value, sigma] = [effect.values[k], effect.sigmas[k]].map(|v| v.to_degrees() * 3600.0);
        assert!(
            (value - truth).abs() < 4.0 * sigma,
            "seed {seed}: {value} ± {sigma} for {truth}"
        );
    }
}

/// The temperature of a unit that has just been switched on settles too, so a lag may explain the curve as well.
#[test]
fn a_bias_that_settles_within_the_recording_is_no_drift() {
    let mut file = unit(&[], Grade::Consumer, 3);
    let parameters = [
        ("dps", axes([0.3, -0.2, 0.25])),
        ("time_constant_s", toml::Value::Float(50.0)),
    ];
    with(&mut file, "gyro_warm_up", &parameters);
    let found = diagnosed(&file, 3);
    let gyro = found.sensors.iter().find(|s| s.sensor == Sensor::Gyro);
    let accepted = &gyro.expect("a gyro").decision.accepted;
    let named = accepted.iter().any(|a| {
        let others = a.chosen.alternatives.iter();
        a.chosen.candidate.id() == "gyro_warm_up"
            || others.into_iter().any(|o| o.id == "gyro_warm_up")
    });
    assert!(named, "{:?}", ids(&found));
    assert!(
        !ids(&found).contains(&"gyro_bias_drift".into()),
        "{:?}",
        ids(&found)
    );
}

/// 0.2 deg/s in two minutes, forty times the noise of a dwell.
#[test]
fn a_bias_that_wanders_at_random_is_named_as_that() {
    let mut file = unit(&[], Grade::Consumer, 1);
    let walk = 0.2_f64.to_radians() / 120.0_f64.sqrt();
    file.unit.gyro_axes.walk_si = Some([walk; 3]);
    let found = diagnosed(&file, 1);
    assert_eq!(ids(&found), [""; 0]);
    assert_eq!(found.verdict, Verdict::Unexplained);
    let gyro = found.sensors.iter().find(|s| s.sensor == Sensor::Gyro);
    let leftover = gyro.expect("a gyro").decision.leftover.iter();
    let strengths: Vec<f64> = leftover
        .filter(|l| l.against == CorrelatesWith::Time && !l.usual)
        .map(|l| l.strength.to_degrees())
        .collect();
    // The rms about the mean of a walk of this size, in two to four minutes.
    assert!(
        !strengths.is_empty() && strengths.iter().all(|s| (0.02..0.5).contains(s)),
        "{strengths:?}"
    );
}
