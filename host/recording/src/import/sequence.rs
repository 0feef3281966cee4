//! Files that follow one another: one for each pose or rate, as when six faces are recorded.
//!
//! Each file is a step, labelled with its name. Its clock may have restarted: its start time is used if it lies after the file before; otherwise the
//! file begins [`PAUSE_S`](super::place::PAUSE_S) after that one. The turns between files are unknown.

use std::collections::BTreeSet;
use std::path::Path;

use super::faces::Face;
use super::joined::JoinedFiles;
use super::options::{file_name, source};
use super::sequence_position::SequencePosition;
use super::step_inputs::StepInputs;
use super::step_labels::StepLabels;
use super::thermometer::LeftOut;
use super::{ImportOptions, ImportSummary};
use crate::columns::Columns;
use crate::error::{Argument, Error, Result};
use crate::manifest::{Manifest, Reference};
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
    let labels = labels(options)?;
    let mut inputs: Option<StepInputs> = None;
    let mut open: Option<(Writer, Manifest, ImportSummary, Columns)> = None;
    let mut without = LeftOut {
        thermometer: true,
        ..LeftOut::default()
    };
    let (mut origin_s, mut after_s) = (0, f64::NEG_INFINITY);
    let count = options.files.len() as f64;
    for (step, path) in options.files.iter().enumerate() {
        let list = options.columns.get(step).or(options.columns.first());
        let one = ImportOptions {
            files: vec![path.clone()],
            columns: list.cloned().into_iter().collect(),
            preset_warnings: Vec::new(),
            ..options.clone()
        };
        let mut import = JoinedFiles::open(&one, left_out)?;
        if import.first.has_step() {
            let problem = "it has a column step, but in a sequence each file is a dwell";
            let remedy = "skip the column, or import this file alone";
            return Err(Error::new(path.display(), problem, remedy).about(Argument::Columns));
        }
        // Which rows of the table are unused is known only after all files.
        let own = import.inputs.take();
        import.inputs = own.map(|own| own.of_step(step as i32, inputs.take()));
        import.first.labels = StepLabels::of(labels.clone());
        let begun_s = import.summary.time.first().map_or(0, |time| time.origin_s);
        if step == 0 {
            origin_s = begun_s;
        }
        let behind_s = (begun_s - origin_s) as f64;
        import.place = Some(SequencePosition::new(step as i32, behind_s, after_s));
        let (writer, manifest, summary, columns) = match &mut open {
            Some(open) => open,
            None => {
                let mut manifest = import.manifest(options);
                manifest.check("import")?;
                manifest.step_labels = labels.clone();
                let writer = Writer::create(out, import.columns, options.format, options.replace)?;
                let mut summary = import.summary.clone();
                (summary.time, summary.warnings) = (Vec::new(), options.preset_warnings.clone());
                if !options.faces.is_empty() {
                    let gyro = import.columns.gyro;
                    summary.warnings.extend(of_faces(options, gyro));
                }
                open.insert((writer, manifest, summary, import.columns))
            }
        };
        if import.columns != *columns {
            let problem = format!(
                "its columns differ from those of {}",
                file_name(&options.files[0])
            );
            return Err(Error::new(
                path.display(),
                problem,
                "give a list of columns for each file",
            )
            .about(Argument::Columns));
        }
        if (import.rate_hz / manifest.sample_rate_hz - 1.0).abs() > ALIKE {
            let problem = format!(
                "its rate is {} Hz, but that of {} is {} Hz",
                import.rate_hz,
                file_name(&options.files[0]),
                manifest.sample_rate_hz
            );
            let remedy = "import only files with the same rate as a sequence";
            return Err(Error::new(path.display(), problem, remedy));
        }
        import.run(writer, &|share: f64| {
            progress((step as f64 + share) / count)
        })?;
        import.finish_summary(writer.rows(), manifest)?;
        let dead = import.to_leave_out();
        if let Some(sensor) = dead.sensors.iter().position(|dead| *dead) {
            let sensor = ["gyro", "accel"][sensor];
            let problem = format!("{sensor} is exactly 0 throughout: it was not connected");
            return Err(Error::new(
                path.display(),
                problem,
                "leave the file out, or skip the columns",
            ));
        }
        // A thermometer that answers in none of the files is none; in some, its zeros are missing answers.
        without.thermometer &= dead.thermometer;
        without.zero_temperatures |= dead.thermometer || dead.zero_temperatures;
        after_s = import.place.map_or(after_s, |place| place.last_s());
        manifest.sources.push(source(path)?);
        add(summary, import.summary);
        inputs = import.inputs;
        if let Some(inputs) = &inputs {
            manifest.turn_steps = inputs.turns().collect();
        }
    }
    let Some((writer, mut manifest, mut summary, _)) = open else {
        return Err(Error::new(
            "import",
            "no file is given",
            "name the files to import",
        ));
    };
    without.zero_temperatures &= !without.thermometer;
    if without != LeftOut::default() && left_out == LeftOut::default() {
        return Ok(Err(without));
    }
    if let Some(file) = &options.inputs {
        manifest.sources.push(source(file)?);
    }
    let unused = inputs.as_ref().and_then(StepInputs::unused);
    summary.warnings.extend(unused);
    summary.rows = writer.rows();
    summary.recording = writer.finish(&manifest)?.display().to_string();
    Ok(Ok(summary))
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
    all.skipped.header += one.skipped.header;
    all.skipped.comment += one.skipped.comment;
    all.skipped.blank += one.skipped.blank;
    all.broken_rows.extend(one.broken_rows);
    all.interpolated += one.interpolated;
    all.padding += one.padding;
    all.not_chosen += one.not_chosen;
    all.empty_cells += one.empty_cells;
}
