//! A board of another maker that writes its readings as lines of text: the usual sketch for an Arduino, a Teensy or an ESP32, or what
//! MotionCal reads.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use mimu_core::compensation::Affine;
use mimu_device::Session;
use mimu_recording::RawUnit;
use mimu_recording::error::{Error, Result};
use nalgebra::{Matrix3, Vector3};

use crate::regular::{Regular, Timed};
use crate::source::{Chunk, Heard, Source, Unit};
use crate::text_line::{Columns, Lines, Reading};

/// Longest wait for the port: what comes together within it has one time of arrival.
const POLL: Duration = Duration::from_millis(5);
/// Longest wait for a line of numbers. A board that is reset by the opening of its port has said its first words by then.
const NOTHING: Duration = Duration::from_secs(5);
/// Silence after which the port is opened again: one that was unplugged need not say so.
const SILENCE: Duration = Duration::from_secs(5);
/// Lines that are not data are told of when there are so many more by this factor.
const TOLD_AGAIN: u64 = 10;

/// How a board writes, and what its numbers are.
#[derive(Debug, Clone)]
pub struct Text {
    /// Path of the serial port, or `tcp://HOST:PORT`.
    pub port: String,
    /// Bits a second; a line over USB or TCP takes no notice of it.
    pub baud: u32,
    /// What stands in which place.
    pub columns: Columns,
    /// Unit of the readings.
    pub raw_unit: RawUnit,
    /// What the board is called; without it, as its port.
    pub name: Option<String>,
}

/// Opens a board, and again when it was gone: the rate that was found first stays, as time is counted by it.
#[derive(Debug, Clone)]
pub struct TextOpener {
    text: Text,
    rate_hz: Option<f64>,
}

impl TextOpener {
    /// Of a board. `rate_hz`: that of the session that goes on, if one does.
    pub fn new(text: Text, rate_hz: Option<f64>) -> Self {
        Self { text, rate_hz }
    }

    /// Opens it, and waits until its rate is known. `next`: the first tick that it may use.
    ///
    /// Errors: the port does not open; within 5 s no line is what was described.
    pub fn open(&mut self, next: u64) -> Result<TextSource> {
        let input = open(&self.text)?;
        let source = TextSource::of(input, &self.text, self.rate_hz, next)?;
        self.rate_hz = Some(source.unit.rate_hz);
        Ok(source)
    }
}

fn open(text: &Text) -> Result<Box<dyn Read + Send>> {
    let Some(address) = text.port.strip_prefix("tcp://") else {
        return Ok(mimu_device::serial_pair(&text.port, text.baud, POLL)?.0);
    };
    let connected = TcpStream::connect(address).and_then(|line| {
        line.set_read_timeout(Some(POLL))?;
        Ok(line)
    });
    let line = connected.map_err(|error| {
        let remedy = "check that the board is on the network, and the address, tcp://HOST:PORT";
        Error::device(&text.port, error, remedy)
    })?;
    Ok(Box::new(line))
}

/// The samples of a board that writes lines.
pub struct TextSource {
    input: Box<dyn Read + Send>,
    port: String,
    lines: Lines,
    regular: Regular,
    unit: Unit,
    began: Instant,
    heard: Instant,
    /// Lines whose time cannot be that are among those refused.
    garbled: u64,
    ready: VecDeque<Heard>,
    /// Number of lines that are not data at which they are told of next.
    tell_at: u64,
}

impl TextSource {
    /// Of an open line. `rate_hz`: what it was before, if it was opened before.
    fn of(
        input: Box<dyn Read + Send>,
        text: &Text,
        rate_hz: Option<f64>,
        next: u64,
    ) -> Result<Self> {
        let name = text.name.clone().unwrap_or_else(|| text.port.clone());
        let unit = Unit {
            id: name.clone(),
            name,
            raw_unit: text.raw_unit,
            rate_hz: rate_hz.unwrap_or(f64::NAN),
            nominal: (text.raw_unit == RawUnit::Si).then(|| [identity(), identity()]),
            told: Vec::new(),
            is_device: false,
            start: None,
        };
        let now = Instant::now();
        let mut source = Self {
            input,
            port: text.port.clone(),
            lines: Lines::new(text.columns.clone()),
            regular: Regular::new(rate_hz, text.columns.has_clock(), next + 1),
            unit,
            began: now,
            heard: now,
            garbled: 0,
            ready: VecDeque::new(),
            tell_at: 1,
        };
        source.find_rate()?;
        Ok(source)
    }

    /// Listens until the rate is known.
    fn find_rate(&mut self) -> Result<()> {
        while self.regular.rate_hz().is_none() {
            self.take()?;
            if self.heard.elapsed() < NOTHING {
                continue;
            }
            return Err(match self.lines.count() {
                0 => self.nothing_fits(),
                _ => Error::device(
                    &self.port,
                    "the lines have stopped before their rate was known",
                    "reset the board and run it again",
                ),
            });
        }
        let rate_hz = self.regular.rate_hz().unwrap_or(f64::NAN);
        self.unit.rate_hz = rate_hz;
        if !(4.0..=50_000.0).contains(&rate_hz) {
            let problem = format!("{rate_hz:.3} lines come a second");
            let remedy = "have the board write 20 to 1000 lines a second, or check the unit of its clock column";
            return Err(Error::device(&self.port, problem, remedy));
        }
        let clock = match self.lines.has_clock() {
            true => "by the board's clock",
            false => "by the clock of this computer",
        };
        self.unit.told = vec![
            format!("{}: lines of text, {}", self.port, self.lines.description()),
            format!("{rate_hz:.2} samples a second, {clock}"),
        ];
        self.unit.told.extend(self.lines.refused_in_words());
        self.tell_at = TOLD_AGAIN * self.lines.refused().max(1);
        Ok(())
    }

    fn nothing_fits(&self) -> Error {
        let seen = self.lines.first_seen();
        if seen.is_empty() {
            return Error::device(
                &self.port,
                "no line of text has come within 5 s",
                "check that the board writes to this port, and --baud",
            );
        }
        let shown: Vec<String> = seen.iter().map(|l| format!("{l:?}")).collect();
        let problem = format!(
            "no line within 5 s is {}; the first are {}",
            self.lines.description(),
            shown.join(", ")
        );
        let remedy = "name the columns in their order with --text, `-` for one that is not needed; where the lines are garbage, give --baud";
        Error::device(&self.port, problem, remedy)
    }

    /// Reads once, and puts what is known of it now into `ready`.
    fn take(&mut self) -> Result<()> {
        let mut bytes = [0; 4096];
        let count = match self.input.read(&mut bytes) {
            // A port that was pulled out, or a peer that has hung up, is at its end for ever.
            Ok(0) => return Err(self.gone()),
            Ok(count) => count,
            Err(e) => match e.kind() {
                ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted => 0,
                _ => return Err(self.gone()),
            },
        };
        let arrived_s = self.began.elapsed().as_secs_f64();
        for reading in self.lines.take(&bytes[..count]) {
            self.heard = Instant::now();
            let Reading { raw, temp_c, t_s } = reading;
            let timed = Timed {
                t_s: t_s.unwrap_or(arrived_s),
                raw,
                temp_c,
            };
            if self.regular.take(timed) {
                while let Some((tick, sample)) = self.regular.rest() {
                    self.emit(tick, &sample);
                }
                self.regular.begin_anew();
                let why = "its clock has gone back".to_string();
                self.ready.push_back(Heard::Restarted(why));
            }
        }
        self.lines.refuse(self.regular.garbled() - self.garbled);
        self.garbled = self.regular.garbled();
        // On the computer's clock time goes on without lines as well.
        let now = (!self.lines.has_clock()).then_some(arrived_s);
        while let Some((tick, sample)) = self.regular.next(now) {
            self.emit(tick, &sample);
        }
        Ok(())
    }

    /// Puts a sample behind those of the same chunk.
    fn emit(&mut self, tick: u64, sample: &Timed) {
        let fits = |c: &Chunk| {
            let same = c.temp_c == sample.temp_c || c.temp_c.is_nan() && sample.temp_c.is_nan();
            same && c.tick + c.values.len() as u64 == tick
        };
        match self.ready.back_mut() {
            Some(Heard::Samples(chunk)) if fits(chunk) => chunk.values.push(sample.raw),
            _ => self.ready.push_back(Heard::Samples(Chunk {
                tick,
                values: vec![sample.raw],
                temp_c: sample.temp_c,
                saturated: false,
                self_test: false,
            })),
        }
    }

    fn gone(&self) -> Error {
        Error::device(
            &self.port,
            "the port has vanished",
            "check the cable and the board",
        )
    }
}

impl Source for TextSource {
    fn unit(&self) -> &Unit {
        &self.unit
    }

    fn next(&mut self) -> Result<Heard> {
        if let Some(heard) = self.ready.pop_front() {
            return Ok(heard);
        }
        self.take()?;
        if self.heard.elapsed() > SILENCE {
            return Err(Error::device(
                &self.port,
                "no line of numbers has come for 5 s",
                "check the cable, and reset the board",
            ));
        }
        if self.lines.refused() >= self.tell_at {
            self.tell_at = TOLD_AGAIN * self.lines.refused();
            if let Some(words) = self.lines.refused_in_words() {
                return Ok(Heard::Note(words));
            }
        }
        Ok(self.ready.pop_front().unwrap_or(Heard::Nothing))
    }

    fn device(&mut self) -> Option<&mut Session> {
        None
    }
}

fn identity() -> Affine<f64> {
    Affine {
        matrix: Matrix3::identity(),
        offset: Vector3::zeros(),
    }
}
