//! The definitions, term by term, and what follows from them.

use mimu_allan::curve::curve;
use mimu_allan::{Deviation, Point, Spacing};

use super::Random;

fn at(rates: &[f64], kind: Deviation, m: usize) -> Point {
    curve(rates, 1.0, kind, &Spacing::Samples(vec![m]), 0.95).expect("finite")[0]
}

fn mean(rates: &[f64], from: usize, m: usize) -> f64 {
    rates[from..from + m].iter().sum::<f64>() / m as f64
}

/// Root of the mean square of a list over a divisor, and its length.
fn root(terms: Vec<f64>, divisor: f64) -> (f64, usize) {
    let n = terms.len();
    let mean = terms.iter().map(|t| t * t).sum::<f64>() / n as f64;
    ((mean / divisor).sqrt(), n)
}

/// SP 1065 in rates: (8) of fang with its inner sum, the mean of m neighbouring such differences, the second
/// difference.
fn by_definition(rates: &[f64], kind: Deviation, m: usize) -> (f64, usize) {
    let n = rates.len();
    let step = |j: usize| mean(rates, j + m, m) - mean(rates, j, m);
    match kind {
        Deviation::Allan => root((0..n + 1 - 2 * m).map(step).collect(), 2.0),
        Deviation::Modified => root(
            (0..n + 2 - 3 * m)
                .map(|j| (j..j + m).map(step).sum::<f64>() / m as f64)
                .collect(),
            2.0,
        ),
        Deviation::Hadamard => root(
            (0..n + 1 - 3 * m).map(|j| step(j + m) - step(j)).collect(),
            6.0,
        ),
    }
}

#[test]
fn every_cluster_length_of_a_short_series_is_the_definition_term_by_term() {
    let rates = Random(1).white(200);
    for (kind, longest) in [
        (Deviation::Allan, 100),
        (Deviation::Modified, 67),
        (Deviation::Hadamard, 66),
    ] {
        let all = Spacing::Samples((0..300).collect());
        let points = curve(&rates, 0.01, kind, &all, 0.95).expect("finite");
        assert_eq!(points.len(), longest, "{kind:?}");
        for (point, m) in points.iter().zip(1..) {
            let (deviation, terms) = by_definition(&rates, kind, m);
            assert_eq!((point.m, point.terms), (m, terms), "{kind:?}");
            assert!((point.tau_s - 0.01 * m as f64).abs() < 1e-12);
            let error = point.deviation / deviation - 1.0;
            assert!(error.abs() < 1e-12, "{kind:?} at {m}: {error:.1e}");
        }
    }
}

#[test]
fn a_ramp_has_the_deviation_of_its_coefficient_and_no_hadamard_deviation() {
    let rates: Vec<f64> = (0..10_000).map(|i| f64::from(i) / 256.0).collect();
    for m in [1, 7, 300, 3000] {
        // sigma = R tau / sqrt 2.
        let expected = m as f64 / 256.0 / 2_f64.sqrt();
        for kind in [Deviation::Allan, Deviation::Modified] {
            let deviation = at(&rates, kind, m).deviation;
            assert!((deviation / expected - 1.0).abs() < 1e-9, "{kind:?} {m}");
        }
        assert!(at(&rates, Deviation::Hadamard, m).deviation < 1e-8 * expected);
    }
}

#[test]
fn series_too_short_for_a_difference_have_no_points() {
    for n in 0..6 {
        let rates = vec![1.0; n];
        for (kind, least) in [
            (Deviation::Allan, 2),
            (Deviation::Modified, 2),
            (Deviation::Hadamard, 3),
        ] {
            let points = curve(&rates, 1.0, kind, &Spacing::Octave, 0.95).expect("finite");
            assert_eq!(points.is_empty(), n < least, "{n} {kind:?}");
        }
    }
}

#[test]
fn a_gap_is_refused_with_the_sample_where_it_begins() {
    let mut rates = vec![1.0; 10_000];
    rates[7000] = f64::NAN;
    rates[9000] = f64::INFINITY;
    let error = curve(&rates, 1.0, Deviation::Allan, &Spacing::Octave, 0.95).expect_err("a gap");
    assert!(error.to_string().starts_with("sample 7000: NaN"), "{error}");
}
