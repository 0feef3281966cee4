//! The test suite of NIST SP 1065, section 12: nine hand-sized values and a thousand by rule.

use mimu_allan::curve::curve;
use mimu_allan::{Deviation, Point, Spacing};

/// Rates of table 30's series ("NBS14", section 12.2).
const NINE: [f64; 9] = [892., 809., 823., 798., 671., 644., 883., 903., 677.];

/// The thousand of section 12.4: the "minimal standard" generator n(i+1) = 16807 n(i) mod 2147483647 from
/// 1234567890, over its modulus.
fn thousand() -> Vec<f64> {
    const MODULUS: u64 = 2_147_483_647;
    std::iter::successors(Some(1_234_567_890_u64), |n| Some(16_807 * n % MODULUS))
        .take(1000)
        .map(|n| n as f64 / MODULUS as f64)
        .collect()
}

fn points(rates: &[f64], kind: Deviation, clusters: &[usize], confidence: f64) -> Vec<Point> {
    let spacing = Spacing::Samples(clusters.to_vec());
    curve(rates, 1.0, kind, &spacing, confidence).expect("finite")
}

fn assert_table(rates: &[f64], clusters: &[usize], table: [(Deviation, &[f64]); 3]) {
    for (kind, expected) in table {
        let points = points(rates, kind, clusters, 0.683);
        assert_eq!(points.len(), expected.len(), "{kind:?}");
        for (point, expected) in points.iter().zip(expected) {
            let error = point.deviation / expected - 1.0;
            // The tables have seven digits.
            assert!(
                error.abs() < 1e-6,
                "{kind:?} at {}: {} for {expected}",
                point.m,
                point.deviation
            );
        }
    }
}

#[test]
fn nine_rates_have_the_deviations_of_table_30() {
    assert_table(
        &NINE,
        &[1, 2],
        [
            (Deviation::Allan, &[91.22945, 85.95287]),
            (Deviation::Modified, &[91.22945, 74.78849]),
            (Deviation::Hadamard, &[70.80607, 85.61487]),
        ],
    );
}

#[test]
fn a_thousand_rates_have_the_deviations_of_table_31() {
    assert_table(
        &thousand(),
        &[1, 10, 100],
        [
            (Deviation::Allan, &[2.922319e-1, 9.159953e-2, 3.241343e-2]),
            (
                Deviation::Modified,
                &[2.922319e-1, 6.172376e-2, 2.170921e-2],
            ),
            (
                Deviation::Hadamard,
                &[2.943883e-1, 9.581083e-2, 3.237638e-2],
            ),
        ],
    );
}
