//! Dwells: the segments over which a reading is averaged.
//!
//! They are given by the `step` column, or found where all channels are still. Either way each is
//! judged sensor by sensor: a reading at a rail, a stuck channel or a unit in motion would ruin the
//! mean without any trace in it.

use std::ops::Range;

pub use crate::fault::Fault;
use crate::fault::SHORTEST_S;
use crate::quantity::{PerSensor, Sensor};
use crate::signal::blocks::{Condensed, Level, Rails, StepBlocks, pool, quantile};
use crate::signal::course::{Course, Motion, motion};
use crate::signal::rails::{self, longest_run_by_chance};
use crate::signal::ramp::ramps;
use crate::signal::rest::{self, Rest};
use crate::signal::slow_turns::{self, Reading};
use crate::signal::stillness::{self, Detection, DwellSearch, Steps, reference_spans};
use crate::warning::Warning;
use mimu_recording::{Argument, Error, Manifest, Reference, Result, health};

/// Largest variance of a numbered dwell relative to the median of all: five times the standard deviation.
const STEP_FACTOR: f64 = 25.0;
/// Largest share of the variance of the block means that the known input of a dwell may leave unexplained. A diagnosis finds errors of a
/// tenth of the input; the reference of another dwell explains nothing.
const UNFOLLOWED: f64 = 0.02;
/// Rate below which an accelerometer off the axis senses almost no centripetal force, rad/s (10 deg/s): at 10 mm it is 0.3 mm/s².
const SLOW: f64 = 0.175;
/// A mean with a larger share of clipped samples is refused. A smaller share moves it by less than a tenth of a standard deviation of one
/// sample.
const CLIPPED_SHARE: f64 = 0.01;

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
    /// Whether the known input of gyro and accelerometer moves within it.
    pub moves: [bool; 2],
    /// Whether no bias explains the gyro's reading, as in a slow turn about the vertical: then the dwell is a pose, but not a rest.
    pub turns_slowly: bool,
    /// Why it is not used for a sensor, if so.
    pub faults: PerSensor<Option<Fault>>,
}

impl Dwell {
    /// Whether a table turns the unit so fast that an accelerometer off the axis would show it.
    pub fn spins(&self) -> bool {
        self.input(Sensor::Gyro)
            .is_some_and(|rate| rate.norm() > SLOW)
    }

    /// Whether the known input of `sensor` moves within it: then it shows more than its mean.
    pub fn moves(&self, sensor: Sensor) -> bool {
        self.moves[sensor as usize]
    }

    /// Time over which the channels of `sensor` are averaged, s: masked samples shorten it.
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

/// A dwell, or a turn between two, that errs by far more than the others predict.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftOut {
    /// A dwell of the accelerometer, or a turn of the gyro.
    pub sensor: Sensor,
    /// Index of the dwell, or of that in which the turn begins.
    pub from: usize,
    /// Index of the dwell, or of that in which the turn ends.
    pub to: usize,
    /// Its error against the prediction of the others: m/s², or rad.
    pub error: f64,
    /// The same in standard deviations.
    pub sigmas: f64,
}

/// The dwells, and turns that end in them, that a fit uses even if the others contradict them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Keep {
    /// None: what the others contradict is left out and named.
    #[default]
    Nothing,
    /// All.
    Everything,
    /// Those with these numbers.
    Steps(Vec<i32>),
}

impl Keep {
    /// Whether nothing may be left out.
    pub fn everything(&self) -> bool {
        *self == Self::Everything
    }

    /// Whether the dwell of `step` may not be left out.
    pub fn keeps(&self, step: i32) -> bool {
        match self {
            Self::Nothing => false,
            Self::Everything => true,
            Self::Steps(steps) => steps.contains(&step),
        }
    }
}

/// The dwells of a recording and how they were found.
#[derive(Debug, Clone)]
pub struct Dwells {
    /// In order of time.
    pub list: Vec<Dwell>,
    /// How they were found; `None` if the `step` column gives them.
    pub detection: Option<Detection>,
    /// A row from which on the readings mean something else; no fit uses such a recording.
    pub fault: Option<health::Finding>,
    /// Rails of the six channels, as declared or as found.
    pub rails: [Rails; 6],
    /// Longest run of equal samples that chance explains, of the six channels; infinite if there is no such limit.
    pub longest_run: [f64; 6],
    /// What a fit has left out.
    pub left_out: Vec<LeftOut>,
    /// What a fit may not leave out.
    pub keep: Keep,
    /// What a person should know.
    pub warnings: Vec<Warning>,
}

impl Dwells {
    /// The dwells of a recording.
    pub fn find(
        condensed: &Condensed,
        manifest: &Manifest,
        search: impl Into<DwellSearch>,
    ) -> Result<Self> {
        let search = search.into();
        let mut warnings = Vec::new();
        let mut longest_run = [0, 1, 2, 3, 4, 5]
            .map(|c| longest_run_by_chance(condensed, c).unwrap_or(f64::INFINITY));
        let rails = rails::find(condensed, manifest, &mut warnings);
        let given = are_given(condensed, search)?;
        let at_rest = search.steps == Steps::AtRest;
        let by_hand = manifest.reference == Reference::Gravity;
        let segments = if given {
            Segments::from(by_step(condensed))
        } else if at_rest {
            Segments::from(vec![(None, 0..condensed.blocks.len())])
        } else {
            Segments::still(condensed, manifest, search, &mut warnings)?
        };
        let mut list = segments.dwells(condensed, manifest, &rails);
        if list.is_empty() {
            return Err(no_dwells(given, condensed.has_steps));
        }
        for (c, longest) in longest_run.iter_mut().enumerate() {
            if is_coarse(&list, condensed.quantisation_step[c], c) {
                *longest = f64::INFINITY;
            }
        }
        let judged = given && search.steps != Steps::Given;
        let too_fast = match manifest.reference {
            Reference::Table => find_moving(&mut list, condensed),
            Reference::Gravity | Reference::TurntableRate => vec![[false; 2]; list.len()],
        };
        judge(&mut list, condensed, (&longest_run, &rails), judged);
        name_too_fast(&mut list, &too_fast);
        if !given && by_hand && !at_rest {
            leave_out_turning(&mut list, condensed);
            warnings.extend(mark_slow_turns(&mut list));
        }
        warnings.extend(segments.fault.map(Warning::Health));
        warn(&list, manifest, &mut warnings);
        Ok(Self {
            list,
            detection: segments.detection,
            fault: segments.fault,
            rails,
            longest_run,
            left_out: Vec::new(),
            keep: Keep::default(),
            warnings,
        })
    }

    /// The dwells that are not used for `sensor`, as a remark: ` (not used: 3 too short, 1 accel_z saturated)`; empty
    /// if all are used.
    pub fn unused(&self, sensor: Sensor) -> String {
        let mut counts: Vec<(Fault, usize)> = Vec::new();
        for fault in self.list.iter().filter_map(|d| d.faults[sensor]) {
            match counts.iter_mut().find(|(known, _)| *known == fault) {
                Some((_, count)) => *count += 1,
                None => counts.push((fault, 1)),
            }
        }
        let all: Vec<String> = counts.iter().map(|(f, n)| format!("{n} {f}")).collect();
        match all.is_empty() {
            true => String::new(),
            false => format!(" (not used: {})", all.join(", ")),
        }
    }

    /// Whether dwells of the `step` column are not used for `sensor` because they are not still; [`Steps::Given`] would use them.
    pub fn are_judged_not_still(&self, sensor: Sensor) -> bool {
        let not_still = |d: &Dwell| d.faults[sensor] == Some(Fault::NotStill);
        self.detection.is_none() && self.list.iter().any(not_still)
    }
}

/// Whether the `step` column gives the dwells.
fn are_given(condensed: &Condensed, search: DwellSearch) -> Result<bool> {
    match search.steps {
        Steps::Given if !condensed.has_steps => {
            let problem = "the dwells were requested from the column step, and the recording has no such column";
            let error = Error::new("dwells", problem, "let mimu find the dwells");
            Err(error.about(Argument::StepsFound))
        }
        Steps::Given | Steps::AsRecorded => Ok(condensed.has_steps),
        Steps::Found | Steps::AtRest => Ok(false),
    }
}

/// The blocks of the dwells, and how they were found.
struct Segments {
    ranges: Vec<StepBlocks>,
    detection: Option<Detection>,
    fault: Option<health::Finding>,
}

impl From<Vec<StepBlocks>> for Segments {
    fn from(ranges: Vec<StepBlocks>) -> Self {
        Self {
            ranges,
            detection: None,
            fault: None,
        }
    }
}

impl Segments {
    /// Those in which all channels are still.
    fn still(
        condensed: &Condensed,
        manifest: &Manifest,
        search: DwellSearch,
        warnings: &mut Vec<Warning>,
    ) -> Result<Self> {
        let found = stillness::find(condensed, manifest, search.still_factor)?;
        let (mut ranges, detection) = (found.ranges, found.detection);
        let ends = match manifest.reference {
            Reference::Gravity => Some(rest::AT_ENDS),
            Reference::TurntableRate => Some(rest::AT_ENDS_OF_TURNS),
            Reference::Table => None,
        };
        let (cut, blocks) = ends.map_or((0, 0), |ends| rest::walk_in(&mut ranges, condensed, ends));
        if cut > 0 && manifest.reference == Reference::Gravity {
            warnings.push(Warning::DwellsCut {
                count: cut,
                cut_s: blocks as f64 * detection.block_s,
            });
        }
        Ok(Self {
            ranges,
            detection: Some(detection),
            fault: found.fault,
        })
    }

    fn dwells(&self, condensed: &Condensed, manifest: &Manifest, rails: &[Rails; 6]) -> Vec<Dwell> {
        let each = self.ranges.iter().enumerate().map(|(i, (step, blocks))| {
            let step = step.unwrap_or(i as i32);
            let turn = manifest.turn_steps.contains(&step);
            Dwell {
                turn,
                ..dwell(condensed, step, blocks.clone(), rails)
            }
        });
        each.collect()
    }
}

/// `given` says whether the `step` column was to give the dwells.
fn no_dwells(given: bool, has_steps: bool) -> Error {
    let (problem, remedy) = match given {
        true => (
            "every row is in transit: its number in the column step is empty or -1",
            "number the dwells in the column step, or leave the column out to let mimu find the dwells",
        ),
        false => (
            "the recording is nowhere still",
            "hold the unit still for some seconds in every pose, or allow a larger variance",
        ),
    };
    let error = Error::undetermined("dwells", problem, remedy);
    match given {
        true => error.about(Argument::StepsFound),
        false if has_steps => error
            .map(|e| e.remedy += ", or take the dwells of the step column as given")
            .about(Argument::StillFactor)
            .about(Argument::StepsGiven),
        false => error.about(Argument::StillFactor),
    }
}

/// Whether the quantisation `step` of channel `c` is coarser than its noise within dwells. Such a channel repeats one value through whole dwells
/// without being stuck.
fn is_coarse(list: &[Dwell], step: Option<f64>, c: usize) -> bool {
    let Some(step) = step else { return false };
    let mut changing: Vec<f64> = list
        .iter()
        .map(|d| d.raw[c].variance)
        .filter(|v| *v > 0.0)
        .collect();
    quantile(&mut changing, 0.5).is_none_or(|v| health::is_coarse(v, step))
}

fn by_step(condensed: &Condensed) -> Vec<StepBlocks> {
    let mut ranges: Vec<StepBlocks> = Vec::new();
    for (i, block) in condensed.blocks.iter().enumerate() {
        match ranges.last_mut() {
            Some((step, range)) if *step == Some(block.step) && range.end == i => range.end = i + 1,
            _ if block.step >= 0 => ranges.push((Some(block.step), i..i + 1)),
            _ => {}
        }
    }
    ranges
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
    let average = |level: fn(&crate::signal::blocks::Block, usize) -> Level, c: usize| {
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
        moves: [false; 2],
        turns_slowly: false,
        faults: PerSensor::default(),
    }
}

/// Excludes dwells that turn evenly, for both sensors.
fn leave_out_turning(list: &mut [Dwell], condensed: &Condensed) {
    let usable = |d: &&Dwell| Sensor::BOTH.iter().all(|s| d.faults[*s].is_none());
    let judged: Vec<&Dwell> = list.iter().filter(usable).collect();
    let rests = judged.iter().map(|d| Rest {
        blocks: d.blocks.clone(),
        mean: d.raw.map(|m| m.mean),
        duration_s: d.duration_s,
        ramps: ramps(&condensed.blocks[d.blocks.clone()], d.duration_s),
    });
    let turning = rest::turning(&rests.collect::<Vec<_>>(), condensed);
    let starts = judged.iter().zip(turning).filter(|(_, turning)| *turning);
    let starts: Vec<u64> = starts.map(|(d, _)| d.first_row).collect();
    for dwell in list.iter_mut().filter(|d| starts.contains(&d.first_row)) {
        dwell.faults = PerSensor::both(Some(Fault::Turning));
    }
}

/// Marks the dwells that are poses of the accelerometer but not rests of the gyro; returns the warning about them.
fn mark_slow_turns(list: &mut [Dwell]) -> Option<Warning> {
    let usable = |d: &&mut Dwell| Sensor::BOTH.iter().all(|s| d.faults[*s].is_none());
    let mut usable: Vec<&mut Dwell> = list.iter_mut().filter(usable).collect();
    let complete = usable.iter().all(|d| d.raw.iter().all(|m| m.n > 0));
    if !complete {
        return None;
    }
    let reading = |d: &&mut Dwell| Reading {
        mean: d.raw.map(|m| m.mean),
        duration_s: d.duration_s,
    };
    let readings: Vec<Reading> = usable.iter().map(reading).collect();
    let slow = slow_turns::find(&readings);
    for (dwell, slow) in usable.iter_mut().zip(slow) {
        dwell.turns_slowly = slow;
    }
    let steps: Vec<String> = usable
        .iter()
        .filter(|d| d.turns_slowly)
        .map(|d| d.step.to_string())
        .collect();
    (!steps.is_empty()).then_some(Warning::SlowTurns { dwells: steps })
}

/// Marks the dwells whose known inputs move; returns for which sensors of each dwell the input moves too fast.
fn find_moving(list: &mut [Dwell], condensed: &Condensed) -> Vec<[bool; 2]> {
    let spans = reference_spans(condensed);
    let each = list.iter_mut().map(|dwell| {
        // In a turn of known angle only the mean rate is known.
        if dwell.turn {
            return [false; 2];
        }
        let blocks = &condensed.blocks[dwell.blocks.clone()];
        let found = Sensor::BOTH.map(|s| motion(blocks, s, &spans));
        dwell.moves = found.map(|m| m == Motion::Moves);
        found.map(|m| m == Motion::TooFast)
    });
    each.collect()
}

/// Where the input of a dwell moves too fast, that is why it is not still.
fn name_too_fast(list: &mut [Dwell], too_fast: &[[bool; 2]]) {
    for (dwell, too_fast) in list.iter_mut().zip(too_fast) {
        for (sensor, too_fast) in PerSensor::from(*too_fast) {
            if too_fast && dwell.faults[sensor] == Some(Fault::NotStill) {
                dwell.faults[sensor] = Some(Fault::TooFast);
            }
        }
    }
}

/// Variance of the block means of each channel of `sensor` over `dwell`, raw units squared, and the part that the known input leaves
/// unexplained; `None` if the input does not move.
fn unfollowed(
    dwell: &Dwell,
    sensor: Sensor,
    condensed: &Condensed,
    rails: &[Rails; 6],
) -> Option<[[f64; 2]; 3]> {
    if !dwell.moves(sensor) {
        return None;
    }
    let course = Course::of(condensed, dwell.blocks.clone(), rails)?;
    let from = sensor.channels().start;
    let mut out = [[0.0; 2]; 3];
    for (k, out) in out.iter_mut().enumerate() {
        let blocks = course.blocks.iter();
        let means: Vec<f64> = blocks
            .map(|i| condensed.blocks[*i].raw[from + k].mean)
            .collect();
        let n = means.len() as f64;
        let centre = means.iter().sum::<f64>() / n;
        let left = course.unfollowed(sensor, &means)?;
        *out = [
            means.iter().map(|m| (m - centre).powi(2)).sum::<f64>() / n,
            left.iter().map(|r| r * r).sum::<f64>() / n,
        ];
    }
    Some(out)
}

/// Sets the faults of the dwells for each sensor, given the longest run of equal samples and the rails of each channel.
fn judge(
    list: &mut [Dwell],
    condensed: &Condensed,
    (longest_run, rails): (&[f64; 6], &[Rails; 6]),
    given: bool,
) {
    for sensor in Sensor::BOTH {
        let channels = || sensor.channels().filter(|&c| condensed.has_raw[c]);
        let any_stands = list.iter().any(|d| !d.moves(sensor));
        let typical: Vec<f64> = channels()
            .map(|c| {
                let usual = list.iter().filter(|d| !any_stands || !d.moves(sensor));
                let mut all: Vec<f64> = usual.map(|d| d.raw[c].variance).collect();
                quantile(&mut all, 0.5).unwrap_or(0.0)
            })
            .collect();
        for dwell in list.iter_mut() {
            // A turn of known angle has a known mean rate, but is not still.
            let turn = dwell.turn;
            let followed = match given && channels().next().is_some() {
                true => unfollowed(dwell, sensor, condensed, rails),
                false => None,
            };
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
                    && !followed.is_some_and(|f| {
                        let [all, left] = f[c - sensor.channels().start];
                        left <= STEP_FACTOR * typical[k] + UNFOLLOWED * all
                    })
                {
                    Some(Fault::NotStill)
                } else {
                    None
                });
            }
            if dwell.duration_s < SHORTEST_S - 0.5 * condensed.period_s && !turn {
                fault = fault.or(Some(Fault::TooShort));
            }
            dwell.faults[sensor] = fault;
        }
    }
}

fn warn(list: &[Dwell], manifest: &Manifest, warnings: &mut Vec<Warning>) {
    let mut by_fault: Vec<(Fault, Option<Sensor>, Vec<String>)> = Vec::new();
    for dwell in list {
        for sensor in Sensor::BOTH {
            let Some(fault) = dwell.faults[sensor] else {
                continue;
            };
            if matches!(fault, Fault::TooShort | Fault::Turning) && sensor == Sensor::Accel {
                continue; // reported once, for both sensors
            }
            // Stillness and the speed of the input are judged sensor by sensor.
            let by_sensor = matches!(fault, Fault::NotStill | Fault::TooFast);
            let whose = by_sensor.then_some(sensor);
            let name = manifest.step_name(dwell.step);
            match by_fault
                .iter_mut()
                .find(|(f, s, _)| (f, s) == (&fault, &whose))
            {
                Some((.., steps)) => steps.push(name),
                None => by_fault.push((fault, whose, vec![name])),
            }
        }
    }
    for (fault, sensor, names) in by_fault {
        warnings.push(Warning::DwellsNotUsed {
            dwells: names,
            fault,
            sensor,
        });
    }
    let clipped: u64 = list
        .iter()
        .flat_map(|d| d.raw.iter().map(|m| m.clipped))
        .sum();
    if clipped > 0 {
        warnings.push(Warning::Clipped { count: clipped });
    }
}
