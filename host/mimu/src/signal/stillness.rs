//! Finds dwells that are not numbered: segments with one level and a scatter no larger than that of noise.

use std::ops::Range;

use serde::Serialize;

use crate::fault::SHORTEST_S;
use crate::quantity::Sensor;
use crate::signal::blocks::{Condensed, Level, StepBlocks, extent, quantile};
use crate::signal::change_point;
use crate::signal::log_fault;
use crate::signal::rate_at_rest::RateAtRest;
use crate::signal::window::{Window, in_bursts, windows};
use mimu_recording::statistics::mean_and_variance;
use mimu_recording::{Error, Manifest, Reference, Result, health};

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

/// Noise of the accelerometer, root sum of squares of the axes as a share of gravity, above which it is that of a hand: a turn then begins unseen for up to
/// half a second. In 24 dwells in a hand that trembles by 20 mg, these ends made means 8.9 mm/s² too large, and scale factors 0.09 %; without them 0.3 mm/s².
/// Digital parts at rest have 5 to 7 mg.
const TREMOR: f64 = 1.2e-2;
/// Longest beginning or end of a turn in a segment, s.
const MOST_TURN_S: f64 = 0.6;
/// Standard deviations of the means of blocks from which on the unit turns.
const OFF: f64 = 3.0;

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
pub struct DwellSearch {
    /// See [`STILL_FACTOR`].
    pub still_factor: f64,
    /// Where they are taken from.
    pub steps: Steps,
}

impl Default for DwellSearch {
    /// By [`STILL_FACTOR`].
    fn default() -> Self {
        STILL_FACTOR.into()
    }
}

impl From<f64> for DwellSearch {
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

/// What [`find`] found.
#[derive(Debug, Clone)]
pub(crate) struct Segmentation {
    /// The still segments, in order.
    pub ranges: Vec<StepBlocks>,
    /// The thresholds; if the log has a fault, those before it.
    pub detection: Detection,
    /// A fault of the log: no calibration holds before and after it.
    pub fault: Option<health::Finding>,
}

/// Finds the still segments of a recording. The part before a fault of the log and the part after it are searched separately, because each
/// has its own noise.
pub(crate) fn find(
    condensed: &Condensed,
    manifest: &Manifest,
    factor: f64,
) -> Result<Segmentation> {
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
    let search = Search {
        condensed,
        reference: manifest.reference,
        factor,
        width,
        // The ends of turns are cut by their level.
        guard: match manifest.reference {
            Reference::TurntableRate => 0,
            Reference::Gravity | Reference::Table => (GUARD_S / block_s).round() as usize,
        },
        block_s,
        spans: reference_spans(condensed),
        windows: windows(blocks, width, &channels, bursts),
        channels,
        bursts,
    };
    let (ranges, detection) = search.still(0..blocks.len());
    let by_hand = manifest.reference == Reference::Gravity && condensed.has_raw[3];
    let fault = by_hand
        .then(|| log_fault::find(&search.quiet(), condensed, manifest))
        .flatten();
    let Some((fault, block)) = fault else {
        return Ok(Segmentation {
            ranges,
            detection,
            fault: None,
        });
    };
    let (mut ranges, detection) = search.still(0..block);
    ranges.extend(search.still(block + 1..blocks.len()).0);
    Ok(Segmentation {
        ranges,
        detection,
        fault: Some(fault),
    })
}

/// A search for still segments.
struct Search<'a> {
    condensed: &'a Condensed,
    reference: Reference,
    factor: f64,
    /// Blocks of a window.
    width: usize,
    /// Blocks that are left out at both ends of a segment.
    guard: usize,
    block_s: f64,
    spans: [f64; 6],
    windows: Vec<Option<Window>>,
    channels: Vec<usize>,
    bursts: bool,
}

impl Search<'_> {
    /// Whether hands turn the unit, and an accelerometer shows it.
    fn by_hand(&self) -> bool {
        self.reference == Reference::Gravity && self.condensed.has_raw[3]
    }

    /// The windows that lie in the blocks `part`, with their first blocks.
    fn windows_in(&self, part: &Range<usize>) -> impl Iterator<Item = (usize, &Window)> {
        let last = (part.end + 1).saturating_sub(self.width);
        let starts = part.start..last.max(part.start);
        starts.filter_map(move |i| Some((i, self.windows[i].as_ref()?)))
    }

    /// Largest variance of the gyro in a still window, relative to the quietest. A hand at rest trembles in angle but hardly in force.
    fn gyro_factor(&self) -> f64 {
        match self.by_hand() {
            true => GYRO_TREMOR * self.factor,
            false => self.factor,
        }
    }

    /// Largest variances of a still window, if `floor` are those of the quietest.
    fn limits(&self, floor: &[f64; 6]) -> [f64; 6] {
        let mut limits = floor.map(|f| self.factor * f);
        for c in Sensor::Gyro.channels() {
            limits[c] = self.gyro_factor() * floor[c];
        }
        limits
    }

    /// Segments that hardly vary, whatever the gyro reads: rests before and after a fault of the log.
    fn quiet(&self) -> Vec<Range<usize>> {
        let part = 0..self.condensed.blocks.len();
        let Some(floor) = Floor::of(self, &part) else {
            return Vec::new();
        };
        let mut limits = self.limits(&floor.variance);
        for c in Sensor::Accel.channels() {
            limits[c] *= OTHER_RANGE;
        }
        let quiet = |_, w: &Window| self.channels.iter().all(|&c| w.variance[c] <= limits[c]);
        self.segments(&part, quiet)
    }

    /// The still segments among the blocks `part`.
    fn still(&self, part: Range<usize>) -> (Vec<StepBlocks>, Detection) {
        let floor = Floor::of(self, &part);
        let variance = floor.as_ref().map_or([0.0; 6], |floor| floor.variance);
        let limits = self.limits(&variance);
        let detection = Detection {
            block_s: self.block_s,
            window_s: self.width as f64 * self.block_s,
            guard_s: self.guard as f64 * self.block_s,
            shortest_s: SHORTEST_S,
            still_factor: self.factor,
            gyro_still_factor: self.gyro_factor(),
            floor: variance.map(f64::sqrt),
        };
        let rests = floor.as_ref().is_some_and(|floor| floor.is_of_rests);
        if self.reference == Reference::Gravity && !rests {
            return (Vec::new(), detection);
        }
        let turntable = Turntable::of(self, &part, &limits);
        let quiet = |w: &Window| match &turntable {
            Some(turntable) => turntable.is_even(w, &limits),
            None => self.channels.iter().all(|&c| w.variance[c] <= limits[c]),
        };
        let at_rest: Vec<&Window> = self.windows_in(&part).map(|(_, w)| w).collect();
        let at_rest: Vec<&Window> = at_rest.into_iter().filter(|w| quiet(w)).collect();
        let rates: Vec<(usize, RateAtRest)> = Sensor::Gyro
            .channels()
            .filter(|&c| self.by_hand() && self.condensed.has_raw[c])
            .map(|c| {
                let margin = (self.factor * variance[c]).sqrt();
                (c, RateAtRest::of(&at_rest, c, margin))
            })
            .collect();
        let turning = |w: &Window| rates.iter().any(|(c, rate)| !rate.has(w, *c));
        let blocks = &self.condensed.blocks;
        let constant = |i: usize| {
            let levels = blocks[i..i + self.width].iter().map(|b| &b.reference);
            self.reference == Reference::Gravity || constant_input(levels, &self.spans)
        };
        let mut segments = self.segments(&part, |i, w| quiet(w) && !turning(w) && constant(i));
        // A table's inputs are known, and end a dwell where they change. A gyro's level at rest also moves with its bias.
        let by_level = match self.reference {
            Reference::Gravity => Sensor::Accel.channels(),
            Reference::TurntableRate => Sensor::Gyro.channels(),
            Reference::Table => 0..0,
        };
        change_point::split(&mut segments, self.condensed, by_level, self.width);
        let trembles = self.trembles(&variance);
        let guarded = segments.into_iter().filter_map(|segment| {
            // At the ends of the recording there is no motion to guard against.
            let from = match segment.start {
                0 => 0,
                start => start + self.guard,
            };
            let to = match segment.end == blocks.len() {
                true => segment.end,
                false => segment.end.saturating_sub(self.guard),
            };
            let range = from..to;
            let range = match trembles {
                true => self.without_turns(range),
                false => range,
            };
            (!range.is_empty()).then_some((None, range))
        });
        (guarded.collect(), detection)
    }

    /// Whether the quietest windows, with these variances, are those of a hand.
    fn trembles(&self, floor: &[f64; 6]) -> bool {
        let accel = || Sensor::Accel.channels();
        // Half of what an axis reads over all poses: volts have a zero that is no force.
        let half = |c: usize| {
            let windows = self.windows.iter().flatten();
            let mut means: Vec<f64> = windows.map(|w| w.mean[c]).collect();
            let [low, high] = [0.02, 0.98].map(|q| quantile(&mut means, q).unwrap_or(0.0));
            0.5 * (high - low)
        };
        let gravity = accel().map(half).fold(0.0, f64::max);
        let noise = accel().map(|c| floor[c]).sum::<f64>();
        // In one pose all that differs is noise.
        let turned = gravity > 10.0 * noise.sqrt();
        self.by_hand() && turned && noise > (TREMOR * gravity).powi(2)
    }

    /// The blocks of a segment without those at its ends whose means the others contradict: the beginning of a turn hides in the variance of a hand that trembles,
    /// and not in the mean.
    fn without_turns(&self, range: Range<usize>) -> Range<usize> {
        let most = (MOST_TURN_S / self.block_s).round() as usize;
        if range.len() < 4 * most {
            return range;
        }
        let blocks = &self.condensed.blocks;
        let inner = range.start + most..range.end - most;
        let usual = |c: usize| {
            let means = blocks[inner.clone()].iter().map(|b| b.raw[c].mean);
            let (mean, square) = mean_and_variance(means);
            (c, mean, square)
        };
        let usual: Vec<_> = self.channels.iter().map(|c| usual(*c)).collect();
        let turns = |i: usize| {
            let off = |(c, mean, square): &(usize, f64, f64)| {
                (blocks[i].raw[*c].mean - mean).powi(2) > OFF * OFF * square
            };
            usual.iter().any(off)
        };
        let from = (range.start..inner.start).rev().find(|i| turns(*i));
        let to = (inner.end..range.end).find(|i| turns(*i));
        // The block before is part of the turn, too.
        from.map_or(range.start, |i| i + 2)..to.map_or(range.end, |i| i - 1)
    }

    /// The segments of `part` that windows cover which `is_still` accepts. Two blocks belong to one segment if a window contains both: two
    /// poses that follow each other without a pause are still up to their border, and only a window across it shows the change.
    fn segments(
        &self,
        part: &Range<usize>,
        is_still: impl Fn(usize, &Window) -> bool,
    ) -> Vec<Range<usize>> {
        let blocks = &self.condensed.blocks;
        let (mut still, mut joined) = (vec![false; part.len()], vec![false; part.len()]);
        for (i, window) in self.windows_in(part) {
            if is_still(i, window) {
                let from = i - part.start;
                still[from..from + self.width].fill(true);
                joined[from + 1..from + self.width].fill(true);
            }
        }
        let mut segments: Vec<Range<usize>> = Vec::new();
        for i in part.clone().filter(|i| still[i - part.start]) {
            let continues = |last: &Range<usize>| {
                last.end == i
                    && joined[i - part.start]
                    && (self.bursts || !blocks[i].after_gap)
                    && same_input(&blocks[i - 1].reference, &blocks[i].reference, &self.spans)
            };
            match segments.last_mut() {
                Some(last) if continues(last) => last.end = i + 1,
                _ => segments.push(i..i + 1),
            }
        }
        segments
    }
}

/// The quietest windows.
struct Floor {
    /// Variance of each channel in them, raw units squared; zero if nothing varies.
    variance: [f64; 6],
    /// Whether they are rests: their variance is that of noise.
    is_of_rests: bool,
}

/// Factor for the accelerometer's variance where a fault of the log is searched: in counts, noise is four times as large in a range a quarter
/// as wide.
const OTHER_RANGE: f64 = 16.0;
/// Share of the windows that are the quietest.
const QUIETEST: f64 = 0.05;
/// Windows are alike if the product of their variances, without that of the channel that stands out most, differs by at most this factor:
/// that of two in each of five.
const ALIKE: f64 = 32.0;
/// If the variance of a channel in the windows that are quietest in the other channels exceeds its own floor by this factor, the channel
/// has become quiet in a part of the recording: shorted, at a rail, or exchanged for another. Below this factor [`STILL_FACTOR`] accepts the
/// other part nearly as well. Hands that tremble reach 11 in the gyro, and columns that change places 20 to 90.
const BECAME_QUIET: f64 = 12.0;
/// Largest share of the variance of a window that may be between blocks, in the median of the channels, if it is noise. White noise at 100 Hz
/// has 0.09, noise filtered at 5 Hz about 0.4, and the steps of somebody who walks 0.8 and more.
const BETWEEN_BLOCKS: f64 = 0.7;

impl Floor {
    /// That of the windows in the blocks `part`; `None` if there are none.
    fn of(search: &Search, part: &Range<usize>) -> Option<Self> {
        let windows: Vec<&Window> = search.windows_in(part).map(|(_, w)| w).collect();
        let positive = |windows: &[&Window], c: usize| -> Vec<f64> {
            let variances = windows.iter().map(|w| w.variance[c]);
            variances.filter(|v| *v > 0.0).collect()
        };
        let mut variance = [0.0; 6];
        for &c in &search.channels {
            // A noiseless simulation has no floor: then anything that varies at all is motion.
            let quietest = quantile(&mut positive(&windows, c), QUIETEST);
            variance[c] = quietest.unwrap_or(0.0);
        }
        // Of a coarse channel some windows are constant; they are no quieter than those that alternate between two codes.
        let score = |w: &Window| {
            let varying = search.channels.iter().filter(|c| variance[**c] > 0.0);
            let ratios = varying.map(|&c| (w.variance[c] / variance[c]).max(0.1).ln());
            let (sum, largest) = ratios.fold((0.0, 0.0), |(sum, largest): (f64, f64), ratio| {
                (sum + ratio, largest.max(ratio))
            });
            sum - largest
        };
        let scores: Vec<f64> = windows.iter().map(|w| score(w)).collect();
        let limit = quantile(&mut scores.clone(), QUIETEST)? + f64::ln(ALIKE);
        let scored = windows.iter().zip(&scores);
        let together: Vec<&Window> = scored
            .filter(|(_, score)| **score <= limit)
            .map(|(w, _)| *w)
            .collect();
        for &c in &search.channels {
            let noise = |w: &&&Window| w.between[c] <= BETWEEN_BLOCKS;
            let noise: Vec<&Window> = together.iter().filter(noise).copied().collect();
            let usual = quantile(&mut positive(&noise, c), 0.9).unwrap_or(0.0);
            if usual > BECAME_QUIET * variance[c] {
                variance[c] = usual;
            }
        }
        let between = |c: usize| {
            let mut shares: Vec<f64> = together.iter().map(|w| w.between[c]).collect();
            quantile(&mut shares, 0.5).unwrap_or(0.0)
        };
        let mut shares: Vec<f64> = search.channels.iter().map(|c| between(*c)).collect();
        let noiseless = variance == [0.0; 6];
        let is_of_rests = noiseless || quantile(&mut shares, 0.5)? <= BETWEEN_BLOCKS;
        Some(Self {
            variance,
            is_of_rests,
        })
    }
}

/// Largest standard deviation of an even turn, as a share of its rate: platters of record players wobble and change their speed by 0.1 to
/// 0.2 %.
const WOBBLE: f64 = 3e-3;

/// What a gyro reads at rest on a turntable. A turning platter wobbles a hundred times more than a unit at rest.
struct Turntable {
    at_rest: [f64; 3],
}

impl Turntable {
    fn of(search: &Search, part: &Range<usize>, limits: &[f64; 6]) -> Option<Self> {
        let gyro = Sensor::Gyro.channels();
        if search.reference != Reference::TurntableRate {
            return None;
        }
        let quiet: Vec<&Window> = search.windows_in(part).map(|(_, w)| w).collect();
        let quiet = |c: usize| -> Vec<f64> {
            let still = |w: &&&Window| gyro.clone().all(|c| w.variance[c] <= limits[c]);
            quiet.iter().filter(still).map(|w| w.mean[c]).collect()
        };
        Some(Self {
            at_rest: [0, 1, 2].map(|c| quantile(&mut quiet(c), 0.5).unwrap_or(0.0)),
        })
    }

    /// Whether the unit rests or turns evenly, by its gyro: a turn about an axis that is not vertical moves gravity through the axes of the accelerometer.
    fn is_even(&self, w: &Window, limits: &[f64; 6]) -> bool {
        let rate = Sensor::Gyro.channels().map(|c| w.mean[c] - self.at_rest[c]);
        let wobble = WOBBLE * WOBBLE * rate.map(|r| r * r).sum::<f64>();
        Sensor::Gyro
            .channels()
            .all(|c| w.variance[c] <= limits[c] + wobble)
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
