//! Units of the readings in a file, as a person names them.

use std::fmt;
use std::str::FromStr;

use crate::RawUnit;
use crate::cell::shorten;
use crate::error::{Argument, Error, Result};

pub(super) const STANDARD_GRAVITY: f64 = 9.80665;

/// Name, sensor, and size in SI; `count` and `V` have no size and hold for both sensors.
const UNITS: [(&str, &str, Option<f64>); 10] = [
    ("g", "accel", Some(STANDARD_GRAVITY)),
    ("mg", "accel", Some(1e-3 * STANDARD_GRAVITY)),
    ("m/s²", "accel", Some(1.0)),
    ("rad/s", "gyro", Some(1.0)),
    ("deg/s", "gyro", Some(std::f64::consts::PI / 180.0)),
    ("mdeg/s", "gyro", Some(std::f64::consts::PI / 180_000.0)),
    ("count", "", None),
    ("V", "", None),
    ("m/s2", "accel", Some(1.0)),
    ("dps", "gyro", Some(std::f64::consts::PI / 180.0)),
];

/// Units of gyro and accelerometer, as `g,deg/s` in any order; `count` and `V` hold for both.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ReadingUnits {
    /// Unit of the gyro, as in [`UnitFound::unit`](crate::units::UnitFound::unit).
    pub gyro: Option<&'static str>,
    /// Unit of the accelerometer.
    pub accel: Option<&'static str>,
}

/// Size of a unit in SI, if it has one.
pub(super) fn si(unit: &str) -> Option<f64> {
    UNITS.iter().find(|(name, ..)| *name == unit)?.2
}

impl ReadingUnits {
    /// These, and the units of `text`.
    ///
    /// # Errors
    /// An unknown unit, or two for one sensor.
    pub fn and(mut self, text: &str) -> Result<Self> {
        let refuse = |problem: String| {
            let remedy = "give one of g, mg, m/s2 and one of deg/s, mdeg/s, rad/s, as g,deg/s; or count, or V";
            Error::new("units", problem, remedy).about(Argument::Units)
        };
        let mut words: Vec<&str> = text.split(',').map(str::trim).collect();
        let of_both = |word: &&str| {
            UNITS
                .iter()
                .any(|(name, sensor, _)| name == word && sensor.is_empty())
        };
        words.sort_by_key(of_both);
        for word in words {
            let known = UNITS.iter().find(|(name, ..)| *name == word);
            let Some((name, sensor, _)) = known else {
                return Err(refuse(format!(
                    "{} is no unit of readings",
                    shorten(word.as_bytes())
                )));
            };
            let name = match *name {
                "m/s2" => "m/s²",
                "dps" => "deg/s",
                other => other,
            };
            for (which, unit) in [("gyro", &mut self.gyro), ("accel", &mut self.accel)] {
                // `g,count` are the two sensors' units.
                if sensor.is_empty() && unit.is_none() || *sensor == which {
                    if unit.is_some_and(|before| before != name) && !sensor.is_empty() {
                        return Err(refuse(format!("the {which} has two units")));
                    }
                    *unit = Some(name);
                }
            }
        }
        Ok(self)
    }

    /// Unit of the readings after a conversion, and the factors to it of gyro and accelerometer, if their units are given.
    ///
    /// # Errors
    /// One sensor in a unit and the other in counts or V: a recording has one unit for both.
    pub fn conversion(&self) -> Result<(RawUnit, [Option<f64>; 2])> {
        let given = [self.gyro, self.accel];
        let factors = given.map(|unit| unit.map(si));
        if factors.into_iter().flatten().all(|factor| factor.is_some()) {
            return Ok((RawUnit::Si, factors.map(Option::flatten)));
        }
        match given {
            [Some("count"), Some("count")] => Ok((RawUnit::Count, [Some(1.0); 2])),
            [Some("V"), Some("V")] => Ok((RawUnit::Volt, [Some(1.0); 2])),
            _ => Err(Error::new(
                "units",
                "one sensor is in a unit and the other in counts or V, and a recording has one unit for both",
                "convert the readings of one of them",
            )),
        }
    }
}

impl FromStr for ReadingUnits {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::default().and(text)
    }
}

impl fmt::Display for ReadingUnits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut both: Vec<&str> = self.accel.into_iter().chain(self.gyro).collect();
        both.dedup();
        f.write_str(&both.join(","))
    }
}
