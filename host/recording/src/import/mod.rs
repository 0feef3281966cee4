//! Import of foreign files: text of any common shape, and Parquet.

mod assignment;
mod binary;
mod counter;
mod first_pass;
mod foreign;
mod inputs;
mod join;
mod options;
mod parquet_table;
mod plausibility;
mod pose_means;
mod preset;
mod resample;
mod ros;
mod row;
mod sequence;
mod step_labels;
#[cfg(test)]
mod tests;
mod text_table;
mod time;

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

pub use assignment::{ColumnList, Offset, Role, Scale};
pub use inputs::Inputs;
pub use options::ImportOptions;
pub use pose_means::{PoseMean, PoseMeans};
pub use preset::{Chosen, Preset, PresetUse};
pub use ros::is_bag;
pub use time::{Decimal, Jitter, Rounds, TimeSummary};

use foreign::{ForeignFile, HowToRead};
use join::{Follower, Joined, check_order};
use options::file_name;
use resample::Resampler;
use row::Row;
use sequence::Place;
use serde::Serialize;
use time::Times;

use super::batch::Batch;
use super::cell::shorten;
use super::columns::{Column, Columns, Layout};
use super::digest;
use super::manifest::{Manifest, Reference, Source};
use super::writer::Writer;
use crate::error::{Argument, Error, Result};

/// Rows that are written at a time.
const BATCH: usize = 1 << 14;

/// Lines of the source files that held no row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct SkippedLines {
    /// Headers and whatever else stood above the data.
    pub header: u64,
    /// Lines that begin with # or %.
    pub comment: u64,
    /// Empty lines.
    pub blank: u64,
}

/// What an import has done: the result of `mimu import`, as its JSON has it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImportSummary {
    /// `mimu-import/1`.
    pub format: &'static str,
    /// Directory of the recording.
    pub recording: String,
    /// Rows written.
    pub rows: u64,
    /// Whether the rows are means over a pose each, and no samples.
    pub means: bool,
    /// The maker's layout that the files were read by, if any.
    pub preset: Option<PresetUse>,
    /// Sample rate in Hz: that of the time stamps, or the one that was given where there are none; null of means without one.
    pub sample_rate_hz: f64,
    /// What the time stamps have shown, of each file that has them.
    pub time: Vec<TimeSummary>,
    /// Lines without a row, over all files.
    #[serde(rename = "skipped_lines")]
    pub skipped: SkippedLines,
    /// Rows of the first file that another file does not reach in time.
    pub dropped_outside: u64,
    /// Rows of the first file that lie in a gap of another file.
    pub dropped_in_gaps: u64,
    /// Rows with values interpolated from another file.
    pub interpolated: u64,
    /// Rows left out as padding, as all of their readings are 0.
    pub padding: u64,
    /// Raw cells that are empty.
    pub empty_cells: u64,
    /// One sentence for each thing that a person should know.
    pub warnings: Vec<String>,
}

/// Imports foreign files as a recording at `out`; `progress` hears the share of the first file
/// that has been read.
pub fn import(
    options: &ImportOptions,
    out: &Path,
    progress: impl Fn(f64),
) -> Result<ImportSummary> {
    check(options, out)?;
    if options.means {
        return pose_means::import_means(options, out);
    }
    if options.sequence {
        return sequence::import_sequence(options, out, progress);
    }
    // Only when all rows have been read it is known that a sensor has nothing but zeros. That is rare, and worth a second time.
    let mut left_out = [false; 2];
    loop {
        match import_sensors(options, out, &progress, left_out)? {
            Outcome::Done(summary) => return Ok(*summary),
            Outcome::NotConnected(sensors) => left_out = sensors,
        }
    }
}

/// What has become of an import.
enum Outcome {
    Done(Box<ImportSummary>),
    /// Nothing was written, as these sensors, gyro and accelerometer, have nothing but zeros.
    NotConnected([bool; 2]),
}

/// Imports without the sensors, gyro and accelerometer, that are to be left out.
fn import_sensors(
    options: &ImportOptions,
    out: &Path,
    progress: &impl Fn(f64),
    left_out: [bool; 2],
) -> Result<Outcome> {
    let mut import = Import::open(options, left_out)?;
    let mut manifest = import.manifest(options, out);
    manifest.check("import")?;
    let mut writer = Writer::create(out, import.columns, options.format, options.replace)?;
    import.run(&mut writer, progress)?;
    let dead = import.dead_sensors();
    if writer.rows() > 0 && left_out == [false; 2] && dead != left_out {
        return Ok(Outcome::NotConnected(dead));
    }
    import.finish_summary(&writer)?;
    for file in options.files.iter().chain(&options.inputs) {
        manifest.sources.push(Source {
            file: file_name(file),
            sha256: digest::sha256(file)?,
        });
    }
    if let Some(inputs) = &import.inputs {
        manifest.turn_steps = inputs.turns.iter().copied().collect();
    }
    manifest.step_labels = std::mem::take(&mut import.first.labels).into_labels();
    import.summary.recording = writer.finish(&manifest)?.display().to_string();
    Ok(Outcome::Done(Box::new(import.summary)))
}

fn check(options: &ImportOptions, out: &Path) -> Result<()> {
    let refuse = |problem: String, remedy: &str| Err(Error::new("import", problem, remedy));
    let (files, lists) = (options.files.len(), options.columns.len());
    if files == 0 {
        return refuse("no file is given".to_owned(), "name the files to import");
    }
    let one_for_all = options.sequence && lists == 1;
    if lists != 0 && lists != files && !one_for_all {
        return refuse(
            format!("there are {files} files and {lists} lists of columns"),
            "give one list of columns for each file, in their order",
        );
    }
    if let Some(rate) = options.rate_hz {
        super::manifest::check_rate(rate, "import, sample_rate_hz")
            .map_err(|e| e.about(Argument::SampleRate))?;
    }
    super::manifest::check_gravity(options.gravity_mps2, "import, gravity")?;
    // A source inside the recording that is to be replaced would be deleted with it.
    for file in options.files.iter().chain(&options.inputs) {
        let (Ok(file), Ok(out)) = (file.canonicalize(), out.canonicalize()) else {
            continue;
        };
        if file.starts_with(&out) {
            let problem = format!("{} lies in the recording to write", file.display());
            return refuse(problem, "choose another name for the recording");
        }
    }
    Ok(())
}

/// How often, in words.
fn times(count: u64) -> String {
    match count {
        1 => "once".into(),
        _ => format!("{count} times"),
    }
}

/// What to say where a rate was given and the time stamps have another one.
fn other_rate(times: &Times, given: f64) -> Option<String> {
    let summary = &times.summary;
    let off = given / summary.rate_hz - 1.0;
    (off.abs() > 1e-3).then(|| {
        format!(
            "{}: the rate of the time stamps is {} Hz, and not the {given} Hz that were given: the stamps are believed; to go by \
             the rate instead, skip the time column",
            summary.file, summary.rate_hz
        )
    })
}

/// Reads the next row of `file`, at regular times where there is a `resampler`; `false` at the end.
fn next(file: &mut ForeignFile, resampler: Option<&mut Resampler>, row: &mut Row) -> Result<bool> {
    match resampler {
        Some(resampler) => resampler.next(file, row),
        None => file.next(row),
    }
}

/// An import under way.
struct Import {
    first: ForeignFile,
    /// Gives the rows of the first file regular times, if a loop took them at irregular ones.
    resampler: Option<Resampler>,
    /// Where the first file stands in a sequence of them.
    place: Option<Place>,
    followers: Vec<Follower>,
    rate_hz: f64,
    columns: Columns,
    /// Column of each value, in the order in which the files give them.
    order: Vec<Column>,
    inputs: Option<Inputs>,
    /// Rows of each step of the first file, where angles must be divided by durations.
    step_rows: HashMap<i32, u64>,
    /// Inputs of the steps met so far; `None` where they are not known.
    known: HashMap<i32, Option<[f64; 6]>>,
    summary: ImportSummary,
}

impl Import {
    fn open(options: &ImportOptions, left_out: [bool; 2]) -> Result<Import> {
        let mut warnings = options.preset_warnings.clone();
        let mut first = ForeignFile::open(&options.files[0], &options.how(0))?;
        let mut time = Vec::new();
        let mut first_times: Option<Times> = None;
        let rate_hz = match first.has_time() {
            true => {
                let how = options.how(0);
                let times = first_pass::times(&options.files[0], &how, options.rate_hz, None)?;
                let rate_hz = times.summary.rate_hz;
                warnings.extend(options.rate_hz.and_then(|given| other_rate(&times, given)));
                time.push(times.summary.clone());
                first_times = Some(times.clone());
                first = first.with_times(times);
                rate_hz
            }
            // Opening has refused this already: without a time column the rate is needed.
            false => options.rate_hz.ok_or_else(|| {
                Error::new("import", "the rate is not known", "give it").about(Argument::SampleRate)
            })?,
        };
        let polled = first_times.as_ref().filter(|t| t.summary.polled.is_some());
        let resampler = polled.map(|times| Resampler::new(times.period_s()));
        let mut followers = Vec::new();
        for (index, path) in options.files.iter().enumerate().skip(1) {
            let how = HowToRead {
                rate_hz: options.rate_hz.or(Some(rate_hz)),
                ..options.how(index)
            };
            let mut file = ForeignFile::open(path, &how)?;
            if file.has_step() {
                let problem = "the column step is not in the first file";
                let remedy = "name the file with the steps first";
                return Err(Error::new(path.display(), problem, remedy));
            }
            let mut period_s = 1.0 / rate_hz;
            if file.has_time() {
                // A sensor of its own, with a rate and delays of its own; the instants are those of one clock.
                let times = first_pass::times(path, &how, options.rate_hz, first_times.as_ref())?;
                period_s = times.period_s();
                time.push(times.summary.clone());
                file = file.with_times(times);
            }
            followers.push(Follower::new(file, period_s, 1.0 / rate_hz));
        }
        let order: Vec<Column> = first
            .columns()
            .chain(
                followers
                    .iter()
                    .flat_map(|follower| follower.file.columns()),
            )
            .collect();
        let inputs = options.inputs.as_deref().map(Inputs::read).transpose()?;
        let mut names: Vec<&str> = vec![Column::Time.name()];
        let kept = |column: &&Column| !matches!(column, Column::Raw(c) if left_out[c / 3]);
        names.extend(order.iter().filter(kept).map(|column| column.name()));
        if first.has_step() || options.sequence {
            names.push(Column::Step.name());
        }
        let given = inputs.as_ref().map_or([false; 6], |inputs| inputs.columns);
        let given = (0..6)
            .filter(|&i| given[i])
            .map(|i| Column::Reference(i).name());
        names.extend(given);
        // The same rules as for a recording's header: nothing twice, all axes of a sensor.
        let columns = Layout::from_names(&names, "import, all columns together")?.columns;
        if inputs.is_some() && !first.has_step() && !options.sequence {
            let problem = "a table of inputs is given, and no column is step";
            return Err(Error::new(
                "import",
                problem,
                "name the column with the steps",
            ));
        }
        if options.reference == Reference::Table && columns.reference == [false; 6] {
            return Err(Error::new(
                "import, reference",
                "the reference is to be the table, and there is no ref_ column",
                "add the ref_ columns or a table of inputs, or say that the reference is gravity",
            )
            .about(Argument::Reference));
        }
        for file in followers
            .iter()
            .map(|follower| &follower.file)
            .chain([&first])
        {
            warnings.extend_from_slice(file.warnings());
        }
        let mut import = Import {
            rate_hz,
            columns,
            order,
            step_rows: HashMap::new(),
            known: HashMap::new(),
            summary: ImportSummary {
                format: "mimu-import/1",
                recording: String::new(),
                rows: 0,
                means: false,
                preset: options.preset.clone(),
                sample_rate_hz: rate_hz,
                time,
                skipped: SkippedLines::default(),
                dropped_outside: 0,
                dropped_in_gaps: 0,
                interpolated: 0,
                padding: 0,
                empty_cells: 0,
                warnings,
            },
            inputs,
            first,
            resampler,
            place: None,
            followers,
        };
        if import
            .inputs
            .as_ref()
            .is_some_and(|inputs| inputs.has_turns)
        {
            import.count_steps(&options.how(0), first_times)?;
        }
        Ok(import)
    }

    /// First pass: the duration of a step is known only when all of it has been seen.
    fn count_steps(&mut self, how: &HowToRead<'_>, times: Option<Times>) -> Result<()> {
        let mut file = ForeignFile::open(self.first.path(), how)?;
        let resampled = self.resampler.is_some();
        if let Some(times) = times.filter(|_| resampled) {
            file = file.with_times(times);
        }
        let mut resampler = resampled.then(|| Resampler::new(1.0 / self.rate_hz));
        let mut row = Row::default();
        while next(&mut file, resampler.as_mut(), &mut row)? {
            *self.step_rows.entry(row.step).or_default() += 1;
        }
        Ok(())
    }

    fn manifest(&self, options: &ImportOptions, out: &Path) -> Manifest {
        let device = options.device.clone().unwrap_or_else(|| file_name(out));
        let mut manifest = Manifest::new(
            device,
            self.rate_hz,
            options.gravity_mps2,
            options.raw_unit,
            options.reference,
        );
        manifest.latitude_deg = options.latitude_deg;
        manifest.imported_with = options.arguments();
        manifest
    }

    fn run(&mut self, writer: &mut Writer, progress: &impl Fn(f64)) -> Result<()> {
        let mut row = Row::default();
        let mut values = Vec::new();
        let mut batch = Batch::default();
        let mut last_t_s = f64::NEG_INFINITY;
        while next(&mut self.first, self.resampler.as_mut(), &mut row)? {
            check_order(&self.first, &row, last_t_s)?;
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

    /// Appends what the other files have at that time; `false` where the row is to be dropped.
    fn join(&mut self, t_s: f64, values: &mut Vec<f64>) -> Result<bool> {
        let mut worst = Joined::Exactly;
        for follower in &mut self.followers {
            match follower.values_at(t_s, values)? {
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
            let labels = &self.first.labels;
            let known = match row.step {
                -1 => None,
                step => *self.known.entry(step).or_insert_with(|| {
                    // n samples span n periods: each stands for the time until the next.
                    let rows = self.step_rows.get(&step).copied().unwrap_or(0);
                    inputs.input(step, labels, rows as f64 / self.rate_hz)
                }),
            };
            for (i, target) in batch.reference.iter_mut().enumerate() {
                if inputs.columns[i] {
                    target.push(known.map_or(f64::NAN, |input| input[i]));
                }
            }
        }
    }

    /// Which sensors, gyro and accelerometer, have shown nothing but zeros in the files that have them.
    fn dead_sensors(&self) -> [bool; 2] {
        [0, 1].map(|s| self.files().any(|file| file.seen.dead()[s].is_some()))
    }

    fn files(&self) -> impl Iterator<Item = &ForeignFile> {
        self.followers.iter().map(|f| &f.file).chain([&self.first])
    }

    fn finish_summary(&mut self, writer: &Writer) -> Result<()> {
        for file in self.files() {
            file.seen.check(&file_name(file.path()))?;
        }
        let files: Vec<&ForeignFile> = self
            .followers
            .iter()
            .map(|f| &f.file)
            .chain([&self.first])
            .collect();
        let summary = &mut self.summary;
        summary.rows = writer.rows();
        if summary.rows == 0 {
            return Err(Error::new(
                "import",
                "the files have no time in common",
                "check that their times begin at the same instant and are in the same unit",
            )
            .about(Argument::TimeUnit));
        }
        for file in files {
            let place = file_name(file.path());
            summary.warnings.extend(file.seen.warnings(&place));
            summary.padding += file.seen.padding;
            let dead = file.seen.dead();
            for (sensor, rows) in ["gyro", "accel"].iter().zip(dead) {
                summary.warnings.extend(rows.map(|rows| {
                    format!(
                        "{place}: {sensor} is exactly 0 on all axes in all of its {rows} rows: it was not connected, and is left out"
                    )
                }));
            }
            if file.zero_bytes() > 0 {
                summary.warnings.push(format!(
                    "{place}: {} bytes of 0 before and after its lines were left out, as room that was kept and not written",
                    file.zero_bytes()
                ));
            }
            if file.stamp_wraps() > 0 {
                summary.warnings.push(format!(
                    "{place}: the time stamps began again at 0 {}, as counters of 16 to 32 bits do, and were counted on",
                    times(file.stamp_wraps())
                ));
            }
            let skipped = file.skipped();
            summary.skipped.header += skipped.header;
            summary.skipped.comment += skipped.comment;
            summary.skipped.blank += skipped.blank;
            if file.wraps() > 0 {
                summary.warnings.push(format!(
                    "{}: the column sample began again at 0 {}, as counters of 16 and 32 bits do, and was counted on",
                    file.path().display(),
                    times(file.wraps())
                ));
            }
        }
        for time in &summary.time {
            let Some(rounds) = &time.polled else { continue };
            let [shortest, longest] =
                [rounds.shortest_s, rounds.longest_s].map(|s| format!("{:.1}", 1e3 * s));
            summary.warnings.push(format!(
                "{}: a loop read the unit at irregular times, {shortest} to {longest} ms apart; the readings are interpolated between them, which lowers their white noise; let a timer of the board or the sensor's own FIFO pace them",
                time.file
            ));
        }
        if summary.interpolated > 0 {
            summary.warnings.push(format!(
                "{} rows were interpolated between the times of another file, which lowers the white noise of its columns",
                summary.interpolated
            ));
        }
        if let Some(inputs) = &self.inputs {
            let unknown = self.known.iter().filter(|(_, input)| input.is_none());
            let steps: BTreeSet<i32> = unknown.map(|(&step, _)| step).collect();
            if !steps.is_empty() {
                let name = |&step: &i32| match self.first.labels.label(step) {
                    Some(label) => shorten(label.as_bytes()),
                    None => step.to_string(),
                };
                let names: Vec<String> = steps.iter().take(10).map(name).collect();
                let (count, names) = (steps.len(), names.join(", "));
                summary.warnings.push(format!(
                    "the inputs of {count} steps are not known: {names}"
                ));
            }
            // Of a sequence that is known when all of it has been read.
            if self.place.is_none() {
                summary.warnings.extend(inputs.unused());
            }
        }
        Ok(())
    }
}
