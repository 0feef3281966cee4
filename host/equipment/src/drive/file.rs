//! The driver file `mimu-driver/1`: connection and commands of a table or a chamber.

use std::path::Path;

use mimu::plan::TableAxis;
use mimu_recording::error::{Error, Result};
use mimu_recording::{ReferenceError, parse_toml, read_text};
use serde::Deserialize;

use super::{ChamberLimits, Limits};

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
    pub to_pose: Option<Command>,
    pub rate: Option<Command>,
    #[serde(default)]
    pub turn: Turns,
    pub busy: Option<Question>,
    pub stop: Option<Command>,
    pub power: Option<Power>,
    #[serde(default)]
    pub limits: Limits,
    pub chamber: Option<Chamber>,
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

/// Turns by an angle, for each axis that has a command: tables number their axes differently.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Turns {
    outer: Option<Command>,
    middle: Option<Command>,
    inner: Option<Command>,
}

impl Turns {
    pub fn of(&self, axis: TableAxis) -> Option<&Command> {
        match axis {
            TableAxis::Outer => self.outer.as_ref(),
            TableAxis::Middle => self.middle.as_ref(),
            TableAxis::Inner => self.inner.as_ref(),
        }
    }
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Power {
    pub off: Command,
    pub on: Command,
}

/// Commands and limits of a chamber, alone or with a table.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Chamber {
    /// Sets the temperature; contains `{temp_c}`.
    pub set: Command,
    /// Query for the temperature: the first number in the answer, °C.
    pub read: Option<String>,
    /// Lowest and highest temperature that may be set, °C.
    from_c: f64,
    to_c: f64,
    /// Largest ramp, K/min.
    c_per_min: Option<f64>,
    /// Rest temperature, °C.
    #[serde(default = "room")]
    rest_c: f64,
}

/// Default rest temperature of a chamber: nothing in it freezes or condenses, or is too hot to touch.
fn room() -> f64 {
    25.0
}

impl Chamber {
    pub fn limits(&self) -> ChamberLimits {
        ChamberLimits {
            from_c: self.from_c,
            to_c: self.to_c,
            c_per_min: self.c_per_min,
            rest_c: self.rest_c,
        }
    }
}

impl DriverFile {
    pub fn read(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let text = read_text(path)?;
        let file: Self = parse_toml(&text, &place, None)?;
        let refuse = |problem: &str, remedy: &str| Err(Error::new(&place, problem, remedy));
        if file.format != "mimu-driver/1" {
            let problem = format!("format is {:?}", file.format);
            return refuse(&problem, "write format = \"mimu-driver/1\"");
        }
        if file.to_pose.is_none() && file.chamber.is_none() {
            let remedy = "give the commands that move a table or set a chamber";
            return refuse("it has neither `move` nor [chamber]", remedy);
        }
        if let Some(chamber) = &file.chamber {
            let [from, to, rest] = [chamber.from_c, chamber.to_c, chamber.rest_c];
            if !(from <= rest && rest <= to) {
                let problem = format!("[chamber]: rest_c = {rest} is not within {from} to {to}");
                let remedy =
                    "give from_c and to_c, the chamber's limits, and a safe rest_c within them";
                return refuse(&problem, remedy);
            }
        }
        if let Some(error) = &file.reference_error {
            error.check(&format!("{place}, reference_error"))?;
        }
        Ok(file)
    }
}
