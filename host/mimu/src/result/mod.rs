//! What a command found, as one type each: its JSON is that type, and text and page are views of it.
//!
//! SI throughout; what is not a number is null in JSON.

pub mod allan;
pub mod design;
pub mod diagnosis;
pub mod fit;
pub mod next_experiment;
pub mod verify;

use serde::{Serialize, Serializer};

use crate::quantity::PerSensor;

/// Serialises what there is for each sensor: one that is absent has no key.
pub fn present<T: Serialize, S: Serializer>(
    sensors: &PerSensor<Option<T>>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(sensors.present())
}

/// Program and version that a result is from.
const TOOL: &str = concat!("mimu ", env!("CARGO_PKG_VERSION"));
