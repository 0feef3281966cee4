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

pub(crate) use crate::calibration::TOOL;
