//! What turns the unit: a person who is told, or a turntable that takes text commands.

use std::io::{BufRead as _, BufReader, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};

use mimu_recording::error::{Error, Result};
use mimu_recording::read_text;
use nalgebra::Vector3;
use serde::Deserialize;

use crate::step::Step;

/// Turns the unit, and its supply off and on.
pub trait Driver {
    /// Why nothing may move now: the interlock; `None` if it may.
    fn held(&mut self) -> Result<Option<String>>;

    /// Begins to carry out a step.
    fn go(&mut self, step: &Step) -> Result<()>;

    /// Whether it still moves on its way to the step.
    fn busy(&mut self) -> Result<bool>;

    /// Ends all motion.
    fn stop(&mut self) -> Result<()>;

    /// Turns the supply off and on; `false`: somebody has to be asked.
    fn power_cycle(&mut self) -> Result<bool>;

    /// Whether a person has to be told what to do.
    fn is_person(&self) -> bool {
        false
    }
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

/// How a turntable is spoken to: `mimu-driver/1`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct DriverFile {
    format: String,
    /// `host:port`.
    tcp: Option<String>,
    /// Path of a serial port.
    serial: Option<String>,
    #[serde(default = "usual_baud")]
    baud: u32,
    /// Longest wait for an answer, s.
    #[serde(default = "usual_timeout")]
    timeout_s: f64,
    interlock: Option<Question>,
    #[serde(rename = "move")]
    to_pose: Command,
    rate: Option<Command>,
    busy: Option<Question>,
    stop: Option<Command>,
    power: Option<Power>,
    #[serde(default)]
    limits: Limits,
}

fn usual_baud() -> u32 {
    9600
}

fn usual_timeout() -> f64 {
    5.0
}

/// Something to ask, and the answer that means yes.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Question {
    ask: String,
    answer: String,
}

/// Lines to say one after the other, what each is answered with (nothing is waited for without it), and a pause after them.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Command {
    say: Vec<String>,
    expect: Option<String>,
    #[serde(default)]
    pause_s: f64,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Power {
    off: Command,
    on: Command,
}

/// What the table can do.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Limits {
    /// Largest rate about the vertical, deg/s.
    rate_dps: Option<f64>,
    /// Largest angle between the body's z axis and the vertical, degrees.
    middle_deg: Option<f64>,
}

/// A turntable that takes lines of text, over TCP or a serial port.
pub struct TextDriver {
    place: String,
    file: DriverFile,
    line: Line,
    /// Turns as soon as it no longer tilts: a table that is told a rate before would turn about another axis.
    then: Option<Step>,
}

struct Line {
    read: BufReader<Box<dyn std::io::Read + Send>>,
    write: Box<dyn Write + Send>,
    name: String,
    timeout: Duration,
}

impl TextDriver {
    /// Reads the driver file and opens the line.
    pub fn open(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let text = read_text(path)?;
        let file: DriverFile = toml::from_str(&text).map_err(|error| {
            let line = error
                .span()
                .map(|s| 1 + text[..s.start].matches('\n').count());
            let place = line.map_or(place.clone(), |l| format!("{place}, line {l}"));
            let remedy = "docs/wizard.md has all keys of a driver file";
            Error::new(place, error.message().trim(), remedy)
        })?;
        if file.format != "mimu-driver/1" {
            let problem = format!("format is {:?}", file.format);
            return Err(Error::new(
                place,
                problem,
                "write format = \"mimu-driver/1\"",
            ));
        }
        let timeout = Duration::from_secs_f64(file.timeout_s.clamp(0.1, 600.0));
        let line = match (&file.tcp, &file.serial) {
            (Some(address), None) => Line::tcp(address, timeout)?,
            (None, Some(port)) => Line::serial(port, file.baud, timeout)?,
            _ => {
                let problem = "it needs one of tcp and serial";
                return Err(Error::new(
                    place,
                    problem,
                    "say where the table is spoken to",
                ));
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
                let problem = format!("{text:?} asks for a value that there is not");
                let remedy = "use {x}, {y}, {z}, {middle_deg}, {inner_deg} and {rate_dps}";
                return Err(Error::new(&self.place, problem, remedy));
            }
            self.line.say(&text)?;
            if let Some(expected) = &command.expect {
                let answer = self.line.answer(&text)?;
                if !answer.starts_with(expected.as_str()) {
                    let problem = format!("it was told {text:?} and answers {answer:?}");
                    return Err(Error::device(&self.line.name, problem, "look at the table"));
                }
            }
        }
        std::thread::sleep(Duration::from_secs_f64(command.pause_s.clamp(0.0, 600.0)));
        Ok(())
    }

    fn is(&mut self, question: &Question) -> Result<bool> {
        self.line.say(&question.ask)?;
        Ok(self.line.answer(&question.ask)? == question.answer)
    }
}

impl Line {
    fn tcp(address: &str, timeout: Duration) -> Result<Self> {
        let broken = |e: std::io::Error| {
            Error::device(address, e, "check that the table is on and reachable")
        };
        let stream = TcpStream::connect(address).map_err(broken)?;
        stream
            .set_read_timeout(Some(Duration::from_millis(50)))
            .map_err(broken)?;
        stream.set_nodelay(true).map_err(broken)?;
        let read = stream.try_clone().map_err(broken)?;
        Ok(Self {
            read: BufReader::new(Box::new(read)),
            write: Box::new(stream),
            name: address.to_owned(),
            timeout,
        })
    }

    fn serial(port: &str, baud: u32, timeout: Duration) -> Result<Self> {
        let (read, write) = mimu_device::serial_pair(port, baud, Duration::from_millis(50))?;
        Ok(Self {
            read: BufReader::new(read),
            write,
            name: port.to_owned(),
            timeout,
        })
    }

    fn say(&mut self, text: &str) -> Result<()> {
        let line = format!("{text}\n");
        let said = self.write.write_all(line.as_bytes());
        let said = said.and_then(|()| self.write.flush());
        said.map_err(|e| Error::device(&self.name, e, "check the line to the table"))
    }

    fn answer(&mut self, to: &str) -> Result<String> {
        use std::io::ErrorKind as Io;
        let until = Instant::now() + self.timeout;
        let mut bytes = Vec::new();
        loop {
            match self.read.read_until(b'\n', &mut bytes) {
                Ok(0) => {
                    let problem = "the table has closed the line";
                    return Err(Error::device(&self.name, problem, "look at the table"));
                }
                Ok(_) if bytes.ends_with(b"\n") => {
                    return Ok(String::from_utf8_lossy(&bytes).trim().to_owned());
                }
                Ok(_) => {}
                Err(e) if matches!(e.kind(), Io::TimedOut | Io::WouldBlock | Io::Interrupted) => {}
                Err(e) => return Err(Error::device(&self.name, e, "check the line to the table")),
            }
            if Instant::now() > until {
                let problem = format!("the table does not answer {to:?}");
                return Err(Error::device(&self.name, problem, "look at the table"));
            }
        }
    }
}

/// Angles of a table that turns the body about z first and tilts it then: with these, `up` points up.
fn angles(up: &Vector3<f64>) -> (f64, f64) {
    let across = up.x.hypot(up.y);
    let inner = if across < 1e-9 { 0.0 } else { up.x.atan2(up.y) };
    (across.atan2(up.z).to_degrees(), inner.to_degrees())
}

/// What a command may ask for.
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
    fn held(&mut self) -> Result<Option<String>> {
        let Some(question) = self.file.interlock.clone() else {
            return Ok(None);
        };
        let free = self.is(&question)?;
        Ok((!free).then(|| "the interlock of the table is open".into()))
    }

    fn go(&mut self, step: &Step) -> Result<()> {
        let (middle, _) = angles(&step.up());
        let limits = self.file.limits;
        let beyond = |what: &str, value: f64, limit: f64| {
            let problem = format!("{what} of {value:.1} is beyond the table's {limit}");
            let remedy = "leave the step out, or mend [limits]";
            Err(Error::new(&self.place, problem, remedy))
        };
        if let Some(limit) = limits.rate_dps.filter(|l| step.rate_dps.abs() > *l) {
            return beyond("a rate in deg/s", step.rate_dps, limit);
        }
        if let Some(limit) = limits.middle_deg.filter(|l| middle.abs() > *l) {
            return beyond("a tilt in degrees", middle, limit);
        }
        if let Some(why) = self.held()? {
            return Err(Error::device(&self.line.name, why, "close it"));
        }
        self.stop()?;
        let to_pose = self.file.to_pose.clone();
        self.command(&to_pose, &values(step))?;
        if step.rate_dps != 0.0 {
            if self.file.rate.is_none() {
                let problem = "a step turns, and there is no [rate]";
                return Err(Error::new(
                    &self.place,
                    problem,
                    "say how the table is told a rate",
                ));
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
