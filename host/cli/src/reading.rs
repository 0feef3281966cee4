//! Reads the recording of a subcommand.

use std::path::Path;

use mimu::prepared::Prepared;
use mimu::signal::stillness::Finding;
use mimu_recording::error::Result;
use mimu_recording::{MANIFEST_FILE, PoseMeans, Recording};

use crate::output::{check_outputs, progress};

/// Reads a recording of samples or of means like [`read`].
pub(crate) fn read_samples_or_means(
    directory: &Path,
    finding: Finding,
    outputs: &[Option<&Path>],
    others: &[Option<&Path>],
) -> Result<Prepared> {
    let Some(means) = PoseMeans::file(directory) else {
        return read(directory, finding, outputs, others);
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
    let recording = Recording::open(directory)?;
    let manifest = directory.join(MANIFEST_FILE);
    let mut inputs: Vec<&Path> = vec![&manifest, &recording.samples];
    inputs.extend(others.iter().flatten());
    check_outputs(outputs, &inputs)?;
    let bar = progress("reading");
    let prepared = Prepared::read(&recording, finding, |share| {
        bar.set_position((share * 1000.0) as u64)
    });
    bar.finish_and_clear();
    prepared
}
