//! What is found out about a device, with where and by what: each result is one type, and JSON is that type.

use mimu_core::wire::Counters;
use serde::Serialize;

/// This program and its version.
pub(crate) const TOOL: &str = concat!("mimu ", env!("CARGO_PKG_VERSION"));

/// What a command found out about the device at a port, `mimu-device/1`.
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
    /// What was found.
    #[serde(flatten)]
    pub found: T,
}

impl<T> DeviceResult<T> {
    /// What `command` found at `port`.
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

/// What the device has counted: the result of `mimu device counters`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Counted {
    /// Since its start, or since they were reset.
    pub counters: Counters,
    /// Whether they were reset afterwards.
    pub reset: bool,
}
