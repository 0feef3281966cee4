//! Sequences and budgets of time.

use mimu::design::budget::{DwellNoise, spend};
use mimu::design::model::Setting;
use mimu::design::reach::Carrier;
use mimu::design::tour::Motion;
use mimu::dwell::Sensor;
use mimu::recording::Reference;

use crate::{accel, close};

#[test]
fn no_order_of_seven_dwells_is_shorter_than_the_one_found_by_more_than_a_tenth() {
    let problem = accel(Reference::Table, "affine");
    let motion = Motion::of(Carrier::ThreeAxis);
    let settings = problem.best(7, 1).unwrap();
    fn shortest(motion: &Motion, done: &mut Vec<Setting>, left: &[Setting]) -> f64 {
        if left.is_empty() {
            return motion.moves_s(done);
        }
        let each = (0..left.len()).map(|k| {
            let mut rest = left.to_vec();
            done.push(rest.remove(k));
            let time = shortest(motion, done, &rest);
            done.pop();
            time
        });
        each.fold(f64::INFINITY, f64::min)
    }
    let known = shortest(&motion, &mut Vec::new(), &settings);
    let found = motion.moves_s(&motion.ordered(&settings));
    assert!(
        found >= known - 1e-9 && found <= 1.1 * known,
        "{found} {known}"
    );
}

#[test]
fn a_budget_is_kept_and_more_of_it_helps() {
    let problem = accel(Reference::Table, "affine");
    let noise = DwellNoise::fang(Sensor::Accel);
    let motion = Motion::of(Carrier::ThreeAxis);
    let mut before = f64::INFINITY;
    for minutes in [2.0, 5.0, 15.0] {
        let best = spend(&problem, &noise, &motion, 60.0 * minutes, 1)
            .unwrap()
            .best;
        assert!(best.time_s() <= 60.0 * minutes + 1e-9);
        let judged = problem.judge(&best.all(), best.sigma);
        assert!(close(judged.mean_sigma, best.mean_sigma, 1e-9) && best.mean_sigma < before);
        before = best.mean_sigma;
    }
}

#[test]
fn random_walk_bounds_the_dwell() {
    let problem = accel(Reference::Table, "affine");
    let noise = DwellNoise {
        n: 1e-3,
        b: 0.0,
        k: 1e-3,
    };
    let best = spend(
        &problem,
        &noise,
        &Motion::of(Carrier::ThreeAxis),
        36_000.0,
        1,
    )
    .unwrap()
    .best;
    // N²/T + K² T/3 is least at T = √3 N/K.
    assert!(best.dwell_s <= 3_f64.sqrt() + 1e-9, "{}", best.dwell_s);
}
