//! Rounding errors in long series. Rates are whole multiples of 2^-30, so integers give the integral, its differences and their sums
//! without rounding.

use mimu_allan::curve::curve;
use mimu_allan::deviation::ALL_TERMS;
use mimu_allan::{Deviation, Point, Spacing};

use super::Random;

const KINDS: [Deviation; 3] = [Deviation::Allan, Deviation::Modified, Deviation::Hadamard];
const UNIT: f64 = 1.0 / (1 << 30) as f64;

fn whole(rate: f64) -> i64 {
    (rate / UNIT).round() as i64
}

fn rates(steps: &[i64]) -> Vec<f64> {
    steps.iter().map(|&s| s as f64 * UNIT).collect()
}

/// Sum of the parts before each, and of all.
fn running(parts: impl IntoIterator<Item = i128>) -> Vec<i128> {
    let mut sum = 0;
    let mut sums = vec![0];
    sums.extend(parts.into_iter().map(|part| {
        sum += part;
        sum
    }));
    sums
}

/// The deviation over those differences that `point` used.
fn exact(steps: &[i64], kind: Deviation, point: &Point) -> f64 {
    let m = point.m;
    let x = running(steps.iter().map(|&s| i128::from(s)));
    let (s, span, divisor) = match kind {
        Deviation::Allan => (x, 2 * m, 2.0),
        Deviation::Hadamard => (x, 3 * m, 6.0),
        Deviation::Modified => (running(x), 3 * m, 2.0 * (m as f64).powi(2)),
    };
    let all = s.len() - span;
    let stride = (1..)
        .find(|stride| all.div_ceil(*stride) == point.terms)
        .expect("a stride");
    let difference = |j: usize| match kind {
        Deviation::Allan => s[j + 2 * m] - 2 * s[j + m] + s[j],
        _ => s[j + 3 * m] - 3 * (s[j + 2 * m] - s[j + m]) - s[j],
    };
    let square = |j| (difference(j) as f64 * UNIT).powi(2);
    let mean = (0..all).step_by(stride).map(square).sum::<f64>() / point.terms as f64;
    (mean / divisor).sqrt() / m as f64
}

/// Largest relative error of a deviation, at clusters that are computed in tiles and at longer ones.
fn worst(steps: &[i64]) -> [f64; 3] {
    let spacing = Spacing::Samples(vec![1, 2, 10, 100, 3000, 20_000]);
    KINDS.map(|kind| {
        let points = curve(&rates(steps), 1.0, kind, &spacing, 0.95).expect("finite");
        assert_eq!(points.len(), 6);
        points
            .iter()
            .map(|point| (point.deviation / exact(steps, kind, point) - 1.0).abs())
            .fold(0.0, f64::max)
    })
}

fn long(mut rate: impl FnMut(usize) -> f64) -> Vec<i64> {
    (0..2 * ALL_TERMS + 100).map(|i| whole(rate(i))).collect()
}

#[test]
fn gravity_under_the_noise_of_a_long_series_costs_less_than_one_in_1e9() {
    let mut random = Random(5);
    let steps = long(|_| 9.8 + 1e-3 * random.normal());
    let worst = worst(&steps);
    assert!(worst.iter().all(|&error| error < 1e-9), "{worst:?}");
}
