//! Information of an experiment: regressor rows, `F'F`, its determinant and its inverse.

use nalgebra::DMatrix;

/// Regressor rows of points at which one could measure.
///
/// A row consists of one or more blocks with separate parameters: the square of a sensor's own input is a
/// regressor of that sensor only, and one dwell serves all three. The information matrix is then block
/// diagonal, and its determinant the product over the blocks.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows {
    widths: Vec<usize>,
    blocks: Vec<Vec<f64>>,
    len: usize,
    /// Rows that every design has beside its own, of the only block; see [`Self::beside`].
    given: Option<DMatrix<f64>>,
}

impl Rows {
    /// No rows yet, of blocks with so many parameters each.
    pub fn new(widths: &[usize]) -> Self {
        Self {
            widths: widths.to_vec(),
            blocks: vec![Vec::new(); widths.len()],
            len: 0,
            given: None,
        }
    }

    /// The same, with rows that every design has beside its own: what is known of the parameters beforehand, in units of the sigma of an
    /// observation. Rows have a single block.
    pub fn beside(mut self, given: Option<DMatrix<f64>>) -> Self {
        debug_assert!(given.is_none() || self.widths.len() == 1);
        self.given = given;
        self
    }

    /// Whether something is known of the parameters beforehand.
    pub fn has_given(&self) -> bool {
        self.given.is_some()
    }

    /// Appends a row, its blocks one after the other.
    pub fn push(&mut self, row: &[f64]) {
        let mut from = 0;
        for (block, width) in self.blocks.iter_mut().zip(&self.widths) {
            block.extend_from_slice(&row[from..from + width]);
            from += width;
        }
        self.len += 1;
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Number of parameters of each block.
    pub fn widths(&self) -> &[usize] {
        &self.widths
    }

    /// Number of parameters of all blocks.
    pub fn parameters(&self) -> usize {
        self.widths.iter().sum()
    }

    /// Block `block` of row `i`.
    pub fn row(&self, block: usize, i: usize) -> &[f64] {
        let width = self.widths[block];
        &self.blocks[block][i * width..(i + 1) * width]
    }

    /// Block `block` of all rows, rows by parameters; then the rows that are given.
    pub fn matrix(&self, block: usize) -> DMatrix<f64> {
        let own = DMatrix::from_row_slice(self.len, self.widths[block], &self.blocks[block]);
        stacked(own, self.given.as_ref())
    }

    /// Information of the rows that are given.
    fn given_information(&self, block: usize) -> DMatrix<f64> {
        let p = self.widths[block];
        let given = self.given.as_ref();
        given.map_or_else(|| DMatrix::zeros(p, p), |g| g.transpose() * g)
    }
}

/// The rows of `own`, then those of `below`.
pub(super) fn stacked(own: DMatrix<f64>, below: Option<&DMatrix<f64>>) -> DMatrix<f64> {
    let Some(below) = below else {
        return own;
    };
    let n = own.nrows();
    DMatrix::from_fn(n + below.nrows(), own.ncols(), |i, j| match i < n {
        true => own[(i, j)],
        false => below[(i - n, j)],
    })
}

/// Smallest share of a squared regressor that the other regressors may leave unexplained; below it the design
/// is singular. It is the inverse square of the condition 1e5 at which an estimator refuses
/// ([`crate::estimate::least_squares::UNDETERMINED`]).
const SINGULAR: f64 = 1e-10;
/// The same beside given rows: a fit with a prior refuses none for its condition, so only rounding limits it (p times 2e-16).
const SINGULAR_BESIDE: f64 = 1e-13;

/// Inverse of an information matrix `Σ w f f'`, block by block, with the logarithm of the determinant.
#[derive(Debug, Clone)]
pub struct Inverse {
    blocks: Vec<DMatrix<f64>>,
    log_det: f64,
}

impl Inverse {
    /// Of the rows with the given indices and weights. `None` where they do not determine all parameters.
    pub fn of(rows: &Rows, weighted: impl Iterator<Item = (usize, f64)> + Clone) -> Option<Self> {
        let mut blocks = Vec::with_capacity(rows.widths.len());
        let mut log_det = 0.0;
        let singular = if rows.has_given() {
            SINGULAR_BESIDE
        } else {
            SINGULAR
        };
        for (b, &p) in rows.widths.iter().enumerate() {
            let mut m = rows.given_information(b);
            for (i, weight) in weighted.clone() {
                let f = rows.row(b, i);
                for r in 0..p {
                    for c in 0..=r {
                        m[(r, c)] += weight * f[r] * f[c];
                    }
                }
            }
            let diagonal = m.diagonal();
            let cholesky = m.cholesky()?;
            let l = cholesky.l_dirty();
            for k in 0..p {
                let pivot = l[(k, k)] * l[(k, k)];
                if !(pivot > singular * diagonal[k]) {
                    return None;
                }
                log_det += pivot.ln();
            }
            blocks.push(cholesky.inverse());
        }
        Some(Self { blocks, log_det })
    }

    /// Of a millionth of the unit matrix beside the given rows, which a random design starts from.
    pub(super) fn ridge(rows: &Rows) -> Option<Self> {
        let (mut blocks, mut log_det) = (Vec::new(), 0.0);
        for (b, &p) in rows.widths.iter().enumerate() {
            let m = rows.given_information(b) + DMatrix::from_diagonal_element(p, p, 1e-6);
            let cholesky = m.cholesky()?;
            let diagonal = cholesky.l_dirty().diagonal();
            log_det += diagonal.iter().map(|d| 2.0 * d.ln()).sum::<f64>();
            blocks.push(cholesky.inverse());
        }
        Some(Self { blocks, log_det })
    }

    /// Logarithm of the determinant of the information matrix (not of its inverse).
    pub fn log_det(&self) -> f64 {
        self.log_det
    }

    /// Block `block`.
    pub fn block(&self, block: usize) -> &DMatrix<f64> {
        &self.blocks[block]
    }

    /// `a' M⁻¹ b` of one block.
    pub(super) fn product(&self, block: usize, a: &[f64], b: &[f64]) -> f64 {
        // Columns are contiguous; the matrix is symmetric.
        let columns = self.blocks[block].as_slice().chunks_exact(a.len());
        columns.zip(b).map(|(column, b)| b * dot(column, a)).sum()
    }

    /// `M⁻¹ f` of one block.
    pub(super) fn times(&self, block: usize, f: &[f64]) -> Vec<f64> {
        let columns = self.blocks[block].as_slice().chunks_exact(f.len());
        columns.map(|column| dot(column, f)).collect()
    }

    /// Variance function `Σ f' M⁻¹ f` of a row, its blocks one after the other: the variance of a prediction
    /// there, in units of that of an observation.
    pub fn variance(&self, row: &[f64]) -> f64 {
        let mut from = 0;
        let each = self.blocks.iter().enumerate().map(|(b, block)| {
            let f = &row[from..from + block.nrows()];
            from += block.nrows();
            self.product(b, f, f)
        });
        each.sum()
    }

    /// The inverse after `weight f f'` is added to the information of one block (Sherman and Morrison).
    pub(super) fn update(&mut self, block: usize, f: &[f64], weight: f64) {
        let v = self.times(block, f);
        let factor = 1.0 + weight * dot(&v, f);
        let p = v.len();
        for (c, column) in self.blocks[block]
            .as_mut_slice()
            .chunks_exact_mut(p)
            .enumerate()
        {
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
