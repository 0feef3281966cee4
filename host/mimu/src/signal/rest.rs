//! Whether a dwell that was found is a rest: a slow and even turn varies as little, and hides at the ends of many.
//!
//! What is usual for the sensors is taken from the recording itself, robustly: noise, wander of the bias within dwells and from one to
//! the next, g-sensitivity, tremor. Only what stands far out of that is left out.

use std::ops::Range;

use crate::quantity::Sensor;
use crate::signal::blocks::{Condensed, Stretch, pool, quantile};

/// Blocks whose mean is compared with that of the middle: noise of a single block would hide a slow turn.
const GROUP: usize = 3;
/// Deviation of a group at an end from the middle of its dwell, at most, over what is usual in the middles. A straight drift over the
/// dwell reaches 3.5 at the ends.
const AT_ENDS: f64 = 5.0;
/// Deviation of a dwell from its neighbours, at most, over what is usual.
const AMONG_DWELLS: f64 = 8.0;
/// Trend beyond the first and the last dwells over that beside them: twice, for a warm-up that slows down within three dwells.
const BEYOND: f64 = 2.0;
/// Fewer dwells show nothing usual.
const FEWEST: usize = 7;
/// From a median absolute deviation to a standard deviation.
const OF_MEDIAN: f64 = 1.4826;

fn mean(condensed: &Condensed, blocks: Range<usize>, c: usize) -> f64 {
    pool(condensed.blocks[blocks].iter().map(|b| b.raw[c])).mean
}

/// Robust standard deviation of `deviations` about zero, and no less than a reading in steps or a rounding error gives.
fn usual(deviations: &[f64], condensed: &Condensed, c: usize) -> f64 {
    let mut sizes: Vec<f64> = deviations.iter().map(|d| d.abs()).collect();
    let scale = OF_MEDIAN * quantile(&mut sizes, 0.5).unwrap_or(0.0);
    let blocks = condensed.blocks.iter().map(|b| b.raw[c]);
    let largest = blocks.map(|m| m.max.abs().max(m.min.abs()));
    let rounding = 1e-9 * largest.fold(0.0, f64::max);
    scale
        .max(0.3 * condensed.reading_step[c].unwrap_or(0.0))
        .max(rounding)
}

/// Blocks at an end that are looked at, and half of those that they are compared with: twenty seconds. A dwell of an hour drifts.
const LONGEST_END: usize = 200;

/// What the beginning and the end of a stretch are compared with: its middle half, of a long one the nearest part of it. `None` where it is
/// too short to have ends.
fn middles(range: &Range<usize>) -> Option<[Range<usize>; 2]> {
    let quarter = (range.len() / 4).min(LONGEST_END);
    let half = (range.len() - 2 * quarter).min(2 * LONGEST_END);
    (quarter >= GROUP).then(|| {
        [
            range.start + quarter..range.start + quarter + half,
            range.end - quarter - half..range.end - quarter,
        ]
    })
}

/// Means of the groups of `middle`, less that of all of it.
fn in_middle(condensed: &Condensed, middle: &Range<usize>, c: usize) -> Vec<f64> {
    let whole = mean(condensed, middle.clone(), c);
    let starts = (middle.start..=middle.end - GROUP).step_by(GROUP);
    starts
        .map(|i| mean(condensed, i..i + GROUP, c) - whole)
        .collect()
}

/// Walks the ends of the stretches in, from both sides, until gyro and accelerometer read what they do in the middle. The number of
/// stretches that were cut, and of blocks in all.
pub(crate) fn walk_in(stretches: &mut [Stretch], condensed: &Condensed) -> (u64, u64) {
    let (mut cut, mut blocks) = (vec![0_usize; stretches.len()], 0);
    let mut ends: Vec<[usize; 2]> = vec![[0; 2]; stretches.len()];
    for c in (0..6).filter(|&c| condensed.has_raw[c]) {
        let middles: Vec<_> = stretches.iter().map(|(_, r)| middles(r)).collect();
        let own: Vec<[Vec<f64>; 2]> = middles
            .iter()
            .flatten()
            .map(|m| m.each_ref().map(|m| in_middle(condensed, m, c)))
            .collect();
        let all: Vec<f64> = own.iter().flatten().flatten().copied().collect();
        let pooled = usual(&all, condensed, c);
        let mut own = own.iter();
        for (k, (_, range)) in stretches.iter().enumerate() {
            let Some((middles, own)) = middles[k].as_ref().and_then(|m| Some((m, own.next()?)))
            else {
                continue;
            };
            let [at_first, at_last] = [0, 1].map(|end| {
                let squares = own[end].iter().map(|d| d * d).sum::<f64>();
                let rms = (squares / own[end].len() as f64).sqrt();
                (
                    mean(condensed, middles[end].clone(), c),
                    AT_ENDS * pooled.max(rms),
                )
            });
            let off = |from: usize, (level, limit): (f64, f64)| {
                (mean(condensed, from..from + GROUP, c) - level).abs() > limit
            };
            let [inner, outer] = [middles[0].start, middles[1].end];
            let first = (range.start..inner).find(|i| !off(*i, at_first));
            let last = (outer..=range.end - 1)
                .rev()
                .find(|i| !off(i + 1 - GROUP, at_last));
            let begins = first.unwrap_or(inner) - range.start;
            let stops = range.end - last.map_or(outer, |i| i + 1);
            ends[k] = [ends[k][0].max(begins), ends[k][1].max(stops)];
        }
    }
    for (((_, range), [begins, stops]), cut) in stretches.iter_mut().zip(ends).zip(&mut cut) {
        *range = range.start + begins..range.end - stops;
        *cut = begins + stops;
        blocks += (begins + stops) as u64;
    }
    (cut.iter().filter(|c| **c > 0).count() as u64, blocks)
}

/// What a value is expected to be by its neighbours in time, and how far a trend may take it from there. Medians of three on each side, so that
/// one more that strays misleads neither.
pub(crate) fn expected(values: &[f64], i: usize) -> (f64, f64) {
    let median = |range: Range<usize>| {
        let mut values = values[range].to_vec();
        quantile(&mut values, 0.5).unwrap_or(f64::NAN)
    };
    let n = values.len();
    match (i >= 2, i + 2 < n) {
        (true, true) => {
            let before = median(i.saturating_sub(3)..i);
            let after = median(i + 1..(i + 4).min(n));
            (0.5 * (before + after), (after - before).abs())
        }
        (false, _) => {
            let near = median(i + 1..i + 4);
            (near, BEYOND * (median(i + 4..(i + 7).min(n)) - near).abs())
        }
        (true, false) => {
            let near = median(i - 3..i);
            (
                near,
                BEYOND * (near - median(i.saturating_sub(6)..i - 3)).abs(),
            )
        }
    }
}

/// What is judged of a dwell.
#[derive(Debug, Clone)]
pub(crate) struct Rest {
    /// Its blocks.
    pub blocks: Range<usize>,
    /// Means of the raw channels.
    pub mean: [f64; 6],
    /// Length, s.
    pub duration_s: f64,
    /// Whether the temperature ramps within it, and biases with it.
    pub ramps: bool,
}

/// Which of `dwells`, usable and in order of time, turn evenly and do not rest: their mean rate is none of the others', or the force
/// rotates within them.
pub(crate) fn turning(dwells: &[Rest], condensed: &Condensed) -> Vec<bool> {
    let n = dwells.len();
    let mut turning = vec![false; n];
    if n < FEWEST {
        return turning;
    }
    let mut lengths: Vec<f64> = dwells.iter().map(|d| d.duration_s).collect();
    let typical_s = quantile(&mut lengths, 0.5).unwrap_or(1.0);
    let mut judge = |c: usize, off: &[f64], trend: &[f64]| {
        let scale = usual(off, condensed, c);
        for i in 0..n {
            // A mean over less time has more noise.
            let mut longer = (typical_s / dwells[i].duration_s).max(1.0).sqrt();
            // A bias that drifts with the temperature goes the further the longer it takes.
            if dwells[i].ramps {
                longer *= (dwells[i].duration_s / typical_s).max(1.0);
            }
            turning[i] |= off[i].abs() > AMONG_DWELLS * longer * scale + trend[i];
        }
    };
    for c in Sensor::Gyro.channels().filter(|&c| condensed.has_raw[c]) {
        let means: Vec<f64> = dwells.iter().map(|d| d.mean[c]).collect();
        let by_neighbours: Vec<_> = (0..n).map(|i| expected(&means, i)).collect();
        let off: Vec<f64> = means
            .iter()
            .zip(&by_neighbours)
            .map(|(m, e)| m - e.0)
            .collect();
        let trend: Vec<f64> = by_neighbours.iter().map(|e| e.1).collect();
        judge(c, &off, &trend);
    }
    for c in Sensor::Accel.channels().filter(|&c| condensed.has_raw[c]) {
        let moved = |d: &Rest| {
            let third = (d.blocks.len() / 3).max(1);
            mean(condensed, d.blocks.end - third..d.blocks.end, c)
                - mean(condensed, d.blocks.start..d.blocks.start + third, c)
        };
        let moved: Vec<f64> = dwells.iter().map(moved).collect();
        judge(c, &moved, &vec![0.0; n]);
    }
    turning
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bias_that_warms_up_is_expected_and_a_single_stray_is_not() {
        let mut means: Vec<f64> = (0..30).map(|i| (-f64::from(i) / 5.0).exp()).collect();
        let off = |means: &[f64], i: usize| {
            let (level, trend) = expected(means, i);
            ((means[i] - level).abs(), trend)
        };
        for i in 0..30 {
            let (off, trend) = off(&means, i);
            assert!(off <= trend + 1e-12, "{i}: {off} {trend}");
        }
        means[20] += 0.3;
        let (stray, trend) = off(&means, 20);
        assert!(stray > 0.28 && trend < 0.02, "{stray} {trend}");
    }
}
