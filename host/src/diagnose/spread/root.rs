//! Roots of covariances: what decorrelates rows.

use nalgebra::{Cholesky, DMatrix, DMatrixViewMut, DVector, Dyn, SymmetricEigen};

use super::Spread;

/// Axes in which rows are independent: the eigenvectors of their known covariance, and those of it and any excess too.
///
/// Found once; each excess that is tried then costs a division for each row, where a Cholesky root costs a third of n³.
pub(super) struct Axes {
    /// Rows times this are independent; `None` where they are as they stand.
    turn: Option<DMatrix<f64>>,
    /// Their known variances.
    variances: DVector<f64>,
}

impl Axes {
    /// The rows' own axes, where they are independent.
    pub(super) fn as_they_stand(known: &DMatrix<f64>) -> Option<Self> {
        let variances = known.diagonal();
        let independent = (known - DMatrix::from_diagonal(&variances)).amax() == 0.0;
        independent.then_some(Self {
            turn: None,
            variances,
        })
    }

    /// Of a known covariance.
    pub(super) fn of(known: &DMatrix<f64>) -> Self {
        Self::as_they_stand(known).unwrap_or_else(|| {
            let eigen = SymmetricEigen::new(known.clone());
            Self {
                turn: Some(eigen.eigenvectors.transpose()),
                variances: eigen.eigenvalues,
            }
        })
    }

    pub(super) fn turn(&self, part: &mut DMatrixViewMut<f64>) {
        if let Some(turn) = &self.turn {
            let turned = turn * &*part;
            part.copy_from(&turned);
        }
    }

    pub(super) fn root(&self, excess: f64, floor: f64) -> Root {
        Root::Diagonal(self.variances.map(|v| (v.max(floor) + excess).sqrt()))
    }
}

/// Root of the covariance of a stratum.
pub(super) enum Root {
    /// Of turned rows.
    Diagonal(DVector<f64>),
    /// Of rows as they are.
    Full(Cholesky<f64, Dyn>),
}

impl Root {
    pub(super) fn whiten(&self, part: &mut DMatrix<f64>) {
        match self {
            Self::Diagonal(sigmas) => {
                for (mut row, sigma) in part.row_iter_mut().zip(sigmas.iter()) {
                    row /= *sigma;
                }
            }
            Self::Full(root) => {
                root.l_dirty().solve_lower_triangular_mut(part);
            }
        }
    }

    pub(super) fn log_determinant(&self) -> f64 {
        match self {
            Self::Diagonal(sigmas) => sigmas.iter().map(|s| 2.0 * s.ln()).sum(),
            Self::Full(root) => root.l_dirty().diagonal().iter().map(|s| 2.0 * s.ln()).sum(),
        }
    }
}

/// Decorrelates rows.
pub struct Whitener<'a> {
    pub(super) spread: &'a Spread<'a>,
    pub(super) roots: Vec<Root>,
}

impl Whitener<'_> {
    /// `matrix`, a row for each of the rows, decorrelated and in sigmas.
    pub fn whiten(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        self.whiten_turned(self.spread.turn(matrix))
    }

    /// The same of a matrix that [`Spread::turn`] has turned.
    pub fn whiten_turned(&self, mut turned: DMatrix<f64>) -> DMatrix<f64> {
        for (stratum, root) in self.spread.rows.strata.iter().zip(&self.roots) {
            let (from, count) = (stratum.rows.start, stratum.rows.len());
            let mut part = turned.rows(from, count).into_owned();
            root.whiten(&mut part);
            turned.rows_mut(from, count).copy_from(&part);
        }
        turned
    }
}

/// Decorrelates a choice of rows.
pub struct Kept {
    pub(super) parts: Vec<(usize, Cholesky<f64, Dyn>)>,
}

impl Kept {
    /// `matrix`, a row for each of the chosen rows, decorrelated and in sigmas.
    pub fn whiten(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = matrix.clone();
        for (from, root) in &self.parts {
            let count = root.l_dirty().nrows();
            let mut part = matrix.rows(*from, count).into_owned();
            root.l_dirty().solve_lower_triangular_mut(&mut part);
            out.rows_mut(*from, count).copy_from(&part);
        }
        out
    }
}
