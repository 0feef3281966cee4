//! Several files as one recording: each row of the first with what the others have at that time.

use super::join::{Joined, joined};
use super::log::is_log;
use super::log_options::file_name;
use super::options::ImportOptions;
use super::source::{HowToRead, Source};
use super::step_inputs::StepInputs;
use super::step_labels::StepLabels;
use super::summary::ImportSummary;
use super::time::{TimeSummary, Times};
use crate::batch::Batch;
use crate::columns::{Column, Columns, Layout};
use crate::declared::{RawUnit, Reference};
use crate::error::{Argument, Error, Result};
use crate::health::{Constant, Fault, Finding};
use crate::manifest::Manifest;
use crate::triad_name::TriadName;
use crate::triads::Triads;
use crate::writer::Writer;

/// Rows that are written at a time.
const BATCH: usize = 1 << 14;

/// Slowest further triad of a log that is interpolated, Hz. Autopilots log a magnetometer once a second unless they are told otherwise, and a hand
/// turns a unit by a right angle in that time.
const SLOWEST_HZ: f64 = 4.0;

/// Parts of a file that are left out, because all rows show that they are no readings.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LeftOut {
    /// Whether gyro and accelerometer read only zeros.
    pub sensors: [bool; 2],
    /// Further triads that read only zeros.
    pub triads: Triads,
    /// Whether the thermometer reads only zeros.
    pub thermometer: bool,
    /// Whether zeros of the thermometer are missing answers.
    pub zero_temperatures: bool,
}

/// Files that were read, each with its times.
pub(super) struct Files {
    pub first: Source,
    others: Vec<Source>,
    pub rate_hz: f64,
    /// Whether the rows of the first file were interpolated, because a loop took them at irregular times.
    pub resampled: bool,
    pub time: Vec<TimeSummary>,
    notes: Vec<String>,
    warnings: Vec<String>,
}

impl Files {
    /// Reads the files of `options`.
    pub fn read(options: &ImportOptions, progress: &dyn Fn(f64)) -> Result<Self> {
        let (how, given) = (options.how(0), options.log.rate_hz);
        let mut parts = Source::read(options.file(0), &how, progress)?.into_iter();
        let mut first = parts.next().ok_or_else(|| {
            Error::new(
                options.file(0).display(),
                "it has no readings",
                "choose another file",
            )
        })?;
        let mut warnings = options.preset_warnings.clone();
        if first.has_time() {
            first.find_times(&how, given, None)?;
            let times = first.times.as_ref();
            warnings.extend(
                given
                    .zip(times)
                    .and_then(|(given, times)| other_rate(times, given)),
            );
        }
        first.check_order()?;
        let polled = first
            .times
            .as_ref()
            .filter(|times| times.summary.polled.is_some());
        let resampled = polled.is_some();
        if let Some(period_s) = polled.map(Times::period_s) {
            first.resample(period_s);
        }
        let mut files = Self {
            rate_hz: first.rate_hz(),
            resampled,
            time: first
                .times
                .iter()
                .map(|times| times.summary.clone())
                .collect(),
            first,
            others: Vec::new(),
            notes: Vec::new(),
            warnings,
        };
        for part in parts {
            files.follow(part, &how)?;
        }
        for source in 1..options.sources() {
            let how = HowToRead {
                rate_hz: given.or(Some(files.rate_hz)),
                ..options.how(source)
            };
            for part in Source::read(options.file(source), &how, &|_| {})? {
                files.follow(part, &how)?;
            }
        }
        Ok(files)
    }

    /// Adds a part of a source, to be joined onto the first file.
    fn follow(&mut self, mut file: Source, how: &HowToRead<'_>) -> Result<()> {
        if file.steps.is_some() {
            let problem = "the first file lacks the column step";
            let remedy = "name the file with the column step first";
            return Err(Error::new(file.path.display(), problem, remedy));
        }
        if file.has_time() {
            // Another sensor has its own rate and delays, but the times of both come from one clock.
            let rate_hz = how.log.rate_hz.filter(|_| !file.is_further());
            let may_leave = file.is_further() && is_log(&file.path);
            let how = HowToRead {
                rate_hz: how.log.rate_hz.or(Some(self.rate_hz)),
                ..how.clone()
            };
            let found = file.find_times(&how, rate_hz, self.first.times.as_ref());
            match found {
                Err(error) if may_leave => {
                    self.warnings
                        .push(left_out(&file, &error.refused().problem));
                    return Ok(());
                }
                found => found?,
            }
            let slow_hz = file.rate_hz();
            if may_leave && slow_hz < SLOWEST_HZ.min(0.5 * self.rate_hz) {
                let why = format!("{slow_hz:.3} Hz are too slow to interpolate between");
                self.notes.push(left_out(&file, &why));
                return Ok(());
            }
            self.time
                .extend(file.times.iter().map(|times| times.summary.clone()));
        }
        file.check_order()?;
        self.others.push(file);
        Ok(())
    }

    fn all(&self) -> impl Iterator<Item = &Source> {
        self.others.iter().chain([&self.first])
    }

    /// What to leave out: columns that measure nothing in one of the files.
    pub fn to_leave_out(&self) -> LeftOut {
        let any = |is: &dyn Fn(&Source) -> bool| self.all().any(is);
        let zeros = |fault| any(&|file| file.seen.zero_temperatures() == Some(fault));
        LeftOut {
            sensors: [0, 1].map(|s| any(&|file| file.seen.not_connected()[s].is_some())),
            triads: self.all().flat_map(zero_triads).collect(),
            thermometer: zeros(Fault::NoThermometer),
            zero_temperatures: zeros(Fault::SilentThermometer),
        }
    }

    /// Columns of the recording: those of the files without `left_out`, the step, and those of `inputs`.
    pub fn columns(
        &self,
        options: &ImportOptions,
        left_out: LeftOut,
        inputs: Option<&StepInputs>,
    ) -> Result<Columns> {
        let by_gaps = options.log.step_gap_s.is_some();
        let has_steps = self.first.steps.is_some() || options.is_sequence() || by_gaps;
        if by_gaps && self.first.steps.is_some() {
            let problem = "it has a column step, but the dwells are to be separated by pauses";
            let remedy = "skip the column, or leave out the pause";
            let place = self.first.path.display();
            return Err(Error::new(place, problem, remedy).about(Argument::Columns));
        }
        let problem = match inputs {
            Some(inputs) if by_gaps && inputs.has_turns() => {
                Some("the table of inputs has angles of turns, but pauses do not separate turns")
            }
            Some(_) if !has_steps => Some("a table of inputs is given, but no column is step"),
            _ => None,
        };
        if let Some(problem) = problem {
            let remedy = "name the column with the numbers of the dwells (step)";
            return Err(Error::new("import", problem, remedy));
        }
        let kept = |column: &Column| match column {
            Column::Raw(c) => !left_out.sensors[c / 3],
            Column::More(triad, _) => !left_out.triads.contains(*triad),
            Column::Temperature => !left_out.thermometer,
            _ => true,
        };
        let files = [&self.first].into_iter().chain(&self.others);
        let of_files = files.flat_map(|file| &file.columns).copied().filter(kept);
        let mut all = vec![Column::Time];
        all.extend(of_files);
        all.extend(has_steps.then_some(Column::Step));
        let given = inputs.map_or([false; 6], StepInputs::columns);
        all.extend((0..6).filter(|i| given[*i]).map(Column::Reference));
        let names: Vec<&str> = all.into_iter().map(Column::name).collect();
        // The same rules as for a recording's header: nothing twice, all axes of a sensor.
        let columns = Layout::from_names(&names, "import, all columns together")?.columns;
        if options.reference == Reference::Table && columns.reference == [false; 6] {
            let problem = "reference is \"table\", but no column is a ref_ column";
            let remedy =
                "add the ref_ columns or a table of inputs, or set the reference to gravity";
            return Err(Error::new("import, reference", problem, remedy).about(Argument::Reference));
        }
        Ok(columns)
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

    /// Joins the files. `step`, if the rows all belong to one.
    pub fn join(
        mut self,
        options: &ImportOptions,
        columns: Columns,
        left_out: LeftOut,
        step: Option<i32>,
    ) -> Result<JoinedFiles> {
        if left_out.zero_temperatures {
            self.first.empty_zero_temperatures();
            self.others
                .iter_mut()
                .for_each(Source::empty_zero_temperatures);
        }
        let mut summary = self.summary(options, columns);
        let t_s = std::mem::take(&mut self.first.t_s);
        let steps = match (step, options.log.step_gap_s) {
            (Some(step), _) => vec![step; t_s.len()],
            (None, Some(gap_s)) => by_pauses(&t_s, gap_s),
            (None, None) => self.first.steps.take().unwrap_or_default(),
        };
        let own = std::mem::take(&mut self.first.values);
        let mut values: Vec<(Column, Vec<f64>)> =
            self.first.columns.iter().copied().zip(own).collect();
        let mut worst = vec![Joined::Exactly; t_s.len()];
        for file in &self.others {
            let (own, how) = joined(file, &t_s, 1.0 / self.rate_hz);
            values.extend(file.columns.iter().copied().zip(own));
            for (worst, how) in worst.iter_mut().zip(how) {
                match how {
                    Joined::Exactly => {}
                    Joined::Interpolated if *worst != Joined::Exactly => {}
                    other => *worst = other,
                }
            }
        }
        values.retain(|(column, _)| columns.has(*column));
        let count = |how| worst.iter().filter(|own| **own == how).count() as u64;
        summary.interpolated = count(Joined::Interpolated);
        summary.dropped_outside = count(Joined::Outside);
        summary.dropped_in_gaps = count(Joined::Gap);
        if summary.interpolated > 0 {
            summary.warnings.push(format!(
                "{} rows were interpolated between the times of another file, which lowers the white noise of its columns",
                summary.interpolated
            ));
        }
        let keep = worst
            .iter()
            .map(|how| matches!(how, Joined::Exactly | Joined::Interpolated));
        Ok(JoinedFiles {
            columns,
            keep: keep.collect(),
            rate_hz: self.rate_hz,
            labels: std::mem::take(&mut self.first.labels),
            t_s,
            steps,
            values,
            summary,
        })
    }

    /// Counts and warnings of all files.
    fn summary(&self, options: &ImportOptions, columns: Columns) -> ImportSummary {
        let mut summary = ImportSummary {
            format: "mimu-import/1",
            preset: options.preset.clone(),
            sample_rate_hz: self.rate_hz,
            time: self.time.clone(),
            without_accel: !columns.accel,
            triads: columns.triads().collect(),
            notes: self.notes.clone(),
            warnings: self.warnings.clone(),
            not_chosen: self.not_chosen(options.has_one_file_for_all()),
            ..ImportSummary::default()
        };
        for file in self.all() {
            summary.add(file);
            let dead = zero_triads(file).filter(|triad| !columns.more.contains(*triad));
            let found = Finding::of_all(0, Fault::NotConnected);
            let said = dead.map(|triad| format!("{}: {triad}: {found}", file_name(&file.path)));
            summary.warnings.extend(said);
            if options.raw_unit == RawUnit::Si {
                let place = file_name(&file.path);
                let found = file.seen.wrong_unit(options.gravity_mps2);
                summary
                    .warnings
                    .extend(found.map(|found| format!("{place}: {found}")));
            }
        }
        let of_loops = self.time.iter().filter_map(TimeSummary::of_loop);
        summary.warnings.extend(of_loops);
        summary
    }

    /// Rows that no source has chosen. Sources of `one_file` choose by other values of a column, so a row that one of them leaves out may be another's.
    fn not_chosen(&self, one_file: bool) -> u64 {
        let counts = || self.all().map(|file| file.chosen);
        match one_file {
            true => {
                let all = counts().map(|[kept, left]| kept + left).max();
                let kept = counts().map(|[kept, _]| kept).sum();
                all.unwrap_or(0).saturating_sub(kept)
            }
            false => counts().map(|[_, left]| left).sum(),
        }
    }

    /// Whether its rows are not those of the first file.
    pub fn interpolates(&self) -> bool {
        self.resampled || !self.others.is_empty()
    }
}

/// The further triads of `file` that read 0 in all rows.
fn zero_triads(file: &Source) -> impl Iterator<Item = TriadName> {
    let zero = |column: Column| {
        let at = file.columns.iter().position(|own| *own == column);
        let read = at.map(|at| Constant::of(file.values[at].iter().copied()));
        read.is_some_and(|read| read.is_zero() && !read.is_empty())
    };
    let triads = file.columns.iter().filter_map(|column| match column {
        Column::More(triad, 0) => Some(*triad),
        _ => None,
    });
    triads.filter(move |triad| (0..3).all(|axis| zero(Column::of(*triad, axis))))
}

/// The steps of rows at these times, if a longer pause than `gap_s` begins another.
fn by_pauses(t_s: &[f64], gap_s: f64) -> Vec<i32> {
    let mut step = 0;
    let begins = |row: usize| row > 0 && t_s[row] - t_s[row - 1] > gap_s;
    let steps = (0..t_s.len()).map(|row| {
        step += i32::from(begins(row));
        step
    });
    steps.collect()
}

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

/// What is said of the further triads of a log that are left out. The log was imported for its gyro and accelerometer.
fn left_out(file: &Source, why: &str) -> String {
    let triads = file.columns.iter().filter_map(|column| column.triad());
    let mut triads: Vec<String> = triads.map(|(triad, _)| triad.to_string()).collect();
    triads.dedup();
    let (place, triads) = (file_name(&file.path), triads.join(", "));
    format!("{place}: {triads} left out: {why}")
}

/// The rows of a recording.
pub(super) struct JoinedFiles {
    pub columns: Columns,
    pub rate_hz: f64,
    pub t_s: Vec<f64>,
    /// Empty if there are none.
    pub steps: Vec<i32>,
    pub labels: StepLabels,
    values: Vec<(Column, Vec<f64>)>,
    /// Rows at whose times all files have values.
    keep: Vec<bool>,
    pub summary: ImportSummary,
}

impl JoinedFiles {
    /// Adds the known inputs of the rows.
    pub fn add(&mut self, inputs: &mut StepInputs) {
        let labels = &self.labels;
        let given = inputs.of_rows(&self.steps, labels, self.rate_hz);
        self.values.extend(given);
    }

    /// Writes the rows that all files have.
    ///
    /// # Errors
    /// There are none; or those of the writer.
    pub fn write(&mut self, writer: &mut Writer) -> Result<()> {
        let rows: Vec<usize> = (0..self.keep.len()).filter(|row| self.keep[*row]).collect();
        if rows.is_empty() {
            let problem = "the files have no time in common";
            let remedy = "check that their times start at the same instant and have the same unit";
            return Err(Error::new("import", problem, remedy).about(Argument::TimeUnit));
        }
        for rows in rows.chunks(BATCH) {
            let mut batch = Batch::default();
            batch.t_s.extend(rows.iter().map(|row| self.t_s[*row]));
            if self.columns.step {
                batch.step.extend(rows.iter().map(|row| self.steps[*row]));
            }
            for (column, values) in &self.values {
                if let Some(target) = batch.values_mut(*column) {
                    target.extend(rows.iter().map(|row| values[*row]));
                }
            }
            let empty = batch.raw.iter().flatten().filter(|value| value.is_nan());
            self.summary.empty_cells += empty.count() as u64;
            writer.write(&batch)?;
        }
        self.summary.rows += rows.len() as u64;
        Ok(())
    }
}
