//! The recursive filter against batch least squares and over ten million updates.

use mimu_core::kalman::{Filter, Rejected};
use nalgebra::{DMatrix, DVector, Vector3};
use proptest::prelude::*;

/// Batch weighted least squares by singular values: mean and covariance of `[b, P1, P2, P3]`. Inputs are in units of `span`; otherwise the columns
/// would differ so much that this reference would be less accurate than the filter. Shares no code with the filter.
fn least_squares(rows: &[(Vector3<f64>, f64, f64)], span: f64) -> (DVector<f64>, DMatrix<f64>) {
    let whiten = |r: f64| 1.0 / r.sqrt();
    let a = DMatrix::from_fn(rows.len(), 4, |i, j| {
        whiten(rows[i].2) * if j == 0 { 1.0 } else { rows[i].0[j - 1] / span }
    });
    let y = DVector::from_fn(rows.len(), |i, _| whiten(rows[i].2) * rows[i].1);
    let svd = a.svd(true, true);
    let mean = svd.solve(&y, 0.0).expect("both sides were asked for");
    let v = svd.v_t.expect("asked for").transpose();
    let w = DMatrix::from_diagonal(&svd.singular_values.map(|s| 1.0 / (s * s)));
    (mean, &v * w * v.transpose())
}

/// xorshift64*, so that the ten million samples are the same on every machine.
struct Noise(u64);
impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
    }
    /// Zero mean, unit variance.
    fn gaussian(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

fn input() -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-1.0..1.0f64).prop_map(Vector3::from)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    /// The recursion passes through the fits to the first four, five, ... rows, each of which may be conditioned worse than the whole. The worst of
    /// them magnifies rounding by the square of its condition, because the prior adds to the normal equations. While the prior is diffuse, the rows
    /// are eliminated in the order of the states, without pivoting. This magnifies rounding if a leading block of the first rows is nearly singular.
    /// The bound is ten ε times both. Of 500 random cases the median mean agrees to 5e-16 and the worst to 4e-15.
    #[test]
    fn diffuse_filter_agrees_with_least_squares_to_rounding(
        inputs in prop::collection::vec((input(), -1.0..1.0f64, 0.1..10.0f64), 8..40),
        span in prop::sample::select(vec![0.01, 1.0, 9.8, 300.0]),
        p in input(), b in 1.0..4.0f64,
    ) {
        let noise = 1e-6;
        let rows: Vec<_> = inputs
            .iter()
            .map(|(x, e, r)| (x * span, b + p.dot(x) + 1e-3 * e, noise * r))
            .collect();
        let mut filter = Filter::diffuse(noise, span);
        for (x, z, r) in &rows {
            filter.update(x, *z, *r).unwrap();
        }
        let (mean, covariance) = least_squares(&rows, span);
        let worst = (4..=rows.len())
            .map(|n| least_squares(&rows[..n], span).1.norm() / noise)
            .fold(1.0, f64::max);
        let growth = (2..=4)
            .map(|k| nalgebra::DMatrix::from_fn(k, k, |i, j| if j == 0 { 1.0 } else { rows[i].0[j - 1] / span }))
            .map(|leading| leading.singular_values().min())
            .filter(|least| *least > 1e-15)
            .fold(1.0, |growth: f64, least| growth.max(least.recip()));
        let bound = 10.0 * f64::EPSILON * worst * growth;
        let unit = nalgebra::Matrix4::from_diagonal(&nalgebra::Vector4::new(1.0, span, span, span));
        let found = unit * filter.covariance() * unit;
        let off = (found - &covariance).norm() / covariance.norm();
        prop_assert!(off <= bound, "covariance: {off:e}, bound {bound:e}");
        let off = (unit * filter.mean() - &mean).norm() / mean.norm();
        prop_assert!(off <= bound, "mean: {off:e}, bound {bound:e}");
    }

    #[test]
    fn what_is_refused_leaves_the_filter_as_it_was(
        bad in prop::sample::select(vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY]),
        place in 0..4usize,
    ) {
        let mut filter = Filter::diffuse(1e-6, 1.0);
        filter.update(&Vector3::x(), 2.8, 1e-6).unwrap();
        let before = filter;
        let (mut x, mut z) = (Vector3::new(0.1, 0.2, 0.3), 2.5);
        if place == 3 { z = bad } else { x[place] = bad }
        prop_assert_eq!(filter.update(&x, z, 1e-6), Err(Rejected::NotFinite));
        let silent = filter.update(&Vector3::x(), 2.5, 0.0);
        prop_assert_eq!(silent, Err(Rejected::NoiseNotPositive));
        prop_assert_eq!(filter, before);
    }
}

/// Ten million samples are 2 h 47 min at 1 kHz. The inputs step through rates about the six directions and rest, as on a table.
#[test]
fn single_precision_stays_positive_and_true_over_ten_million_updates() {
    const UPDATES: usize = 10_000_000;
    const SIGMA: f64 = 3e-3;
    let truth = [2.5, 0.003, 0.291, -0.004];
    let mut rng = Noise(0x6d69_6d75);
    let mut single = Filter::<f32>::diffuse((SIGMA * SIGMA) as f32, 2.0);
    let mut double = Filter::<f64>::diffuse(SIGMA * SIGMA, 2.0);
    for i in 0..UPDATES {
        let mut rate = Vector3::zeros();
        if i % 7 < 6 {
            rate[i % 7 / 2] = if i % 2 == 0 { 2.0 } else { -2.0 };
        }
        // Both filters get the same reading, so its rounding is not attributed to either.
        let raw = (truth[0]
            + truth[1] * rate.x
            + truth[2] * rate.y
            + truth[3] * rate.z
            + SIGMA * rng.gaussian()) as f32;
        let noise = (SIGMA * SIGMA) as f32;
        single.update(&rate.cast(), raw, noise).unwrap();
        double
            .update(&rate, f64::from(raw), f64::from(noise))
            .unwrap();
        if i % 1000 == 0 {
            assert!(single.diagonal().iter().all(|d| *d > 0.0), "after {i}");
        }
    }
    let covariance = single.covariance();
    assert_eq!(covariance, covariance.transpose());
    assert!(covariance.cholesky().is_some(), "{covariance}");
    for i in 0..4 {
        let sigma = double.covariance()[(i, i)].sqrt();
        let off = f64::from(single.mean()[i]) - double.mean()[i];
        let ratio = f64::from(covariance[(i, i)].sqrt()) / sigma;
        // For a bias of 2.5 V, a unit in the last place of f32 is 0.25 of its sigma here.
        assert!(
            off.abs() < 0.5 * sigma,
            "state {i} is off by {off:e}, sigma {sigma:e}"
        );
        assert!((ratio - 1.0).abs() < 0.05, "state {i}: {ratio}");
    }
}

#[test]
fn an_input_that_overflows_single_precision_is_refused() {
    let mut filter = Filter::<f32>::diffuse(1e-6, 1.0);
    let before = filter;
    let huge = Vector3::new(1e20_f32, 0.0, 0.0);
    assert_eq!(filter.update(&huge, 2.5, 1e-6), Err(Rejected::NotFinite));
    assert_eq!(filter, before);
}
