//! What the readings of a triad of sensors are: the device says it in its greeting, and a calibration belongs to it.

use serde::{Deserialize, Serialize};

/// A triad of sensors: what its readings are, by the data sheet.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Triad<'a> {
    /// Name of the part.
    pub part: &'a str,
    /// Unit of a raw reading: `V` or `count`.
    pub unit: &'a str,
    /// Bits of a reading before it is scaled, with its sign.
    pub bits: u8,
    /// Largest input, rad/s or m/s².
    pub range: f32,
    /// Raw reading without an input.
    pub null: f32,
    /// Nominal scale factor: raw units per rad/s or per m/s².
    pub per_si: f32,
    /// Samples per second by the device's crystal, as far as it knows them now.
    pub rate_hz: f32,
    /// Filters and rate as they are set: with part and range, what a calibration belongs to.
    pub filter: &'a str,
}
