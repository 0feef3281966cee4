//! Whether biases of several axes move together from session to session, as they do if a temperature that nobody recorded moves them all.

use nalgebra::{DMatrix, SymmetricEigen};
use serde::Serialize;

/// Correlations drawn without a common cause, with which the observed one is compared.
const DRAWS: u32 = 2000;
/// Sessions needed: with four, correlations of 0.99 by chance are common among six biases.
const LEAST_SESSIONS: usize = 5;

/// A direction along which biases move together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Direction {
    /// Share of the standardised variance of all biases along it.
    pub share: f64,
    /// Probability of such a share without a common cause.
    pub p: f64,
    /// Change of the biases of gyro and accelerometer for one standard deviation along it, raw.
    pub loading: Vec<f64>,
    /// Position of each used session along it, in standard deviations.
    pub scores: Vec<f64>,
}

/// The principal direction of `biases`, one row for each session. `None` with too few sessions, or if a bias is constant.
pub fn direction(biases: &DMatrix<f64>) -> Option<Direction> {
    let (sessions, n) = biases.shape();
    if sessions < LEAST_SESSIONS || n < 2 {
        return None;
    }
    let (standard, sigmas) = standardised(biases)?;
    let (share, along) = principal(&standard);
    // Without a common cause the share depends on the numbers of sessions and biases only.
    let mut random = Normal(0x9E37_79B9_7F4A_7C15);
    let reached = (0..DRAWS).filter(|_| {
        let drawn = DMatrix::from_fn(sessions, n, |_, _| random.next());
        standardised(&drawn).is_some_and(|(drawn, _)| principal(&drawn).0 >= share)
    });
    let p = f64::from(reached.count() as u32 + 1) / f64::from(DRAWS + 1);
    let scores = &standard * &along;
    let size = (scores.norm_squared() / (sessions - 1) as f64).sqrt();
    // Sign: more of the first bias.
    let sign = along[0].signum();
    Some(Direction {
        share,
        p,
        loading: (0..n).map(|i| sign * along[i] * size * sigmas[i]).collect(),
        scores: scores.iter().map(|s| sign * s / size).collect(),
    })
}

/// Columns with mean 0 and variance 1, and their standard deviations.
fn standardised(columns: &DMatrix<f64>) -> Option<(DMatrix<f64>, Vec<f64>)> {
    let mut out = columns.clone();
    let mut sigmas = Vec::new();
    for mut column in out.column_iter_mut() {
        let mean = column.mean();
        column.add_scalar_mut(-mean);
        let sigma = (column.norm_squared() / (column.len() - 1) as f64).sqrt();
        if !(sigma > 0.0) {
            return None;
        }
        column /= sigma;
        sigmas.push(sigma);
    }
    Some((out, sigmas))
}

/// Share and unit vector of the principal direction.
fn principal(standard: &DMatrix<f64>) -> (f64, nalgebra::DVector<f64>) {
    let eigen = SymmetricEigen::new(standard.transpose() * standard);
    let total: f64 = eigen.eigenvalues.sum();
    let k = eigen.eigenvalues.imax();
    (
        eigen.eigenvalues[k] / total,
        eigen.eigenvectors.column(k).into_owned(),
    )
}

/// Standard normal numbers by xorshift64* and the sum of twelve uniform ones: the distribution of a share needs no better, and no dependency.
struct Normal(u64);

impl Normal {
    fn next(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.0 ^= self.0 >> 12;
            self.0 ^= self.0 << 25;
            self.0 ^= self.0 >> 27;
            let word = self.0.wrapping_mul(0x2545_F491_4F6C_DD1D);
            sum += (word >> 11) as f64 / (1u64 << 53) as f64;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn biases_that_follow_one_cause_are_named_and_independent_ones_are_rarely() {
        let mut random = Normal(7);
        let mut named = 0;
        for _ in 0..40 {
            let alone = DMatrix::from_fn(8, 6, |_, _| random.next());
            named += u32::from(direction(&alone).expect("eight sessions").p < 0.01);
        }
        assert!(named <= 3, "{named} of 40 at 1 %");
        let causes: Vec<f64> = (0..8).map(|_| random.next()).collect();
        let effect = [3.0, -2.0, 1.0, 10.0, 5.0, -8.0];
        let common = DMatrix::from_fn(8, 6, |s, i| effect[i] * (causes[s] + 0.2 * random.next()));
        let found = direction(&common).expect("eight sessions");
        assert!(found.p < 0.002 && found.share > 0.9, "{found:?}");
        let signs = found.loading.iter().zip(effect).all(|(l, e)| l * e > 0.0);
        assert!(signs, "{found:?}");
    }
}
