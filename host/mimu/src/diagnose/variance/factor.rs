//! Factors of covariances: what decorrelates rows.

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DMatrixViewMut, DVector, Dyn, Matrix2, SymmetricEigen, Vector2};

use super::VarianceModel;

/// Axes in which rows are independent: the eigenvectors of their known covariance. Extra white variance does not change them.
///
/// Computed once. Each extra white variance that is tried then takes one division for each row; a Cholesky factor would take a third of n³.
pub(super) struct Axes {
    /// Rotation that makes the rows independent; `None` if they already are.
    rotate: Option<DMatrix<f64>>,
    /// Their known variances.
    variances: DVector<f64>,
}

impl Axes {
    /// The rows' own axes, if the rows are independent in these.
    pub(super) fn as_they_stand(known: &DMatrix<f64>) -> Option<Self> {
        let variances = known.diagonal();
        let independent = (known - DMatrix::from_diagonal(&variances)).amax() == 0.0;
        independent.then_some(Self {
            rotate: None,
            variances,
        })
    }

    /// Of a known covariance.
    pub(super) fn of(known: &DMatrix<f64>) -> Self {
        Self::as_they_stand(known).unwrap_or_else(|| {
            let eigen = SymmetricEigen::new(known.clone());
            Self {
                rotate: Some(eigen.eigenvectors.transpose()),
                variances: eigen.eigenvalues,
            }
        })
    }

    pub(super) fn rotate(&self, part: &mut DMatrixViewMut<f64>) {
        if let Some(rotate) = &self.rotate {
            let rotated = rotate * &*part;
            part.copy_from(&rotated);
        }
    }

    pub(super) fn factor(&self, extra_white: f64, floor: f64) -> Factor {
        Factor::Diagonal(self.variances.map(|v| (v.max(floor) + extra_white).sqrt()))
    }
}

/// A covariance with the element u_i + v_j for rows i < j, such as that of a random walk minus its mean. With independent noise added, its
/// factor has n terms (Foreman-Mackey et al. 2017, AJ 154:220, with two terms that do not decay).
///
/// Each size of a random walk that was tried took a Cholesky factor: six tenths of the time of a diagnosis of 150 dwells.
pub(super) struct Separable {
    /// u and v of each row.
    sums: Vec<[f64; 2]>,
    /// Its diagonal.
    variances: DVector<f64>,
}

impl Separable {
    /// `None` if the covariance is not of this kind.
    pub(super) fn of(covariance: &DMatrix<f64>) -> Option<Self> {
        let n = covariance.nrows();
        let last = n.checked_sub(1)?;
        // A constant may be moved from u to v, so u of the first row is set to 0.
        let v = |j: usize| if j == 0 { 0.0 } else { covariance[(0, j)] };
        let u = |i: usize| match i {
            0 => 0.0,
            i if i == last => 0.0,
            i => covariance[(i, last)] - v(last),
        };
        let sums: Vec<[f64; 2]> = (0..n).map(|i| [u(i), v(i)]).collect();
        let within = 1e-9 * covariance.amax();
        let as_sums = |i: usize, j: usize| {
            let off = covariance[(i, j)] - (sums[i][0] + sums[j][1]);
            off.abs() <= within
        };
        let all = (0..n).all(|i| (i + 1..n).all(|j| as_sums(i, j)));
        all.then(|| Self {
            sums,
            variances: covariance.diagonal(),
        })
    }

    /// The covariance of some of the rows, in ascending order.
    pub(super) fn of_rows(&self, rows: &[usize]) -> Self {
        Self {
            sums: rows.iter().map(|i| self.sums[*i]).collect(),
            variances: self.variances.select_rows(rows),
        }
    }

    /// Factor of `size` times this covariance plus independent noise of the variances `beside`; `None` if the sum is not positive.
    pub(super) fn factor(&self, size: f64, beside: &DVector<f64>) -> Option<Factor> {
        let mut steps = Vec::with_capacity(self.sums.len());
        let mut s = Matrix2::zeros();
        for ((&[u, v], own), independent) in self.sums.iter().zip(&self.variances).zip(beside) {
            let later = Vector2::new(size, size * v);
            let carried = s * later;
            let variance = independent + size * own - later.dot(&carried);
            if !(variance > 0.0) {
                return None;
            }
            let gain = (Vector2::new(u, 1.0) - carried) / variance;
            s += gain * gain.transpose() * variance;
            steps.push(Step {
                later,
                gain,
                sigma: variance.sqrt(),
            });
        }
        Some(Factor::Steps(steps))
    }
}

/// A row of the factor of a [`Separable`] covariance.
pub(super) struct Step {
    /// Weights of the rows before in this one.
    later: Vector2<f64>,
    /// Weights of this row in the later ones.
    gain: Vector2<f64>,
    /// Its standard deviation given the rows before.
    sigma: f64,
}

/// Factor of the covariance of a stratum.
pub(super) enum Factor {
    /// Of rotated rows.
    Diagonal(DVector<f64>),
    /// Of rows that are independent except for a random walk, not rotated.
    Steps(Vec<Step>),
    /// Of rows that are not rotated.
    Full(Cholesky<f64, Dyn>),
    /// Of noise with another factor, and of a few errors that are common to all rows.
    Common {
        /// Of the noise.
        noise: Box<Factor>,
        /// Orthonormal directions of these errors among the decorrelated rows.
        directions: DMatrix<f64>,
        /// Their variances in units of the noise variance.
        variances: DVector<f64>,
    },
}

impl Factor {
    /// The factor of this covariance plus `open` times its transpose; `None` if it contains NaN.
    ///
    /// Among decorrelated rows the sum is 1 + w wᵀ, whose inverse root differs from 1 along the directions of w only. An n by n factor for
    /// each level of the noise that is tried took minutes for 500 dwells.
    pub(super) fn beside(self, open: &DMatrix<f64>) -> Option<Self> {
        let mut white = open.clone();
        self.whiten(&mut white);
        if !white.iter().all(|v| v.is_finite()) {
            return None;
        }
        // By the eigenvectors of the small normal matrix: a singular value decomposition of all rows for each level of the noise took most of the time of
        // 1000 dwells. What is small beside the noise is lost in its rounding, and needs no decorrelation.
        let eigen = SymmetricEigen::new(white.tr_mul(&white));
        let counts = |k: &usize| eigen.eigenvalues[*k] > NEGLIGIBLE;
        let kept: Vec<usize> = (0..white.ncols()).filter(counts).collect();
        let variances = eigen.eigenvalues.select_rows(&kept);
        let mut into = eigen.eigenvectors.select_columns(&kept);
        for (mut column, variance) in into.column_iter_mut().zip(variances.iter()) {
            column /= variance.sqrt();
        }
        Some(Self::Common {
            noise: Box::new(self),
            directions: white * into,
            variances,
        })
    }

    pub(super) fn whiten(&self, part: &mut DMatrix<f64>) {
        match self {
            Self::Diagonal(sigmas) => {
                for (mut row, sigma) in part.row_iter_mut().zip(sigmas.iter()) {
                    row /= *sigma;
                }
            }
            Self::Steps(steps) => {
                for mut column in part.column_iter_mut() {
                    let mut before = Vector2::zeros();
                    for (value, step) in column.iter_mut().zip(steps) {
                        let new = *value - step.later.dot(&before);
                        before += step.gain * new;
                        *value = new / step.sigma;
                    }
                }
            }
            Self::Full(factor) => {
                factor.l_dirty().solve_lower_triangular_mut(part);
            }
            Self::Common {
                noise,
                directions,
                variances,
            } => {
                noise.whiten(part);
                let mut along = directions.tr_mul(part);
                for (mut row, variance) in along.row_iter_mut().zip(variances.iter()) {
                    row *= 1.0 - 1.0 / (1.0 + variance).sqrt();
                }
                *part -= directions * along;
            }
        }
    }

    pub(super) fn log_determinant(&self) -> f64 {
        match self {
            Self::Diagonal(sigmas) => sigmas.iter().map(|s| 2.0 * s.ln()).sum(),
            Self::Steps(steps) => steps.iter().map(|s| 2.0 * s.sigma.ln()).sum(),
            Self::Full(factor) => factor
                .l_dirty()
                .diagonal()
                .iter()
                .map(|s| 2.0 * s.ln())
                .sum(),
            Self::Common {
                noise, variances, ..
            } => noise.log_determinant() + variances.iter().map(|v| v.ln_1p()).sum::<f64>(),
        }
    }
}

/// Variance along a direction of common errors, relative to that of the noise, below which it is neglected.
const NEGLIGIBLE: f64 = 1e-8;

/// Decorrelates rows, or a choice of them.
pub struct Whitener<'a> {
    /// What rotates the rows first; a choice is not rotated.
    pub(super) rotation: Option<&'a VarianceModel<'a>>,
    pub(super) parts: Vec<(Range<usize>, Factor)>,
}

impl Whitener<'_> {
    /// `matrix`, a row for each of the rows, decorrelated and in sigmas.
    pub fn whiten(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let rotated = self.rotation.map(|variance| variance.rotate(matrix));
        self.whiten_rotated(rotated.unwrap_or_else(|| matrix.clone()))
    }

    /// The same of one column.
    pub fn vector(&self, column: &DVector<f64>) -> DVector<f64> {
        let matrix = DMatrix::from_columns(std::slice::from_ref(column));
        self.whiten(&matrix).column(0).into_owned()
    }

    /// The same of a matrix that [`VarianceModel::rotate`] has rotated.
    pub fn whiten_rotated(&self, mut rotated: DMatrix<f64>) -> DMatrix<f64> {
        for (rows, factor) in &self.parts {
            let mut part = rotated.rows_range(rows.clone()).into_owned();
            factor.whiten(&mut part);
            rotated.rows_range_mut(rows.clone()).copy_from(&part);
        }
        rotated
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::wander::Slow;

    fn spans(n: u32) -> Vec<[f64; 2]> {
        // Pauses and lengths that do not repeat.
        let from = |i: u32| 12.0 * f64::from(i) + f64::from(i * i % 7);
        (0..n)
            .map(|i| [from(i), from(i) + 4.0 + f64::from(i % 3)])
            .collect()
    }

    #[test]
    fn the_root_of_a_walk_is_that_of_its_matrix() {
        let spans = spans(40);
        let random_walk = Slow {
            instability: 0.0,
            walk: 1.0,
        };
        let random_walk = random_walk.covariance(&spans, [0.0, 600.0]);
        let beside = DVector::from_fn(40, |i, _| 1e-3 * (1.0 + (i % 5) as f64));
        let matrix = DMatrix::from_fn(40, 3, |i, j| ((i * (j + 2)) as f64).sin());
        for size in [1e-9, 1e-5, 1e-2, 10.0] {
            let separable = Separable::of(&random_walk).unwrap();
            let factor = separable.factor(size, &beside).unwrap();
            let full = &random_walk * size + DMatrix::from_diagonal(&beside);
            let full = Factor::Full(Cholesky::new(full).unwrap());
            let [mut a, mut b] = [matrix.clone(), matrix.clone()];
            factor.whiten(&mut a);
            full.whiten(&mut b);
            assert!((&a - &b).amax() < 1e-8 * b.amax(), "{size}: {}", a - b);
            assert!((factor.log_determinant() - full.log_determinant()).abs() < 1e-6);
        }
    }

    #[test]
    fn a_factor_beside_few_common_errors_is_that_of_the_sum() {
        let noise = DVector::from_fn(30, |i, _| 0.1 * (1.0 + (i % 4) as f64));
        let open = DMatrix::from_fn(30, 3, |i, j| (1.0 + (i * (j + 1)) as f64).cos());
        let matrix = DMatrix::from_fn(30, 2, |i, j| ((i * (j + 2)) as f64).sin());
        let diagonal = Factor::Diagonal(noise.map(f64::sqrt));
        let common = diagonal.beside(&open).unwrap();
        let sum = DMatrix::from_diagonal(&noise) + &open * open.transpose();
        let full = Factor::Full(Cholesky::new(sum).unwrap());
        let [mut a, mut b] = [matrix.clone(), matrix];
        common.whiten(&mut a);
        full.whiten(&mut b);
        // Decorrelated in other axes, with the same lengths and angles.
        assert!((a.tr_mul(&a) - b.tr_mul(&b)).amax() < 1e-9);
        assert!((common.log_determinant() - full.log_determinant()).abs() < 1e-9);
    }

    #[test]
    fn flicker_has_no_such_root() {
        let flicker = Slow {
            instability: 1.0,
            walk: 0.0,
        };
        assert!(Separable::of(&flicker.covariance(&spans(10), [0.0, 200.0])).is_none());
    }
}
