//! A table with text commands.

use std::path::Path;
use std::time::Duration;

use mimu_device::patience;
use mimu_recording::{Error, ReferenceError, Result};
use nalgebra::Vector3;

use super::Driver;
use super::file::{Command, DriverFile, Question};
use super::line::Line;
use crate::step::Step;

/// A table with text commands over TCP or a serial port.
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
                let remedy = "give the address or the port of the table";
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
        Ok((!free).then(|| "the interlock of the table is open".into()))
    }

    fn go(&mut self, step: &Step) -> Result<()> {
        let (middle, _) = angles(&step.up());
        if let Some(problem) = self.file.limits.beyond(step.rate_dps, middle) {
            let remedy = "leave this dwell out, or correct [limits]";
            return Err(Error::new(&self.place, problem, remedy));
        }
        self.not_held()?;
        self.stop()?;
        let to_pose = self.file.to_pose.clone();
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
}
