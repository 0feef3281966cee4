//! Files that follow one another: one for each pose or rate, as when six faces are recorded.
//!
//! Each file is a step, labelled with its name. Its clock may have restarted: its start time is used if it lies after the file before; otherwise the
//! file begins [`PAUSE_S`](super::place::PAUSE_S) after that one. The turns between files are unknown.

use std::collections::BTreeSet;
use std::path::Path;

use super::faces::Face;
use super::joined::JoinedFiles;
use super::left_out::LeftOut;
use super::log_options::file_name;
use super::options::source;
use super::sequence_position::SequencePosition;
use super::step_inputs::StepInputs;
use super::step_labels::StepLabels;
use super::{ImportOptions, ImportSummary};
use crate::columns::Columns;
use crate::declared::Reference;
use crate::error::{Argument, Error, Result};
use crate::health::{Fault, Finding, SENSORS};
use crate::manifest::Manifest;
use crate::writer::Writer;

/// Rates of two files may differ by this share: a loop without a timer is not equally fast each time.
const ALIKE: f64 = 0.02;

/// Imports the files of `options` one after the other, without `left_out`. If more is to be left out, writes nothing and returns all of it.
pub(super) fn import_sequence(
    options: &ImportOptions,
    out: &Path,
    progress: &impl Fn(f64),
    left_out: LeftOut,
) -> Result<std::result::Result<ImportSummary, LeftOut>> {
    let mut sequence = Sequence::of(options, left_out)?;
    let mut recording: Option<SequenceRecording> = None;
    let count = options.files.len() as f64;
    for (step, path) in options.files.iter().enumerate() {
        let mut import = sequence.open(step, path)?;
        let recording = match &mut recording {
            Some(recording) => recording,
            None => recording.insert(SequenceRecording::begin(&sequence, &import, out)?),
        };
        recording.check_alike(&import, path, &options.files[0])?;
        recording.take(&mut import, &|share| {
            progress((step as f64 + share) / count)
        })?;
        sequence.close(&import, path)?;
        recording.manifest.sources.push(source(path)?);
        add(&mut recording.summary, import.summary);
        sequence.inputs = import.inputs;
        if let Some(inputs) = &sequence.inputs {
            recording.manifest.turn_steps = inputs.turns().collect();
        }
    }
    let Some(recording) = recording else {
        return Err(Error::new(
            "import",
            "no file is given",
            "name the files to import",
        ));
    };
    let without = sequence.to_leave_out();
    if without != LeftOut::default() && left_out == LeftOut::default() {
        return Ok(Err(without));
    }
    recording.finish(options, sequence.inputs.as_ref()).map(Ok)
}

/// What the files of a sequence so far mean for the next one.
struct Sequence<'a> {
    options: &'a ImportOptions,
    left_out: LeftOut,
    labels: Vec<String>,
    /// The table of inputs. Which of its rows are unused is known only after all files.
    inputs: Option<StepInputs>,
    /// When the first file began, by its stamps.
    origin_s: i64,
    /// Time of the last row, s.
    after_s: f64,
    /// What is no reading: a thermometer in all files, zeros of it in any.
    without: LeftOut,
}

impl<'a> Sequence<'a> {
    fn of(options: &'a ImportOptions, left_out: LeftOut) -> Result<Self> {
        Ok(Self {
            options,
            left_out,
            labels: labels(options)?,
            inputs: None,
            origin_s: 0,
            after_s: f64::NEG_INFINITY,
            without: LeftOut {
                thermometer: true,
                ..LeftOut::default()
            },
        })
    }

    /// Opens the file of `step`, at its position after the others.
    fn open(&mut self, step: usize, path: &Path) -> Result<JoinedFiles> {
        let options = self.options;
        let mut one = ImportOptions {
            files: vec![path.to_owned()],
            preset_warnings: Vec::new(),
            ..options.clone()
        };
        let lists = &options.log.columns;
        let list = lists.get(step).or(lists.first());
        one.log.columns = list.cloned().into_iter().collect();
        let mut import = JoinedFiles::open(&one, self.left_out)?;
        if import.first.has_step() {
            let problem = "it has a column step, but in a sequence each file is a dwell";
            let remedy = "skip the column, or import this file alone";
            return Err(Error::new(path.display(), problem, remedy).about(Argument::Columns));
        }
        let own = import.inputs.take();
        import.inputs = own.map(|own| own.of_step(step as i32, self.inputs.take()));
        import.first.labels = StepLabels::of(self.labels.clone());
        let begun_s = import.summary.time.first().map_or(0, |time| time.origin_s);
        if step == 0 {
            self.origin_s = begun_s;
        }
        let behind_s = (begun_s - self.origin_s) as f64;
        let place = SequencePosition::new(step as i32, behind_s, self.after_s);
        import.place = Some(place);
        Ok(import)
    }

    /// Notes the end of a file that has been read, and what of it is no reading. Refuses a sensor that was not connected.
    fn close(&mut self, import: &JoinedFiles, path: &Path) -> Result<()> {
        let dead = import.to_leave_out();
        if let Some(sensor) = dead.sensors.iter().position(|dead| *dead) {
            let found = Finding::new(SENSORS[sensor], 0, Fault::NotConnected);
            return Err(found.refusal(path.display()));
        }
        // A thermometer that answers in none of the files is none; in some, its zeros are missing answers.
        self.without.thermometer &= dead.thermometer;
        self.without.zero_temperatures |= dead.thermometer || dead.zero_temperatures;
        self.after_s = import.place.map_or(self.after_s, |place| place.last_s());
        Ok(())
    }

    /// What is to be left out, once all files have been read.
    fn to_leave_out(&self) -> LeftOut {
        LeftOut {
            zero_temperatures: self.without.zero_temperatures && !self.without.thermometer,
            ..self.without
        }
    }
}

/// The recording of a sequence, to which each file is added.
struct SequenceRecording {
    writer: Writer,
    manifest: Manifest,
    summary: ImportSummary,
    columns: Columns,
}

impl SequenceRecording {
    /// Begins the recording with what the first file determines.
    fn begin(sequence: &Sequence<'_>, import: &JoinedFiles, out: &Path) -> Result<Self> {
        let options = sequence.options;
        let mut manifest = import.manifest(options);
        manifest.check("import")?;
        manifest.step_labels = sequence.labels.clone();
        let columns = import.columns;
        let writer = Writer::create(out, columns, options.format, options.replace)?;
        let mut summary = import.summary.clone();
        (summary.time, summary.warnings) = (Vec::new(), options.preset_warnings.clone());
        if !options.faces.is_empty() {
            summary.warnings.extend(of_faces(options, columns.gyro));
        }
        Ok(Self {
            writer,
            manifest,
            summary,
            columns,
        })
    }

    /// Refuses a file with other columns or another rate than the `first`.
    fn check_alike(&self, import: &JoinedFiles, path: &Path, first: &Path) -> Result<()> {
        let first = file_name(first);
        if import.columns != self.columns {
            let problem = format!("its columns differ from those of {first}");
            let remedy = "give a list of columns for each file";
            return Err(Error::new(path.display(), problem, remedy).about(Argument::Columns));
        }
        let rate_hz = self.manifest.sample_rate_hz;
        if (import.rate_hz / rate_hz - 1.0).abs() > ALIKE {
            let problem = format!(
                "its rate is {} Hz, but that of {first} is {rate_hz} Hz",
                import.rate_hz
            );
            let remedy = "import only files with the same rate as a sequence";
            return Err(Error::new(path.display(), problem, remedy));
        }
        Ok(())
    }

    /// Reads all rows of a file.
    fn take(&mut self, import: &mut JoinedFiles, progress: &impl Fn(f64)) -> Result<()> {
        import.run(&mut self.writer, progress)?;
        import.finish_summary(self.writer.rows(), &self.manifest)
    }

    fn finish(
        mut self,
        options: &ImportOptions,
        inputs: Option<&StepInputs>,
    ) -> Result<ImportSummary> {
        if let Some(file) = &options.log.inputs {
            self.manifest.sources.push(source(file)?);
        }
        let mut summary = self.summary;
        summary.warnings.extend(inputs.and_then(StepInputs::unused));
        summary.rows = self.writer.rows();
        summary.recording = self.writer.finish(&self.manifest)?.display().to_string();
        Ok(summary)
    }
}

/// Warnings about what six faces do not determine.
fn of_faces(options: &ImportOptions, gyro: bool) -> Vec<String> {
    let mut warnings: Vec<String> = Face::missing(&options.faces).into_iter().collect();
    if options.reference == Reference::Gravity {
        warnings.push(
            "with gravity as the reference only the magnitude of the specific force is known, and six faces do not determine the nine \
             parameters of an accelerometer: with --reference table the faces are its known inputs"
                .into(),
        );
    }
    if gyro {
        warnings.push(
            "gyro: the files contain rests but not the turns between them, so this recording does not determine its scale factors"
                .into(),
        );
    }
    warnings
}

/// Labels of the steps: the faces, or the names of the files without their endings.
fn labels(options: &ImportOptions) -> Result<Vec<String>> {
    if !options.faces.is_empty() {
        return Ok(options.faces.iter().map(Face::to_string).collect());
    }
    let stem = |path: &std::path::PathBuf| {
        let stem = path.file_stem().unwrap_or(path.as_os_str());
        stem.to_string_lossy().into_owned()
    };
    let labels: Vec<String> = options.files.iter().map(stem).collect();
    let mut seen = BTreeSet::new();
    if let Some(twice) = labels.iter().find(|label| !seen.insert(label.as_str())) {
        let problem =
            format!("two files have the name {twice}, but the names are the labels of the dwells");
        return Err(Error::new("import", problem, "give them different names"));
    }
    Ok(labels)
}

/// Adds the counts and warnings of a file to those of the files before.
fn add(all: &mut ImportSummary, one: ImportSummary) {
    all.time.extend(one.time);
    all.notes.extend(one.notes);
    all.warnings.extend(one.warnings);
    all.skipped.add(one.skipped);
    all.broken_rows.extend(one.broken_rows);
    all.interpolated += one.interpolated;
    all.padding += one.padding;
    all.not_chosen += one.not_chosen;
    all.empty_cells += one.empty_cells;
}
