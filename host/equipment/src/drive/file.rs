//! The driver file `mimu-driver/1`: connection and commands of a table.

use std::path::Path;

use mimu_recording::{Error, ReferenceError, Result, parse_toml, read_text};
use serde::Deserialize;

use super::Limits;

/// Contents of a driver file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DriverFile {
    format: String,
    /// `host:port`.
    pub tcp: Option<String>,
    /// Path of a serial port.
    pub serial: Option<String>,
    #[serde(default = "usual_baud")]
    pub baud: u32,
    /// Longest wait for an answer, s.
    #[serde(default = "usual_timeout")]
    pub timeout_s: f64,
    pub interlock: Option<Question>,
    #[serde(rename = "move")]
    pub to_pose: Command,
    pub rate: Option<Command>,
    pub busy: Option<Question>,
    pub stop: Option<Command>,
    pub power: Option<Power>,
    #[serde(default)]
    pub limits: Limits,
    /// What the table does wrong, by its certificate.
    pub reference_error: Option<ReferenceError>,
}

fn usual_baud() -> u32 {
    9600
}

fn usual_timeout() -> f64 {
    5.0
}

/// A query, and the answer that means yes.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Question {
    pub ask: String,
    pub answer: String,
}

/// Lines to send in order, the answer expected to each (none is awaited if it is absent), and a pause after them.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Command {
    pub say: Vec<String>,
    pub expect: Option<String>,
    #[serde(default)]
    pub pause_s: f64,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Power {
    pub off: Command,
    pub on: Command,
}

impl DriverFile {
    pub fn read(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let text = read_text(path)?;
        let file: Self = parse_toml(&text, &place, None)?;
        if file.format != "mimu-driver/1" {
            let problem = format!("format is {:?}", file.format);
            let remedy = "write format = \"mimu-driver/1\"";
            return Err(Error::new(place, problem, remedy));
        }
        if let Some(error) = &file.reference_error {
            error.check(&format!("{place}, reference_error"))?;
        }
        Ok(file)
    }
}
