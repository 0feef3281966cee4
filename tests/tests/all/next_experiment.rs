//! From a recording that cannot show an effect, or cannot distinguish two, to the planned one that can; the bench carries out the plan.

use mimu::diagnose::{Diagnosis, diagnose};
use mimu::effects;
use mimu::fit::Options;
use mimu::plan::next_experiment::prediction::Target;
use mimu::plan::next_experiment::{Next, Setup, next, smallest};
use mimu_rig::rig_file::{EffectFile, RigFile};
use mimu_tests::bench;

/// A unit with one effect, x, y and z of the given sizes.
fn unit(id: &str, key: &str, sizes: [f64; 3]) -> RigFile {
    let mut file = bench::drawn(5, "unit");
    let sizes = toml::Value::Array(sizes.map(toml::Value::Float).to_vec());
    file.effect = vec![EffectFile {
        id: id.into(),
        parameters: [(key.to_string(), sizes)].into_iter().collect(),
    }];
    file
}

/// Six faces at rest, and each axis upright at these rates; all three times.
fn first_plan(rates_dps: &[f64]) -> String {
    let mut plan =
        String::from("format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"table\"\n");
    for _ in 0..3 {
        for axis in 0..3 {
            let up: [f64; 3] = std::array::from_fn(|i| f64::from(u8::from(i == axis)));
            let down = up.map(|u| -u);
            let rates = rates_dps.iter().flat_map(|r| [(up, *r), (up, -r)]);
            for (up, rate) in [(up, 0.0), (down, 0.0)].into_iter().chain(rates) {
                plan += &format!("[[step]]\nup = {up:?}\nrate_dps = {rate:?}\ndwell_s = 5.0\n");
            }
        }
    }
    plan
}

fn diagnosed(plan: &str, unit: &RigFile, seed: u64) -> Diagnosis {
    diagnose(bench::recorded(plan, unit, seed).into(), Options::IN_SAMPLE).unwrap()
}

fn found(diagnosis: &Diagnosis) -> Vec<String> {
    diagnosis.effects.iter().map(|e| e.candidate.id()).collect()
}

/// The plan that shows `targets`, for the unit of `diagnosis`.
fn plan(diagnosis: &Diagnosis, targets: &[Target]) -> String {
    let setup = Setup::of(&diagnosis.after, None);
    let answer = smallest(&setup, targets).expect("a recipe");
    assert!(answer.done(), "{:?}", answer.predictions);
    answer.plan(&setup, None, 100.0)
}

/// A first recording does not excite the effect `id`. The planned recording shows it and nothing else of the sensor, each coefficient within three
/// sigmas of `truth`, SI: 1 in 120 sets of three exceeds this by chance.
fn shown_by_the_next(id: &str, unit: &RigFile, rates_dps: &[f64], seed: u64, truth: [f64; 3]) {
    let first = diagnosed(&first_plan(rates_dps), unit, seed);
    let open: Next = next(&first);
    let told = open.not_excited.iter().find(|n| n.id == id);
    assert!(told.is_some(), "{:?} {:?}", found(&first), open.not_excited);
    let target = Target::listed(effects::by_id(id).unwrap());
    let second = diagnosed(&plan(&first, &[target]), unit, seed + 1);
    assert_eq!(found(&second), [id]);
    let sensors = second.sensors.iter();
    let accepted = sensors.flat_map(|s| &s.decision.accepted).next().unwrap();
    let names = accepted.chosen.candidate.names();
    for (axis, truth) in ["x", "y", "z"].iter().zip(truth) {
        let k = names.iter().position(|n| n.0 == *axis).expect("an axis");
        let (value, sigma) = (
            accepted.effect.values[k],
            accepted.covariance[(k, k)].sqrt(),
        );
        assert!(
            (value - truth).abs() < 3.0 * sigma,
            "{id} {axis}: {value} ± {sigma}, {truth}"
        );
        assert!(
            truth.abs() > 3.0 * sigma,
            "{id} {axis}: {sigma} shows nothing of {truth}"
        );
    }
}

#[test]
fn a_cubic_that_low_rates_cannot_show_is_found_by_the_next_experiment() {
    let sizes = [0.3, -0.25, 0.35];
    let unit = unit("gyro_scale_cubic", "dps_at_300dps", sizes);
    // deg/s at 300 deg/s, over the cube of that rate.
    let truth = sizes.map(|s: f64| s.to_radians() / 300f64.to_radians().powi(3));
    shown_by_the_next("gyro_scale_cubic", &unit, &[10.0, 20.0], 1, truth);
}

#[test]
fn two_effects_that_one_rate_confuses_are_told_apart_by_the_next_experiment() {
    // At ±150 deg/s and rest, a square and an asymmetry are the same.
    for (id, seed) in [("gyro_scale_quadratic", 3), ("gyro_scale_asymmetry", 4)] {
        let unit = unit(id, "dps_at_300dps", [0.6, -0.5, 0.7]);
        let first = diagnosed(&first_plan(&[150.0]), &unit, seed);
        let open = next(&first);
        let pair = open.confused.iter().any(|c| {
            let has = |id: &str| c.ids.iter().any(|i| i == id);
            has("gyro_scale_quadratic") && has("gyro_scale_asymmetry")
        });
        assert!(pair, "{:?} {:?}", found(&first), open.confused);
        let apart: Vec<Target> = open.targets.iter().filter(|t| !t.each).cloned().collect();
        let second = diagnosed(&plan(&first, &apart), &unit, seed + 10);
        assert_eq!(found(&second), [id]);
        assert!(
            next(&second).confused.is_empty(),
            "{:?}",
            next(&second).confused
        );
    }
}
