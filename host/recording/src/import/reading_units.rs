//! Units of the readings in a file, as a person names them.

use std::fmt;
use std::str::FromStr;

use super::unit_names::{unit_of, unit_written};
use crate::RawUnit;
use crate::cell::shorten;
use crate::error::{Argument, Error, Result};
use crate::triad_name::TriadKind;

/// Readings of a converter, of both sensors.
const OF_BOTH: [&str; 2] = ["count", "V"];

/// Units of gyro and accelerometer, as `g,deg/s` in any order; `count` and `V` hold for both.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ReadingUnits {
    /// Unit of the gyro, as in [`UnitFound::unit`](crate::units::UnitFound::unit).
    pub gyro: Option<&'static str>,
    /// Unit of the accelerometer.
    pub accel: Option<&'static str>,
}

/// Size of a unit in SI, if it has one.
pub(super) fn si(symbol: &str) -> Option<f64> {
    unit_of(symbol).map(|unit| unit.size)
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
        words.sort_by_key(|word| OF_BOTH.contains(word));
        for word in words {
            let both = OF_BOTH.into_iter().find(|unit| *unit == word);
            let unit = unit_written(word);
            let Some(name) = both.or(unit.map(|unit| unit.symbol)) else {
                let word = shorten(word.as_bytes());
                return Err(refuse(format!("{word} is no unit of readings")));
            };
            for (kind, own) in [
                (TriadKind::Gyro, &mut self.gyro),
                (TriadKind::Accel, &mut self.accel),
            ] {
                if unit.is_some_and(|unit| unit.kind == kind) {
                    if own.is_some_and(|before| before != name) {
                        return Err(refuse(format!("the {} has two units", kind.name())));
                    }
                    *own = Some(name);
                } else if both.is_some() && own.is_none() {
                    // `g,count` are the two sensors' units.
                    *own = both;
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
