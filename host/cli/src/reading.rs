//! Reads the recording of a subcommand.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use mimu::prepared::Prepared;
use mimu::signal::stillness::Finding;
use mimu_recording::error::{Error, Result};
use mimu_recording::{MANIFEST_FILE, PoseMeans, Recording};
use tempfile::TempDir;

use crate::importing::imported_log;
use crate::output::{check_outputs, progress};
use crate::report;

/// Folders of logs that were given in place of recordings; see [`remove_logs`].
static LOGS: Mutex<Vec<TempDir>> = Mutex::new(Vec::new());

/// The recording at `path`: its folder. A file is a log: it is imported to a folder that lasts as long as the command, and what it was taken for is
/// printed to standard error, where it does not disturb a result.
///
/// # Errors
/// A log that does not show its columns or units; the error has the import to complete.
pub(crate) fn folder(path: &Path) -> Result<PathBuf> {
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
    let io = |error: std::io::Error| Error::io(&std::env::temp_dir(), &error);
    let scratch = tempfile::Builder::new()
        .prefix("mimu-")
        .tempdir()
        .map_err(io)?;
    let out = scratch.path().join(path.file_name().unwrap_or_default());
    LOGS.lock()
        .unwrap_or_else(PoisonError::into_inner)
        .push(scratch);
    let summary = imported_log(path, &out)?;
    eprint!("{}", report::import_text(&summary));
    Ok(out)
}

/// Removes the folders of logs, at the end of a command.
pub(crate) fn remove_logs() {
    LOGS.lock().unwrap_or_else(PoisonError::into_inner).clear();
}

/// Reads a recording of samples or of means like [`read`].
pub(crate) fn read_samples_or_means(
    directory: &Path,
    finding: Finding,
    outputs: &[Option<&Path>],
    others: &[Option<&Path>],
) -> Result<Prepared> {
    let given = directory;
    let directory = &folder(given)?;
    let Some(means) = PoseMeans::file(directory) else {
        let others: Vec<Option<&Path>> = others.iter().copied().chain([Some(given)]).collect();
        return read(directory, finding, outputs, &others);
    };
    let manifest = directory.join(MANIFEST_FILE);
    let mut inputs: Vec<&Path> = vec![&manifest, &means];
    inputs.extend(others.iter().flatten());
    check_outputs(outputs, &inputs)?;
    Prepared::of_means(&PoseMeans::open(directory)?)
}

/// Reads a recording, after checking that the results can be written and overwrite no input.
pub(crate) fn read(
    directory: &Path,
    finding: Finding,
    outputs: &[Option<&Path>],
    others: &[Option<&Path>],
) -> Result<Prepared> {
    let given = directory;
    let directory = &folder(given)?;
    let recording = Recording::open(directory)?;
    let manifest = directory.join(MANIFEST_FILE);
    let mut inputs: Vec<&Path> = vec![&manifest, &recording.samples, given];
    inputs.extend(others.iter().flatten());
    check_outputs(outputs, &inputs)?;
    let bar = progress("reading");
    let prepared = Prepared::read(&recording, finding, |share| {
        bar.set_position((share * 1000.0) as u64)
    });
    bar.finish_and_clear();
    prepared
}
