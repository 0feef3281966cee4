//! Noise against the Allan deviation of its coefficients.

use std::f64::consts::PI;

use mimu_rig::noise::{Coefficients, Noise};

/// Overlapping Allan variance at `m` samples, and its degrees of freedom for white noise, flicker noise and
/// random walk (Riley, NIST SP 1065, table 5).
fn allan(samples: &[f64], m: usize) -> (f64, [f64; 3]) {
    let mut sums = vec![0.0];
    for x in samples {
        sums.push(sums[sums.len() - 1] + x);
    }
    let terms = sums.len() - 2 * m;
    let square: f64 = (0..terms)
        .map(|i| (sums[i + 2 * m] - 2.0 * sums[i + m] + sums[i]).powi(2))
        .sum();
    let (n, k) = (sums.len() as f64, m as f64);
    let dof = [
        (3.0 * (n - 1.0) / (2.0 * k) - 2.0 * (n - 2.0) / n) * 4.0 * k * k / (4.0 * k * k + 5.0),
        5.0 * n * n / (4.0 * k * (n + 3.0 * k)),
        (n - 2.0) / k * ((n - 1.0).powi(2) - 3.0 * k * (n - 1.0) + 4.0 * k * k) / (n - 3.0).powi(2),
    ];
    (square / (2.0 * k * k * terms as f64), dof)
}

#[test]
fn the_allan_deviation_shows_each_coefficient_as_stated() {
    let (dt, count) = (0.01, 2_000_000);
    let only = |white, instability, walk| Coefficients {
        white,
        instability,
        walk,
    };
    type Expected = fn(f64) -> f64;
    // Systematic error of the variance besides chance: none; twice the 0.5 % of the floor; 1/(2 m²), by which the sums of a random walk at whole
    // steps exceed its integral.
    let cases: [(Coefficients, Expected, f64); 3] = [
        (only(3.0, 0.0, 0.0), |tau| 9.0 / tau, 0.0),
        (only(0.0, 3.0, 0.0), |_| 9.0 * 2.0 * 2_f64.ln() / PI, 0.01),
        (only(0.0, 0.0, 3.0), |tau| 9.0 * tau / 3.0, 5e-4),
    ];
    let seeds = 8;
    for (kind, (coefficients, expected, slack)) in cases.into_iter().enumerate() {
        let lengths = [32, 320, 3_200, 32_000];
        let (mut ratio, mut sigma) = ([0.0; 4], [0.0; 4]);
        for seed in 0..seeds {
            let mut noise = Noise::new(&coefficients, "a", dt, seed);
            let samples: Vec<f64> = (0..count).map(|_| noise.step()).collect();
            for (i, m) in lengths.into_iter().enumerate() {
                let (variance, dof) = allan(&samples, m);
                ratio[i] += variance / expected(m as f64 * dt) / seeds as f64;
                sigma[i] = (2.0 / dof[kind] / seeds as f64).sqrt();
            }
        }
        for i in 0..4 {
            let miss = (ratio[i] - 1.0).abs();
            assert!(
                miss < 4.0 * sigma[i] + slack,
                "kind {kind}, m {}: {}",
                lengths[i],
                ratio[i]
            );
        }
    }
}
