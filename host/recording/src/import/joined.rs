//! Several files as one recording: each row of the first with what the others have at that time.

use super::first_pass;
use super::foreign::{ForeignFile, HowToRead};
use super::join::{Follower, Joined, check_order};
use super::left_out::LeftOut;
use super::log::is_log;
use super::log_options::file_name;
use super::options::ImportOptions;
use super::resample::{self, Resampler};
use super::row::Row;
use super::sequence_position::SequencePosition;
use super::step_inputs::StepInputs;
use super::summary::ImportSummary;
use super::time::{TimeSummary, Times};
use crate::batch::Batch;
use crate::columns::{Column, Columns, Layout};
use crate::declared::{RawUnit, Reference};
use crate::error::{Argument, Error, Result};
use crate::health::Fault;
use crate::manifest::Manifest;
use crate::writer::Writer;

/// Rows that are written at a time.
const BATCH: usize = 1 << 14;

/// Slowest further triad of a log that is interpolated, Hz. Autopilots log a magnetometer once a second unless they are told otherwise, and a hand
/// turns a unit by a right angle in that time.
const SLOWEST_HZ: f64 = 4.0;

/// A warning if the time stamps have another rate than the given one.
fn other_rate(times: &Times, given: f64) -> Option<String> {
    let summary = &times.summary;
    let off = given / summary.rate_hz - 1.0;
    (off.abs() > 1e-3).then(|| match summary.counter {
        true => format!(
            "{}: the counter rises by {:.0} or more from row to row, so by {given} Hz there are {} rows a second: if {given} Hz is the rate of the rows, multiply it by {:.0}",
            summary.file, 1.0 + off, summary.rate_hz, 1.0 + off
        ),
        false => format!(
            "{}: the rate of the time stamps is {} Hz, but {given} Hz were given: the stamps are used; to use the rate instead, skip the time column",
            summary.file, summary.rate_hz
        ),
    })
}

/// Files that are being opened, and what the first passes over them have found.
struct Opening<'a> {
    options: &'a ImportOptions,
    left_out: LeftOut,
    first: ForeignFile,
    /// Times of the first file, if it has stamps.
    first_times: Option<Times>,
    rate_hz: f64,
    followers: Vec<Follower>,
    time: Vec<TimeSummary>,
    warnings: Vec<String>,
}

impl<'a> Opening<'a> {
    /// Opens the first file and finds its times, which are those of the recording.
    fn first(options: &'a ImportOptions, left_out: LeftOut) -> Result<Self> {
        let how = how(options, left_out, 0);
        let first = ForeignFile::open(options.file(0), &how)?;
        let mut opening = Self {
            options,
            left_out,
            first,
            first_times: None,
            rate_hz: f64::NAN,
            followers: Vec::new(),
            time: Vec::new(),
            warnings: options.preset_warnings.clone(),
        };
        if !opening.first.has_time() {
            // Opening has refused this already: without a time column the rate is needed.
            opening.rate_hz = options.log.rate_hz.ok_or_else(|| {
                Error::new("import", "the rate is unknown", "give it").about(Argument::SampleRate)
            })?;
            return Ok(opening);
        }
        let times = first_pass::times(options.file(0), &how, options.log.rate_hz, None)?;
        let warning = options
            .log
            .rate_hz
            .and_then(|given| other_rate(&times, given));
        opening.rate_hz = times.summary.rate_hz;
        opening.warnings.extend(warning);
        opening.time.push(times.summary.clone());
        opening.first = opening.first.with_times(times.clone());
        opening.first_times = Some(times);
        Ok(opening)
    }

    /// Opens the further parts of the first file, and all parts of the others.
    fn open_followers(&mut self) -> Result<()> {
        for part in 1..self.first.parts {
            self.follow(0, part)?;
        }
        for source in 1..self.options.sources() {
            for part in 1..self.follow(source, 0)? {
                self.follow(source, part)?;
            }
        }
        Ok(())
    }

    /// Opens a part of a source, to be read beside the first file. Returns how many parts the source has.
    fn follow(&mut self, source: usize, part: usize) -> Result<usize> {
        let path = self.options.file(source);
        let how = HowToRead {
            rate_hz: self.options.log.rate_hz.or(Some(self.rate_hz)),
            part,
            ..how(self.options, self.left_out, source)
        };
        let mut file = ForeignFile::open(path, &how)?;
        if file.has_step() {
            let problem = "the first file lacks the column step";
            let remedy = "name the file with the column step first";
            return Err(Error::new(path.display(), problem, remedy));
        }
        let first_period_s = 1.0 / self.rate_hz;
        let mut period_s = first_period_s;
        if file.has_time() {
            // Another sensor has its own rate and delays, but the times of both come from one clock.
            let first = self.first_times.as_ref();
            let rate_hz = self.options.log.rate_hz.filter(|_| !file.is_further());
            let may_leave = file.is_further() && is_log(path);
            let times = match first_pass::times(path, &how, rate_hz, first) {
                Err(error) if may_leave => {
                    self.leave_out(&file, &error.refused().problem);
                    return Ok(file.parts);
                }
                Ok(times) if may_leave && times.summary.rate_hz < SLOWEST_HZ => {
                    let rate_hz = times.summary.rate_hz;
                    let why = format!("{rate_hz:.3} Hz are too slow to interpolate between");
                    self.leave_out(&file, &why);
                    return Ok(file.parts);
                }
                times => times?,
            };
            period_s = times.period_s();
            self.time.push(times.summary.clone());
            file = file.with_times(times);
        }
        let parts = file.parts;
        self.followers
            .push(Follower::new(file, period_s, first_period_s));
        Ok(parts)
    }

    /// Leaves out further triads of a log that cannot be used. The log was imported for its gyro and accelerometer.
    fn leave_out(&mut self, file: &ForeignFile, why: &str) {
        let triads = file.columns().filter_map(Column::triad);
        let mut triads: Vec<String> = triads.map(|(triad, _)| triad.to_string()).collect();
        triads.dedup();
        let (place, triads) = (file_name(file.path()), triads.join(", "));
        self.warnings
            .push(format!("{place}: {triads} left out: {why}"));
    }

    /// Columns of the values, in the order in which the files give them.
    fn columns(&self) -> impl Iterator<Item = Column> + '_ {
        let followers = self.followers.iter();
        self.first
            .columns()
            .chain(followers.flat_map(|follower| follower.file.columns()))
    }

    /// Whether the rows of the recording belong to numbered steps.
    fn has_steps(&self) -> bool {
        self.first.has_step() || self.options.is_sequence() || self.options.log.step_gap_s.is_some()
    }

    /// Columns of the recording: those of the files that are not left out, the step, and those of `inputs`.
    fn columns_with(&self, inputs: Option<&StepInputs>) -> Result<Columns> {
        let kept = |column: &Column| match column {
            Column::Raw(c) => !self.left_out.sensors[c / 3],
            Column::Temperature => !self.left_out.thermometer,
            _ => true,
        };
        let mut names: Vec<&str> = vec![Column::Time.name()];
        names.extend(self.columns().filter(kept).map(|column| column.name()));
        if self.options.log.step_gap_s.is_some() && self.first.has_step() {
            let problem = "it has a column step, but the dwells are to be separated by pauses";
            let remedy = "skip the column, or leave out the pause";
            let place = self.first.path().display();
            return Err(Error::new(place, problem, remedy).about(Argument::Columns));
        }
        if self.has_steps() {
            names.push(Column::Step.name());
        }
        let given = inputs.map_or([false; 6], StepInputs::columns);
        let given = (0..6)
            .filter(|&i| given[i])
            .map(|i| Column::Reference(i).name());
        names.extend(given);
        // The same rules as for a recording's header: nothing twice, all axes of a sensor.
        Ok(Layout::from_names(&names, "import, all columns together")?.columns)
    }

    /// Refuses a table of inputs whose steps the files do not number.
    fn check_inputs(&self, inputs: Option<&StepInputs>) -> Result<()> {
        let problem = match inputs {
            Some(inputs) if self.options.log.step_gap_s.is_some() && inputs.has_turns() => {
                "the table of inputs has angles of turns, but pauses do not separate turns"
            }
            Some(_) if !self.has_steps() => "a table of inputs is given, but no column is step",
            _ => return Ok(()),
        };
        let remedy = "name the column with the numbers of the dwells (step)";
        Err(Error::new("import", problem, remedy))
    }
}

/// How to read a source without `left_out`.
fn how(options: &ImportOptions, left_out: LeftOut, source: usize) -> HowToRead<'_> {
    HowToRead {
        empty_zero_temperatures: left_out.zero_temperatures,
        ..options.how(source)
    }
}

/// Files that are read side by side, on the times of the first.
pub(super) struct JoinedFiles {
    pub first: ForeignFile,
    /// Gives the rows of the first file regular times, if a loop took them at irregular ones.
    resampler: Option<Resampler>,
    /// Position of the first file in a sequence.
    pub place: Option<SequencePosition>,
    /// Pause that separates two steps, s.
    step_gap_s: Option<f64>,
    followers: Vec<Follower>,
    /// Whether all of them are the same file, of which each takes other rows or columns.
    one_file: bool,
    pub rate_hz: f64,
    pub columns: Columns,
    /// Column of each value, in the order in which the files give them.
    order: Vec<Column>,
    pub inputs: Option<StepInputs>,
    pub summary: ImportSummary,
}

impl JoinedFiles {
    /// Opens the files of `options` and finds their times and columns, without `left_out`.
    pub fn open(options: &ImportOptions, left_out: LeftOut) -> Result<Self> {
        let mut files = Opening::first(options, left_out)?;
        files.open_followers()?;
        let polled = files.first_times.as_ref();
        let polled = polled.filter(|times| times.summary.polled.is_some());
        let resampler = polled.map(|times| Resampler::new(times.period_s()));
        let order: Vec<Column> = files.columns().collect();
        let mut inputs = StepInputs::of(options)?;
        let columns = files.columns_with(inputs.as_ref())?;
        files.check_inputs(inputs.as_ref())?;
        if options.reference == Reference::Table && columns.reference == [false; 6] {
            return Err(Error::new(
                "import, reference",
                "reference is \"table\", but no column is a ref_ column",
                "add the ref_ columns or a table of inputs, or set the reference to gravity",
            )
            .about(Argument::Reference));
        }
        let mut warnings = files.warnings;
        let followers = files.followers.iter().map(|follower| &follower.file);
        for file in followers.chain([&files.first]) {
            warnings.extend_from_slice(&file.noticed().warnings);
        }
        if let Some(inputs) = &mut inputs {
            let irregular = files.first_times.filter(|_| resampler.is_some());
            inputs.count_rows(options.file(0), &options.how(0), irregular)?;
        }
        Ok(Self {
            summary: ImportSummary {
                format: "mimu-import/1",
                preset: options.preset.clone(),
                sample_rate_hz: files.rate_hz,
                time: files.time,
                without_accel: !columns.accel,
                triads: columns.triads().collect(),
                warnings,
                ..ImportSummary::default()
            },
            rate_hz: files.rate_hz,
            columns,
            order,
            inputs,
            first: files.first,
            resampler,
            place: None,
            step_gap_s: options.log.step_gap_s,
            followers: files.followers,
            one_file: options.has_one_file_for_all(),
        })
    }

    /// Whether its rows are not those of the first file.
    pub fn interpolates(&self) -> bool {
        self.resampler.is_some() || !self.followers.is_empty()
    }

    /// The manifest of the recording, without its sources and steps.
    pub fn manifest(&self, options: &ImportOptions) -> Manifest {
        let mut manifest = Manifest::new(
            options.unit(),
            self.rate_hz,
            options.gravity_mps2,
            options.raw_unit,
            options.reference,
        );
        manifest.latitude_deg = options.log.latitude_deg;
        manifest.turntable = options.log.turntable().clone();
        manifest.imported_with = options.arguments();
        manifest
    }

    /// Reads all rows, and hands them to `writer`.
    pub fn run(&mut self, writer: &mut Writer, progress: &impl Fn(f64)) -> Result<()> {
        let mut row = Row::default();
        let mut values = Vec::new();
        let mut batch = Batch::default();
        let mut last_t_s = f64::NEG_INFINITY;
        let mut step = 0;
        while resample::next(&mut self.first, self.resampler.as_mut(), &mut row)? {
            check_order(&self.first, &row, last_t_s)?;
            if let Some(gap_s) = self.step_gap_s {
                step += i32::from(row.t_s - last_t_s > gap_s && last_t_s.is_finite());
                row.step = step;
            }
            last_t_s = row.t_s;
            if let Some(place) = &mut self.place {
                place.put(&mut row);
            }
            values.clear();
            values.extend_from_slice(&row.values);
            if self.join(row.t_s, &mut values)? {
                self.push(&row, &values, &mut batch);
            }
            if batch.len() == BATCH {
                writer.write(&batch)?;
                batch.clear();
                progress(self.first.progress());
            }
        }
        writer.write(&batch)?;
        progress(1.0);
        Ok(())
    }

    /// Appends the values of the other files at that time; `false` if the row must be dropped.
    fn join(&mut self, t_s: f64, values: &mut Vec<f64>) -> Result<bool> {
        let mut worst = Joined::Exactly;
        for follower in &mut self.followers {
            match follower.append_at(t_s, values)? {
                Joined::Exactly => {}
                Joined::Interpolated if worst != Joined::Exactly => {}
                other => worst = other,
            }
        }
        match worst {
            Joined::Exactly => return Ok(true),
            Joined::Interpolated => self.summary.interpolated += 1,
            Joined::Outside => self.summary.dropped_outside += 1,
            Joined::Gap => self.summary.dropped_in_gaps += 1,
        }
        Ok(worst == Joined::Interpolated)
    }

    fn push(&mut self, row: &Row, values: &[f64], batch: &mut Batch) {
        batch.t_s.push(row.t_s);
        if self.columns.step {
            batch.step.push(row.step);
        }
        for (column, &value) in self.order.iter().zip(values) {
            if !self.columns.has(*column) {
                continue;
            }
            if matches!(column, Column::Raw(_)) {
                self.summary.empty_cells += u64::from(value.is_nan());
            }
            if let Some(target) = batch.values_mut(*column) {
                target.push(value);
            }
        }
        if let Some(inputs) = &mut self.inputs {
            inputs.push(row.step, &self.first.labels, self.rate_hz, batch);
        }
    }

    /// What is to be left out, because it is no reading in one of the files.
    pub fn to_leave_out(&self) -> LeftOut {
        let any = |is: &dyn Fn(&ForeignFile) -> bool| self.files().any(is);
        let zeros = |fault| any(&|file| file.seen.zero_temperatures() == Some(fault));
        LeftOut {
            sensors: [0, 1].map(|s| any(&|file| file.seen.not_connected()[s].is_some())),
            thermometer: zeros(Fault::NoThermometer),
            zero_temperatures: zeros(Fault::SilentThermometer),
        }
    }

    fn files(&self) -> impl Iterator<Item = &ForeignFile> {
        self.followers.iter().map(|f| &f.file).chain([&self.first])
    }

    /// Rows that no source has chosen. Sources of one file choose by other values of a column, so a row that one of them leaves out may be another's.
    fn not_chosen(&self) -> u64 {
        let counts: Vec<[u64; 2]> = self.files().map(ForeignFile::chosen).collect();
        let all = counts.iter().map(|[kept, left]| kept + left);
        let kept: u64 = counts.iter().map(|[kept, _]| kept).sum();
        match self.one_file {
            true => all.max().unwrap_or(0).saturating_sub(kept),
            false => counts.iter().map(|[_, left]| left).sum(),
        }
    }

    /// Counts and warnings of all files, once they have been read and `rows` written.
    pub fn finish_summary(&mut self, rows: u64, manifest: &Manifest) -> Result<()> {
        for file in self.files() {
            file.seen.check(&file_name(file.path()))?;
        }
        if rows == 0 {
            return Err(Error::new(
                "import",
                "the files have no time in common",
                "check that their times start at the same instant and have the same unit",
            )
            .about(Argument::TimeUnit));
        }
        let summary = &mut self.summary;
        summary.rows = rows;
        let followers = self.followers.iter().map(|f| &f.file);
        for file in followers.chain([&self.first]) {
            summary.add(file);
            if manifest.raw_unit == RawUnit::Si {
                let place = file_name(file.path());
                let found = file.seen.wrong_unit(manifest.gravity_mps2);
                let found = found.map(|found| format!("{place}: {found}"));
                summary.warnings.extend(found);
            }
        }
        let not_chosen = self.not_chosen();
        let summary = &mut self.summary;
        summary.not_chosen = not_chosen;
        let of_loops = summary.time.iter().filter_map(TimeSummary::of_loop);
        summary.warnings.extend(of_loops.collect::<Vec<_>>());
        if summary.interpolated > 0 {
            summary.warnings.push(format!(
                "{} rows were interpolated between the times of another file, which lowers the white noise of its columns",
                summary.interpolated
            ));
        }
        if let Some(inputs) = &self.inputs {
            summary.warnings.extend(inputs.unknown(&self.first.labels));
            // For a sequence, this is known only when all files have been read.
            if self.place.is_none() {
                summary.warnings.extend(inputs.unused());
            }
        }
        Ok(())
    }
}
