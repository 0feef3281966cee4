//! Import of foreign files: text of any common shape, and Parquet.

mod ardupilot;
mod assignment;
mod binary;
pub(crate) mod broken;
mod codes;
pub(crate) mod comment_signs;
mod copied;
mod counter;
mod decimal;
mod faces;
mod first_pass;
mod foreign;
mod gyroflow;
pub(crate) mod head;
mod header;
mod inputs;
mod instance;
mod join;
mod joined;
pub mod labelled;
mod left_out;
pub(crate) mod lines;
mod log;
mod log_options;
pub mod look;
mod name_words;
mod names;
pub(crate) mod noticed;
mod options;
#[cfg(feature = "parquet")]
mod parquet_rows;
mod per_column;
mod plausibility;
mod pose_means;
mod preset;
mod preview;
mod px4;
mod reading_units;
mod readings;
mod resample;
#[cfg(feature = "bags")]
mod ros;
mod rotation;
mod row;
mod row_filter;
mod row_limit;
mod row_range;
mod sequence;
mod sequence_position;
#[cfg(feature = "bags")]
mod sqlite;
mod step_inputs;
mod step_labels;
mod summary;
mod table;
#[cfg(all(test, feature = "parquet"))]
mod tests;
mod text_columns;
mod time;
mod unit_names;
#[cfg(not(feature = "bags"))]
mod without_bags;
#[cfg(not(feature = "parquet"))]
mod without_parquet;

#[cfg(not(feature = "bags"))]
use without_bags as ros;
#[cfg(not(feature = "parquet"))]
use without_parquet as parquet_rows;

use std::path::Path;

pub use assignment::{ColumnList, Role};
pub use broken::{BrokenKind, BrokenLimit, BrokenRows};
pub use comment_signs::CommentSigns;
pub use copied::{CopiedTable, ReplacedTriad};
pub use decimal::Decimal;
pub use faces::Face;
pub use inputs::Inputs;
pub use instance::Instance;
pub use log::{is_log, log_formats};
pub use log_options::LogOptions;
pub use options::ImportOptions;
pub use per_column::{Offset, PerColumn, Scale, TwosComplement, Zero};
pub use pose_means::{PoseMean, PoseMeans};
pub use preset::{Chosen, Preset, PresetUse};
pub use preview::{Preview, preview};
pub use reading_units::ReadingUnits;
pub use row_filter::RowFilter;
pub use row_range::RowRange;
pub use summary::{ImportSummary, SkippedLines};
pub use text_columns::text_columns;
pub use time::{Jitter, Rounds, TimeSummary};

use joined::JoinedFiles;
use left_out::{LeftOut, repeated};
use options::source;
use sequence::import_sequence;

use super::writer::Writer;
use crate::error::Result;

/// Imports foreign files as a recording at `out`; `progress` receives the share of the first file that has been read.
pub fn import(
    options: &ImportOptions,
    out: &Path,
    progress: impl Fn(f64),
) -> Result<ImportSummary> {
    options.check(out)?;
    if options.log.means {
        return pose_means::import_means(options, out);
    }
    if options.is_sequence() {
        return repeated(|left_out| import_sequence(options, out, &progress, left_out));
    }
    // Only reading all rows shows that a sensor reads nothing but zeros. This is rare, so the import is then repeated without the sensor.
    repeated(|left_out| import_joined(options, out, &progress, left_out))
}

/// Imports files side by side, without `left_out`. If more is to be left out, writes nothing and returns all of it.
fn import_joined(
    options: &ImportOptions,
    out: &Path,
    progress: &impl Fn(f64),
    left_out: LeftOut,
) -> Result<std::result::Result<ImportSummary, LeftOut>> {
    let mut import = JoinedFiles::open(options, left_out)?;
    let mut manifest = import.manifest(options);
    manifest.check("import")?;
    let mut writer = Writer::create(out, import.columns, options.format, options.replace)?;
    import.run(&mut writer, progress)?;
    let dead = import.to_leave_out();
    if writer.rows() > 0 && left_out == LeftOut::default() && dead != left_out {
        return Ok(Err(dead));
    }
    import.finish_summary(writer.rows(), &manifest)?;
    for file in options.files.iter().chain(&options.log.inputs) {
        manifest.sources.push(source(file)?);
    }
    if let Some(inputs) = &import.inputs {
        manifest.turn_steps = inputs.turns().collect();
    }
    manifest.step_labels = std::mem::take(&mut import.first.labels).into_labels();
    import.summary.recording = writer.finish(&manifest)?.display().to_string();
    Ok(Ok(import.summary))
}
