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
}

impl Rows {
    /// No rows yet, of blocks with so many parameters each.
    pub fn new(widths: &[usize]) -> Self {
        Self {
            widths: widths.to_vec(),
            blocks: vec![Vec::new(); widths.len()],
            len: 0,
        }
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

    /// Block `block` of all rows, rows by parameters.
    pub fn matrix(&self, block: usize) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.len, self.widths[block], &self.blocks[block])
    }
}

/// Smallest share of a squared regressor that the other regressors may leave unexplained; below it the design
/// is singular. It is the inverse square of the condition 1e5 at which an estimator refuses
/// ([`crate::estimate::least_squares::UNDETERMINED`]).
const SINGULAR: f64 = 1e-10;

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
        for (b, &p) in rows.widths.iter().enumerate() {
            let mut m = DMatrix::<f64>::zeros(p, p);
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
                if !(pivot > SINGULAR * diagonal[k]) {
                    return None;
                }
                log_det += pivot.ln();
            }
            blocks.push(cholesky.inverse());
        }
        Some(Self { blocks, log_det })
    }

    /// Of a millionth of the unit matrix, which a random design starts from.
    pub(super) fn ridge(widths: &[usize]) -> Self {
        let diagonal = |&p: &usize| DMatrix::from_diagonal_element(p, p, 1e6);
        Self {
            blocks: widths.iter().map(diagonal).collect(),
            log_det: widths.iter().sum::<usize>() as f64 * 1e-6_f64.ln(),
        }
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
