//! Sums of the squares of all differences at many averaging times.

use std::ops::Range;

use rayon::prelude::*;

use super::super::Deviation;
use super::differences::{difference, sums};
use super::window_sums::WindowSums;

/// Number of positions in a tile, for which all clusters are computed before the next tile. With the reach of clusters of [`NEAR`] it is
/// 350 KB of doubles, for a second-level cache.
const TILE: usize = 1 << 15;
/// Shorter clusters are computed in tiles. Differences of longer ones are so far apart (`STARTS_PER_CLUSTER`) that each would read a
/// separate cache line from a tile too.
const NEAR: usize = 4096;

/// What is computed at one averaging time.
#[derive(Clone, Copy)]
pub struct Plan {
    /// Cluster length.
    pub m: usize,
    /// One difference in this many is used.
    pub stride: usize,
    /// Number of all differences.
    pub all: usize,
}

impl Plan {
    /// From the first used difference in the tile at `from` to the last.
    fn within(&self, from: usize) -> Range<usize> {
        let end = (from + TILE).min(self.all).max(from);
        from.next_multiple_of(self.stride).min(end)..end
    }
}

/// Differences of one kind of a series.
pub struct Squares<'a> {
    x: &'a [f64],
    kind: Deviation,
    windows: Option<WindowSums<'a>>,
}

impl<'a> Squares<'a> {
    /// One pass over the series for [`Deviation::Modified`].
    pub fn new(x: &'a [f64], kind: Deviation) -> Self {
        let windows = (kind == Deviation::Modified).then(|| WindowSums::new(x));
        Self { x, kind, windows }
    }

    /// Sum of the squares of every `stride`-th of those differences that begin in `positions`, from the first.
    pub fn sum(&self, m: usize, stride: usize, positions: Range<usize>) -> f64 {
        if let Some(windows) = &self.windows {
            return windows.sum_of_squares(m, stride, positions);
        }
        let [sum] = if self.kind == Deviation::Hadamard {
            sums(self.x, [0, m, 2 * m, 3 * m], stride, positions, |taps| {
                [difference(&taps).powi(2)]
            })
        } else {
            sums(self.x, [0, m, 2 * m], stride, positions, |taps| {
                [difference(&taps).powi(2)]
            })
        };
        sum
    }
}

/// For each of `plans`, which have ascending clusters. The order of additions does not depend on the number of threads.
pub fn sums_of_squares(x: &[f64], kind: Deviation, plans: &[Plan]) -> Vec<f64> {
    let squares = Squares::new(x, kind);
    let (near, far) = plans.split_at(plans.partition_point(|plan| plan.m < NEAR));
    let mut sums = tiled(near, |from| {
        let sum = |plan: &Plan| squares.sum(plan.m, plan.stride, plan.within(from));
        near.iter().map(sum).collect()
    });
    let sum = |plan: &Plan| squares.sum(plan.m, plan.stride, 0..plan.all);
    sums.par_extend(far.par_iter().map(sum));
    sums
}

/// Sums for all plans, tile by tile, so that the series is read from memory once for all clusters. `part` receives the start of the tile.
fn tiled(plans: &[Plan], part: impl Fn(usize) -> Vec<f64> + Sync + Send) -> Vec<f64> {
    let end = plans.iter().map(|plan| plan.all).max().unwrap_or(0);
    let tiles: Vec<Vec<f64>> = (0..end).into_par_iter().step_by(TILE).map(part).collect();
    let mut sums = vec![0.0; plans.len()];
    for tile in tiles {
        for (sum, part) in sums.iter_mut().zip(tile) {
            *sum += part;
        }
    }
    sums
}
