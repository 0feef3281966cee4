//! A gyro whose firmware learns the bias at rest and subtracts it.
//!
//! The sign is a rest that begins at a level and ends at zero although nothing turns, and rests that all read zero from then on. A bias that is merely
//! small has no such rest. If the firmware had learnt the bias before the recording began, the readings are those of a sensor without
//! bias, and nothing shows.

use std::ops::Range;

use super::{GUARD, mean};
use crate::bias_removal::Zeroed;
use crate::signal::blocks::{Block, Moments};

/// Length of the level that a rest begins with, in blocks: firmware needs about a second to know that it is still.
const HEAD: usize = 5;
/// Length of a rest that can show both, in blocks.
const LONG: usize = 40;
/// Difference between the two levels, in sigmas of the mean of a block.
const STEP: f64 = 12.0;
/// Level at the end of this rest and of all later ones, relative to that before. They may be off by the noise of a block, because the bias was learnt
/// from such noise, and by what was learnt from the end of a slow turn and is not corrected yet.
const ZERO: f64 = 0.1;
/// Sigmas of a block by which the accelerometer may change while the level does.
const UNMOVED: f64 = 3.0;
/// Fewest later rests.
const FEWEST: usize = 3;

/// Standard deviation of the mean of a block at rest, from successive differences, raw.
fn noise(blocks: &[Block], rests: &[Range<usize>], c: usize) -> f64 {
    let pairs = rests.iter().flat_map(|r| blocks[r.clone()].windows(2));
    let squares = pairs.map(|p| (p[1].raw[c].mean - p[0].raw[c].mean).powi(2));
    let mut all: Vec<f64> = squares.collect();
    // The median of a chi-square of one degree of freedom: the learning is no noise.
    let median = crate::signal::blocks::quantile(&mut all, 0.5).unwrap_or(0.0);
    (0.5 * median / 0.454_94).sqrt()
}

impl Zeroed {
    /// The bias that firmware learns in one of the `rests`, if it does.
    pub(super) fn find(blocks: &[Block], rests: &[Range<usize>]) -> Option<Self> {
        let sigma = [0, 1, 2, 3, 4, 5].map(|c| noise(blocks, rests, c));
        let later = |k: usize| rests.iter().skip(k + 1).filter(|r| r.len() > 2 * GUARD);
        let learns = |k: usize, rest: &Range<usize>| {
            if rest.len() < LONG || later(k).count() < FEWEST {
                return None;
            }
            let head = &blocks[rest.start..rest.start + HEAD];
            let tail = &blocks[rest.end - rest.len() / 2..rest.end - GUARD];
            let (before, after) = (mean(head), mean(tail));
            let large = |axis: &usize| before[*axis].abs() > STEP * sigma[*axis];
            let axes: Vec<usize> = (0..3).filter(large).collect();
            let is_zero = |level: [f64; 3]| {
                let most = |k: usize| (ZERO * before[k].abs()).max(sigma[k]);
                axes.iter().all(|k| level[*k].abs() < most(*k))
            };
            // A level, not the end of a motion.
            let steady = |axis: &usize| {
                let off = |b: &Block| (b.raw[*axis].mean - before[*axis]).abs();
                head.iter().map(off).fold(0.0, f64::max) < 4.0 * sigma[*axis]
            };
            let moved = |c: usize| {
                let of = |some: &[Block]| {
                    let means = some.iter().map(|b: &Block| -> &Moments { &b.raw[c] });
                    means.map(|m| m.mean).sum::<f64>() / some.len() as f64
                };
                (of(head) - of(tail)).abs() > UNMOVED * sigma[c]
            };
            let learnt = !axes.is_empty()
                && axes.iter().all(steady)
                && is_zero(after)
                && !(3..6).any(moved)
                && later(k).all(|r| is_zero(mean(&blocks[r.end - r.len() / 3..r.end - GUARD])));
            learnt.then_some(Self {
                from_s: blocks[rest.start].start_s,
                bias: before,
            })
        };
        let mut each = rests.iter().enumerate();
        each.find_map(|(k, rest)| learns(k, rest))
    }
}
