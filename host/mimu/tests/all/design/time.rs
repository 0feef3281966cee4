//! Sequences and time budgets.

use mimu::plan::design::budget::{DwellNoise, Session};
use mimu::plan::design::model::Setting;
use mimu::plan::design::reach::Fixture;
use mimu::plan::design::tour::{Motion, randomised};
use mimu_recording::Reference;
use nalgebra::DMatrix;

use super::{accel, close};

#[test]
fn random_walk_bounds_the_dwell() {
    let problem = accel(Reference::Table);
    let spent = |k: f64| {
        let session = Session {
            time_s: 36_000.0,
            noise: DwellNoise { n: 1e-3, b: 0.0, k },
            motion: Motion::of(Fixture::ThreeAxis),
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

/// An order in which neighbours are similar: by z, then y, then x.
fn listed(settings: &[Setting]) -> Vec<Setting> {
    let mut order = settings.to_vec();
    let key = |s: &Setting| [s.up.z, s.up.y, s.up.x].map(|c| (c * 1e6).round() as i64);
    order.sort_by_key(key);
    order
}

#[test]
fn in_an_order_by_lot_drift_is_scatter_that_a_fit_knows_of_and_in_a_listed_order_it_is_not() {
    let problem = accel(Reference::Table);
    for n in [9, 12, 22] {
        let settings = problem.best(n, 1).unwrap();
        let listed = true_over_claimed(&listed(&settings));
        let lots = (0..2000).map(|seed| true_over_claimed(&randomised(&settings, seed)));
        let randomised = lots.sum::<f64>() / 2000.0;
        println!(
            "{n} dwells: true over claimed variance {listed:.2} in a listed order, {randomised:.2} in a randomised one"
        );
        assert!(
            listed > 1.5 && randomised < 1.2,
            "{n}: {listed} {randomised}"
        );
    }
}
