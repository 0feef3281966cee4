//! Reads the recording of a subcommand.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::{Mutex, PoisonError};

use clap::Args;
use mimu::{DwellSearch, Prepared};
use mimu_recording::error::{Error, Result};
use mimu_recording::{ImportOptions, LogOptions, MANIFEST_FILE, PoseMeans, Recording};
use tempfile::TempDir;

use crate::hint::LOG_IS_READ;
use crate::importing::imported_log;
use crate::output::{check_outputs, progress};
use crate::report;

/// What a log that is given in place of a recording does not say, and where its recording is kept.
#[derive(Args, Default, Clone)]
pub(crate) struct LogArgs {
    /// Directory in which to keep the recording that is made of the log
    #[arg(long = "save", value_name = "DIR")]
    folder: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) options: LogOptions,
}

impl LogArgs {
    /// With the gravity of a calibration that judges the log, unless the person knows a better one.
    pub(crate) fn or_gravity(&self, known: Option<f64>) -> Self {
        let mut with = self.clone();
        if with.options.latitude_deg.is_none() {
            with.options.gravity_mps2 = with.options.gravity_mps2.or(known);
        }
        with
    }
}

/// Folders of logs that were given in place of recordings; see [`remove_logs`].
static LOGS: Mutex<Vec<TempDir>> = Mutex::new(Vec::new());

/// Logs that were read, with the folders of their recordings: a command that turns from poses to a compass alone opens its log again.
static READ: Mutex<Vec<(PathBuf, PathBuf)>> = Mutex::new(Vec::new());

/// The recording at `path`: its folder. A file is a log: it is imported to the folder of `log`, or to one that lasts as long as the command, and what
/// it was taken for is printed to standard error, where it does not disturb a result.
///
/// # Errors
/// A log that does not show its columns or units; the error has the import to complete.
pub(crate) fn folder(path: &Path, log: &LogArgs) -> Result<PathBuf> {
    let own = path.file_name().is_some_and(|name| name == MANIFEST_FILE);
    let within = path
        .parent()
        .filter(|parent| path.is_file() && parent.join(MANIFEST_FILE).is_file());
    if let (Some(parent), true) = (within, own || path.is_file()) {
        return Ok(parent.to_owned());
    }
    if !path.is_file() {
        return Ok(path.to_owned());
    }
    let known = || READ.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, folder)) = known().iter().find(|(log, _)| log == path) {
        return Ok(folder.clone());
    }
    let (folder, _) = imported_to(path, log)?;
    known().push((path.to_owned(), folder.clone()));
    Ok(folder)
}

/// The folder to which the log at `path` is imported, and the options of its import.
pub(crate) fn imported_to(path: &Path, log: &LogArgs) -> Result<(PathBuf, ImportOptions)> {
    let out = match &log.folder {
        Some(folder) => folder.clone(),
        None => scratch()?.join(path.file_name().unwrap_or_default()),
    };
    LOG_IS_READ.store(true, Ordering::Relaxed);
    let (mut summary, options) = imported_log(path, &out, &log.options)?;
    // Its folder is of no interest.
    if log.folder.is_none() {
        summary.recording = path.display().to_string();
    }
    eprint!("{}", report::import_text(&summary));
    Ok((out, options))
}

/// Opens the recording at `path`, or that of the log at `path`, which messages then name.
pub(crate) fn open(path: &Path, log: &LogArgs) -> Result<Recording> {
    Ok(named(Recording::open(&folder(path, log)?)?, path))
}

/// `recording`, called by the log at `given` if it is in a folder that nobody sees.
pub(crate) fn named(mut recording: Recording, given: &Path) -> Recording {
    let logs = LOGS.lock().unwrap_or_else(PoisonError::into_inner);
    if logs
        .iter()
        .any(|log| recording.directory.starts_with(log.path()))
    {
        recording.place = given.display().to_string();
    }
    recording
}

/// A folder that [`remove_logs`] removes.
fn scratch() -> Result<PathBuf> {
    let made = tempfile::Builder::new().prefix("mimu-").tempdir();
    let made = made.map_err(|error| Error::io(&std::env::temp_dir(), &error))?;
    let path = made.path().to_owned();
    let mut logs = LOGS.lock().unwrap_or_else(PoisonError::into_inner);
    logs.push(made);
    Ok(path)
}

/// Removes the folders of logs, at the end of a command.
pub(crate) fn remove_logs() {
    READ.lock().unwrap_or_else(PoisonError::into_inner).clear();
    LOGS.lock().unwrap_or_else(PoisonError::into_inner).clear();
}

/// Reads a recording of samples or of means like [`read_samples`]; with the recording, if it is one of samples.
pub(crate) fn read_with_samples(
    directory: &Path,
    log: &LogArgs,
    search: DwellSearch,
    outputs: &[Option<&Path>],
    others: &[Option<&Path>],
) -> Result<(Prepared, Option<Recording>)> {
    let Some(means) = PoseMeans::file(directory) else {
        let (prepared, recording) = read_samples(directory, log, search, outputs, others)?;
        return Ok((prepared, Some(recording)));
    };
    let manifest = directory.join(MANIFEST_FILE);
    let mut inputs: Vec<&Path> = vec![&manifest, &means];
    inputs.extend(others.iter().flatten());
    check_outputs(outputs, &inputs)?;
    Ok((Prepared::of_means(&PoseMeans::open(directory)?)?, None))
}

/// Reads a recording, after checking that the results can be written and overwrite no input.
pub(crate) fn read_samples(
    directory: &Path,
    log: &LogArgs,
    search: DwellSearch,
    outputs: &[Option<&Path>],
    others: &[Option<&Path>],
) -> Result<(Prepared, Recording)> {
    let recording = open(directory, log)?;
    let manifest = recording.directory.join(MANIFEST_FILE);
    let mut inputs: Vec<&Path> = vec![&manifest, &recording.samples, directory];
    inputs.extend(others.iter().flatten());
    check_outputs(outputs, &inputs)?;
    let bar = progress("reading");
    let prepared = Prepared::read(&recording, search, |share| bar.reach(share));
    bar.finish();
    Ok((prepared?, recording))
}
