//! Dwells: the stretches over which a reading is averaged.
//!
//! They are given by the `step` column, or found where all channels are still. Either way each is
//! judged sensor by sensor: a reading at a rail, a stuck channel or a unit in motion would ruin the
//! mean without any trace in it.

use std::fmt;
use std::ops::Range;

use crate::blocks::{Block, Condensed, Level, Moments, Rails};
use crate::error::{Error, Result};
use crate::recording::{Manifest, RAW_COLUMNS, Reference};

/// Length of the window whose variance decides on stillness, s. Long enough that a slow turn shows in
/// the accelerometer (0.5 degrees a second moves it by 30 times its noise), short enough for hands.
pub const WINDOW_S: f64 = 1.0;
/// Left out at both ends of a dwell that was found, s: stillness begins and ends within a window.
pub const GUARD_S: f64 = 0.2;
/// A dwell that is shorter is flagged and not used, s.
pub const SHORTEST_S: f64 = 1.0;
/// Variance of a still window over the quietest, at most. Seven recordings by hand give the same
/// dwells from 7 to 20; at 3 the hands that put a unit down split them, at 100 they join.
pub const STILL_FACTOR: f64 = 10.0;
/// What the gyro is allowed beyond that in recordings by hand with an accelerometer to watch as well. Hands tremble in angle:
/// of 22 rests of each of five units, some had 50 to 230 times the quietest variance in the gyro while the accelerometer
/// saw nothing, and without them the held-out error was threefold. The mean rate of a rest is what it turned by in all
/// over its length, and the tremor leaves next to none.
const GYRO_TREMOR: f64 = 30.0;
/// Variance of a given step over the median of all steps, at most; a fivefold standard deviation.
const STEP_FACTOR: f64 = 25.0;
/// Share of clipped samples from which on a mean is refused: below, it moves by less than a tenth
/// of a standard deviation of one sample.
const CLIPPED_SHARE: f64 = 0.01;
/// Natural logarithm of the odds against a run of equal samples by chance in the whole recording.
const RUN_LOG_ODDS: f64 = 14.0;

/// A sensor triad.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensor {
    /// Gyro triad.
    Gyro,
    /// Accelerometer triad.
    Accel,
}

impl Sensor {
    /// Both triads.
    pub const BOTH: [Self; 2] = [Self::Gyro, Self::Accel];

    /// Its three channels among the six.
    pub fn channels(self) -> Range<usize> {
        match self {
            Self::Gyro => 0..3,
            Self::Accel => 3..6,
        }
    }

    /// `gyro` or `accel`, as in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gyro => "gyro",
            Self::Accel => "accel",
        }
    }

    /// SI unit of its input.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Gyro => "rad/s",
            Self::Accel => "m/s^2",
        }
    }
}

impl fmt::Display for Sensor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Why a dwell is not used for a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// Shorter than [`SHORTEST_S`].
    TooShort,
    /// The variance is far above that of the other dwells.
    NotStill,
    /// Samples of the channel (0..6) lie at a rail.
    Saturated(usize),
    /// The channel (0..6) repeats one value.
    Stuck(usize),
    /// The channel (0..6) has no samples.
    Missing(usize),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooShort => f.write_str("too short"),
            Self::NotStill => f.write_str("not still"),
            Self::Saturated(c) => write!(f, "{} saturated", RAW_COLUMNS[c]),
            Self::Stuck(c) => write!(f, "{} stuck", RAW_COLUMNS[c]),
            Self::Missing(c) => write!(f, "{} missing", RAW_COLUMNS[c]),
        }
    }
}

/// Mean of a raw channel over a dwell.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Mean {
    /// Number of samples averaged.
    pub n: u64,
    /// Their mean, raw units.
    pub mean: f64,
    /// Variance of one sample, raw units squared.
    pub variance: f64,
    /// Samples at a rail, left out.
    pub clipped: u64,
}

/// One dwell.
#[derive(Debug, Clone, PartialEq)]
pub struct Dwell {
    /// Number by the `step` column, or in order of time.
    pub step: i32,
    /// Data row of its first sample, from 0.
    pub first_row: u64,
    /// Number of samples.
    pub rows: u64,
    /// Instant of the first sample, s.
    pub start_s: f64,
    /// Instant of the last sample, s.
    pub last_s: f64,
    /// Rows over rate: n samples span n periods, not n - 1.
    pub duration_s: f64,
    /// Its blocks.
    pub blocks: Range<usize>,
    /// Gyro x, y, z, accelerometer x, y, z, raw.
    pub raw: [Mean; 6],
    /// Known input in SI: rates (rad/s), specific forces (m/s²). Not a number where unknown.
    pub reference: [f64; 6],
    /// Mean temperature, °C, or not a number.
    pub temp_c: f64,
    /// Whether it is a turn of known angle, of which only the mean rate is known.
    pub turn: bool,
    /// Why it is not used for the gyro, if so.
    pub gyro_fault: Option<Fault>,
    /// Why it is not used for the accelerometer, if so.
    pub accel_fault: Option<Fault>,
}

impl Dwell {
    /// Why it is not used for `sensor`, if so.
    pub fn fault(&self, sensor: Sensor) -> Option<Fault> {
        match sensor {
            Sensor::Gyro => self.gyro_fault,
            Sensor::Accel => self.accel_fault,
        }
    }

    /// Time over which the channels of `sensor` are averaged, s: masked samples are gone, and the mean is that of a shorter
    /// dwell.
    pub fn averaged_s(&self, sensor: Sensor) -> f64 {
        let fewest = self.raw[sensor.channels()]
            .iter()
            .map(|m| m.n)
            .min()
            .unwrap_or(0);
        self.duration_s * fewest as f64 / self.rows as f64
    }

    /// Mean raw reading of `sensor`.
    pub fn raw_mean(&self, sensor: Sensor) -> nalgebra::Vector3<f64> {
        let from = sensor.channels().start;
        nalgebra::Vector3::from_fn(|i, _| self.raw[from + i].mean)
    }

    /// Known input of `sensor`, SI; `None` where any of its axes is unknown.
    pub fn input(&self, sensor: Sensor) -> Option<nalgebra::Vector3<f64>> {
        let from = sensor.channels().start;
        let input = nalgebra::Vector3::from_fn(|i, _| self.reference[from + i]);
        input.iter().all(|x| x.is_finite()).then_some(input)
    }
}

/// The dwells of a recording and how they were found.
#[derive(Debug, Clone)]
pub struct Dwells {
    /// In order of time.
    pub list: Vec<Dwell>,
    /// How they were found; `None` if the `step` column says.
    pub detection: Option<Detection>,
    /// Rails of the six channels, as declared or as found.
    pub rails: [Rails; 6],
    /// Longest run of equal samples that chance explains, of the six channels; infinite where nothing can be told.
    pub longest_run: [f64; 6],
    /// What a person should know.
    pub warnings: Vec<String>,
}

/// The thresholds that found the dwells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
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
    pub floor: [f64; 6],
}

impl Dwells {
    /// The dwells of a recording. `still_factor`: see [`STILL_FACTOR`].
    pub fn find(condensed: &Condensed, manifest: &Manifest, still_factor: f64) -> Result<Self> {
        let mut warnings = Vec::new();
        let longest_run = [0, 1, 2, 3, 4, 5]
            .map(|c| longest_run_by_chance(condensed, c).unwrap_or(f64::INFINITY));
        let rails = rails(condensed, manifest, &longest_run, &mut warnings);
        let (ranges, detection) = if condensed.has_steps {
            (by_step(condensed), None)
        } else {
            let (ranges, detection) = by_stillness(condensed, manifest, still_factor)?;
            (ranges, Some(detection))
        };
        let mut list: Vec<Dwell> = ranges
            .into_iter()
            .enumerate()
            .map(|(i, (step, blocks))| {
                let step = step.unwrap_or(i as i32);
                let turn = manifest.turn_steps.contains(&step);
                Dwell {
                    turn,
                    ..dwell(condensed, step, blocks, &rails)
                }
            })
            .collect();
        if list.is_empty() {
            let (problem, remedy) = match condensed.has_steps {
                true => (
                    "every row is in transit: its step is empty or -1",
                    "number the dwells in the column step, or leave the column out to have them found",
                ),
                false => (
                    "no stretch of the recording is still",
                    "hold the unit still for some seconds in every pose, or raise --still",
                ),
            };
            return Err(Error::new("dwells", problem, remedy));
        }
        judge(&mut list, condensed, &longest_run, detection.is_none());
        warn(&list, manifest, &mut warnings);
        Ok(Self {
            list,
            detection,
            rails,
            longest_run,
            warnings,
        })
    }
}

impl Dwells {
    /// The dwells that are not used for `sensor`, as a remark: ` (not used: 3 too short, 1 accel_z saturated)`; empty
    /// if all are used.
    pub fn unused(&self, sensor: Sensor) -> String {
        let mut counts: Vec<(String, usize)> = Vec::new();
        for fault in self.list.iter().filter_map(|d| d.fault(sensor)) {
            let name = fault.to_string();
            match counts.iter_mut().find(|(known, _)| *known == name) {
                Some((_, count)) => *count += 1,
                None => counts.push((name, 1)),
            }
        }
        let all: Vec<String> = counts.iter().map(|(f, n)| format!("{n} {f}")).collect();
        match all.is_empty() {
            true => String::new(),
            false => format!(" (not used: {})", all.join(", ")),
        }
    }
}

/// A stretch of blocks, with its step if that is given.
type Stretch = (Option<i32>, Range<usize>);

fn by_step(condensed: &Condensed) -> Vec<Stretch> {
    let mut ranges: Vec<Stretch> = Vec::new();
    for (i, block) in condensed.blocks.iter().enumerate() {
        match ranges.last_mut() {
            Some((step, range)) if *step == Some(block.step) && range.end == i => range.end = i + 1,
            _ if block.step >= 0 => ranges.push((Some(block.step), i..i + 1)),
            _ => {}
        }
    }
    ranges
}

fn by_stillness(
    condensed: &Condensed,
    manifest: &Manifest,
    factor: f64,
) -> Result<(Vec<Stretch>, Detection)> {
    let blocks = &condensed.blocks;
    let block_s = blocks.iter().map(|b| b.rows).max().unwrap_or(1) as f64 * condensed.period_s;
    let width = ((WINDOW_S / block_s).round() as usize).max(2);
    if blocks.len() < width {
        let problem = format!(
            "the recording lasts {:.2} s, less than the {WINDOW_S} s in which stillness shows",
            condensed.rows as f64 * condensed.period_s
        );
        return Err(Error::new("dwells", problem, "record for longer"));
    }
    let channels: Vec<usize> = (0..6).filter(|&c| condensed.has_raw[c]).collect();
    let windows = windows(blocks, width, &channels);
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
    // A hand that holds still trembles in angle and not in force.
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
        .map(|c| (c, rate_at_rest(&at_rest, c, (factor * floor[c]).sqrt())))
        .collect();
    let turning = |w: &Window| rates.iter().any(|(c, range)| !range.contains(&w.mean[*c]));
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
    // Two steps of a table may follow each other without a still window being disturbed.
    let guard = (GUARD_S / block_s).round() as usize;
    let mut ranges = Vec::new();
    let mut start = None;
    for i in 0..=blocks.len() {
        let open = i < blocks.len()
            && still[i]
            && (start.is_none()
                || (!blocks[i].after_gap
                    && same_input(&blocks[i - 1].reference, &blocks[i].reference, &spans)));
        match (open, start) {
            (true, None) => start = Some(i),
            (false, Some(from)) => {
                // At the ends of the recording nothing was set in motion.
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
        window_s: width as f64 * block_s,
        guard_s: guard as f64 * block_s,
        shortest_s: SHORTEST_S,
        still_factor: factor,
        gyro_still_factor: gyro,
        floor: floor.map(f64::sqrt),
    };
    Ok((ranges, detection))
}

/// Mean and variance of the six raw channels over [`WINDOW_S`].
struct Window {
    mean: [f64; 6],
    variance: [f64; 6],
}

/// The window that begins at each block; `None` where there is a gap in it.
fn windows(blocks: &[Block], width: usize, channels: &[usize]) -> Vec<Option<Window>> {
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
        Window { mean, variance }
    };
    let whole = |w: &[Block]| !w[1..].iter().any(|b| b.after_gap);
    blocks
        .windows(width)
        .map(|w| whole(w).then(|| window(w)))
        .collect()
}

/// Mean readings of channel `c` that a window at rest may have: about the median of the windows that vary little, by
/// `margin` and by five of their own deviations, which hold a drift of the bias.
///
/// A turn about the vertical does not show in the accelerometer, and a slow one hardly in the variance of the gyro.
fn rate_at_rest(at_rest: &[&Window], c: usize, margin: f64) -> std::ops::RangeInclusive<f64> {
    let mut means: Vec<f64> = at_rest.iter().map(|w| w.mean[c]).collect();
    let Some(middle) = quantile(&mut means, 0.5) else {
        return f64::NEG_INFINITY..=f64::INFINITY;
    };
    let mut deviations: Vec<f64> = means.iter().map(|m| (m - middle).abs()).collect();
    let sigma = 1.4826 * quantile(&mut deviations, 0.5).unwrap_or(0.0);
    let reach = margin + 5.0 * sigma;
    middle - reach..=middle + reach
}

/// Largest less smallest value of each reference channel in the recording, by sensor.
fn reference_spans(condensed: &Condensed) -> [f64; 6] {
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
            let high = levels().map(|l| l.max).fold(f64::NEG_INFINITY, f64::max);
            let low = levels().map(|l| l.min).fold(f64::INFINITY, f64::min);
            span = span.max(high - low);
        }
        spans[sensor.channels()].fill(span);
    }
    spans
}

/// An input counts as constant while it moves by less than this share of its span: an encoder's noise,
/// but no ramp of the table.
const CONSTANT_SHARE: f64 = 2e-3;

/// And always while it moves by less than this, deg/s or m/s²: where nothing moves, the span is that of the jitter.
const CONSTANT: [f64; 2] = [0.01, 1e-3];

fn tolerance(c: usize, spans: &[f64; 6]) -> f64 {
    (CONSTANT_SHARE * spans[c]).max(CONSTANT[c / 3])
}

fn constant_input<'a>(
    levels: impl Iterator<Item = &'a [Level; 6]> + Clone,
    spans: &[f64; 6],
) -> bool {
    (0..6).all(|c| {
        let known = levels.clone().map(|l| l[c]).filter(|l| l.mean.is_finite());
        let high = known
            .clone()
            .map(|l| l.max)
            .fold(f64::NEG_INFINITY, f64::max);
        let low = known.map(|l| l.min).fold(f64::INFINITY, f64::min);
        high - low <= tolerance(c, spans)
    })
}

fn same_input(a: &[Level; 6], b: &[Level; 6], spans: &[f64; 6]) -> bool {
    (0..6).all(|c| {
        let unknown = [a[c].mean, b[c].mean].map(f64::is_nan);
        unknown == [true; 2] || (a[c].mean - b[c].mean).abs() <= tolerance(c, spans)
    })
}

/// Moments of several stretches taken together; extremes are not kept.
fn pool(parts: impl Iterator<Item = Moments>) -> Moments {
    parts.fold(Moments::default(), |a, b| {
        let n = a.n + b.n;
        if n == 0 {
            return a;
        }
        let (na, nb) = (f64::from(a.n), f64::from(b.n));
        let shift = b.mean - a.mean;
        Moments {
            n,
            mean: a.mean + shift * nb / f64::from(n),
            m2: a.m2 + b.m2 + shift * shift * na * nb / f64::from(n),
            ..a
        }
    })
}

/// The `share` quantile; reorders `values`.
fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let at = ((values.len() - 1) as f64 * share).round() as usize;
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}

fn dwell(condensed: &Condensed, step: i32, range: Range<usize>, rails: &[Rails; 6]) -> Dwell {
    let blocks = &condensed.blocks[range.clone()];
    let rows: u64 = blocks.iter().map(|b| u64::from(b.rows)).sum();
    let mut raw = [Mean::default(); 6];
    for (c, mean) in raw.iter_mut().enumerate() {
        let mut clipped = 0;
        let pooled = pool(blocks.iter().map(|b| {
            let (kept, masked) = b.raw[c].without_rails(rails[c]);
            clipped += u64::from(masked);
            kept
        }));
        *mean = Mean {
            n: u64::from(pooled.n),
            mean: pooled.mean,
            variance: if pooled.n > 1 {
                pooled.m2 / f64::from(pooled.n - 1)
            } else {
                0.0
            },
            clipped,
        };
    }
    let average = |level: fn(&crate::blocks::Block, usize) -> Level, c: usize| {
        let first = level(&blocks[0], c).mean;
        let sum: f64 = blocks
            .iter()
            .map(|b| f64::from(b.rows) * (level(b, c).mean - first))
            .sum();
        first + sum / rows as f64
    };
    let mut reference = [0, 1, 2, 3, 4, 5].map(|c| average(|b, c| b.reference[c], c));
    for rate in &mut reference[Sensor::Gyro.channels()] {
        *rate = rate.to_radians();
    }
    Dwell {
        step,
        first_row: blocks[0].first_row,
        rows,
        start_s: blocks[0].start_s,
        last_s: blocks[blocks.len() - 1].last_s,
        duration_s: rows as f64 * condensed.period_s,
        blocks: range,
        raw,
        reference,
        temp_c: average(|b, _| b.temp_c, 0),
        turn: false,
        gyro_fault: None,
        accel_fault: None,
    }
}

/// Finds out which dwells are no good for which sensor.
fn judge(list: &mut [Dwell], condensed: &Condensed, longest_run: &[f64; 6], given: bool) {
    for sensor in Sensor::BOTH {
        let channels = || sensor.channels().filter(|&c| condensed.has_raw[c]);
        let typical: Vec<f64> = channels()
            .map(|c| {
                let mut all: Vec<f64> = list.iter().map(|d| d.raw[c].variance).collect();
                quantile(&mut all, 0.5).unwrap_or(0.0)
            })
            .collect();
        for dwell in list.iter_mut() {
            // A turn of known angle has a known mean rate, and is anything but still.
            let turn = dwell.turn;
            let mut fault = None;
            for (k, c) in channels().enumerate() {
                let mean = dwell.raw[c];
                let constant = mean.n > 1 && mean.variance == 0.0;
                fault = fault.or(if mean.n == 0 && mean.clipped == 0 {
                    Some(Fault::Missing(c))
                } else if mean.clipped as f64 > CLIPPED_SHARE * dwell.rows as f64 {
                    Some(Fault::Saturated(c))
                } else if constant && mean.n as f64 > longest_run[c] {
                    Some(Fault::Stuck(c))
                } else if given
                    && !turn
                    && mean.variance > STEP_FACTOR * typical[k]
                    && typical[k] > 0.0
                {
                    Some(Fault::NotStill)
                } else {
                    None
                });
            }
            if dwell.duration_s < SHORTEST_S - 0.5 * condensed.period_s && !turn {
                fault = fault.or(Some(Fault::TooShort));
            }
            match sensor {
                Sensor::Gyro => dwell.gyro_fault = fault,
                Sensor::Accel => dwell.accel_fault = fault,
            }
        }
    }
}

fn warn(list: &[Dwell], manifest: &Manifest, warnings: &mut Vec<String>) {
    let mut by_fault: Vec<(String, Vec<String>)> = Vec::new();
    for dwell in list {
        for sensor in Sensor::BOTH {
            let Some(fault) = dwell.fault(sensor) else {
                continue;
            };
            if matches!(fault, Fault::TooShort) && sensor == Sensor::Accel {
                continue; // said once, for both
            }
            let key = match fault {
                Fault::TooShort => format!("shorter than {SHORTEST_S} s"),
                Fault::NotStill => format!("not still enough for the {sensor}"),
                other => other.to_string(),
            };
            let name = manifest
                .step_labels
                .get(dwell.step as usize)
                .cloned()
                .unwrap_or_else(|| dwell.step.to_string());
            match by_fault.iter_mut().find(|(k, _)| *k == key) {
                Some((_, steps)) => steps.push(name),
                None => by_fault.push((key, vec![name])),
            }
        }
    }
    for (fault, steps) in by_fault {
        let count = steps.len();
        let shown = steps[..count.min(8)].join(", ");
        let more = if count > 8 { ", ..." } else { "" };
        let (noun, verb) = if count == 1 {
            ("dwell", "is")
        } else {
            ("dwells", "are")
        };
        warnings.push(format!(
            "{count} {noun} ({shown}{more}) {verb} not used: {fault}"
        ));
    }
    let clipped: u64 = list
        .iter()
        .flat_map(|d| d.raw.iter().map(|m| m.clipped))
        .sum();
    if clipped > 0 {
        warnings.push(format!(
            "{} within dwells at a rail of the converter: masked",
            crate::blocks::counted(clipped, "sample")
        ));
    }
}

/// Longest run of equal samples that chance explains in channel `c`, from how often neighbours are
/// equal where the channel works. `None`: they mostly are, and nothing can be told.
fn longest_run_by_chance(condensed: &Condensed, c: usize) -> Option<f64> {
    let mut shares: Vec<f64> = condensed
        .blocks
        .iter()
        .map(|b| b.raw[c])
        .filter(|m| m.n > 1)
        .map(|m| f64::from(m.repeats) / f64::from(m.n - 1))
        .collect();
    let share = quantile(&mut shares, 0.5)?.max(1e-3);
    let odds = RUN_LOG_ODDS + (condensed.rows as f64).ln();
    (share < 0.8).then(|| (1.0 + odds / -share.ln()).max(5.0))
}

/// Rails of the six channels: as declared, at the ends of a 16-bit code, or where the largest or smallest
/// value of a whole recording is repeated more often in a row than chance allows.
fn rails(
    condensed: &Condensed,
    manifest: &Manifest,
    longest_run: &[f64; 6],
    warnings: &mut Vec<String>,
) -> [Rails; 6] {
    let mut rails = [Rails::default(); 6];
    for (c, rail) in rails.iter_mut().enumerate() {
        if !condensed.has_raw[c] {
            continue;
        }
        let declared = manifest
            .rails
            .and_then(|r| if c < 3 { r.gyro } else { r.accel });
        if let Some([low, high]) = declared {
            *rail = Rails {
                low: Some(low),
                high: Some(high),
            };
            continue;
        }
        let moments = || {
            condensed
                .blocks
                .iter()
                .map(move |b| b.raw[c])
                .filter(|m| m.n > 0)
        };
        let high = moments().map(|m| m.max).fold(f64::NEG_INFINITY, f64::max);
        let low = moments().map(|m| m.min).fold(f64::INFINITY, f64::min);
        let chance = longest_run[c];
        if low == high {
            continue;
        }
        for (value, name) in [(high, "highest"), (low, "lowest")] {
            // Blocks are short: a run goes on through those that hold nothing else.
            let (mut longest, mut run) = (0.0_f64, 0.0);
            for m in moments() {
                if m.min == m.max && m.max == value {
                    run += f64::from(m.n);
                } else {
                    run = 0.0;
                    if m.run_value == value {
                        longest = longest.max(f64::from(m.run));
                    }
                }
                longest = longest.max(run);
            }
            if longest > chance {
                warnings.push(format!(
                    "{}: the {name} value {value} comes {longest} times in a row, chance explains {:.0}: taken for a rail",
                    RAW_COLUMNS[c], chance.floor()
                ));
                if value == high {
                    rail.high = Some(value)
                } else {
                    rail.low = Some(value)
                }
            }
        }
    }
    rails
}

/// Refuses a recording in which a channel never changes.
pub fn refuse_dead_channels(condensed: &Condensed, place: &str) -> Result<()> {
    for c in 0..6 {
        if !condensed.has_raw[c] {
            continue;
        }
        let mut moments = condensed
            .blocks
            .iter()
            .map(|b| b.raw[c])
            .filter(|m| m.n > 0);
        let Some(first) = moments.next() else {
            return Err(Error::new(
                format!("{place}, column {}", RAW_COLUMNS[c]),
                "every cell is empty or not a number",
                "leave the sensor's columns out, or import the right ones",
            ));
        };
        if first.min == first.max && moments.all(|m| m.min == first.min && m.max == first.min) {
            return Err(Error::new(
                format!("{place}, column {}", RAW_COLUMNS[c]),
                format!("the channel is stuck at {} throughout", first.min),
                "check its wiring, or that the right column was imported",
            ));
        }
    }
    Ok(())
}
