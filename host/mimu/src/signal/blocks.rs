//! A recording condensed to blocks of a tenth of a second, in one pass and bounded memory.
//!
//! An affine fit needs only the first two moments of the samples over short segments, and for rotations the integral of the rate. For
//! fourteen million samples that is 85 to 225 MB instead of 1.5 GB. The rails and the thresholds of stillness are only known at the end of
//! the pass, so a block also carries what is needed to remove clipped samples from its sums later.

use nalgebra::Vector3;

use crate::quantity::Sensor;
use crate::signal::increment::{Increment, Integrator};
use crate::signal::jump::Jump;
pub(crate) use crate::signal::moments::pool;
pub use crate::signal::moments::{Moments, Rails};
use crate::signal::quantisation_step::QuantisationFinder;
use crate::warning::Warning;
use mimu_recording::health::{At, Finding, HeldReadings, SignedLowByteFinder, Temperatures};
pub(crate) use mimu_recording::statistics::{OF_MEDIAN, quantile};
use mimu_recording::{Argument, Batch, Column, Error, RAW_COLUMNS, Recording, Result};

/// Length of a block, s: a tenth of the shortest usable dwell, ten samples at 100 Hz.
const BLOCK_S: f64 = 0.1;
/// Smallest number of samples in a full block, for slow recordings.
const BLOCK_MIN_ROWS: usize = 4;
/// An interval between time stamps of this many sample periods is a gap.
const GAP_PERIODS: f64 = 1.5;
/// If more than this share of the intervals is irregular, the sample rate is wrong. Intervals of whole periods are excluded.
const GAP_SHARE: f64 = 0.02;
/// The same limit with intervals of whole periods included: a radio link may lose that many samples, and an import makes its time stamps
/// regular.
const LOSS_SHARE: f64 = 0.2;
/// Largest difference, in periods, of an interval from a whole number of periods.
const WHOLE: f64 = 0.1;
/// A longer interval, in periods, is a pause of the logger, after which samples may begin at any instant.
const PAUSE: f64 = 8.0;
/// After this many rows a recording is refused if its blocks hardly condense it: the rest could fill the memory.
const LOOK_AFTER: u64 = 100_000;

/// A reference or temperature channel over one block; not a number if any sample is missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// Mean.
    pub mean: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
}

impl Level {
    const UNKNOWN: Self = Self {
        mean: f64::NAN,
        min: f64::NAN,
        max: f64::NAN,
    };

    fn of(samples: &[f64]) -> Self {
        if samples.is_empty() {
            return Self::UNKNOWN;
        }
        let first = samples[0];
        let (mut sum, mut min, mut max) = (0.0, first, first);
        for &x in samples {
            sum += x - first;
            min = min.min(x);
            max = max.max(x);
        }
        // Measured from the first, so that the mean of a constant is that constant.
        let mean = first + sum / samples.len() as f64;
        if mean.is_finite() {
            Self { mean, min, max }
        } else {
            Self::UNKNOWN
        }
    }
}

/// Consecutive samples of one step without a gap, a tenth of a second or less.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Data row of the first sample, from 0.
    pub first_row: u64,
    /// Number of samples.
    pub rows: u32,
    /// Instant of the first sample, s.
    pub start_s: f64,
    /// Instant of the last sample, s.
    pub last_s: f64,
    /// Step, or -1 in transit; 0 throughout when the recording has no steps.
    pub step: i32,
    /// Whether samples are missing between this block and the one before.
    pub after_gap: bool,
    /// Gyro x, y, z, accelerometer x, y, z, raw.
    pub raw: [Moments; 6],
    /// The largest change of the accelerometer's reading between two samples.
    pub jump: Jump,
    /// Known inputs: rates (deg/s), specific forces (m/s²).
    pub reference: [Level; 6],
    /// Temperature, °C.
    pub temp_c: Level,
}

/// The result of one pass over a recording.
#[derive(Debug, Clone)]
pub struct Condensed {
    /// The blocks, in order.
    pub blocks: Vec<Block>,
    /// The integrals of the gyro, in order; empty unless requested.
    pub increments: Vec<Increment>,
    /// Number of rows.
    pub rows: u64,
    /// Quantisation step of each raw channel, raw; `None` if none was found.
    pub quantisation_step: [Option<f64>; 6],
    /// Raw channels whose low byte a firmware took for a signed number.
    pub signed_low_byte: Vec<Finding>,
    /// Which of the six raw channels the recording has.
    pub has_raw: [bool; 6],
    /// Which of the six reference channels the recording has.
    pub has_reference: [bool; 6],
    /// Whether it has a `step` column.
    pub has_steps: bool,
    /// Sample period by the time stamps, gaps left out, s.
    pub period_s: f64,
    /// Number of gaps, and the time missing in all of them, s.
    pub gaps: (u64, f64),
    /// Rows left out because they repeat the row before.
    pub duplicates: u64,
    /// Samples of each raw channel that are not numbers.
    pub missing: [u64; 6],
    /// Samples of the thermometer that cannot be temperatures.
    pub no_temperatures: Option<Finding>,
    /// SHA-256 of the samples file, hexadecimal.
    pub sha256: String,
    /// What a person should know about this recording.
    pub warnings: Vec<Warning>,
}

impl Condensed {
    /// Adds to the gyro's readings between two instants, raw.
    pub(crate) fn add_to_gyro(&mut self, added: &Vector3<f64>, [from_s, to_s]: [f64; 2]) {
        let own = self.blocks.iter_mut();
        for block in own.filter(|b| from_s <= b.start_s && b.start_s < to_s) {
            // Extremes keep their values: they decide on rails, which are those of the recorded reading.
            let gyro = &mut block.raw[Sensor::Gyro.channels()];
            gyro.iter_mut().zip(added).for_each(|(m, a)| m.mean += a);
        }
        let pieces = self.increments.iter_mut();
        for piece in pieces.filter(|p| from_s < p.end_s && p.end_s <= to_s) {
            *piece = piece.with_added(added);
        }
    }

    /// The blocks between two instants, without integrals.
    pub(crate) fn between(&self, from_s: f64, to_s: f64) -> Self {
        let within = |b: &&Block| from_s <= b.start_s && b.start_s < to_s;
        Self {
            blocks: self.blocks.iter().filter(within).cloned().collect(),
            increments: Vec::new(),
            warnings: Vec::new(),
            sha256: String::new(),
            signed_low_byte: self.signed_low_byte.clone(),
            ..*self
        }
    }

    /// Reads `recording` once. `integrate`: also integrate the gyro, as rotations need it. `progress` receives the share that is done.
    pub fn read(recording: &Recording, integrate: bool, progress: impl Fn(f64)) -> Result<Self> {
        let place = recording.place.clone();
        let rate = recording.manifest.sample_rate_hz;
        let mut condenser = Condenser::new(rate, integrate, place);
        let summary = recording.for_each_batch(progress, |batch| condenser.push(batch))?;
        let mut condensed = condenser.finish()?;
        condensed.sha256 = summary.sha256;
        // Stamps with jitter have slightly different rates by different means. Only a rate that somebody gave can be contradicted.
        if recording.manifest.has_rate_of_stamps() {
            let by_stamps = |warning: &Warning| !matches!(warning, Warning::RateOff { .. });
            condensed.warnings.retain(by_stamps);
        }
        let read = summary.warnings.into_iter().map(Warning::Reading);
        condensed.warnings.splice(0..0, read);
        Ok(condensed)
    }

    /// Condenses samples in memory, `rate_hz` a second. `integrate`: also integrate the gyro, as rotations need it.
    ///
    /// Errors: a column is neither empty nor as long as the times.
    pub fn of(samples: &Batch, rate_hz: f64, integrate: bool) -> Result<Self> {
        let lengths = Column::fixed().map(|column| {
            let length = samples
                .values(column)
                .map_or(samples.step.len(), <[f64]>::len);
            (column, length)
        });
        for (column, length) in lengths {
            if length != 0 && length != samples.len() {
                return Err(Error::new(
                    format!("samples in memory, column {}", column.name()),
                    format!("it has {length} rows, and t_s has {}", samples.len()),
                    "give every column a value for each time, or leave the column out",
                ));
            }
        }
        let mut condenser = Condenser::new(rate_hz, integrate, "samples in memory".into());
        condenser.push(samples)?;
        condenser.finish()
    }
}

/// Takes batches of samples in order and makes blocks of them.
struct Condenser {
    rate_hz: f64,
    period_s: f64,
    place: String,
    block_rows: usize,
    open: Batch,
    open_after_gap: bool,
    last: Option<(f64, i32)>,
    /// The accelerometer's last sample before the open block.
    accel: Option<[f64; 3]>,
    integrator: Option<Integrator>,
    intervals: Intervals,
    quantisation_steps: [QuantisationFinder; 6],
    signed_low_bytes: [SignedLowByteFinder; 6],
    held: [HeldReadings; 2],
    temperatures: Temperatures,
    out: Condensed,
}

/// Statistics of the intervals between time stamps.
#[derive(Default)]
struct Intervals {
    regular: u64,
    regular_s: f64,
    longer: u64,
    /// Those of `longer` that are a whole number of periods, or a pause.
    whole: u64,
    missing_s: f64,
    shorter: u64,
    first_odd: Option<(u64, f64)>,
}

impl Condenser {
    fn new(rate_hz: f64, integrate: bool, place: String) -> Self {
        let period_s = 1.0 / rate_hz;
        Self {
            rate_hz,
            period_s,
            place,
            block_rows: ((BLOCK_S / period_s).round() as usize).max(BLOCK_MIN_ROWS),
            open: Batch::default(),
            open_after_gap: false,
            last: None,
            accel: None,
            integrator: integrate.then(|| Integrator::new(period_s)),
            intervals: Intervals::default(),
            quantisation_steps: Default::default(),
            signed_low_bytes: Default::default(),
            held: Default::default(),
            temperatures: Temperatures::default(),
            out: Condensed {
                blocks: Vec::new(),
                increments: Vec::new(),
                rows: 0,
                quantisation_step: [None; 6],
                signed_low_byte: Vec::new(),
                has_raw: [false; 6],
                has_reference: [false; 6],
                has_steps: false,
                period_s,
                gaps: (0, 0.0),
                duplicates: 0,
                missing: [0; 6],
                no_temperatures: None,
                sha256: String::new(),
                warnings: Vec::new(),
            },
        }
    }

    fn push(&mut self, batch: &Batch) -> Result<()> {
        let rows = batch.t_s.len();
        self.out.rows += rows as u64;
        for c in 0..6 {
            self.out.has_raw[c] |= !batch.raw[c].is_empty();
            self.out.has_reference[c] |= !batch.reference[c].is_empty();
        }
        self.out.has_steps |= !batch.step.is_empty();
        let mut from = 0;
        for i in 0..rows {
            let t = batch.t_s[i];
            let step = batch.step.get(i).copied().unwrap_or(0);
            let mut cut = false;
            let mut gap = false;
            if let Some((last_t, last_step)) = self.last {
                let dt = t - last_t;
                if !(dt > 0.0) {
                    if dt == 0.0 && self.repeats_the_row_before(batch, i) {
                        self.out.duplicates += 1;
                        self.append(batch, from, i);
                        from = i + 1;
                        continue;
                    }
                    return Err(self.time_error(batch.first_row + i as u64, last_t, t));
                }
                gap = self.count(dt, batch.first_row + i as u64);
                cut = gap || step != last_step;
            }
            let pending = self.open.t_s.len() + (i - from);
            if cut || pending >= self.block_rows {
                self.append(batch, from, i);
                self.flush();
                self.open_after_gap = gap;
                from = i;
            }
            if let Some(integrator) = &mut self.integrator {
                let u = [0, 1, 2].map(|c| batch.raw[c].get(i).copied().unwrap_or(f64::NAN));
                self.out.increments.extend(integrator.push(t, u, gap));
            }
            for (sensor, held) in self.held.iter_mut().enumerate() {
                let reading = |axis: usize| batch.raw[3 * sensor + axis].get(i).copied();
                let row = batch.first_row + i as u64 + 1;
                held.take(row, [0, 1, 2].map(|axis| reading(axis).unwrap_or(f64::NAN)));
            }
            self.last = Some((t, step));
        }
        self.append(batch, from, rows);
        if self.out.rows > LOOK_AFTER && self.out.blocks.len() as u64 > self.out.rows / 2 {
            self.check_rate()?;
            return Err(Error::new(
                format!("{}, column step", self.place),
                "the number of the dwell changes in every other row or more often",
                "give all rows of a dwell the same number, or leave the column out",
            ));
        }
        Ok(())
    }

    /// Whether row `i` repeats the row before it in every raw channel.
    fn repeats_the_row_before(&self, batch: &Batch, i: usize) -> bool {
        (0..6).all(|c| {
            let column = &batch.raw[c];
            let before = match i {
                0 => self.open.raw[c].last(),
                _ => column.get(i - 1),
            };
            // Two empty cells count as equal, although NaN never equals NaN.
            match (column.get(i), before) {
                (Some(a), Some(b)) => a == b || a.is_nan() && b.is_nan(),
                (a, b) => a == b,
            }
        })
    }

    fn time_error(&self, row: u64, before: f64, now: f64) -> Error {
        let place = format!("{}, data row {}, t_s", self.place, row + 1);
        if now.is_nan() {
            Error::new(place, "the time is not a number", "give every row its time")
        } else if now == before {
            let problem = format!("two different rows have the time {now} s");
            Error::new(
                place,
                problem,
                "if the rows are in order, import again without the time column and with the sample rate",
            ).about(Argument::SampleRate)
        } else {
            let problem = format!("time goes back from {before} s to {now} s");
            Error::new(
                place,
                problem,
                "sort the rows by time, or import the parts as separate recordings",
            )
        }
    }

    /// Counts an interval between time stamps; returns whether it is a gap.
    fn count(&mut self, dt: f64, row: u64) -> bool {
        let intervals = &mut self.intervals;
        if dt > GAP_PERIODS * self.period_s {
            intervals.longer += 1;
            let periods = dt / self.period_s;
            let whole = (periods - periods.round()).abs() < WHOLE;
            intervals.whole += u64::from(whole || periods > PAUSE);
            intervals.missing_s += dt - self.period_s;
            intervals.first_odd.get_or_insert((row, dt));
            return true;
        }
        if dt < 0.5 * self.period_s {
            intervals.shorter += 1;
            intervals.first_odd.get_or_insert((row, dt));
        }
        intervals.regular += 1;
        intervals.regular_s += dt;
        false
    }

    /// Adds rows `from..to` of `batch` to the open block.
    fn append(&mut self, batch: &Batch, from: usize, to: usize) {
        if from >= to {
            return;
        }
        let open = &mut self.open;
        if open.t_s.is_empty() {
            open.first_row = batch.first_row + from as u64;
        }
        open.t_s.extend_from_slice(&batch.t_s[from..to]);
        if !batch.step.is_empty() {
            open.step.extend_from_slice(&batch.step[from..to]);
        }
        let columns = open.raw.iter_mut().chain(&mut open.reference);
        for (into, column) in columns.zip(batch.raw.iter().chain(&batch.reference)) {
            if !column.is_empty() {
                into.extend_from_slice(&column[from..to]);
            }
        }
        if !batch.temp_c.is_empty() {
            open.temp_c.extend_from_slice(&batch.temp_c[from..to]);
        }
    }

    /// Condenses the open block.
    fn flush(&mut self) {
        let open = &mut self.open;
        let (Some(&start_s), Some(&last_s)) = (open.t_s.first(), open.t_s.last()) else {
            return;
        };
        for (c, t_s) in open.temp_c.iter_mut().zip(&open.t_s) {
            *c = self.temperatures.take(*c, At::Time(*t_s));
        }
        let mut raw = [Moments::default(); 6];
        for (c, column) in open.raw.iter().enumerate() {
            if !column.is_empty() {
                raw[c] = Moments::of(column);
                self.quantisation_steps[c].push(column);
                self.signed_low_bytes[c].push(column);
                self.out.missing[c] += column.len() as u64 - u64::from(raw[c].n);
            }
        }
        let accel = Sensor::Accel.channels();
        let last = |column: &Vec<f64>| column.last().copied();
        let before = self.accel.filter(|_| !self.open_after_gap);
        let jump = Jump::of(&open.raw[accel.clone()], open.first_row, before);
        self.accel = match &open.raw[accel] {
            [x, y, z] => last(x)
                .zip(last(y))
                .zip(last(z))
                .map(|((x, y), z)| [x, y, z]),
            _ => None,
        };
        self.out.blocks.push(Block {
            first_row: open.first_row,
            rows: open.t_s.len() as u32,
            start_s,
            last_s,
            step: open.step.first().copied().unwrap_or(0),
            after_gap: self.open_after_gap,
            raw,
            jump,
            reference: [0, 1, 2, 3, 4, 5].map(|c| Level::of(&open.reference[c])),
            temp_c: Level::of(&open.temp_c),
        });
        self.open_after_gap = false;
        open.t_s.clear();
        open.step.clear();
        open.temp_c.clear();
        for column in open.raw.iter_mut().chain(&mut open.reference) {
            column.clear();
        }
    }

    /// Refuses a recording whose intervals between time stamps often do not fit the rate.
    fn check_rate(&self) -> Result<()> {
        let intervals = &self.intervals;
        let all = (intervals.regular + intervals.longer) as f64;
        let share = (intervals.longer + intervals.shorter) as f64 / all;
        let odd = (intervals.longer - intervals.whole + intervals.shorter) as f64 / all;
        if odd <= GAP_SHARE && share <= LOSS_SHARE {
            return Ok(());
        }
        let (row, dt) = intervals.first_odd.unwrap_or((0, f64::NAN));
        let rate = self.rate_hz;
        let (problem, remedy) = if share > 0.9 {
            (
                format!(
                    "the intervals between time stamps do not fit sample_rate_hz = {rate}: the first such interval is {dt:.6} s"
                ),
                "correct sample_rate_hz, or the unit of t_s",
            )
        } else if odd <= GAP_SHARE {
            (
                format!(
                    "samples are missing in {:.0} % of the intervals at {rate} Hz, or the rate is mixed: the first such interval is {dt:.6} s, and hardly any turn is complete",
                    100.0 * share
                ),
                "record it without losses, or resample to one rate",
            )
        } else {
            (
                format!(
                    "the rate is mixed: {:.0} % of the intervals between time stamps do not fit sample_rate_hz = {rate}, the first such interval is {dt:.6} s",
                    100.0 * share
                ),
                "correct sample_rate_hz, or resample to one rate",
            )
        };
        let place = format!("{}, data row {}, t_s", self.place, row + 1);
        Err(Error::new(place, problem, remedy))
    }

    fn finish(mut self) -> Result<Condensed> {
        self.flush();
        let intervals = &self.intervals;
        let rate = self.rate_hz;
        if intervals.regular + intervals.longer == 0 {
            return Err(Error::new(
                &self.place,
                "it has only one row",
                "record for longer",
            ));
        }
        self.check_rate()?;
        let period = intervals.regular_s / intervals.regular.max(1) as f64;
        let off = period / self.period_s - 1.0;
        if off.abs() > 0.02 {
            let problem = format!(
                "rows are {period:.6} s apart, and by sample_rate_hz = {rate} they should be {:.6} s apart",
                self.period_s
            );
            return Err(Error::new(
                format!("{}, t_s", self.place),
                problem,
                "correct sample_rate_hz or the unit of t_s",
            ));
        }
        let out = &mut self.out;
        if off.abs() > 1e-3 {
            out.warnings.push(Warning::RateOff {
                stamps_hz: 1.0 / period,
                off_percent: -100.0 * off,
                manifest_hz: rate,
            });
        }
        out.period_s = period;
        out.gaps = (intervals.longer, intervals.missing_s);
        if intervals.longer > 0 {
            let (row, _) = intervals.first_odd.unwrap_or((0, 0.0));
            let gaps = Warning::Gaps {
                count: intervals.longer,
                missing_s: intervals.missing_s,
                row: row + 1,
            };
            out.warnings.push(gaps);
        }
        if out.duplicates > 0 {
            out.warnings.push(Warning::Repeated {
                rows: out.duplicates,
            });
        }
        for (c, &missing) in out.missing.iter().enumerate() {
            if missing > 0 {
                out.warnings.push(Warning::Empty {
                    count: missing,
                    channel: RAW_COLUMNS[c],
                });
            }
        }
        out.no_temperatures = self.temperatures.impossible();
        out.warnings
            .extend(out.no_temperatures.map(Warning::Health));
        for (sensor, held) in Sensor::BOTH.iter().zip(&self.held) {
            let held = held.found(sensor.name(), 1.0 / period);
            out.warnings.extend(held.map(Warning::Health));
        }
        if let Some(integrator) = &mut self.integrator {
            out.increments.extend(integrator.take());
        }
        out.quantisation_step = self.quantisation_steps.map(QuantisationFinder::find);
        let finders = self.signed_low_bytes.iter().enumerate();
        out.signed_low_byte = finders.filter_map(|(c, finder)| finder.found(c)).collect();
        Ok(self.out)
    }
}

/// The lowest and the highest of `values`; the infinities, the higher one first, without any.
pub fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
        [low.min(v), high.max(v)]
    })
}

/// A range of blocks, with its step if that is given.
pub(crate) type StepBlocks = (Option<i32>, std::ops::Range<usize>);
