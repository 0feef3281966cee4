//! Whether a dwell that was found is a rest. A slow, even turn varies as little as a rest, and many dwells have one at their ends.
//!
//! The recording itself shows what is usual for the sensors, by robust statistics: noise, wander of the bias within dwells and between
//! them, g-sensitivity, tremor. Only what far exceeds that is left out.

use std::ops::Range;

use crate::quantity::Sensor;
use crate::signal::blocks::{Condensed, OF_MEDIAN, StepBlocks, pool, quantile};
use mimu_recording::statistics::root_mean_square;

/// Number of blocks whose mean is compared with that of the middle: the noise of a single block would hide a slow turn.
const GROUP: usize = 3;
/// Largest deviation of a group at an end from the middle of its dwell, relative to the usual deviation in the middles. A linear drift over
/// the dwell reaches 3.5 at the ends.
pub(crate) const AT_ENDS: f64 = 5.0;
/// The same for even turns of a turntable. A wobble reaches 1.4, and a motor that approaches its rate exponentially would enter the mean.
pub(crate) const AT_ENDS_OF_TURNS: f64 = 2.5;
/// Largest deviation of a dwell from its neighbours, relative to the usual one.
const AMONG_DWELLS: f64 = 8.0;
/// Largest trend at the first and the last dwells, relative to that next to them: twice, for a warm-up that slows down within three dwells.
const BEYOND: f64 = 2.0;
/// Fewer dwells do not show what is usual.
const FEWEST: usize = 7;

fn mean(condensed: &Condensed, blocks: Range<usize>, c: usize) -> f64 {
    pool(condensed.blocks[blocks].iter().map(|b| b.raw[c])).mean
}

/// Robust standard deviation of `deviations` about zero, at least that of quantisation and rounding.
fn usual(deviations: &[f64], condensed: &Condensed, c: usize) -> f64 {
    let mut sizes: Vec<f64> = deviations.iter().map(|d| d.abs()).collect();
    let scale = OF_MEDIAN * quantile(&mut sizes, 0.5).unwrap_or(0.0);
    let blocks = condensed.blocks.iter().map(|b| b.raw[c]);
    let largest = blocks.map(|m| m.max.abs().max(m.min.abs()));
    let rounding = 1e-9 * largest.fold(0.0, f64::max);
    scale
        .max(0.3 * condensed.quantisation_step[c].unwrap_or(0.0))
        .max(rounding)
}

/// If the thermometer differs by more than this, K, between an end and the middle of a dwell, temperature explains other readings at the end. The
/// rests of a session by hand differ by tenths of this.
const WARMS_K: f64 = 0.5;

/// Largest number of blocks that are tested at an end, and half the number that they are compared with: twenty seconds, because a dwell of
/// an hour drifts.
const LONGEST_END: usize = 200;

/// The ranges that the beginning and the end of a segment are compared with: its middle half; in a long segment, the nearest part of that.
/// `None` if the segment is too short.
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

/// Whether the temperature of blocks `end` differs from that of the middle of their dwell. Without a thermometer nothing is known of it.
fn warms(condensed: &Condensed, end: Range<usize>, middle: &Range<usize>) -> bool {
    let mean_c = |blocks: Range<usize>| {
        let all = condensed.blocks[blocks].iter().map(|b| b.temp_c.mean);
        let (sum, n) = all
            .filter(|c| c.is_finite())
            .fold((0.0, 0.0), |(sum, n), c| (sum + c, n + 1.0));
        sum / n
    };
    (mean_c(end) - mean_c(middle.clone())).abs() > WARMS_K
}

/// Means of the groups of `middle`, minus the mean of all of it.
fn in_middle(condensed: &Condensed, middle: &Range<usize>, c: usize) -> Vec<f64> {
    let whole = mean(condensed, middle.clone(), c);
    let starts = (middle.start..=middle.end - GROUP).step_by(GROUP);
    starts
        .map(|i| mean(condensed, i..i + GROUP, c) - whole)
        .collect()
}

/// Trims the segments at both ends until gyro and accelerometer read what they read in the middle. Returns the number of segments that were
/// cut, and of blocks removed; `at_ends` is the largest deviation of an end, as [`AT_ENDS`].
pub(crate) fn walk_in(
    segments: &mut [StepBlocks],
    condensed: &Condensed,
    at_ends: f64,
) -> (u64, u64) {
    let (mut cut, mut blocks) = (vec![0_usize; segments.len()], 0);
    let mut ends: Vec<[usize; 2]> = vec![[0; 2]; segments.len()];
    for c in (0..6).filter(|&c| condensed.has_raw[c]) {
        let middles: Vec<_> = segments.iter().map(|(_, r)| middles(r)).collect();
        let own: Vec<[Vec<f64>; 2]> = middles
            .iter()
            .flatten()
            .map(|m| m.each_ref().map(|m| in_middle(condensed, m, c)))
            .collect();
        let all: Vec<f64> = own.iter().flatten().flatten().copied().collect();
        let pooled = usual(&all, condensed, c);
        let mut own = own.iter();
        for (k, (_, range)) in segments.iter().enumerate() {
            let Some((middles, own)) = middles[k].as_ref().and_then(|m| Some((m, own.next()?)))
            else {
                continue;
            };
            let [at_first, at_last] = [0, 1].map(|end| {
                let rms = root_mean_square(own[end].iter().copied());
                (
                    mean(condensed, middles[end].clone(), c),
                    at_ends * pooled.max(rms),
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
            let cut = |blocks: usize, end: Range<usize>, middle: &Range<usize>| match blocks {
                0 => 0,
                _ if warms(condensed, end, middle) => 0,
                blocks => blocks,
            };
            let begins = first.unwrap_or(inner) - range.start;
            let stops = range.end - last.map_or(outer, |i| i + 1);
            let begins = cut(begins, range.start..range.start + GROUP, &middles[0]);
            let stops = cut(stops, range.end - GROUP..range.end, &middles[1]);
            ends[k] = [ends[k][0].max(begins), ends[k][1].max(stops)];
        }
    }
    for (((_, range), [begins, stops]), cut) in segments.iter_mut().zip(ends).zip(&mut cut) {
        *range = range.start + begins..range.end - stops;
        *cut = begins + stops;
        blocks += (begins + stops) as u64;
    }
    (cut.iter().filter(|c| **c > 0).count() as u64, blocks)
}

/// The value that the neighbours in time predict, and how far a trend may move it from there. Both use medians of three on each side, so
/// that another stray value does not mislead them.
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

/// The properties of a dwell that are judged.
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

/// Which of `dwells`, usable and in order of time, turn evenly instead of resting: their mean rate differs from that of the others, or the
/// force rotates within them.
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
            // A bias that drifts with the temperature moves further in a longer dwell.
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
