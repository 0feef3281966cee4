//! What a command found, as one type each: its JSON is that type, and text and page are views of it.
//!
//! SI throughout; what is not a number is null in JSON.

pub mod allan;
pub mod design;
pub mod diagnosis;
pub mod fit;
pub mod next_experiment;

/// Program and version that a result is from.
const TOOL: &str = concat!("mimu ", env!("CARGO_PKG_VERSION"));
