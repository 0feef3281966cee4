//! Holding dwells out, and what an effect rests on.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::diagnose::rows::Rows;
use crate::diagnose::search::{Search, unit_columns};
use crate::diagnose::variance::Fitted;

/// Contiguous blocks that are left out in turn.
const BLOCKS: usize = 4;

/// Root mean square of the judged rows; of `judged.1` rows a dwell or turn.
pub(in crate::diagnose) fn rms(rows: &Rows, residuals: &DVector<f64>) -> f64 {
    let (count, together) = rows.judged;
    (residuals.rows(0, count).norm_squared() / (count / together) as f64).sqrt()
}

/// How dwells are held out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// Contiguous blocks of time.
    Blocks,
    /// Every so manieth dwell: for what is seen in one block only, like a warm-up, which nothing else determines.
    Interleaved,
}

impl Split {
    /// Part that a dwell is in; of several recordings each block is a stretch of every one.
    pub(in crate::diagnose) fn part(self, rows: &Rows, dwell: usize) -> usize {
        let (place, of) = rows.place(dwell);
        match self {
            Self::Blocks => place * BLOCKS / of.max(1),
            Self::Interleaved => place % BLOCKS,
        }
    }
}

/// Held-out residuals of the judged rows: each by a model that has not seen its block. `None` where what is left of the
/// experiment does not determine the model.
pub(in crate::diagnose) fn held_out(
    search: &Search,
    model: &DMatrix<f64>,
    at: &Fitted,
    split: Split,
) -> Option<DVector<f64>> {
    let rows = search.rows;
    let parts_of = |r: usize| rows.dwells(r).map(|d| split.part(rows, d));
    let mut out = DVector::zeros(rows.y.len());
    // Columns of one size: a temperature far from the reference, squared, is no reason to be taken for undetermined.
    let model = unit_columns(model);
    for block in 0..BLOCKS {
        let kept: Vec<usize> = (0..rows.y.len())
            .filter(|r| !parts_of(*r).contains(&block))
            .collect();
        let parts = search.variance.kept(&at.components, &kept)?;
        let white = parts.whiten(&model.select_rows(&kept));
        let y = parts.whiten(&DMatrix::from_fn(kept.len(), 1, |i, _| rows.y[kept[i]]));
        let svd = white.svd(true, true);
        let most = svd.singular_values.max();
        if svd.singular_values.min() < 1e-7 * most {
            return None;
        }
        let solution = svd.solve(&y, 0.0).ok()?;
        // A turn into the block is of it; one out of it is of the next, and is judged there.
        for r in (0..rows.y.len()).filter(|r| parts_of(*r)[1] == block) {
            out[r] = rows.y[r] - (model.row(r) * &solution)[(0, 0)];
        }
    }
    Some(out)
}

/// Largest shares of one dwell, and of one block of time, in what the columns of an effect rest on.
pub(super) fn leverage(rows: &Rows, others: &DMatrix<f64>, columns: &DMatrix<f64>) -> [f64; 2] {
    let q = others.clone().qr().q();
    let z = columns - &q * q.tr_mul(columns);
    let count = rows.dwell_count();
    let mut worst = [0.0_f64; 2];
    for column in z.column_iter() {
        let mut by = [vec![0.0; count], vec![0.0; BLOCKS]];
        for (r, v) in column.iter().enumerate() {
            let dwell = rows.dwells(r)[1];
            by[0][dwell] += v * v;
            by[1][Split::Blocks.part(rows, dwell)] += v * v;
        }
        for (worst, by) in worst.iter_mut().zip(by) {
            let total: f64 = by.iter().sum();
            *worst = worst.max(by.into_iter().fold(0.0, f64::max) / total);
        }
    }
    worst
}
