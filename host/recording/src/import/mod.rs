//! Import of foreign files: text of any common shape, and Parquet.

mod ardupilot;
mod assignment;
mod binary;
mod broken;
mod codes;
mod counter;
mod faces;
mod first_pass;
mod foreign;
mod inputs;
mod join;
mod joined;
mod log;
mod options;
#[cfg(feature = "parquet")]
mod parquet_table;
mod plausibility;
mod pose_means;
mod preset;
mod preview;
mod px4;
mod readings;
mod resample;
#[cfg(feature = "bags")]
mod ros;
mod rotation;
mod row;
mod row_filter;
mod sequence;
mod sequence_position;
#[cfg(feature = "bags")]
mod sqlite;
mod step_inputs;
mod step_labels;
mod summary;
#[cfg(all(test, feature = "parquet"))]
mod tests;
mod text_table;
mod time;
mod two_sources;
#[cfg(not(feature = "bags"))]
mod without_bags;
#[cfg(not(feature = "parquet"))]
mod without_parquet;

#[cfg(not(feature = "bags"))]
use without_bags as ros;
#[cfg(not(feature = "parquet"))]
use without_parquet as parquet_table;

use std::path::Path;

pub use assignment::{ColumnList, Offset, Role, Scale};
pub use broken::{BrokenKind, BrokenLimit, BrokenRows};
pub use codes::{TwosComplement, Zero};
pub use faces::Face;
pub use inputs::Inputs;
pub use log::is_log;
pub use options::ImportOptions;
pub use pose_means::{PoseMean, PoseMeans};
pub use preset::{Chosen, Preset, PresetUse};
pub use preview::{Preview, preview};
pub use row_filter::RowFilter;
pub use summary::{ImportSummary, SkippedLines};
pub use time::{Decimal, Jitter, Rounds, TimeSummary};

use joined::JoinedFiles;
use options::source;

use super::writer::Writer;
use crate::error::Result;

/// Imports foreign files as a recording at `out`; `progress` receives the share of the first file that has been read.
pub fn import(
    options: &ImportOptions,
    out: &Path,
    progress: impl Fn(f64),
) -> Result<ImportSummary> {
    options.check(out)?;
    if options.means {
        return pose_means::import_means(options, out);
    }
    if options.is_sequence() {
        return sequence::import_sequence(options, out, progress);
    }
    // Only reading all rows shows that a sensor reads nothing but zeros. This is rare, so the import is then repeated without the sensor.
    let mut left_out = [false; 2];
    loop {
        match import_sensors(options, out, &progress, left_out)? {
            Outcome::Done(summary) => return Ok(*summary),
            Outcome::NotConnected(sensors) => left_out = sensors,
        }
    }
}

/// Outcome of an import.
enum Outcome {
    Done(Box<ImportSummary>),
    /// Nothing was written, because these sensors (gyro, accelerometer) read only zeros.
    NotConnected([bool; 2]),
}

/// Imports without the sensors (gyro, accelerometer) that `left_out` marks.
fn import_sensors(
    options: &ImportOptions,
    out: &Path,
    progress: &impl Fn(f64),
    left_out: [bool; 2],
) -> Result<Outcome> {
    let mut import = JoinedFiles::open(options, left_out)?;
    let mut manifest = import.manifest(options, out);
    manifest.check("import")?;
    let mut writer = Writer::create(out, import.columns, options.format, options.replace)?;
    import.run(&mut writer, progress)?;
    let dead = import.dead_sensors();
    if writer.rows() > 0 && left_out == [false; 2] && dead != left_out {
        return Ok(Outcome::NotConnected(dead));
    }
    import.finish_summary(writer.rows(), &manifest)?;
    for file in options.files.iter().chain(&options.inputs) {
        manifest.sources.push(source(file)?);
    }
    if let Some(inputs) = &import.inputs {
        manifest.turn_steps = inputs.turns().collect();
    }
    manifest.step_labels = std::mem::take(&mut import.first.labels).into_labels();
    import.summary.recording = writer.finish(&manifest)?.display().to_string();
    Ok(Outcome::Done(Box::new(import.summary)))
}
