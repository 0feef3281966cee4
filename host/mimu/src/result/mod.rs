//! Result of each command, as one type. JSON is that type; text and HTML page are views of it.
//!
//! SI throughout; NaN and infinity are null in JSON.

pub mod allan;
pub mod budget;
pub mod design;
pub mod diagnosis;
pub mod fit;
pub mod next_experiment;
pub mod sessions;

/// Program and version that a result is from.
pub(crate) const TOOL: &str = concat!("mimu ", env!("CARGO_PKG_VERSION"));
