//! What a person declares of a recording: the unit of its readings, what is known of the input, where readings saturate, turns by hand.

use serde::{Deserialize, Serialize};
use strum::{Display, EnumString};

use crate::error::{Argument, Error, Result};

/// Unit of the raw columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Display, EnumString)]
#[strum(parse_err_ty = Error, parse_err_fn = unknown_unit)]
pub enum RawUnit {
    /// Volts at the converter's input.
    #[serde(rename = "V")]
    #[strum(serialize = "V")]
    Volt,
    /// The device's own counts.
    #[serde(rename = "count")]
    #[strum(serialize = "count")]
    Count,
    /// Already rad/s and m/s², from a device that applies its own calibration. "Raw" is then what that device reports, and the fit finds the errors
    /// that its calibration leaves.
    #[serde(rename = "SI")]
    #[strum(to_string = "SI", serialize = "si")]
    Si,
}

/// What is known of the true input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Display, EnumString)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case", parse_err_ty = Error, parse_err_fn = unknown_reference)]
pub enum Reference {
    /// The `ref_` columns contain it.
    Table,
    /// Only the magnitude of gravity, at rest.
    Gravity,
    /// Only the magnitude of the rate, at rest and at the rates of a [`Turntable`](crate::Turntable).
    TurntableRate,
}

fn unknown_unit(text: &str) -> Error {
    unknown("raw unit", text, "write V, count or SI (rad/s and m/s²)")
}

fn unknown_reference(text: &str) -> Error {
    let remedy = "write table (ref_ columns give the input), gravity (only its magnitude is known) or turntable-rate (only the magnitude of the rate)";
    unknown("reference", text, remedy)
}

fn unknown(place: &str, text: &str, remedy: &str) -> Error {
    let word = super::cell::shorten(text.as_bytes());
    Error::new(place, format!("{word} is unknown"), remedy)
}

/// Readings at which each sensor's output stops following its input, in raw units.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rails {
    /// Lowest and highest reading of the gyros.
    pub gyro: Option<[f64; 2]>,
    /// Lowest and highest reading of the accelerometers.
    pub accel: Option<[f64; 2]>,
}

/// Turns by hand, whole ones, after which the unit is put back where it lay.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WholeTurns {
    /// Half-width of the 95 % interval of the heading in which it is put back, degrees.
    #[serde(default = "placement_deg")]
    pub placement_deg: f64,
    /// Number of turns of each, if somebody has counted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turns: Option<u32>,
}

/// Against the edge of a table with a box, people are within a degree.
const PLACEMENT_DEG: f64 = 1.0;

fn placement_deg() -> f64 {
    PLACEMENT_DEG
}

impl Default for WholeTurns {
    fn default() -> Self {
        Self {
            placement_deg: PLACEMENT_DEG,
            turns: None,
        }
    }
}

impl WholeTurns {
    /// Refuses impossible values; `place` names them.
    pub fn check(&self, place: &str) -> Result<()> {
        if !(0.01..=20.0).contains(&self.placement_deg) {
            return Err(Error::new(
                place,
                format!("the placement is {:?} degrees", self.placement_deg),
                "give the half-width of its 95 % interval, 0.01 to 20 degrees",
            )
            .about(Argument::WholeTurns));
        }
        if self.turns.is_some_and(|turns| !(1..=1000).contains(&turns)) {
            return Err(Error::new(
                place,
                "the number of turns is not 1 to 1000",
                "give the turns of each, or leave it out",
            )
            .about(Argument::WholeTurns));
        }
        Ok(())
    }
}
