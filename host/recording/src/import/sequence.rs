//! Files that follow one another: one for each pose or rate, as when six faces are recorded.
//!
//! Each file is a step, labelled with its name. Its clock may have restarted: its start time is used if it lies after the file before; otherwise the
//! file begins [`PAUSE_S`] after that one. The turns between files are unknown.

use std::collections::BTreeSet;
use std::path::Path;

use super::faces::Face;
use super::joined::{Files, LeftOut};
use super::log_options::file_name;
use super::options::source;
use super::step_inputs::StepInputs;
use super::step_labels::StepLabels;
use super::{ImportOptions, ImportSummary};
use crate::columns::Columns;
use crate::declared::Reference;
use crate::error::{Argument, Error, Result};
use crate::health::{Fault, Finding, SENSORS};
use crate::writer::Writer;

/// Rates of two files may differ by this share: a loop without a timer is not equally fast each time.
const ALIKE: f64 = 0.02;

/// Time in s from one file to the next if it is unknown. No turn is integrated across such a gap.
const PAUSE_S: f64 = 10.0;

/// Imports the files of `options` one after the other.
pub(super) fn import_sequence(
    options: &ImportOptions,
    out: &Path,
    progress: &dyn Fn(f64),
) -> Result<ImportSummary> {
    let labels = labels(options)?;
    let mut inputs = StepInputs::of(options)?;
    let mut files = Vec::new();
    let count = options.files.len() as f64;
    for (step, path) in options.files.iter().enumerate() {
        let one = of_file(options, step, path);
        let read = Files::read(&one, &|share| progress((step as f64 + share) / count))?;
        if read.first.steps.is_some() {
            let problem = "it has a column step, but in a sequence each file is a dwell";
            let remedy = "skip the column, or import this file alone";
            return Err(Error::new(path.display(), problem, remedy).about(Argument::Columns));
        }
        files.push((one, read));
    }
    let left_out = left_out(files.iter().map(|(_, read)| read))?;
    let columns = alike(&files, left_out, inputs.as_ref())?;
    let mut manifest = files[0].1.manifest(options);
    manifest.check("import")?;
    let mut writer = Writer::create(out, columns, options.format, options.replace)?;
    let mut summary: Option<ImportSummary> = None;
    let begun_s = |read: &Files| read.time.first().map_or(0, |time| time.origin_s);
    let origin_s = begun_s(&files[0].1);
    let mut after_s = f64::NEG_INFINITY;
    for (step, (one, read)) in (0..).zip(files) {
        let behind_s = (begun_s(&read) - origin_s) as f64;
        let mut joined = read.join(&one, columns, left_out, Some(step))?;
        joined.labels = StepLabels::of(labels.clone());
        let first_s = joined.t_s.first().copied().unwrap_or(0.0);
        let offset_s = match behind_s + first_s > after_s {
            true => behind_s,
            false => after_s + PAUSE_S - first_s,
        };
        joined.t_s.iter_mut().for_each(|t| *t += offset_s);
        after_s = joined.t_s.last().copied().unwrap_or(after_s);
        if let Some(inputs) = &mut inputs {
            joined.add(inputs);
        }
        joined.write(&mut writer)?;
        match &mut summary {
            Some(all) => add(all, joined.summary),
            None => summary = Some(joined.summary),
        }
    }
    let mut summary = summary.unwrap_or_default();
    summary
        .warnings
        .splice(0..0, options.preset_warnings.clone());
    if !options.faces.is_empty() {
        summary.warnings.extend(of_faces(options, columns.gyro));
    }
    for file in options.files.iter().chain(&options.log.inputs) {
        manifest.sources.push(source(file)?);
    }
    if let Some(inputs) = &inputs {
        manifest.turn_steps = inputs.turns();
        summary
            .warnings
            .extend(inputs.warnings(&StepLabels::of(labels.clone())));
    }
    manifest.step_labels = labels;
    summary.recording = writer.finish(&manifest)?.display().to_string();
    Ok(summary)
}

/// The options of the file of a step.
fn of_file(options: &ImportOptions, step: usize, path: &Path) -> ImportOptions {
    let lists = &options.log.columns;
    let list = lists.get(step).or(lists.first());
    let mut one = ImportOptions {
        files: vec![path.to_owned()],
        preset_warnings: Vec::new(),
        ..options.clone()
    };
    one.log.columns = list.cloned().into_iter().collect();
    one
}

/// Columns that measure nothing: a thermometer that never answers in any file, and its zeros. Refuses a sensor that was not connected.
fn left_out<'a>(files: impl Iterator<Item = &'a Files>) -> Result<LeftOut> {
    let mut all = LeftOut {
        thermometer: true,
        ..LeftOut::default()
    };
    for (k, file) in files.enumerate() {
        let dead = file.to_leave_out();
        let before = dead.triads.iter();
        // One that answers in some of the files is connected.
        let in_all = before.filter(|triad| k == 0 || all.triads.contains(*triad));
        all.triads = in_all.collect();
        if let Some(sensor) = dead.sensors.iter().position(|dead| *dead) {
            let found = Finding::new(SENSORS[sensor], 0, Fault::NotConnected);
            return Err(found.refusal(file.first.path.display()));
        }
        all.thermometer &= dead.thermometer;
        all.zero_temperatures |= dead.thermometer || dead.zero_temperatures;
    }
    all.zero_temperatures &= !all.thermometer;
    Ok(all)
}

/// The columns of all files. Refuses a file with other columns or another rate than the first.
fn alike(
    files: &[(ImportOptions, Files)],
    left_out: LeftOut,
    inputs: Option<&StepInputs>,
) -> Result<Columns> {
    let first = file_name(&files[0].1.first.path);
    let rate_hz = files[0].1.rate_hz;
    let mut columns = None;
    for (options, file) in files {
        let (own, place) = (
            file.columns(options, left_out, inputs)?,
            file.first.path.display(),
        );
        if *columns.get_or_insert(own) != own {
            let problem = format!("its columns differ from those of {first}");
            let remedy = "give a list of columns for each file";
            return Err(Error::new(place, problem, remedy).about(Argument::Columns));
        }
        if (file.rate_hz / rate_hz - 1.0).abs() > ALIKE {
            let own_hz = file.rate_hz;
            let problem = format!("its rate is {own_hz} Hz, but that of {first} is {rate_hz} Hz");
            let remedy = "import only files with the same rate as a sequence";
            return Err(Error::new(place, problem, remedy));
        }
    }
    Ok(columns.unwrap_or_default())
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
    all.rows += one.rows;
    all.dropped_outside += one.dropped_outside;
    all.dropped_in_gaps += one.dropped_in_gaps;
}
