//! Moves and warms the unit: a person with instructions, or a table and a chamber with text commands.

mod file;
mod line;
mod text_driver;

use mimu::plan::{TableAxis, Turn};
use mimu_recording::error::{Error, Result};
use serde::Deserialize;

pub use text_driver::TextDriver;

use crate::step::Step;

/// Turns the unit, its supply off and on, and warms it.
pub trait Driver: Send {
    /// Why nothing may move now: the interlock; `None` if it may.
    fn held(&mut self) -> Result<Option<String>>;

    /// Begins to carry out a step.
    fn go(&mut self, step: &Step) -> Result<()>;

    /// Whether it still moves on its way to the step, or in a turn.
    fn busy(&mut self) -> Result<bool>;

    /// Ends all motion.
    fn stop(&mut self) -> Result<()>;

    /// Turns the supply off and on; `false`: a person has to do it.
    fn power_cycle(&mut self) -> Result<bool>;

    /// Whether a person has to be told what to do.
    fn is_person(&self) -> bool {
        false
    }

    /// What it can do beside that, and how far.
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

    /// Temperature in the chamber, °C, where it can be asked.
    fn chamber_c(&mut self) -> Result<Option<f64>> {
        Ok(None)
    }
}

fn unable(what: &str) -> Error {
    Error::new("driver", format!("it cannot {what}"), "give another one")
}

/// What a driver can do, and how far.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Abilities {
    /// Its file.
    pub place: String,
    /// Whether it brings the unit to a pose.
    pub moves: bool,
    /// Whether it turns it at a rate.
    pub rates: bool,
    /// Axes that it turns by an angle.
    pub turns: Vec<TableAxis>,
    /// How far its table goes.
    pub limits: Limits,
    /// Its chamber.
    pub chamber: Option<ChamberLimits>,
}

/// What a table can do.
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

/// What a chamber can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChamberLimits {
    /// Lowest temperature, °C.
    pub from_c: f64,
    /// Highest temperature, °C.
    pub to_c: f64,
    /// Largest ramp, K/min.
    pub c_per_min: Option<f64>,
    /// What it is left at, °C.
    pub rest_c: f64,
}

/// A person, who reads what to do.
#[derive(Debug, Clone, Copy, Default)]
pub struct Person;

impl Driver for Person {
    fn held(&mut self) -> Result<Option<String>> {
        Ok(None)
    }

    fn go(&mut self, _: &Step) -> Result<()> {
        Ok(())
    }

    fn busy(&mut self) -> Result<bool> {
        Ok(false)
    }

    fn stop(&mut self) -> Result<()> {
        Ok(())
    }

    fn power_cycle(&mut self) -> Result<bool> {
        Ok(false)
    }

    fn is_person(&self) -> bool {
        true
    }
}

/// Several that are all told the same: fixtures side by side, each with its boards.
pub struct Together(pub Vec<Box<dyn Driver>>);

impl Driver for Together {
    fn held(&mut self) -> Result<Option<String>> {
        for driver in &mut self.0 {
            if let Some(why) = driver.held()? {
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
