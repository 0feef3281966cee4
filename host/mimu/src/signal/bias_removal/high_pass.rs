//! A gyro behind a first-order high-pass filter: found by how it decays at rest, and undone.
//!
//! `τ dy/dt + y = τ dx/dt` has the inverse `x = y + (1/τ) ∫ y dt`, up to a constant. At rest x is the bias, so the readings y of all rests lie on one
//! straight line over their own integral, of slope -1/τ. After turns the integral differs from rest to rest by whole
//! turns, and nothing else that a gyro does follows it: in a simulated recording with τ = 15 s the line leaves 1/300 of the scatter.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Vector3};

use super::GUARD;
use crate::bias_removal::HighPass;
use crate::signal::blocks::{Block, Condensed};
use crate::triad::half_width_95;
use mimu_recording::statistics::mean_and_variance;

/// Fewest rests.
const FEWEST: usize = 6;
/// Scatter of the readings at rest over that about the line, at least. A thermal drift, a warm-up or g-sensitivity explains at most a part
/// of it, because the integral changes with the path between two poses.
const RATIO: f64 = 5.0;
/// Largest relative difference of the slopes of two axes, or of that between the rests from that within them.
const AGREE: f64 = 0.1;
/// Sigmas at which the decay within the rests has to show.
const SEEN: f64 = 6.0;

/// Integral of the gyro, raw·s: at the end of each block.
struct Integral {
    ends: Vec<(f64, [f64; 3])>,
}

impl Integral {
    fn of(blocks: &[Block], period_s: f64) -> Self {
        let mut sum = [0.0; 3];
        let mut ends: Vec<(f64, [f64; 3])> = Vec::with_capacity(blocks.len() + 1);
        let means = |b: &Block| [0, 1, 2].map(|axis| b.raw[axis].mean);
        for (i, block) in blocks.iter().enumerate() {
            let start_s = block.start_s - 0.5 * period_s;
            match ends.last() {
                None => ends.push((start_s, sum)),
                // Over a gap the reading is taken as the mean of its two sides.
                Some(&(end_s, _)) if start_s > end_s + 0.5 * period_s => {
                    for (sum, (a, b)) in sum
                        .iter_mut()
                        .zip(means(&blocks[i - 1]).into_iter().zip(means(block)))
                    {
                        *sum += 0.5 * (a + b) * (start_s - end_s);
                    }
                    ends.push((start_s, sum));
                }
                Some(_) => {}
            }
            let end_s = block.last_s + 0.5 * period_s;
            let from_s = ends.last().map_or(start_s, |e| e.0);
            for (sum, mean) in sum.iter_mut().zip(means(block)) {
                *sum += mean * (end_s - from_s);
            }
            ends.push((end_s, sum));
        }
        Self { ends }
    }

    /// At an instant, raw·s.
    fn at(&self, t_s: f64) -> [f64; 3] {
        let last = self.ends.len() - 1;
        let k = self.ends.partition_point(|e| e.0 < t_s).clamp(1, last);
        let [(a_s, a), (b_s, b)] = [self.ends[k - 1], self.ends[k]];
        let share = ((t_s - a_s) / (b_s - a_s)).clamp(0.0, 1.0);
        [0, 1, 2].map(|axis| a[axis] + share * (b[axis] - a[axis]))
    }
}

/// A block at rest.
struct AtRest {
    rest: usize,
    t_s: f64,
    reading: [f64; 3],
    integral: [f64; 3],
}

/// Slope of the readings of one axis over their integral, 1/s.
struct Slope {
    value: f64,
    sigma: f64,
    /// Scatter of the readings over that about the line.
    ratio: f64,
}

/// Slope over all rests, beside a level and a drift that bends.
fn between(all: &[AtRest], axis: usize, rests: usize) -> Option<Slope> {
    let (first, last) = (all.first()?.t_s, all.last()?.t_s);
    let slow = DMatrix::from_fn(all.len(), 3, |i, k| {
        (2.0 * (all[i].t_s - first) / (last - first) - 1.0).powi(k as i32)
    });
    let q = slow.qr().q();
    let beside = |value: &dyn Fn(&AtRest) -> f64| {
        let column = DVector::from_iterator(all.len(), all.iter().map(value));
        &column - &q * q.tr_mul(&column)
    };
    let (y, x) = (beside(&|a| a.reading[axis]), beside(&|a| a.integral[axis]));
    let squares = x.norm_squared();
    let value = x.dot(&y) / squares;
    let left = &y - &x * value;
    // The noise of one rest goes on in the integral of the next, so a rest counts as one witness.
    let mut by_rest = vec![0.0; rests];
    for (i, one) in all.iter().enumerate() {
        by_rest[one.rest] += x[i] * left[i];
    }
    let sigma = by_rest.iter().map(|s| s * s).sum::<f64>().sqrt() / squares;
    Some(Slope {
        value,
        sigma,
        ratio: y.norm() / left.norm(),
    })
    .filter(|s| s.value.is_finite() && s.sigma.is_finite())
}

/// The same within the rests, each about its mean: how the reading decays while nothing turns. All `axes` together.
fn within(all: &[AtRest], axes: &[usize]) -> (f64, f64) {
    let (mut squares, mut products) = (0.0, 0.0);
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    for rest in all.chunk_by(|a, b| a.rest == b.rest) {
        let count = rest.len() as f64;
        for axis in axes {
            let mean = |value: fn(&AtRest) -> &[f64; 3]| {
                rest.iter().map(|a| value(a)[*axis]).sum::<f64>() / count
            };
            let (y, x) = (mean(|a| &a.reading), mean(|a| &a.integral));
            let each = rest
                .iter()
                .map(|a| (a.integral[*axis] - x, a.reading[*axis] - y));
            pairs.extend(each);
        }
    }
    for (x, y) in &pairs {
        squares += x * x;
        products += x * y;
    }
    let value = products / squares;
    let left: f64 = pairs.iter().map(|(x, y)| (y - value * x).powi(2)).sum();
    (value, (left / pairs.len() as f64 / squares).sqrt())
}

impl HighPass {
    /// The filter that the readings at `rests` show, if they do.
    pub(super) fn find(condensed: &Condensed, rests: &[Range<usize>]) -> Option<Self> {
        if rests.len() < FEWEST {
            return None;
        }
        let integral = Integral::of(&condensed.blocks, condensed.period_s);
        let all: Vec<AtRest> = at_rest(&condensed.blocks, rests, &integral);
        let slopes: Vec<Slope> = (0..3)
            .map(|axis| between(&all, axis, rests.len()))
            .collect::<Option<_>>()?;
        let shows: Vec<usize> = (0..3).filter(|k| slopes[*k].ratio > RATIO).collect();
        if shows.len() < 2 {
            return None;
        }
        let of_shown = || shows.iter().map(|k| slopes[*k].value);
        let (slope, scatter) = mean_and_variance(of_shown());
        let near = |other: f64| (other / slope - 1.0).abs() < AGREE;
        let (decay, sigma) = within(&all, &shows);
        let decays = decay < -SEEN * sigma && (near(decay) || (decay - slope).abs() < 4.0 * sigma);
        if !(slope < 0.0 && of_shown().all(near) && decays) {
            return None;
        }
        let count = shows.len() as f64;
        let known = shows.iter().map(|k| slopes[*k].sigma.powi(2)).sum::<f64>() / count;
        // Axes differ by what their noise left in the integral, which the scatter about the lines does not contain.
        let by_axes = half_width_95([(scatter / count, count - 1.0)].into_iter());
        let by_rests = half_width_95([(known / count, f64::INFINITY)].into_iter());
        let time_constant_s = -1.0 / slope;
        let level = [0, 1, 2].map(|axis| {
            let each = all.iter();
            let restored = each.map(|a| a.reading[axis] + a.integral[axis] / time_constant_s);
            restored.sum::<f64>() / all.len() as f64
        });
        Some(Self {
            time_constant_s,
            half_width_s: by_axes.max(by_rests) * time_constant_s.powi(2),
            level,
        })
    }

    /// The recording without the filter. Its readings at rest are about zero, because the constant is unknown.
    pub(crate) fn undo(&self, mut condensed: Condensed) -> Condensed {
        let integral = Integral::of(&condensed.blocks, condensed.period_s);
        let added = |t_s: f64| {
            let integral = integral.at(t_s);
            [0, 1, 2].map(|k| integral[k] / self.time_constant_s - self.level[k])
        };
        for block in &mut condensed.blocks {
            // Extremes keep their values: they decide on rails, which are those of the recorded reading.
            let added = added(0.5 * (block.start_s + block.last_s));
            for (moments, added) in block.raw.iter_mut().zip(added) {
                moments.mean += added;
            }
        }
        for piece in &mut condensed.increments {
            let added = Vector3::from(added(piece.end_s - piece.duration_s));
            let [a, d] = [piece.integral, piece.moment].map(Vector3::from);
            // The integral of a over the piece, by the definition of d. The change of rate that the filter took within 10 ms is of second order.
            let integrated = (d + a * piece.duration_s) * 0.5;
            *piece = piece.with_added(&added);
            piece.integral =
                (Vector3::from(piece.integral) + integrated / self.time_constant_s).into();
        }
        condensed
    }
}

fn at_rest(blocks: &[Block], rests: &[Range<usize>], integral: &Integral) -> Vec<AtRest> {
    let each = rests.iter().enumerate().flat_map(|(rest, range)| {
        let inner = range.start + GUARD..range.end - GUARD;
        blocks[inner].iter().map(move |block| {
            let t_s = 0.5 * (block.start_s + block.last_s);
            AtRest {
                rest,
                t_s,
                reading: [0, 1, 2].map(|axis| block.raw[axis].mean),
                integral: integral.at(t_s),
            }
        })
    });
    each.collect()
}
