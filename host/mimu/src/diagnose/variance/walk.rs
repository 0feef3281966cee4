//! A bias that walks at random, in all rows at once.
//!
//! The strata are independent of each other, as noise is. A bias that wanders is one process: it moves the rates at rest, and it turns the unit
//! between the rests. Beside independent strata a wander of 0.2 deg/s in two minutes was a warm-up with p < 1e-6, because one smooth law moved
//! the rests and the turns together and no random law could.
//!
//! The walk is a sum of independent steps: `V = V0 + K² W Wᵀ`, with a ramp for each step and axis in W. By Woodbury's identity a likelihood takes
//! one factor of the size of W's columns, whose number does not grow with the dwells.

use nalgebra::{Cholesky, DMatrix};

use super::{Components, NormalEquations, VarianceModel};
use crate::diagnose::rows::{Rows, Stratum};

/// Most steps of a walk, of all recordings together. A walk of finer steps differs from it by less than the noise of its dwells.
const STEPS: usize = 32;
/// Rounds over the components, and the values that are tried for each, relative to the last one.
const ROUNDS: usize = 6;
const TRIED: [f64; 5] = [0.0, 0.3, 0.7, 1.5, 4.0];
/// Values that are tried for a component that is zero, relative to a typical one.
const FROM_ZERO: [f64; 4] = [0.01, 0.1, 1.0, 10.0];
/// Drop in deviance below which the rounds end.
const SETTLED: f64 = 0.1;

/// The columns of a walk of the three biases.
pub struct CommonWalk {
    /// Those of x, of y, of z; unit of the rows per unit of K.
    columns: DMatrix<f64>,
}

impl CommonWalk {
    /// Of the biases of all recordings of `rows`; `None` if a walk is not to be sought: the wander is known, or the rows of each stratum alone show it.
    pub fn of(rows: &Rows) -> Option<Self> {
        let unknown = |s: &Stratum| s.random_walk.is_some() && !s.wander_known;
        if rows.is_of_known_inputs() || !rows.strata.iter().any(unknown) {
            return None;
        }
        let spans = rows.spans();
        let steps = (STEPS / spans.len().max(1)).max(4);
        let each = spans.iter().enumerate().map(|(session, [from, to])| {
            let length = (to - from) / steps as f64;
            let starts: Vec<f64> = (0..steps).map(|k| from + length * k as f64).collect();
            rows.ramps(session, &starts, length) * length.sqrt()
        });
        let all: Vec<DMatrix<f64>> = each.collect();
        let per_axis = steps;
        let mut columns = DMatrix::zeros(rows.y.len(), 3 * per_axis * all.len());
        for (session, part) in all.iter().enumerate() {
            for axis in 0..3 {
                let to = per_axis * (axis * all.len() + session);
                columns
                    .columns_mut(to, per_axis)
                    .copy_from(&part.columns(axis * per_axis, per_axis));
            }
        }
        Some(Self { columns })
    }

    /// Number of columns of an axis.
    fn of_axis(&self) -> usize {
        self.columns.ncols() / 3
    }
}

/// Deviance, up to the constant of [`super::Fitted::deviance`], given the normal equations of walk, columns and residual.
fn deviance(strata: &[NormalEquations], walk: usize, sizes: [f64; 3]) -> Option<f64> {
    let mut normal = strata.first()?.normal.clone();
    let mut deviance = 0.0;
    for (k, stratum) in strata.iter().enumerate() {
        if k > 0 {
            normal += &stratum.normal;
        }
        deviance += stratum.log_determinant;
    }
    let of_axis = walk / 3;
    let others = normal.ncols() - walk;
    let size = |k: usize| sizes[k / of_axis];
    let mut inner = DMatrix::from_fn(walk, walk, |i, j| size(i) * normal[(i, j)] * size(j));
    for i in 0..walk {
        inner[(i, i)] += 1.0;
    }
    let inner = Cholesky::new(inner)?;
    let l = inner.l_dirty();
    deviance += (0..walk).map(|i| 2.0 * l[(i, i)].ln()).sum::<f64>();
    let cross = DMatrix::from_fn(walk, others, |i, j| size(i) * normal[(i, walk + j)]);
    let reduced = normal.view((walk, walk), (others, others)) - cross.tr_mul(&inner.solve(&cross));
    let p = others - 1;
    let scale: Vec<f64> = (0..p)
        .map(|i| reduced[(i, i)].max(f64::MIN_POSITIVE).sqrt())
        .collect();
    let scaled = DMatrix::from_fn(p, p, |i, j| reduced[(i, j)] / (scale[i] * scale[j]));
    let right = DMatrix::from_fn(p, 1, |i, _| reduced[(i, p)] / scale[i]);
    let explained = Cholesky::new(scaled)?.solve(&right).dot(&right);
    Some(deviance + (reduced[(p, p)] - explained).max(0.0))
}

impl VarianceModel<'_> {
    /// Deviance of the model with `columns` beside a walk of the biases in all rows, at the components that maximise the likelihood, searched from
    /// `start` on. The walks of the strata are replaced by it.
    pub fn deviance_beside_walk(
        &self,
        columns: &DMatrix<f64>,
        walk: &CommonWalk,
        start: &Components,
    ) -> Option<f64> {
        let count = walk.columns.ncols();
        let mut all = walk
            .columns
            .clone()
            .resize_horizontally(count + columns.ncols(), 0.0);
        all.columns_mut(count, columns.ncols()).copy_from(columns);
        let both = self.both(&all);
        let mut white: Vec<f64> = start.iter().map(|levels| levels[0]).collect();
        let typical: Vec<f64> = self.typical.iter().map(|t| t.0).collect();
        let mut strata: Vec<NormalEquations> = (0..white.len())
            .map(|s| self.stratum(s, [white[s], 0.0], &both))
            .collect::<Option<_>>()?;
        // K of a walk that reaches the noise of a row within the recording, by axis.
        let unit = |axis: usize| {
            let ours = walk.columns.columns(axis * walk.of_axis(), walk.of_axis());
            let rows = self.rows.strata.iter().enumerate().map(|(s, stratum)| {
                let squares = ours.rows_range(stratum.rows.clone()).norm_squared();
                squares / (stratum.rows.len() as f64 * typical[s])
            });
            rows.fold(f64::MIN_POSITIVE, f64::max).sqrt().recip()
        };
        let units = [0, 1, 2].map(unit);
        let mut sizes = units;
        let mut best = deviance(&strata, count, sizes)?;
        let tried = |now: f64, unit: f64| -> Vec<f64> {
            match now > 0.0 {
                true => TRIED.iter().map(|f| f * now).collect(),
                false => FROM_ZERO.iter().map(|f| f * unit).collect(),
            }
        };
        for _ in 0..ROUNDS {
            let before = best;
            for axis in 0..3 {
                for size in tried(sizes[axis], units[axis]) {
                    let mut there = sizes;
                    there[axis] = size;
                    if let Some(found) = deviance(&strata, count, there).filter(|d| *d < best) {
                        (best, sizes) = (found, there);
                    }
                }
            }
            for s in 0..white.len() {
                for extra in tried(white[s], typical[s]) {
                    let Some(new) = self.stratum(s, [extra, 0.0], &both) else {
                        continue;
                    };
                    let old = std::mem::replace(&mut strata[s], new);
                    match deviance(&strata, count, sizes).filter(|d| *d < best) {
                        Some(found) => (best, white[s]) = (found, extra),
                        None => strata[s] = old,
                    }
                }
            }
            if before - best < SETTLED {
                break;
            }
        }
        Some(best)
    }
}
