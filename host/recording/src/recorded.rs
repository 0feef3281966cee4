//! Where a recording of a device comes from: `[recorded]` in `recording.toml`.

use serde::{Deserialize, Serialize};

/// What recorded it from a device, and what was lost on the way.
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
    /// Why the device had started, where that was no power-on: its clock began then, and nobody knows when the power came.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<String>,
    /// Samples that are missing between the first and the last, restarts left out: every gap is a step of `t_s`.
    #[serde(default)]
    pub missing: u64,
    /// Times that the device restarted: it began counting anew, and how long it took is known by the PC's clock only.
    #[serde(default, rename = "restart", skip_serializing_if = "Vec::is_empty")]
    pub restarts: Vec<Restart>,
}

/// A restart of the device within a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Restart {
    /// Time of the first sample after it, s.
    pub t_s: f64,
    /// Why, as the device says.
    pub start: String,
}
