//! Finds dwells that are not numbered: segments in which no channel varies.

use serde::Serialize;

use crate::fault::SHORTEST_S;
use crate::quantity::Sensor;
use crate::signal::blocks::{
    Block, Condensed, Level, OF_MEDIAN, StepBlocks, extent, pool, quantile,
};
use mimu_recording::error::{Error, Result};
use mimu_recording::{Manifest, Reference};

/// Length of the window whose variance decides on stillness, s. It is long enough for a slow turn to show in the accelerometer: the force
/// changes linearly by g ω, a variance of (g ω)²/12, which with a noise of 7 mm/s² reaches [`STILL_FACTOR`] at 0.4 deg/s. It is short
/// enough for rests by hand.
pub const WINDOW_S: f64 = 1.0;

/// Left out at both ends of a dwell that was found, s: stillness begins and ends within a window.
pub const GUARD_S: f64 = 0.2;

/// Largest variance of a still window, relative to the quietest ones. In six recordings by hand, all factors from 15 to 30 give the same
/// number of dwells (38, and 22 five times). At 10 one recording has another fragment, too short to be used; at 7 and 5 some dwells are
/// split. The factor is below that plateau, because motion that it admits would enter the means.
pub const STILL_FACTOR: f64 = 10.0;

/// Additional factor for the gyro, in recordings by hand that have an accelerometer to show motion as well. Hands tremble in angle: of 22
/// rests of each of five units, some had 50 to 230 times the quietest variance in the gyro while the accelerometer showed nothing. Without
/// these rests the held-out error was three times as large. The mean rate of a rest is its total angle over its length, and tremor leaves
/// almost no angle.
const GYRO_TREMOR: f64 = 30.0;

/// Where the dwells are taken from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Steps {
    /// The `step` column if there is one, with a test for stillness; otherwise found by stillness.
    #[default]
    AsRecorded,
    /// The `step` column, without a test for stillness.
    Given,
    /// Found by stillness, whatever the column says.
    Found,
    /// Dwells are not searched: the caller declares that the unit lay still throughout, and the whole recording is one dwell.
    AtRest,
}

/// How the dwells are to be found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Finding {
    /// See [`STILL_FACTOR`].
    pub still_factor: f64,
    /// Where they are taken from.
    pub steps: Steps,
}

impl From<f64> for Finding {
    fn from(still_factor: f64) -> Self {
        Self {
            still_factor,
            steps: Steps::default(),
        }
    }
}

/// The thresholds that found the dwells.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Detection {
    /// Length of a block, s: ends of dwells are on this grid.
    #[serde(skip)]
    pub block_s: f64,
    /// Window of the variance, s.
    pub window_s: f64,
    /// Left out at both ends, s.
    pub guard_s: f64,
    /// Shortest dwell that is used, s.
    pub shortest_s: f64,
    /// Largest variance of a still window in the accelerometer, in units of `floor` squared.
    pub still_factor: f64,
    /// The same in the gyro.
    pub gyro_still_factor: f64,
    /// Standard deviation of one sample in the quietest twentieth of the recording, raw units.
    #[serde(rename = "floor_raw")]
    pub floor: [f64; 6],
}

pub(crate) fn find(
    condensed: &Condensed,
    manifest: &Manifest,
    factor: f64,
) -> Result<(Vec<StepBlocks>, Detection)> {
    let blocks = &condensed.blocks;
    let block_s = blocks.iter().map(|b| b.rows).max().unwrap_or(1) as f64 * condensed.period_s;
    let width = ((WINDOW_S / block_s).round() as usize).max(2);
    if blocks.len() < width {
        let problem = format!(
            "the recording lasts {:.2} s, less than the window of {WINDOW_S} s in which stillness is judged",
            condensed.rows as f64 * condensed.period_s
        );
        return Err(Error::new("dwells", problem, "record for longer"));
    }
    let channels: Vec<usize> = (0..6).filter(|&c| condensed.has_raw[c]).collect();
    let bursts = manifest.reference == Reference::Gravity && in_bursts(blocks);
    let windows = windows(blocks, width, &channels, bursts);
    let mut floor = [0.0; 6];
    for &c in &channels {
        let mut of_channel: Vec<f64> = windows
            .iter()
            .flatten()
            .map(|w| w.variance[c])
            .filter(|v| *v > 0.0)
            .collect();
        // A noiseless simulation has no floor: then anything that varies at all is motion.
        floor[c] = quantile(&mut of_channel, 0.05).unwrap_or(0.0);
    }
    // A hand at rest trembles in angle but hardly in force.
    let by_hand = manifest.reference == Reference::Gravity && condensed.has_raw[3];
    let gyro = if by_hand {
        GYRO_TREMOR * factor
    } else {
        factor
    };
    let factors = [gyro, gyro, gyro, factor, factor, factor];
    let quiet = |w: &Window| {
        channels
            .iter()
            .all(|&c| w.variance[c] <= factors[c] * floor[c])
    };
    let at_rest: Vec<&Window> = windows.iter().flatten().filter(|w| quiet(w)).collect();
    let rates = Sensor::Gyro
        .channels()
        .filter(|&c| by_hand && condensed.has_raw[c]);
    let rates: Vec<_> = rates
        .map(|c| (c, RateAtRest::of(&at_rest, c, (factor * floor[c]).sqrt())))
        .collect();
    let turning = |w: &Window| rates.iter().any(|(c, rate)| !rate.has(w, *c));
    let spans = reference_spans(condensed);
    let mut still = vec![false; blocks.len()];
    for (i, window) in windows.iter().enumerate() {
        let Some(window) = window else { continue };
        let quiet = quiet(window) && !turning(window);
        let constant = manifest.reference == Reference::Gravity
            || constant_input(blocks[i..i + width].iter().map(|b| &b.reference), &spans);
        if quiet && constant {
            still[i..i + width].fill(true);
        }
    }
    // Two dwells of a table may follow each other without a disturbed window between them.
    let guard = (GUARD_S / block_s).round() as usize;
    let mut ranges = Vec::new();
    let mut start = None;
    for i in 0..=blocks.len() {
        let open = i < blocks.len()
            && still[i]
            && (start.is_none()
                || ((bursts || !blocks[i].after_gap)
                    && same_input(&blocks[i - 1].reference, &blocks[i].reference, &spans)));
        match (open, start) {
            (true, None) => start = Some(i),
            (false, Some(from)) => {
                // At the ends of the recording there is no motion to guard against.
                let from = if from == 0 { 0 } else { from + guard };
                let to = if i == blocks.len() {
                    i
                } else {
                    i.saturating_sub(guard)
                };
                if to > from {
                    ranges.push((None, from..to));
                }
                start = (i < blocks.len() && still[i]).then_some(i);
            }
            _ => {}
        }
    }
    let detection = Detection {
        block_s,
        window_s: width as f64 * block_s,
        guard_s: guard as f64 * block_s,
        shortest_s: SHORTEST_S,
        still_factor: factor,
        gyro_still_factor: gyro,
        floor: floor.map(f64::sqrt),
    };
    Ok((ranges, detection))
}

/// This many bursts are a way of recording; fewer pauses are a loss of samples.
const BURSTS: usize = 20;
/// Largest median of the bursts, and smallest median of the pauses between them, s. Longer bursts show by themselves that they are still,
/// and are separate dwells. Joined, 25 bursts of 5 s in a cooling chamber became four dwells whose noise was their drift.
const BURST_S: f64 = 2.0;
const PAUSE_S: f64 = 1.0;

/// Whether samples were taken in short bursts, with pauses. A single burst may be too short to show that it is still; joined with its
/// neighbours it is long enough.
fn in_bursts(blocks: &[Block]) -> bool {
    let starts = (1..blocks.len()).filter(|i| blocks[*i].after_gap);
    let starts: Vec<usize> = [0].into_iter().chain(starts).collect();
    let ends = starts[1..].iter().copied().chain([blocks.len()]);
    let mut lengths: Vec<f64> = starts
        .iter()
        .zip(ends)
        .map(|(from, to)| blocks[to - 1].last_s - blocks[*from].start_s)
        .collect();
    let mut pauses: Vec<f64> = starts[1..]
        .iter()
        .map(|i| blocks[*i].start_s - blocks[i - 1].last_s)
        .collect();
    let median = |values: &mut Vec<f64>| quantile(values, 0.5);
    starts.len() >= BURSTS
        && median(&mut lengths).is_some_and(|s| s < BURST_S)
        && median(&mut pauses).is_some_and(|s| s > PAUSE_S)
}

/// Mean and variance of the six raw channels over [`WINDOW_S`], and the temperature.
struct Window {
    mean: [f64; 6],
    variance: [f64; 6],
    temp_c: f64,
}

/// The window that begins at each block; `None` where there is a gap in it, unless samples come in bursts.
fn windows(
    blocks: &[Block],
    width: usize,
    channels: &[usize],
    bursts: bool,
) -> Vec<Option<Window>> {
    let window = |window: &[Block]| {
        let (mut mean, mut variance) = ([0.0; 6], [0.0; 6]);
        for &c in channels {
            let pooled = pool(window.iter().map(|b| b.raw[c]));
            mean[c] = pooled.mean;
            variance[c] = match pooled.n {
                0 | 1 => f64::INFINITY,
                n => pooled.m2 / f64::from(n - 1),
            };
        }
        Window {
            mean,
            variance,
            temp_c: window[width / 2].temp_c.mean,
        }
    };
    let whole = |w: &[Block]| bursts || !w[1..].iter().any(|b| b.after_gap);
    blocks
        .windows(width)
        .map(|w| whole(w).then(|| window(w)))
        .collect()
}

/// If the temperature varies by less than this over all windows, K, it moves a bias by no more than hands do.
const LEVELS_FROM_K: f64 = 5.0;
/// Least width, K, and least number of windows (one minute) of a temperature bin with one level: a turn in a bin is then the smaller part
/// of it.
const LEVEL_K: f64 = 1.0;
const LEVEL_WINDOWS: usize = 600;
/// Largest deviation of a window at rest from its level, in sigmas of all windows.
const REACH_SIGMAS: f64 = 5.0;

/// Range of a channel's mean reading in windows at rest: the median of the quiet windows, plus or minus a margin and five of their standard
/// deviations, which include a drift of the bias.
///
/// A turn about the vertical does not show in the accelerometer, and a slow one hardly in the variance of the gyro. A bias that follows the
/// temperature looks like such a turn, so each window is compared with others at the same temperature, from which only a turn differs.
struct RateAtRest {
    /// Temperature and median reading, by temperature; a single pair if the temperature hardly changes.
    levels: Vec<(f64, f64)>,
    reach: f64,
}

impl RateAtRest {
    fn of(at_rest: &[&Window], c: usize, margin: f64) -> Self {
        let mut by_temp: Vec<(f64, f64)> = at_rest.iter().map(|w| (w.temp_c, w.mean[c])).collect();
        by_temp.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ends = by_temp.first().zip(by_temp.last());
        let changes = ends.is_some_and(|(a, b)| b.0 - a.0 > LEVELS_FROM_K);
        let mut bins: Vec<&[(f64, f64)]> = Vec::new();
        let mut from = 0;
        for i in 0..by_temp.len() {
            let full = changes
                && i - from >= LEVEL_WINDOWS
                && by_temp[i].0 - by_temp[from].0 >= LEVEL_K
                && by_temp.len() - i >= LEVEL_WINDOWS;
            if full {
                bins.push(&by_temp[from..i]);
                from = i;
            }
        }
        bins.push(&by_temp[from..]);
        let level = |bin: &&[(f64, f64)]| {
            let median = |of: fn(&(f64, f64)) -> f64| {
                let mut values: Vec<f64> = bin.iter().map(of).collect();
                quantile(&mut values, 0.5)
            };
            Some((median(|w| w.0)?, median(|w| w.1)?))
        };
        let mut rate = Self {
            levels: bins.iter().filter_map(level).collect(),
            reach: f64::INFINITY,
        };
        let mut deviations: Vec<f64> = at_rest
            .iter()
            .map(|w| (w.mean[c] - rate.level(w.temp_c)).abs())
            .collect();
        let sigma = OF_MEDIAN * quantile(&mut deviations, 0.5).unwrap_or(0.0);
        rate.reach = margin + REACH_SIGMAS * sigma;
        rate
    }

    /// Interpolated linearly between the levels of the nearest temperatures; beyond them, extrapolated through the last two.
    fn level(&self, temp_c: f64) -> f64 {
        let [first, .., last] = self.levels.as_slice() else {
            return self.levels.first().map_or(0.0, |l| l.1);
        };
        if !temp_c.is_finite() {
            return 0.5 * (first.1 + last.1);
        }
        let k = self.levels.partition_point(|l| l.0 < temp_c);
        let k = k.clamp(1, self.levels.len() - 1);
        let [(t0, a), (t1, b)] = [self.levels[k - 1], self.levels[k]];
        a + (b - a) * (temp_c - t0) / (t1 - t0)
    }

    fn has(&self, window: &Window, c: usize) -> bool {
        let off = window.mean[c] - self.level(window.temp_c);
        self.levels.is_empty() || off.abs() <= self.reach
    }
}

/// Largest minus smallest value of the reference channels in the recording; all axes of a sensor have that of the widest.
pub(crate) fn reference_spans(condensed: &Condensed) -> [f64; 6] {
    let mut spans = [0.0; 6];
    for sensor in Sensor::BOTH {
        let mut span: f64 = 0.0;
        for c in sensor.channels() {
            let levels = || {
                condensed
                    .blocks
                    .iter()
                    .map(move |b| &b.reference[c])
                    .filter(|l| l.mean.is_finite())
            };
            let [low, high] = extent(levels().flat_map(|l| [l.min, l.max]));
            span = span.max(high - low);
        }
        spans[sensor.channels()].fill(span);
    }
    spans
}

/// An input counts as constant if it moves by less than this share of its span: this admits an encoder's noise, but no ramp of the table.
const CONSTANT_SHARE: f64 = 2e-3;

/// It always counts as constant if it moves by less than this, deg/s or m/s²: if nothing moves, the span is that of the jitter.
const CONSTANT: [f64; 2] = [0.01, 1e-3];

/// By how much reference channel `c` may move and still count as constant, deg/s or m/s²; `spans` are those of [`reference_spans`].
pub(crate) fn tolerance(c: usize, spans: &[f64; 6]) -> f64 {
    (CONSTANT_SHARE * spans[c]).max(CONSTANT[c / 3])
}

fn constant_input<'a>(
    levels: impl Iterator<Item = &'a [Level; 6]> + Clone,
    spans: &[f64; 6],
) -> bool {
    (0..6).all(|c| {
        let known = levels.clone().map(|l| l[c]).filter(|l| l.mean.is_finite());
        let [low, high] = extent(known.flat_map(|l| [l.min, l.max]));
        high - low <= tolerance(c, spans)
    })
}

fn same_input(a: &[Level; 6], b: &[Level; 6], spans: &[f64; 6]) -> bool {
    (0..6).all(|c| {
        let unknown = [a[c].mean, b[c].mean].map(f64::is_nan);
        unknown == [true; 2] || (a[c].mean - b[c].mean).abs() <= tolerance(c, spans)
    })
}
