//! Moves the unit and changes its temperature: a person with instructions, or a table and a chamber with text commands.

mod file;
mod line;
mod text_driver;

use mimu::plan::{TableAxis, Turn};
use mimu_recording::error::{Error, Result};
use serde::Deserialize;

pub use text_driver::TextDriver;

use crate::step::Step;

/// Moves the unit, switches its supply, and changes its temperature. By default a person does all of it.
pub trait Driver: Send {
    /// Why motion is blocked by the interlock; `None` if it is allowed.
    fn interlock(&mut self) -> Result<Option<String>> {
        Ok(None)
    }

    /// Begins to move to a step.
    fn go(&mut self, _: &Step) -> Result<()> {
        Ok(())
    }

    /// Whether it still moves to the step, or turns by an angle.
    fn busy(&mut self) -> Result<bool> {
        Ok(false)
    }

    /// Stops all motion.
    fn stop(&mut self) -> Result<()> {
        Ok(())
    }

    /// Switches the supply off and on. `false`: a person has to do it.
    fn power_cycle(&mut self) -> Result<bool> {
        Ok(false)
    }

    /// Whether a person needs instructions.
    fn is_person(&self) -> bool {
        false
    }

    /// Optional abilities and limits.
    fn abilities(&self) -> Abilities {
        Abilities::default()
    }

    /// Begins a turn of one axis by an angle, from rest to rest.
    fn turn(&mut self, _: &Turn) -> Result<()> {
        Err(unable("turn by an angle"))
    }

    /// Sets the temperature of the chamber, °C.
    fn set_chamber(&mut self, _: f64) -> Result<()> {
        Err(unable("set a temperature"))
    }

    /// Temperature in the chamber, °C, if it can be read.
    fn chamber_c(&mut self) -> Result<Option<f64>> {
        Ok(None)
    }
}

fn unable(what: &str) -> Error {
    Error::new("driver", format!("it cannot {what}"), "give another one")
}

/// Abilities and limits of a driver.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Abilities {
    /// Path of the driver file.
    pub place: String,
    /// Whether it moves the unit to a pose.
    pub moves: bool,
    /// Whether it turns the unit at a rate.
    pub rates: bool,
    /// Axes that it can turn by an angle.
    pub turns: Vec<TableAxis>,
    /// Limits of its table.
    pub limits: Limits,
    /// Limits of its chamber, if it has one.
    pub chamber: Option<ChamberLimits>,
}

/// Limits of a table.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Largest rate about the vertical, deg/s.
    pub rate_dps: Option<f64>,
    /// Largest angle between the body's z axis and the vertical, degrees.
    pub middle_deg: Option<f64>,
    /// Largest rate of a turn by an angle, deg/s.
    pub turn_dps: Option<f64>,
}

impl Limits {
    /// What of a motion is beyond a limit, in words: its rate about the vertical, the angle of its pose, the rate of its turn.
    pub(crate) fn beyond(&self, rate_dps: f64, middle_deg: f64, turn_dps: f64) -> Option<String> {
        let all = [
            ("a rate in deg/s", rate_dps, self.rate_dps, "rate_dps"),
            (
                "a tilt in degrees",
                middle_deg,
                self.middle_deg,
                "middle_deg",
            ),
            ("a turn in deg/s", turn_dps, self.turn_dps, "turn_dps"),
        ];
        all.into_iter().find_map(|(what, value, limit, key)| {
            let limit = limit.filter(|limit| value.abs() > *limit)?;
            Some(format!("{what} of {value:.1} is beyond {key} = {limit}"))
        })
    }
}

/// Limits of a chamber.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChamberLimits {
    /// Lowest temperature, °C.
    pub from_c: f64,
    /// Highest temperature, °C.
    pub to_c: f64,
    /// Largest ramp, K/min.
    pub c_per_min: Option<f64>,
    /// Rest temperature, °C.
    pub rest_c: f64,
}

/// A person who reads instructions.
#[derive(Debug, Clone, Copy, Default)]
pub struct Person;

impl Driver for Person {
    fn is_person(&self) -> bool {
        true
    }
}

/// Several drivers that receive the same commands: fixtures side by side, each with its boards.
pub struct Together(pub Vec<Box<dyn Driver>>);

impl Driver for Together {
    fn interlock(&mut self) -> Result<Option<String>> {
        for driver in &mut self.0 {
            if let Some(why) = driver.interlock()? {
                return Ok(Some(why));
            }
        }
        Ok(None)
    }

    fn go(&mut self, step: &Step) -> Result<()> {
        self.0.iter_mut().try_for_each(|d| d.go(step))
    }

    fn busy(&mut self) -> Result<bool> {
        let mut busy = false;
        for driver in &mut self.0 {
            busy |= driver.busy()?;
        }
        Ok(busy)
    }

    fn stop(&mut self) -> Result<()> {
        self.0.iter_mut().try_for_each(|d| d.stop())
    }

    fn power_cycle(&mut self) -> Result<bool> {
        let mut all = true;
        for driver in &mut self.0 {
            all &= driver.power_cycle()?;
        }
        Ok(all)
    }
}
