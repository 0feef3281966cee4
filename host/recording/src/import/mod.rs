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
mod gyroflow;
pub(crate) mod head;
mod header;
mod inputs;
mod instance;
mod join;
mod joined;
pub mod labelled;
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
#[cfg(feature = "bags")]
mod ros;
mod rotation;
mod row_filter;
mod row_limit;
mod row_range;
mod sequence;
mod source;
#[cfg(feature = "bags")]
mod sqlite;
mod step_inputs;
mod step_labels;
mod summary;
mod table;
#[cfg(all(test, feature = "parquet"))]
mod tests;
#[cfg(feature = "parquet")]
mod text_columns;
mod time;
mod unit_names;

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
#[cfg(feature = "parquet")]
pub use text_columns::text_columns;
pub use time::{Jitter, Rounds, TimeSummary};

use joined::Files;
use sequence::import_sequence;
use step_inputs::StepInputs;

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
    crate::staging::check_target(out, Some(options.replace))?;
    match options.is_sequence() {
        true => import_sequence(options, out, &progress),
        false => import_joined(options, out, &progress),
    }
}

/// Imports files side by side.
fn import_joined(
    options: &ImportOptions,
    out: &Path,
    progress: &dyn Fn(f64),
) -> Result<ImportSummary> {
    let mut inputs = StepInputs::of(options)?;
    let files = Files::read(options, progress)?;
    let left_out = files.to_leave_out();
    let columns = files.columns(options, left_out, inputs.as_ref())?;
    let mut manifest = files.manifest(options);
    manifest.check("import")?;
    let mut joined = files.join(options, columns, left_out, None)?;
    if let Some(inputs) = &mut inputs {
        joined.add(inputs);
        manifest.turn_steps = inputs.turns();
        joined
            .summary
            .warnings
            .extend(inputs.warnings(&joined.labels));
    }
    let mut writer = Writer::create(out, columns, options.format, options.replace)?;
    joined.write(&mut writer)?;
    for file in options.files.iter().chain(&options.log.inputs) {
        manifest.sources.push(options::source(file)?);
    }
    manifest.step_labels = joined.labels.into_labels();
    let mut summary = joined.summary;
    summary.recording = writer.finish(&manifest)?.display().to_string();
    progress(1.0);
    Ok(summary)
}
