//! The course of a known input through a dwell, block by block, and whether it moves.
//!
//! If reading and reference are averaged over the same samples, block means are as exact for a moving input as for a constant one: a linear
//! model maps one mean to the other at any speed.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Vector3};

use crate::quantity::Sensor;
use crate::signal::blocks::{Block, Condensed, Rails, extent};
use crate::signal::stillness::tolerance;

/// Fewer blocks leave too few residuals after a regression on an input and its rate of change.
const FEWEST_BLOCKS: usize = 12;
/// Number of blocks for a rate of change, by a polynomial of fourth order through them. In a turn by 30 degrees per block it errs by 0.4 %,
/// a central difference by 5 %. The effect of a delay on the reading is computed from it.
const OF_SLOPE: usize = 5;
/// Largest movement of an input within a block, as a share of its range in the dwell: that of a turn by 50 degrees. There the rate of
/// change of the block means errs by 2 %, and the square of the mean, which replaces the mean of the square, by 6 %.
const WITHIN_BLOCK: f64 = 0.4;
/// Across a gap of this many block lengths no rate of change is computed.
const GAP_BLOCKS: f64 = 3.0;

/// What the known input of a sensor does within a dwell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Motion {
    /// It is constant, or unknown.
    Stands,
    /// It moves slowly enough for the blocks to follow.
    Moves,
    /// It moves too fast for the blocks to follow.
    TooFast,
}

/// Motion of the known input of `sensor` over `blocks`; `spans` are those of the reference channels in the recording.
pub(crate) fn motion(blocks: &[Block], sensor: Sensor, spans: &[f64; 6]) -> Motion {
    let mut found = Motion::Stands;
    for c in sensor.channels() {
        let levels = || blocks.iter().map(|b| b.reference[c]);
        if !levels().all(|l| l.mean.is_finite()) {
            return Motion::Stands;
        }
        let [low, high] = extent(levels().map(|l| l.mean));
        if high - low <= tolerance(c, spans) {
            // A whole turn in every block: the means are equal although the samples move.
            let within = levels().map(|l| l.max - l.min).fold(0.0, f64::max);
            if within > FAST_SPAN * tolerance(c, spans) {
                return Motion::TooFast;
            }
            continue;
        }
        let whole = levels().map(|l| l.max).fold(f64::NEG_INFINITY, f64::max)
            - levels().map(|l| l.min).fold(f64::INFINITY, f64::min);
        let mut within: Vec<f64> = levels().map(|l| l.max - l.min).collect();
        within.sort_by(f64::total_cmp);
        // One block may contain the jerk at the end of a ramp.
        if within[within.len() * 9 / 10] > WITHIN_BLOCK * whole {
            return Motion::TooFast;
        }
        found = Motion::Moves;
    }
    found
}

/// If the block means are constant but the samples move by more than this many tolerances, the input turns within a block.
const FAST_SPAN: f64 = 10.0;

/// Known inputs through a dwell.
#[derive(Debug, Clone)]
pub(crate) struct Course {
    /// Indices of the blocks without a masked sample.
    pub blocks: Vec<usize>,
    /// Share of each block in all samples.
    pub share: Vec<f64>,
    /// Input of gyro and accelerometer, SI, and its rate of change; `None` where it is not known.
    pub of: [Option<[Vec<Vector3<f64>>; 2]>; 2],
}

impl Course {
    /// Through the blocks `range`. `None` if too few are whole, or samples are missing in between.
    pub fn of(condensed: &Condensed, range: Range<usize>, rails: &[Rails; 6]) -> Option<Self> {
        let whole = |i: &usize| {
            let block = &condensed.blocks[*i];
            let mut present = (0..6).filter(|c| condensed.has_raw[*c]);
            present.all(|c| {
                block.raw[c].n == block.rows && block.raw[c].without_rails(rails[c]).1 == 0
            })
        };
        let blocks: Vec<usize> = range.filter(whole).collect();
        let middle = |i: usize| {
            let block = &condensed.blocks[i];
            0.5 * (block.start_s + block.last_s)
        };
        let t: Vec<f64> = blocks.iter().map(|i| middle(*i)).collect();
        let rows = |i: &usize| f64::from(condensed.blocks[*i].rows);
        let longest = blocks.iter().map(rows).fold(0.0, f64::max) * condensed.period_s;
        let gap = t.windows(2).any(|t| t[1] - t[0] > GAP_BLOCKS * longest);
        if blocks.len() < FEWEST_BLOCKS || gap {
            return None;
        }
        let total: f64 = blocks.iter().map(rows).sum();
        let input = |sensor: Sensor| {
            let from = sensor.channels().start;
            let unit = sensor.pick(1f64.to_radians(), 1.0);
            let level = |i: usize, k: usize| unit * condensed.blocks[i].reference[from + k].mean;
            let x: Vec<Vector3<f64>> = blocks
                .iter()
                .map(|i| Vector3::from_fn(|k, _| level(*i, k)))
                .collect();
            let known = x.iter().all(|x| x.iter().all(|x| x.is_finite()));
            known.then(|| {
                let change = (0..x.len()).map(|i| slope(&t, &x, i)).collect();
                [x, change]
            })
        };
        Some(Self {
            share: blocks.iter().map(|i| rows(i) / total).collect(),
            of: Sensor::BOTH.map(input),
            blocks,
        })
    }

    /// Residuals of a linear regression of `values` (one for each block) on the input of `sensor` and its rate of change; `None` if the
    /// input is unknown.
    pub fn unfollowed(&self, sensor: Sensor, values: &[f64]) -> Option<Vec<f64>> {
        let [input, change] = self.of[sensor as usize].as_ref()?;
        let n = values.len();
        let mut spanned: Vec<DVector<f64>> = vec![DVector::from_element(n, 1.0).normalize()];
        for series in [input, change] {
            for k in 0..3 {
                let column = DVector::from_fn(n, |i, _| series[i][k]);
                let left = across(&spanned, &column);
                if left.norm() > 1e-6 * column.norm() {
                    spanned.push(left.normalize());
                }
            }
        }
        let left = across(&spanned, &DVector::from_column_slice(values));
        Some(left.iter().copied().collect())
    }
}

/// The part of `column` that is orthogonal to the orthonormal `spanned`; projected twice, because once leaves rounding errors.
fn across(spanned: &[DVector<f64>], column: &DVector<f64>) -> DVector<f64> {
    let basis = DMatrix::from_columns(spanned);
    let once = column - &basis * basis.tr_mul(column);
    &once - &basis * basis.tr_mul(&once)
}

/// Rate of change of `x` at `t[i]`: that of the polynomial through the nearest points (Lagrange's form).
fn slope(t: &[f64], x: &[Vector3<f64>], i: usize) -> Vector3<f64> {
    let from = i.saturating_sub(OF_SLOPE / 2).min(t.len() - OF_SLOPE);
    let nodes = from..from + OF_SLOPE;
    let others = |j: usize| nodes.clone().filter(move |k| *k != j);
    let weight = |j: usize| {
        if j == i {
            return others(i).map(|k| 1.0 / (t[i] - t[k])).sum::<f64>();
        }
        let above: f64 = others(j).filter(|k| *k != i).map(|k| t[i] - t[k]).product();
        let below: f64 = others(j).map(|k| t[j] - t[k]).product();
        above / below
    };
    nodes.clone().map(|j| x[j] * weight(j)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_of_change_of_a_polynomial_of_fourth_order_is_exact_at_uneven_times() {
        let t = [0.0, 0.1, 0.23, 0.3, 0.41, 0.5, 0.62];
        let x: Vec<Vector3<f64>> = t
            .iter()
            .map(|t: &f64| Vector3::new(t.powi(4), 3.0 * t.powi(2) - t, 7.0))
            .collect();
        for (i, t0) in t.iter().enumerate() {
            let known = Vector3::new(4.0 * t0.powi(3), 6.0 * t0 - 1.0, 0.0);
            assert!((slope(&t, &x, i) - known).norm() < 1e-10, "{i}");
        }
    }
}
