//! A table or a chamber with text commands.

use std::path::Path;
use std::time::Duration;

use mimu::plan::{TableAxis, Turn};
use mimu_device::patience;
use mimu_recording::ReferenceError;
use mimu_recording::error::{Error, Result};
use nalgebra::Vector3;

use super::file::{Chamber, Command, DriverFile, Question};
use super::line::Line;
use super::{Abilities, Driver};
use crate::step::Step;

/// A table or a chamber, or both, with text commands over TCP or a serial port.
pub struct TextDriver {
    place: String,
    file: DriverFile,
    line: Line,
    /// Step whose rate is set once the tilt has ended. A table that got the rate earlier would turn about another axis.
    then: Option<Step>,
}

impl TextDriver {
    /// Errors of the table that the driver file states; the table need not be there.
    ///
    /// # Errors
    /// The file cannot be read, or states impossible errors.
    pub fn reference_error(path: &Path) -> Result<Option<ReferenceError>> {
        Ok(DriverFile::read(path)?.reference_error)
    }

    /// Reads the driver file and opens the line.
    pub fn open(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let file = DriverFile::read(path)?;
        let timeout = Duration::from_secs_f64(file.timeout_s.clamp(0.1, 600.0)) * patience();
        let line = match (&file.tcp, &file.serial) {
            (Some(address), None) => Line::open(&format!("tcp://{address}"), file.baud, timeout)?,
            (None, Some(port)) => Line::open(port, file.baud, timeout)?,
            _ => {
                let problem = "it needs one of tcp and serial";
                let remedy = "give the address or the port of the table or the chamber";
                return Err(Error::new(place, problem, remedy));
            }
        };
        Ok(Self {
            place,
            file,
            line,
            then: None,
        })
    }

    /// Like [`Self::open`], but refuses a driver that cannot move the unit.
    pub fn open_table(path: &Path) -> Result<Self> {
        let driver = Self::open(path)?;
        match driver.file.to_pose {
            Some(_) => Ok(driver),
            None => Err(driver.lacks("`move`")),
        }
    }

    fn lacks(&self, what: &str) -> Error {
        let problem = format!("it has no {what}");
        Error::new(
            &self.place,
            problem,
            "docs/wizard/driver.md has all keys of a driver file",
        )
    }

    fn command(&mut self, command: &Command, values: &[(&str, f64)]) -> Result<()> {
        for text in &command.say {
            let mut text = text.clone();
            for (name, value) in values {
                text = text.replace(&format!("{{{name}}}"), &format!("{value:.6}"));
            }
            if text.contains('{') {
                let problem = format!("{text:?} contains an unknown field");
                let names: Vec<String> = values.iter().map(|v| format!("{{{}}}", v.0)).collect();
                let remedy = match names.is_empty() {
                    true => "this line has no fields: write it without braces".into(),
                    false => format!("use {}", names.join(", ")),
                };
                return Err(Error::new(&self.place, problem, remedy));
            }
            self.line.say(&text)?;
            if let Some(expected) = &command.expect {
                let answer = self.line.answer(&text)?;
                if !answer.starts_with(expected.as_str()) {
                    let problem = format!("it answers {answer:?} to {text:?}");
                    return Err(Error::device(&self.line.name, problem, "check it"));
                }
            }
        }
        std::thread::sleep(Duration::from_secs_f64(command.pause_s.clamp(0.0, 600.0)));
        Ok(())
    }

    fn not_held(&mut self) -> Result<()> {
        match self.interlock()? {
            Some(why) => Err(Error::device(&self.line.name, why, "close it")),
            None => Ok(()),
        }
    }

    fn is(&mut self, question: &Question) -> Result<bool> {
        self.line.say(&question.ask)?;
        Ok(self.line.answer(&question.ask)? == question.answer)
    }
}

/// Angles of a table that turns the body about z first and then tilts it, so that `up` points up.
fn angles(up: &Vector3<f64>) -> (f64, f64) {
    let across = up.x.hypot(up.y);
    let inner = if across < 1e-9 { 0.0 } else { up.x.atan2(up.y) };
    (across.atan2(up.z).to_degrees(), inner.to_degrees())
}

/// Values that replace `{name}` in a command.
fn values(step: &Step) -> [(&'static str, f64); 6] {
    let (middle, inner) = angles(&step.up());
    let [x, y, z] = step.up;
    [
        ("x", x),
        ("y", y),
        ("z", z),
        ("middle_deg", middle),
        ("inner_deg", inner),
        ("rate_dps", step.rate_dps),
    ]
}

impl Driver for TextDriver {
    fn interlock(&mut self) -> Result<Option<String>> {
        let Some(question) = self.file.interlock.clone() else {
            return Ok(None);
        };
        let free = self.is(&question)?;
        let whose = match self.file.to_pose {
            Some(_) => "table",
            None => "chamber",
        };
        Ok((!free).then(|| format!("the interlock of the {whose} is open")))
    }

    fn go(&mut self, step: &Step) -> Result<()> {
        let (middle, _) = angles(&step.up());
        if let Some(problem) = self.file.limits.beyond(step.rate_dps, middle, 0.0) {
            let remedy = "leave this dwell out, or correct [limits]";
            return Err(Error::new(&self.place, problem, remedy));
        }
        self.not_held()?;
        self.stop()?;
        let to_pose = self.file.to_pose.clone();
        let to_pose = to_pose.ok_or_else(|| self.lacks("`move`"))?;
        self.command(&to_pose, &values(step))?;
        if step.rate_dps != 0.0 {
            if self.file.rate.is_none() {
                let problem = "a dwell turns, but the file has no [rate]";
                let remedy = "give the command that sets a rate";
                return Err(Error::new(&self.place, problem, remedy));
            }
            self.then = Some(*step);
        }
        Ok(())
    }

    fn busy(&mut self) -> Result<bool> {
        let busy = match self.file.busy.clone() {
            Some(question) => self.is(&question)?,
            None => false,
        };
        match (self.then, self.file.rate.clone()) {
            (Some(step), Some(rate)) if !busy => {
                self.command(&rate, &values(&step))?;
                self.then = None;
                Ok(true)
            }
            _ => Ok(busy),
        }
    }

    fn stop(&mut self) -> Result<()> {
        self.then = None;
        match self.file.stop.clone() {
            Some(stop) => self.command(&stop, &[]),
            None => Ok(()),
        }
    }

    fn power_cycle(&mut self) -> Result<bool> {
        let Some(power) = self.file.power.clone() else {
            return Ok(false);
        };
        self.command(&power.off, &[])?;
        self.command(&power.on, &[])?;
        Ok(true)
    }

    fn abilities(&self) -> Abilities {
        let axes = [TableAxis::Outer, TableAxis::Middle, TableAxis::Inner];
        let turns = axes.into_iter().filter(|a| self.file.turn.of(*a).is_some());
        Abilities {
            place: self.place.clone(),
            moves: self.file.to_pose.is_some(),
            rates: self.file.rate.is_some(),
            turns: turns.collect(),
            limits: self.file.limits,
            chamber: self.file.chamber.as_ref().map(Chamber::limits),
        }
    }

    fn turn(&mut self, turn: &Turn) -> Result<()> {
        self.not_held()?;
        let command = self.file.turn.of(turn.axis).cloned();
        let command = command.ok_or_else(|| self.lacks(&format!("turn.{}", turn.axis.name())))?;
        let [x, y, z] = turn.to_up;
        let [middle, inner] = turn.to_deg;
        let values = [
            ("turn_deg", turn.angle_deg),
            ("turn_dps", turn.rate_dps),
            ("x", x),
            ("y", y),
            ("z", z),
            ("middle_deg", middle),
            ("inner_deg", inner),
        ];
        self.command(&command, &values)
    }

    fn set_chamber(&mut self, temp_c: f64) -> Result<()> {
        let set = self.file.chamber.as_ref().map(|c| c.set.clone());
        let set = set.ok_or_else(|| self.lacks("[chamber]"))?;
        self.command(&set, &[("temp_c", temp_c)])
    }

    fn chamber_c(&mut self) -> Result<Option<f64>> {
        let Some(ask) = self.file.chamber.as_ref().and_then(|c| c.read.clone()) else {
            return Ok(None);
        };
        self.line.say(&ask)?;
        let answer = self.line.answer(&ask)?;
        match first_number(&answer) {
            Some(temp_c) => Ok(Some(temp_c)),
            None => {
                let problem = format!("its answer {answer:?} to {ask:?} contains no number");
                Err(Error::device(
                    &self.line.name,
                    problem,
                    "correct [chamber] read",
                ))
            }
        }
    }
}

/// The first number in a line, as 23.4 in `T=23.4 C`.
fn first_number(text: &str) -> Option<f64> {
    let of_number = |c: char| c.is_ascii_digit() || "+-.eE".contains(c);
    let mut words = text.split(|c| !of_number(c));
    words.find_map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::first_number;

    #[test]
    fn a_temperature_is_found_among_words() {
        for (text, temp_c) in [
            ("23.4", Some(23.4)),
            ("T=-10.25 degC", Some(-10.25)),
            ("OK, +7", Some(7.0)),
            ("ERR", None),
        ] {
            assert_eq!(first_number(text), temp_c, "{text}");
        }
    }
}
