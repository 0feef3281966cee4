//! Moves the unit: a person with instructions, or a table with text commands.

mod file;
mod line;
mod text_driver;

use mimu_recording::error::Result;
use serde::Deserialize;

pub use text_driver::TextDriver;

use crate::step::Step;

/// Moves the unit and switches its supply. By default a person does both.
pub trait Driver: Send {
    /// Why motion is blocked by the interlock; `None` if it is allowed.
    fn interlock(&mut self) -> Result<Option<String>> {
        Ok(None)
    }

    /// Begins to move to a step.
    fn go(&mut self, _: &Step) -> Result<()> {
        Ok(())
    }

    /// Whether it still moves to the step.
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
}

/// Limits of a table.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Largest rate about the vertical, deg/s.
    pub rate_dps: Option<f64>,
    /// Largest angle between the body's z axis and the vertical, degrees.
    pub middle_deg: Option<f64>,
}

impl Limits {
    /// What of a motion is beyond a limit, in words: its rate about the vertical, or the angle of its pose.
    pub(crate) fn beyond(&self, rate_dps: f64, middle_deg: f64) -> Option<String> {
        let all = [
            ("a rate in deg/s", rate_dps, self.rate_dps, "rate_dps"),
            (
                "a tilt in degrees",
                middle_deg,
                self.middle_deg,
                "middle_deg",
            ),
        ];
        all.into_iter().find_map(|(what, value, limit, key)| {
            let limit = limit.filter(|limit| value.abs() > *limit)?;
            Some(format!("{what} of {value:.1} is beyond {key} = {limit}"))
        })
    }
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
