//! Recordings: reading them in a stream, writing them whole, and importing foreign files.
//!
//! A recording is a directory with `recording.toml` ([`Manifest`]) and `samples.csv` or `samples.parquet`. Four hours at 1 kHz are ordinary, so a
//! recording is never read into memory as a whole: [`Recording::for_each_batch`] hands rows over in order, some hundred thousand at a time.
//!
//! The features `parquet` and `bags` are on by default. Without them neither Parquet nor the readers of ROS bags and MCAP are compiled, recordings
//! are CSV, and such files are refused.

pub mod digits;
pub mod error;
pub mod health;
pub mod result_file;
pub mod signed_low_byte;
pub mod statistics;
pub mod units;

mod ahead;
mod batch;
mod cell;
mod clock;
mod columns;
mod csv_file;
mod csv_writer;
mod declared;
mod digest;
mod growing;
mod import;
mod in_memory;
mod manifest;
mod parents;
#[cfg(feature = "parquet")]
mod parquet_file;
#[cfg(feature = "parquet")]
mod parquet_writer;
mod reader;
mod recorded;
mod reference_error;
mod separator;
mod staging;
#[cfg(feature = "parquet")]
mod strict_file;
#[cfg(test)]
mod tests;
mod toml_file;
mod triad_name;
mod triads;
mod turntable;
mod unit_name;
mod warning;
mod writer;

pub use batch::Batch;
pub use clock::{ClockRate, REFUSED_SHARE, REPORTED_SHARE, Times};
pub use columns::{Column, Columns, RAW_COLUMNS, REFERENCE_COLUMNS};
pub use declared::{Rails, RawUnit, Reference, WholeTurns};
pub use error::{Argument, Error, Result};
pub use growing::Growing;
#[cfg(feature = "parquet")]
pub use import::text_columns;
pub use import::{
    BrokenKind, BrokenLimit, BrokenRows, Chosen, ColumnList, CommentSigns, CopiedTable, Decimal,
    Face, ImportOptions, ImportSummary, Inputs, Instance, Jitter, LogOptions, Offset, PerColumn,
    PoseMean, PoseMeans, Preset, PresetUse, Preview, ReadingUnits, ReplacedTriad, Role, Rounds,
    RowFilter, RowRange, Scale, SkippedLines, TimeSummary, TwosComplement, Zero, import, is_log,
    labelled, log_formats, look, preview,
};
pub use in_memory::{InMemory, usual_rate_hz};
pub use manifest::{Format, MANIFEST_FILE, Manifest, Source};
pub use parents::Parents;
pub use reader::{ReadSummary, Recording};
pub use recorded::{Recorded, Restart, SensorSetting, SensorSettings};
pub use reference_error::{NORMAL_95, ReferenceError};
pub use separator::Separator;
pub use toml_file::{check_kind, parse_toml, read_text};
pub use triad_name::{TriadKind, TriadName};
pub use triads::Triads;
pub use turntable::{Turntable, TurntableRate, rate_error};
pub use unit_name::{UNNAMED, are_two_units};
pub use warning::Warning;
pub use writer::{SampleFormat, Writer};
