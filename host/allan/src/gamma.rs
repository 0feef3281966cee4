//! Variances that are sums of terms, fitted by maximum likelihood.
//!
//! A mean of squares with n degrees of freedom is gamma distributed. Its likelihood is maximized by iterated least squares, weighted by the model: weights by the
//! measured values would let one small value of two degrees of freedom outweigh a hundred.

use nalgebra::{DMatrix, DVector};

/// A mean of squares.
#[derive(Debug, Clone, Copy)]
pub struct MeanSquare<const TERMS: usize> {
    /// Its value, above zero.
    pub value: f64,
    /// Degrees of freedom.
    pub dof: f64,
    /// Expected value for a coefficient of 1 of each term.
    pub basis: [f64; TERMS],
}

/// The most likely coefficients of some terms.
#[derive(Debug, Clone)]
pub struct GammaFit<const TERMS: usize> {
    /// Numbers of the terms.
    pub terms: Vec<usize>,
    /// Coefficients of all terms; 0 of the others.
    pub coefficients: [f64; TERMS],
    /// Variance of the first of the coefficients.
    pub variance: f64,
    /// Minus twice the logarithm of the likelihood, without constants.
    pub deviance: f64,
}

/// Iterations at the most, and the relative change of the expected values that ends them.
const ITERATIONS: usize = 50;
const SETTLED: f64 = 1e-10;

impl<const TERMS: usize> GammaFit<TERMS> {
    /// Of `terms` to `all`; `None` if these do not determine them. A coefficient may be negative.
    pub fn of(all: &[MeanSquare<TERMS>], terms: Vec<usize>) -> Option<Self> {
        let mut expected: Vec<f64> = all.iter().map(|m| m.value).collect();
        let mut coefficients = [0.0; TERMS];
        let mut variance = f64::NAN;
        for _ in 0..ITERATIONS {
            if all.len() < terms.len() || expected.iter().any(|e| !(*e > 0.0)) {
                return None;
            }
            let weight = |i: usize| (0.5 * all[i].dof).sqrt() / expected[i];
            let mut matrix = DMatrix::from_fn(all.len(), terms.len(), |i, k| {
                all[i].basis[terms[k]] * weight(i)
            });
            // Terms differ by powers of the longest time or the highest frequency; without scaling the smallest would be lost.
            let scale: Vec<f64> = matrix.column_iter().map(|c| c.norm()).collect();
            for (mut column, s) in matrix.column_iter_mut().zip(&scale) {
                column /= *s;
            }
            let right = DVector::from_fn(all.len(), |i, _| all[i].value * weight(i));
            let inverse = matrix.tr_mul(&matrix).cholesky()?.inverse();
            let solution = &inverse * matrix.tr_mul(&right);
            for (k, term) in terms.iter().enumerate() {
                coefficients[*term] = solution[k] / scale[k];
            }
            variance = inverse[(0, 0)] / (scale[0] * scale[0]);
            let mut change = 0.0_f64;
            for (expected, one) in expected.iter_mut().zip(all) {
                let next: f64 = coefficients
                    .iter()
                    .zip(&one.basis)
                    .map(|(a, b)| a * b)
                    .sum();
                // A step to zero or below is shortened.
                let next = next.max(0.1 * *expected);
                change = change.max((next / *expected - 1.0).abs());
                *expected = next;
            }
            if change < SETTLED {
                break;
            }
        }
        let deviance = all.iter().zip(&expected).map(|(one, expected)| {
            let ratio = one.value / expected;
            one.dof * (ratio - 1.0 - ratio.ln())
        });
        coefficients[terms[0]].is_finite().then(|| Self {
            coefficients,
            variance,
            deviance: deviance.sum(),
            terms,
        })
    }

    /// The deviance, and [`TERM_DEVIANCE`] for each term: the least is that of the terms that the data need.
    pub fn cost(&self) -> f64 {
        self.deviance + TERM_DEVIANCE * self.terms.len() as f64
    }
}

/// Least drop in deviance for another term: 2.8 standard deviations, 0.5 %. With every positive term included, the noise of the curve alone made the means of white noise a
/// tenth too noisy (errors of 0.88 sigma instead of 1).
pub const TERM_DEVIANCE: f64 = 8.0;

/// The sets of some of `terms` terms, as numbers.
pub fn sets(terms: usize) -> impl Iterator<Item = Vec<usize>> {
    (1..1_usize << terms).map(move |set| (0..terms).filter(|k| set & (1 << k) != 0).collect())
}
