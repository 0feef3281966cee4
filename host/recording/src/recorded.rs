//! The device from which a recording comes: `[recorded]` in `recording.toml`.

use serde::{Deserialize, Serialize};

/// The device, the program that recorded it, and what was lost on the way.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recorded {
    /// Program and version.
    pub tool: String,
    /// Version of the firmware.
    pub firmware: String,
    /// Name of the board.
    pub board: String,
    /// The microcontroller's own number, hexadecimal.
    pub unit_id: String,
    /// Why the device had started, if it was not by a power-on: its clock began then, and the time of the power-on is unknown.
    pub start: Option<String>,
    /// Its sensors as they were set.
    pub sensors: Option<SensorSettings>,
    /// Samples missing between the first and the last, except at restarts. Each gap is a longer interval of `t_s`.
    #[serde(default)]
    pub missing: u64,
    /// Restarts of the device: its counter began anew, and only the PC's clock shows how long each took.
    #[serde(default, rename = "restart", skip_serializing_if = "Vec::is_empty")]
    pub restarts: Vec<Restart>,
}

/// The sensors of a unit as they were set. A calibration belongs to them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorSettings {
    /// The gyros.
    pub gyro: SensorSetting,
    /// The accelerometers.
    pub accel: SensorSetting,
}

/// The sensors of a triad as they were set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorSetting {
    /// Name of the part.
    pub part: String,
    /// Bits of a reading, with its sign.
    pub bits: u8,
    /// Largest input, rad/s or m/s².
    pub range: f64,
    /// Filters and rate.
    pub filter: String,
}

/// A restart of the device within a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Restart {
    /// Time of the first sample after it, s.
    pub t_s: f64,
    /// Cause, as the device reports it.
    pub start: String,
}
