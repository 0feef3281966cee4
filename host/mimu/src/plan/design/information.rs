//! Information of an experiment: regressor rows, `F'F`, its determinant and its inverse.

use nalgebra::DMatrix;

/// Regressor rows of points at which one could measure.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows {
    width: usize,
    rows: Vec<f64>,
    /// Rows that every design has beside its own; see [`Self::beside`].
    given: Option<DMatrix<f64>>,
}

impl Rows {
    /// No rows yet, of so many parameters each.
    pub fn new(width: usize) -> Self {
        Self {
            width,
            rows: Vec::new(),
            given: None,
        }
    }

    /// The same, with rows that every design has beside its own: what is known of the parameters beforehand, in units of the sigma of an
    /// observation.
    pub fn beside(mut self, given: Option<DMatrix<f64>>) -> Self {
        self.given = given;
        self
    }

    /// Whether something is known of the parameters beforehand.
    pub fn has_given(&self) -> bool {
        self.given.is_some()
    }

    /// Appends a row.
    pub fn push(&mut self, row: &[f64]) {
        self.rows.extend_from_slice(row);
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len() / self.width
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Number of parameters.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Row `i`.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.rows[i * self.width..(i + 1) * self.width]
    }

    /// All rows, rows by parameters; then those that are given.
    pub fn matrix(&self) -> DMatrix<f64> {
        let n = self.len();
        let given = self.given.as_ref();
        let all = n + given.map_or(0, DMatrix::nrows);
        DMatrix::from_fn(all, self.width, |i, j| match given {
            Some(given) if i >= n => given[(i - n, j)],
            _ => self.row(i)[j],
        })
    }

    /// Information of the rows that are given.
    fn given_information(&self) -> DMatrix<f64> {
        let p = self.width;
        let given = self.given.as_ref();
        given.map_or_else(|| DMatrix::zeros(p, p), |g| g.transpose() * g)
    }
}

/// Smallest share of a squared regressor that the other regressors may leave unexplained; below it the design
/// is singular. It is the inverse square of the condition 1e5 at which an estimator refuses
/// ([`crate::estimate::least_squares::UNDETERMINED`]).
const SINGULAR: f64 = 1e-10;
/// The same beside given rows: a fit with a prior refuses none for its condition, so only rounding limits it (p times 2e-16).
const SINGULAR_BESIDE: f64 = 1e-13;

/// Inverse of an information matrix `Σ f f'`, with the logarithm of the determinant.
#[derive(Debug, Clone)]
pub struct Inverse {
    matrix: DMatrix<f64>,
    log_det: f64,
}

impl Inverse {
    /// Of all rows. `None` where they do not determine all parameters.
    pub fn of_all(rows: &Rows) -> Option<Self> {
        Self::of(rows, 0..rows.len())
    }

    /// Of the rows with the given indices. `None` where they do not determine all parameters.
    pub fn of(rows: &Rows, points: impl IntoIterator<Item = usize>) -> Option<Self> {
        let singular = if rows.has_given() {
            SINGULAR_BESIDE
        } else {
            SINGULAR
        };
        let p = rows.width;
        let mut m = rows.given_information();
        for i in points {
            let f = rows.row(i);
            for r in 0..p {
                for c in 0..=r {
                    m[(r, c)] += f[r] * f[c];
                }
            }
        }
        let diagonal = m.diagonal();
        let cholesky = m.cholesky()?;
        let l = cholesky.l_dirty();
        let mut log_det = 0.0;
        for k in 0..p {
            let pivot = l[(k, k)] * l[(k, k)];
            if !(pivot > singular * diagonal[k]) {
                return None;
            }
            log_det += pivot.ln();
        }
        Some(Self {
            matrix: cholesky.inverse(),
            log_det,
        })
    }

    /// Of a millionth of the unit matrix beside the given rows, which a random design starts from.
    pub(super) fn ridge(rows: &Rows) -> Option<Self> {
        let p = rows.width;
        let m = rows.given_information() + DMatrix::from_diagonal_element(p, p, 1e-6);
        let cholesky = m.cholesky()?;
        let diagonal = cholesky.l_dirty().diagonal();
        Some(Self {
            log_det: diagonal.iter().map(|d| 2.0 * d.ln()).sum(),
            matrix: cholesky.inverse(),
        })
    }

    /// Logarithm of the determinant of the information matrix (not of its inverse).
    pub fn log_det(&self) -> f64 {
        self.log_det
    }

    /// The inverse.
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }

    /// `M⁻¹ f`.
    pub(super) fn times(&self, f: &[f64]) -> Vec<f64> {
        // Columns are contiguous; the matrix is symmetric.
        let columns = self.matrix.as_slice().chunks_exact(f.len());
        columns.map(|column| dot(column, f)).collect()
    }

    /// Variance function `f' M⁻¹ f` of a row: the variance of a prediction there, in units of that of an observation.
    pub fn variance(&self, f: &[f64]) -> f64 {
        let columns = self.matrix.as_slice().chunks_exact(f.len());
        columns.zip(f).map(|(column, b)| b * dot(column, f)).sum()
    }

    /// The inverse after `weight f f'` is added to the information (Sherman and Morrison).
    pub(super) fn update(&mut self, f: &[f64], weight: f64) {
        let v = self.times(f);
        let factor = 1.0 + weight * dot(&v, f);
        let p = v.len();
        for (c, column) in self.matrix.as_mut_slice().chunks_exact_mut(p).enumerate() {
            for (r, element) in column.iter_mut().enumerate() {
                *element -= weight / factor * v[r] * v[c];
            }
        }
        self.log_det += factor.ln();
    }
}

/// Scalar product.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
