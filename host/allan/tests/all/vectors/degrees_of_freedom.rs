//! Equivalent degrees of freedom against covariances, and intervals against what they claim.

use mimu_allan::Deviation;
use mimu_allan::bounds::{Estimator, Sampling, interval};

const KINDS: [Deviation; 3] = [Deviation::Allan, Deviation::Modified, Deviation::Hadamard];

/// Weights of the integral's samples in one difference.
fn weights(kind: Deviation, m: usize) -> Vec<f64> {
    let taps: &[f64] = match kind {
        Deviation::Allan | Deviation::Modified => &[1.0, -2.0, 1.0],
        Deviation::Hadamard => &[-1.0, 3.0, -3.0, 1.0],
    };
    let width = if kind == Deviation::Modified { m } else { 1 };
    let mut weights = vec![0.0; (taps.len() - 1) * m + width];
    for (k, tap) in taps.iter().enumerate() {
        for i in 0..width {
            weights[k * m + i] += tap;
        }
    }
    weights
}

/// Degrees of freedom by their definition, `2 E(s²)²/var(s²)`, for normal noise whose integral is white noise
/// summed `sums` times: white phase 0, white rate 1.
fn by_definition(kind: Deviation, m: usize, stride: usize, terms: usize, sums: usize) -> f64 {
    let mut response = weights(kind, m);
    for _ in 0..sums {
        // Summation of the noise is summation of the weights, from the other end.
        for i in (1..response.len()).rev() {
            response[i - 1] += response[i];
        }
    }
    let covariance = |lag: usize| -> f64 {
        let n = response.len().saturating_sub(lag);
        (0..n).map(|i| response[i] * response[i + lag]).sum()
    };
    let sum: f64 = (1..terms)
        .map(|k| 2.0 * (1.0 - k as f64 / terms as f64) * covariance(k * stride).powi(2))
        .sum();
    let zero = covariance(0).powi(2);
    terms as f64 * zero / (zero + sum)
}

fn edf(kind: Deviation, m: usize, stride: usize, terms: usize, alpha: i32) -> f64 {
    Estimator {
        kind,
        sampling: Sampling::Instants,
        m,
        stride,
        terms,
    }
    .edf(alpha)
}

/// So few terms that the combined algorithm of Greenhall and Riley sums them one by one.
#[test]
fn degrees_of_freedom_for_white_noise_are_those_of_its_covariances() {
    for kind in KINDS {
        for m in [1, 2, 5, 8, 20] {
            for terms in [1, 3, m, 4 * m, 90] {
                for (alpha, sums) in [(2, 0), (0, 1)] {
                    let (ours, exact) = (
                        edf(kind, m, 1, terms, alpha),
                        by_definition(kind, m, 1, terms, sums),
                    );
                    // The modified variance of white rates is the exception: GR average the integral over the
                    // cluster, the definition sums it; 4.8 % fewer at m = 2, where bounds are 2.4 % wider than
                    // need be.
                    let tolerance = match kind {
                        Deviation::Modified if alpha == 0 && m > 1 => 0.1 / m as f64,
                        _ => 1e-12,
                    };
                    assert!(
                        (ours / exact - 1.0).abs() < tolerance,
                        "{kind:?} m {m} terms {terms} alpha {alpha}: {ours} for {exact}"
                    );
                }
            }
        }
    }
}

/// So many terms that the combined algorithm of Greenhall and Riley uses fits instead of sums.
#[test]
fn degrees_of_freedom_of_long_series_are_within_two_percent_of_those_of_their_covariances() {
    for kind in KINDS {
        for (m, terms) in [(64, 300), (64, 1000), (200, 250), (200, 3000)] {
            for (alpha, sums) in [(2, 0), (0, 1)] {
                let ours = edf(kind, m, 1, terms, alpha);
                let exact = by_definition(kind, m, 1, terms, sums);
                assert!(
                    (ours / exact - 1.0).abs() < 0.02,
                    "{kind:?} m {m} terms {terms} alpha {alpha}: {ours} for {exact}"
                );
            }
        }
    }
}

#[test]
fn degrees_of_freedom_with_differences_left_out_are_those_of_their_covariances() {
    for kind in KINDS {
        for (stride, terms) in [(3, 400), (4, 60), (7, 500)] {
            for (alpha, sums) in [(2, 0), (0, 1)] {
                let ours = edf(kind, 256, stride, terms, alpha);
                let exact = by_definition(kind, 256, stride, terms, sums);
                assert!(
                    (ours / exact - 1.0).abs() < 2e-4,
                    "{kind:?} stride {stride} alpha {alpha}: {ours} for {exact}"
                );
            }
        }
    }
}

/// Quantiles of chi-square from any printed table: 3.247 and 20.483 for 10 degrees, 74.222 and 129.561 for 100.
#[test]
fn intervals_have_the_tabulated_quantiles_of_chi_square() {
    for (degrees, low, high) in [(10.0, 3.247, 20.483), (100.0, 74.222, 129.561)] {
        let (lower, upper) = interval(2.0, degrees, 0.95);
        assert!((lower - 2.0 * f64::sqrt(degrees / high)).abs() < 1e-4 * lower);
        assert!((upper - 2.0 * f64::sqrt(degrees / low)).abs() < 2e-4 * upper);
    }
}
