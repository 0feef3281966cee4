//! Sequences and time budgets.

use mimu::plan::design::budget::{DwellNoise, Session};
use mimu::plan::design::model::Setting;
use mimu::plan::design::reach::Fixture;
use mimu::plan::design::tour::{Motion, Order, randomised};
use mimu::quantity::Sensor;
use mimu_recording::Reference;
use nalgebra::DMatrix;

use super::{accel, close};

#[test]
fn no_order_of_seven_dwells_is_shorter_than_the_one_found_by_more_than_a_tenth() {
    let problem = accel(Reference::Table, "affine");
    let motion = Motion::of(Fixture::ThreeAxis);
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
    let found = motion.moves_s(&motion.shortest(&settings));
    assert!(
        found >= known - 1e-9 && found <= 1.1 * known,
        "{found} {known}"
    );
}

#[test]
fn a_budget_is_kept_and_more_of_it_helps() {
    kept(&[2.0, 5.0]);
}

fn kept(budgets: &[f64]) {
    let problem = accel(Reference::Table, "affine");
    let (mut sigmas, mut several_passes) = (Vec::new(), false);
    for &minutes in budgets {
        for order in [Order::Shortest, Order::Randomised] {
            let session = Session {
                time_s: 60.0 * minutes,
                noise: DwellNoise::fang(Sensor::Accel),
                motion: Motion::of(Fixture::ThreeAxis),
                order,
            };
            let budget = session.spend(&problem, 1).unwrap();
            for way in &budget.by_size {
                assert!(way.time_s() <= 60.0 * minutes + 1e-9);
                let moves_s = session.motion.moves_s(&way.settings);
                assert!(close(moves_s, way.moves_s, 1e-12));
                let judged = problem.judge(&way.settings, way.sigma);
                assert!(close(judged.mean_sigma, way.mean_sigma, 1e-9));
                assert!(budget.best.mean_sigma <= way.mean_sigma);
                // All of its passes measure the same settings.
                let count = |s: &Setting| way.settings.iter().filter(|t| *t == s).count();
                assert!(way.settings.iter().all(|s| count(s) % way.passes == 0));
            }
            several_passes |= budget.by_size.iter().any(|way| way.passes > 1);
            sigmas.push(budget.best.mean_sigma);
        }
    }
    assert!(several_passes);
    // Shortest and randomised, for each budget.
    assert!(
        sigmas.windows(3).all(|s| s[2] < s[0]) && sigmas.chunks(2).all(|s| s[0] <= s[1]),
        "{sigmas:?}"
    );
}

#[test]
fn random_walk_bounds_the_dwell() {
    let problem = accel(Reference::Table, "affine");
    let spent = |k: f64| {
        let session = Session {
            time_s: 36_000.0,
            noise: DwellNoise { n: 1e-3, b: 0.0, k },
            motion: Motion::of(Fixture::ThreeAxis),
            order: Order::Shortest,
        };
        session.spend(&problem, 1).unwrap().best.dwell_s
    };
    // N²/T + K² T/3 is smallest at T = √3 N/K; but no dwell is shorter than a second.
    assert!(
        close(spent(5e-4), 2.0 * 3_f64.sqrt(), 1e-9),
        "{}",
        spent(5e-4)
    );
    assert!(close(spent(1.0), 1.0, 1e-12), "{}", spent(1.0));
}

/// True variance of the elements of a row of P over the variance that a fit claims from its residuals, averaged, if the noise of the dwells is a
/// random walk of the bias: with V its covariance and A = (F'F)⁻¹F', `A V A'` over `(F'F)⁻¹ tr((I - H)V)/(n - 4)`.
fn true_over_claimed(settings: &[Setting]) -> f64 {
    let n = settings.len();
    let f = DMatrix::from_fn(n, 4, |i, j| {
        [1.0, settings[i].up.x, settings[i].up.y, settings[i].up.z][j]
    });
    let walk = DMatrix::from_fn(n, n, |i, j| i.min(j) as f64 + 1.0);
    let inverse = (f.transpose() * &f).try_inverse().unwrap();
    let a = &inverse * f.transpose();
    let residual = (DMatrix::identity(n, n) - &f * &a) * &walk;
    let claimed = &inverse * (residual.trace() / (n as f64 - 4.0));
    let truth = &a * walk * a.transpose();
    (1..4).map(|k| truth[(k, k)] / claimed[(k, k)]).sum::<f64>() / 3.0
}

#[test]
fn in_an_order_by_lot_drift_is_scatter_that_a_fit_knows_of_and_in_the_shortest_order_it_is_not() {
    let problem = accel(Reference::Table, "affine");
    for n in [9, 12, 22] {
        let settings = problem.best(n, 1).unwrap();
        let shortest = true_over_claimed(&Motion::of(Fixture::ThreeAxis).shortest(&settings));
        let lots = (0..2000).map(|seed| true_over_claimed(&randomised(&settings, seed)));
        let randomised = lots.sum::<f64>() / 2000.0;
        println!(
            "{n} dwells: true over claimed variance {shortest:.2} in the shortest order, {randomised:.2} in a randomised one"
        );
        assert!(
            shortest > 1.5 && randomised < 1.2,
            "{n}: {shortest} {randomised}"
        );
    }
}

#[test]
fn a_lot_leaves_no_dwell_out_and_no_place_to_chance_more_than_another() {
    let settings = accel(Reference::Table, "affine").best(5, 1).unwrap();
    // How often each dwell is at each position: 1/5 of 2000 random orders, within five sigmas.
    let mut counts = [[0_u32; 5]; 5];
    for seed in 0..2000 {
        let drawn = randomised(&settings, seed);
        assert_eq!(drawn.len(), 5);
        for (place, setting) in drawn.iter().enumerate() {
            counts[settings.iter().position(|s| s == setting).unwrap()][place] += 1;
        }
    }
    for count in counts.as_flattened() {
        assert!(count.abs_diff(400) < 90, "{counts:?}");
    }
}
