//! Results of `mimu device` commands. Each result is one type, and the JSON output serialises that type.

use mimu_core::wire::Counters;
use serde::Serialize;

/// This program and its version.
pub(crate) const TOOL: &str = concat!("mimu ", env!("CARGO_PKG_VERSION"));

/// Result of a command for the device at a port, `mimu-device/1`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DeviceResult<T> {
    /// `mimu-device/1`.
    pub format: &'static str,
    /// This program and its version.
    pub tool: &'static str,
    /// Subcommand of `mimu device`.
    pub command: &'static str,
    /// Port of the device.
    pub port: String,
    /// The command's own result.
    #[serde(flatten)]
    pub found: T,
}

impl<T> DeviceResult<T> {
    /// Result of `command` at `port`.
    pub fn new(command: &'static str, port: &str, found: T) -> Self {
        Self {
            format: "mimu-device/1",
            tool: TOOL,
            command,
            port: port.to_owned(),
            found,
        }
    }
}

/// The device's counters: the result of `mimu device counters`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Counted {
    /// Counts since the start or the last reset of the counters.
    pub counters: Counters,
    /// Whether they were reset after reading.
    pub reset: bool,
}
