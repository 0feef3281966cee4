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
fn gravity_under_the_noise_of_a_short_series_costs_no_digits() {
    let mut random = Random(4);
    let steps: Vec<i64> = (0..ALL_TERMS)
        .map(|_| whole(9.8 + 1e-4 * random.normal()))
        .collect();
    let spacing = Spacing::Samples(vec![1, 10, 1000, 100_000]);
    for kind in KINDS {
        for point in curve(&rates(&steps), 1.0, kind, &spacing, 0.95).expect("finite") {
            let error = point.deviation / exact(&steps, kind, &point) - 1.0;
            assert!(error.abs() < 1e-11, "{kind:?} {}: {error:.1e}", point.m);
        }
    }
}

#[test]
fn gravity_under_the_noise_of_a_long_series_costs_less_than_one_in_1e9() {
    let mut random = Random(5);
    let steps = long(|_| 9.8 + 1e-3 * random.normal());
    let worst = worst(&steps);
    assert!(worst.iter().all(|&error| error < 1e-9), "{worst:?}");
}

#[test]
fn a_drift_through_a_thousand_sigma_costs_no_more() {
    let mut random = Random(6);
    let steps = long(|i| 9.8 + 1e-3 * random.normal() + 5e-7 * i as f64);
    let worst = worst(&steps);
    assert!(worst.iter().all(|&error| error < 1e-9), "{worst:?}");
}

/// Twice a first-order filter of a thousand samples. From one sample to the next its Hadamard deviation is a
/// thirtieth of its Allan deviation.
#[test]
fn noise_behind_a_slow_filter_costs_no_more_and_its_hadamard_deviation_one_in_1e5() {
    let mut random = Random(7);
    let mut level = [0.0; 2];
    let steps = long(|_| {
        level[0] += 1e-3 * (random.normal() - level[0]);
        level[1] += 1e-3 * (level[0] - level[1]);
        level[1]
    });
    let [allan, modified, hadamard] = worst(&steps);
    assert!(
        allan < 1e-9 && modified < 1e-9,
        "{allan:.1e} {modified:.1e}"
    );
    assert!(hadamard < 1e-5, "{hadamard:.1e}");
}

/// A ramp without noise: its integral is the smoothest that is not a line.
#[test]
fn a_ramp_costs_less_than_one_in_1e8_and_leaves_1e_4_of_it_to_the_hadamard_deviation() {
    let steps: Vec<i64> = (0..2 * ALL_TERMS as i64).map(|i| 1024 * i).collect();
    let [allan, modified, _] = worst(&steps);
    assert!(
        allan < 1e-8 && modified < 1e-8,
        "{allan:.1e} {modified:.1e}"
    );
    let spacing = Spacing::Samples(vec![1]);
    let at_one =
        |kind| curve(&rates(&steps), 1.0, kind, &spacing, 0.95).expect("finite")[0].deviation;
    assert!(at_one(Deviation::Hadamard) < 1e-4 * at_one(Deviation::Allan));
}
