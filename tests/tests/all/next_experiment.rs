//! From a recording that cannot show an effect, or tell two apart, to the one that does: the bench carries out what is planned.

use mimu::design::settle::{Question, Suspect, settle};
use mimu::diagnose::next::{Next, next, question};
use mimu::diagnose::{Diagnosis, diagnose, library};
use mimu::fit::{Method, Options};
use mimu::stillness::STILL_FACTOR;
use mimu_rig::random::Random;
use mimu_rig::rig_file::{EffectFile, RigFile};
use mimu_tests::bench;

/// A unit with one effect, x, y and z of the given sizes.
fn unit(id: &str, key: &str, sizes: [f64; 3]) -> RigFile {
    let mut random = Random::new(5, "unit");
    let (gyro, accel) = (bench::gyro(&mut random), bench::accel(&mut random));
    let mut file = bench::clean(gyro, accel);
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
    let options = Options {
        method: Method::LeastSquares,
        holdout_blocks: 0,
        only: None,
        still_factor: STILL_FACTOR,
    };
    diagnose(bench::recorded(plan, unit, seed).into(), options).unwrap()
}

fn found(diagnosis: &Diagnosis) -> Vec<String> {
    diagnosis.effects.iter().map(|e| e.candidate.id()).collect()
}

/// The plan that shows `suspects`, for the unit of `diagnosis`.
fn plan(diagnosis: &Diagnosis, suspects: Vec<Suspect>) -> String {
    let base = question(&diagnosis.after, None);
    let answer = settle(&Question { suspects, ..base });
    assert!(
        answer.settled.iter().all(|s| s.done()),
        "{:?}",
        answer.settled
    );
    answer.plan(None, 100.0)
}

#[test]
fn an_effect_that_low_rates_cannot_show_is_found_by_the_next_experiment() {
    let unit = unit("gyro_scale_cubic", "dps_at_300dps", [0.3, -0.25, 0.35]);
    let first = diagnosed(&first_plan(&[10.0, 20.0]), &unit, 1);
    let open: Next = next(&first);
    let told = open.not_excited.iter().find(|n| n.0 == "gyro_scale_cubic");
    let (_, experiment) = told.expect("20 deg/s show no cubic of 300");
    println!("{experiment}");
    assert!(experiment.contains("300 deg/s"), "{experiment}");
    let cubic =
        Suspect::listed(library::by_id("gyro_scale_cubic").unwrap()).expect("a plan can show it");
    let second = diagnosed(&plan(&first, vec![cubic]), &unit, 2);
    assert_eq!(found(&second), ["gyro_scale_cubic"]);
}

#[test]
fn two_effects_that_one_rate_confuses_are_told_apart_by_the_next_experiment() {
    // At ±150 deg/s and rest a square is an asymmetry.
    for (id, seed) in [("gyro_scale_quadratic", 3), ("gyro_scale_asymmetry", 4)] {
        let unit = unit(id, "dps_at_300dps", [0.6, -0.5, 0.7]);
        let first = diagnosed(&first_plan(&[150.0]), &unit, seed);
        let open = next(&first);
        let pair = open.confused.iter().find(|c| {
            let has = |id: &str| c.ids.iter().any(|i| i == id);
            has("gyro_scale_quadratic") && has("gyro_scale_asymmetry")
        });
        let pair = pair.unwrap_or_else(|| panic!("{:?} {:?}", found(&first), open.confused));
        println!("{pair:?}");
        let confused: Vec<Suspect> = open
            .suspects
            .iter()
            .filter(|s| s.group > 0)
            .cloned()
            .collect();
        let second = diagnosed(&plan(&first, confused), &unit, seed + 10);
        assert_eq!(found(&second), [id]);
        assert!(
            next(&second).confused.is_empty(),
            "{:?}",
            next(&second).confused
        );
    }
}
