//! The residuals beside a model, and what functions of the reading explain of them.
//!
//! Thousands of places are looked at, so the rows are taken for independent: each by what it is off from what all others
//! predict of it, with the variance of that. The readings of successive dwells have no order, and what a slow wander makes
//! neighbours share averages out. What is found is judged with the whole noise, as every candidate is.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::effect::Moment;
use crate::diagnose::library::readout::Converter;
use crate::diagnose::rows::RowReading;
use crate::diagnose::search::{Search, basis, unit_columns};
use crate::diagnose::spread::Fitted;

/// What keeps bits that turn together, or not at all, from being told apart by rounding.
const RIDGE: f64 = 1e-3;
/// Part of a column that the others do not span, below which it is none of its own.
const INDEPENDENT: f64 = 1e-2;
/// Part of a column's square that is left of it beside the model, below which it is in the model.
const ROUNDING: f64 = 1e-9;
/// Rows up to which the noise is taken apart by all of its covariances.
const DENSE: usize = 1500;

/// The residuals beside a model, as if rows were independent.
pub(super) struct Sight {
    pub(super) readings: Vec<RowReading>,
    /// Root of the weight of each row.
    pub(super) root: DVector<f64>,
    /// Basis of the model, weighted, by rows: orthonormal columns.
    pub(super) model: DMatrix<f64>,
    /// Residuals over their standard deviations.
    left: DVector<f64>,
    /// Sum of their squares, as the noise has it.
    total: f64,
    /// That readings are multiples of, raw, where they are.
    pub(super) step: Option<f64>,
    /// Whether the noise is that beside all errors: else it is taken for what is left, errors included.
    pub(super) noise_known: bool,
}

/// Normal equations of some columns beside the model.
pub(super) struct Normal {
    pub(super) matrix: DMatrix<f64>,
    pub(super) with_left: DVector<f64>,
}

impl Normal {
    /// What the columns in `set` explain; `None` where they are not independent, or the coefficient of one of them beside the others is not
    /// known to within `sigma`: all bits together are nearly what is read, which the affine parameters take up.
    pub(super) fn explains(&self, set: &[usize], sigma: f64) -> Option<f64> {
        let size = |k: usize| self.matrix[(k, k)].max(0.0).sqrt();
        let p = set.len();
        let scaled = DMatrix::from_fn(p, p, |i, j| {
            let (a, b) = (set[i], set[j]);
            self.matrix[(a, b)] / (size(a) * size(b))
        });
        let with_left = DVector::from_fn(p, |i, _| self.with_left[set[i]] / size(set[i]));
        let root = scaled.cholesky()?;
        let least = root.l_dirty().diagonal().min();
        let variance = root.inverse().diagonal();
        let known = |k: usize| variance[k].sqrt() <= sigma * size(set[k]);
        (least > INDEPENDENT && (0..p).all(known)).then(|| root.solve(&with_left).dot(&with_left))
    }

    /// What all columns together explain, those that there are.
    pub(super) fn explains_with_ridge(&self) -> Option<f64> {
        let p = self.with_left.len();
        let size: Vec<f64> = (0..p)
            .map(|k| self.matrix[(k, k)].max(f64::MIN_POSITIVE).sqrt())
            .collect();
        let ridge = |i, j| if i == j { RIDGE } else { 0.0 };
        let scaled = DMatrix::from_fn(p, p, |i, j| {
            self.matrix[(i, j)] / (size[i] * size[j]) + ridge(i, j)
        });
        let with_left = DVector::from_fn(p, |i, _| self.with_left[i] / size[i]);
        Some(scaled.cholesky()?.solve(&with_left).dot(&with_left))
    }
}

impl Sight {
    /// Beside `model`, at readings without noise, which `moments` are.
    pub(super) fn new(
        search: &Search,
        model: &DMatrix<f64>,
        null: &Fitted,
        moments: &[Moment],
    ) -> Option<Self> {
        let rows = search.rows;
        let n = rows.y.len();
        let whitener = search.spread.whitener(&null.components)?;
        let whitened = whitener.whiten(model);
        let y = whitener.whiten(&DMatrix::from_column_slice(n, 1, rows.y.as_slice()));
        let q = whitened.qr().q();
        let left = &y - &q * q.tr_mul(&y);
        let total = left.norm_squared();
        let (pull, weights) = if n <= DENSE {
            let whitener = whitener.whiten(&DMatrix::identity(n, n));
            let weights = DVector::from_fn(n, |i, _| whitener.column(i).norm_squared());
            (whitener.tr_mul(&left), weights)
        } else {
            let left = &rows.y - model * &null.coefficients;
            let weights = search.spread.variances(&null.components).map(|v| 1.0 / v);
            let pull = left.component_mul(&weights);
            (DMatrix::from_column_slice(n, 1, pull.as_slice()), weights)
        };
        let root = weights.map(f64::sqrt);
        let mut weighted = unit_columns(model);
        for (mut row, w) in weighted.row_iter_mut().zip(root.iter()) {
            row *= *w;
        }
        let mut readings = search.by_dwell.readings(moments);
        readings.retain(|r| r.mean.is_finite() && r.sd.is_finite());
        // With all covariances it is across the model already; without them not quite, and a column nearly in the model would seem to
        // explain what is in it.
        let model = basis(&weighted);
        let left = DVector::from_fn(n, |i, _| pull[(i, 0)] / root[i]);
        let left = &left - &model * model.tr_mul(&left);
        Some(Self {
            left,
            model: model.transpose(),
            root,
            total,
            readings,
            step: rows.step,
            noise_known: false,
        })
    }

    /// Of one axis alone.
    pub(super) fn of(&self, axis: Option<usize>) -> Vec<RowReading> {
        let ours = self.readings.iter().copied();
        ours.filter(|r| axis.is_none_or(|a| a == r.axis)).collect()
    }

    /// Normal equations of so many functions of the reading, which `values` writes.
    pub(super) fn normal(
        &self,
        readings: &[RowReading],
        count: usize,
        values: impl Fn(&RowReading, &mut [f64]),
    ) -> Normal {
        let mut of_one = vec![0.0; count];
        let mut of_row = DVector::zeros(count);
        let mut matrix = DMatrix::zeros(count, count);
        let mut with_left = DVector::zeros(count);
        let mut in_model = DMatrix::zeros(self.model.nrows(), count);
        // The readings of a row follow each other; rows of other axes are none of these.
        for of_this in readings.chunk_by(|a, b| a.row == b.row) {
            of_row.fill(0.0);
            let row = of_this[0].row;
            for r in of_this {
                values(r, &mut of_one);
                let weight = r.weight * self.root[row];
                for (sum, value) in of_row.iter_mut().zip(&of_one) {
                    *sum += weight * value;
                }
            }
            matrix.ger(1.0, &of_row, &of_row, 1.0);
            with_left.axpy(self.left[row], &of_row, 1.0);
            in_model.ger(1.0, &self.model.column(row), &of_row, 1.0);
        }
        let before = matrix.diagonal();
        matrix.gemm_tr(-1.0, &in_model, &in_model, 1.0);
        // Of what the model spans, as a bit that never turns, rounding leaves a little.
        for k in 0..count {
            if matrix[(k, k)] > ROUNDING * before[k] {
                continue;
            }
            matrix.row_mut(k).fill(0.0);
            matrix.column_mut(k).fill(0.0);
            with_left[k] = 0.0;
        }
        Normal { matrix, with_left }
    }

    /// Drop of the deviance where so much is explained.
    pub(super) fn drop(&self, explained: f64) -> f64 {
        if self.noise_known {
            return explained;
        }
        let share = (explained / self.total).clamp(0.0, 0.999_999);
        -(self.root.len() as f64) * (-share).ln_1p()
    }

    /// Some bits of a converter.
    pub(super) fn bits(
        &self,
        readings: &[RowReading],
        converter: &Converter,
        bits: &[usize],
    ) -> Normal {
        self.normal(readings, bits.len(), |r, out| {
            for (bit, out) in bits.iter().zip(out) {
                *out = converter.weight * converter.share(*bit, r.mean, r.sd);
            }
        })
    }
}

/// Lowest and highest reading.
pub(super) fn ends(readings: &[RowReading]) -> (f64, f64) {
    let wider = |(a, b): (f64, f64), r: &RowReading| (a.min(r.mean), b.max(r.mean));
    readings
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), wider)
}

pub(super) fn range(readings: &[RowReading]) -> f64 {
    let (lowest, highest) = ends(readings);
    highest - lowest
}

/// How far samples scatter in a dwell, raw.
pub(super) fn median_sd(readings: &[RowReading]) -> f64 {
    let mut sds: Vec<f64> = readings.iter().map(|r| r.sd).collect();
    sds.sort_by(f64::total_cmp);
    sds.get(sds.len() / 2).copied().unwrap_or(0.0)
}
