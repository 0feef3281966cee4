//! A board of another maker that writes its readings as lines of text: the usual sketch for an Arduino, a Teensy or an ESP32, or what
//! MotionCal reads.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use mimu_core::compensation::Affine;
use mimu_device::Session;
use mimu_recording::RawUnit;
use mimu_recording::error::{Argument, Error, Result};
use nalgebra::{Matrix3, Vector3};

use crate::regular::{Regular, Timed};
use crate::source::{Chunk, Heard, Source, Unit};
use crate::text_line::{Columns, Lines, Reading};

/// Longest wait for the port: what comes together within it has one time of arrival.
const POLL: Duration = Duration::from_millis(5);
/// Longest wait for a line of numbers. A board that resets when its port is opened has started by then.
const NOTHING: Duration = Duration::from_secs(5);
/// Silence after which the port is opened again: one that was unplugged need not say so.
const SILENCE: Duration = Duration::from_secs(5);
/// So long the board's clock is compared with the computer's before its rate is believed: lines that waited in a buffer are then few
/// beside those that came at their time.
const COMPARED: Duration = Duration::from_secs(2);
/// Departure of the two that is worth a word: crystals and ceramic resonators are within 0.5 %.
const CLOCK_SHARE: f64 = 0.05;
/// A factor between the two that no replay of a recording has, and that a wrong unit has: 1000 or a million.
const WRONG_UNIT: f64 = 100.0;
/// Lines that are not data are told of when there are so many more by this factor.
const TOLD_AGAIN: u64 = 10;

/// How a board writes, and what its numbers are.
#[derive(Debug, Clone)]
pub struct Text {
    /// Path of the serial port, or `tcp://HOST:PORT`.
    pub port: String,
    /// Bits a second; a line over USB or TCP takes no notice of it.
    pub baud: u32,
    /// Meaning of each place in a line.
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
    patience: Duration,
}

impl TextOpener {
    /// Opens a board. `rate_hz`: that of the session, if one is resumed.
    pub fn new(text: Text, rate_hz: Option<f64>) -> Self {
        Self {
            text,
            rate_hz,
            patience: NOTHING,
        }
    }

    /// Opens it, and waits until its rate is known. `next`: the first tick that it may use.
    ///
    /// Errors: the port does not open; within 5 s no line is what was described.
    pub fn open(&mut self, next: u64) -> Result<TextSource> {
        let input = open(&self.text)?;
        let source = TextSource::of(input, self, next)?;
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
    /// Times of lines by the board's clock and by the computer's, s, until the two are compared.
    clocks: Vec<[f64; 2]>,
    /// How many times as fast as the computer's the board's clock goes, once they are.
    clock_factor: Option<f64>,
    ready: VecDeque<Heard>,
    /// Number of lines that are not data at which they are told of next.
    tell_at: u64,
}

impl TextSource {
    /// Of an open line.
    fn of(input: Box<dyn Read + Send>, opener: &TextOpener, next: u64) -> Result<Self> {
        let (text, rate_hz) = (&opener.text, opener.rate_hz);
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
            clocks: Vec::new(),
            clock_factor: None,
            ready: VecDeque::new(),
            tell_at: 1,
        };
        source.find_rate(opener.patience)?;
        Ok(source)
    }

    /// Listens until the rate is known and a line has come.
    fn find_rate(&mut self, patience: Duration) -> Result<()> {
        while self.regular.rate_hz().is_none() || self.lines.count() == 0 {
            self.take()?;
            self.check_clock()?;
            if self.heard.elapsed() < patience {
                continue;
            }
            return Err(match self.lines.count() {
                0 => self.nothing_fits(),
                _ => Error::device(
                    &self.port,
                    "the lines stopped before their rate was known",
                    "reset the board and run it again",
                ),
            });
        }
        let rate_hz = self.regular.rate_hz().unwrap_or(f64::NAN);
        self.unit.rate_hz = rate_hz;
        if !(4.0..=50_000.0).contains(&rate_hz) {
            let problem = format!("{rate_hz:.3} lines arrive per second");
            let remedy = "let the board write 20 to 1000 lines per second, or check the unit of its clock column";
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
        if let Some(factor) = self.clock_factor.filter(|f| (f - 1.0).abs() > CLOCK_SHARE) {
            self.unit.told.push(format!(
                "the board's clock runs {factor:.3} times as fast as this computer's, and every rate of the gyro errs by that factor: unless this is a replay, check the clock that the board writes"
            ));
        }
        self.unit.told.extend(self.lines.others_in_words());
        self.unit.told.extend(self.lines.refused_in_words());
        self.tell_at = TOLD_AGAIN * self.lines.refused().max(1);
        Ok(())
    }

    /// Compares the board's clock with the computer's, once enough of both has passed.
    ///
    /// Errors: one goes so much faster that the unit of the column is another.
    fn check_clock(&mut self) -> Result<()> {
        let spent = self.clocks.last().zip(self.clocks.first());
        let spent_s = spent.map_or(0.0, |(last, first)| last[1] - first[1]);
        if self.clock_factor.is_some() || spent_s < COMPARED.as_secs_f64() || self.clocks.len() < 8
        {
            return Ok(());
        }
        // A garbled time is in few of the pairs, and leaves the median alone.
        let later = &self.clocks[self.clocks.len() / 2..];
        let both = self.clocks.iter().zip(later);
        let mut factors: Vec<f64> = both.map(|(a, b)| (b[0] - a[0]) / (b[1] - a[1])).collect();
        factors.sort_by(f64::total_cmp);
        let factor = factors[factors.len() / 2];
        (self.clock_factor, self.clocks) = (Some(factor), Vec::new());
        if (1.0 / WRONG_UNIT..WRONG_UNIT).contains(&factor) {
            return Ok(());
        }
        let problem = format!(
            "its clock runs {} times as fast as this computer's, as if its column were {}",
            mimu::quantity::significant(factor),
            self.lines.clock_in_words(factor)
        );
        let remedy = "name the column t_us, t_ms or t_s as the board writes it, or `-` to use this computer's clock";
        Err(Error::device(&self.port, problem, remedy))
    }

    fn nothing_fits(&self) -> Error {
        let seen = self.lines.first_seen();
        if seen.is_empty() {
            return Error::device(
                &self.port,
                "no line of text arrived within 5 s",
                "check that the board writes to this port, and its bits per second",
            )
            .about(Argument::Baud);
        }
        let shown: Vec<String> = seen.iter().map(|l| format!("{l:?}")).collect();
        let problem = format!(
            "no line within 5 s is {}; the first are {}",
            self.lines.description(),
            shown.join(", ")
        );
        let remedy = "name the columns in their order, `-` for one that is not needed; if the lines are garbage, give the board's bits per second";
        Error::device(&self.port, problem, remedy)
            .about(Argument::TextColumns)
            .about(Argument::Baud)
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
            if let (Some(t_s), None) = (t_s, self.clock_factor) {
                self.clocks.push([t_s, arrived_s]);
            }
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
        // On the computer's clock time advances without lines too.
        let now = (!self.lines.has_clock()).then_some(arrived_s);
        while let Some((tick, sample)) = self.regular.certain(now) {
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
                power_on_s: None,
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
                "no line of numbers arrived for 5 s",
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

    fn aside(&mut self) -> Option<&mut Session> {
        None
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

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;
    use std::io::Write as _;
    use std::net::TcpListener;

    use super::*;

    fn board(columns: &str, writes: Vec<String>, stays: Duration) -> TextOpener {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = format!("tcp://{}", listener.local_addr().unwrap());
        // One after the other, and hung up so long behind each.
        std::thread::spawn(move || {
            for text in writes {
                let mut line = listener.accept().unwrap().0;
                let _ = line.write_all(text.as_bytes());
                std::thread::sleep(stays);
            }
        });
        let text = Text {
            port,
            baud: 115_200,
            columns: Columns::parse(columns).unwrap(),
            raw_unit: RawUnit::Count,
            name: None,
        };
        TextOpener {
            patience: Duration::from_millis(200),
            ..TextOpener::new(text, None)
        }
    }

    /// Lines with a clock, which show their number as a reading; `odd` gives another one in the place of some.
    fn numbered(rate_hz: f64, count: usize, odd: impl Fn(usize) -> Option<String>) -> String {
        let mut text = String::from("cut\n");
        for k in 0..count {
            let t_us = (1e6 * k as f64 / rate_hz).round();
            match odd(k) {
                None => writeln!(text, "{t_us},{k},0,4096,1,2,3").unwrap(),
                Some(other) => text.push_str(&other),
            }
        }
        text
    }

    /// All samples until the line is lost: tick and number; and what was noted.
    fn all(source: &mut TextSource) -> (Vec<(u64, usize)>, Vec<String>) {
        let (mut samples, mut notes) = (Vec::new(), Vec::new());
        while let Ok(heard) = source.next() {
            match heard {
                Heard::Samples(chunk) => {
                    let numbered = (chunk.tick..).zip(&chunk.values);
                    samples.extend(numbered.map(|(tick, v)| (tick, v[3] as usize)));
                }
                Heard::Restarted(words) | Heard::Note(words) => notes.push(words),
                Heard::Nothing => {}
            }
        }
        (samples, notes)
    }

    const CLOCKED: &str = "t_us,ax,ay,az,gx,gy,gz";

    #[test]
    fn lines_that_are_lost_or_garbled_are_missing_ticks_and_are_counted() {
        let odd = |k: usize| match k {
            300 => Some(String::new()),
            400 => Some("4000000,4\u{fffd}\n".into()),
            k if (500..540).contains(&k) => Some("#\n".into()),
            _ => None,
        };
        let mut opener = board(CLOCKED, vec![numbered(100.0, 1000, odd)], Duration::ZERO);
        let mut source = opener.open(50).unwrap();
        assert!((source.unit.rate_hz - 100.0).abs() < 1e-6);
        let (samples, notes) = all(&mut source);
        assert_eq!(samples[0], (51, 0));
        assert!(samples.iter().all(|(tick, k)| *tick == 51 + *k as u64));
        let numbers: Vec<usize> = samples.iter().map(|s| s.1).collect();
        let whole = (0..numbers.len() + 42).filter(|k| odd(*k).is_none());
        assert_eq!(numbers, whole.collect::<Vec<_>>());
        let told = [source.unit.told.clone(), notes].concat().join("; ");
        assert!(told.contains("are not data"), "{told}");
        assert_eq!(source.lines.refused(), 41);
    }

    #[test]
    fn a_port_that_comes_back_goes_on_behind_the_last_sample_at_the_same_rate() {
        let first = numbered(250.0, 2000, |_| None);
        // The second time the rate would be found otherwise.
        let second = numbered(251.0, 2000, |_| None);
        let mut opener = board(CLOCKED, vec![first, second], Duration::ZERO);
        let mut source = opener.open(0).unwrap();
        let (samples, _) = all(&mut source);
        let next = samples.last().unwrap().0 + 1;
        let mut again = opener.open(next).unwrap();
        assert_eq!(again.unit.rate_hz, source.unit.rate_hz);
        let (samples, _) = all(&mut again);
        assert_eq!(samples[0], (next + 1, 0));
        assert!(samples.windows(2).all(|p| p[1].0 > p[0].0));
    }

    #[test]
    fn a_board_that_restarts_is_told_of_and_its_ticks_never_go_back() {
        let text = numbered(100.0, 1200, |_| None).repeat(2);
        let mut source = board(CLOCKED, vec![text], Duration::ZERO).open(0).unwrap();
        let (samples, notes) = all(&mut source);
        assert_eq!(notes, ["its clock has gone back"]);
        assert!(samples.windows(2).all(|p| p[1].0 > p[0].0));
        assert!(samples.len() > 2300, "{}", samples.len());
    }

    /// A board that writes ten lines in a tenth of a second, for three seconds.
    fn paced(columns: &str, unit_s: f64) -> Result<TextSource> {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = format!("tcp://{}", listener.local_addr().unwrap());
        std::thread::spawn(move || {
            let mut line = listener.accept().unwrap().0;
            for k in 0..300 {
                // One of them is garbled.
                let t = if k == 1 {
                    9e9
                } else {
                    (0.01 * f64::from(k) / unit_s).round()
                };
                if writeln!(line, "{t},0,0,4096,1,2,3").is_err() {
                    return;
                }
                if k % 10 == 9 {
                    std::thread::sleep(Duration::from_millis(100));
                }
            }
        });
        let text = Text {
            port,
            baud: 115_200,
            columns: Columns::parse(columns).unwrap(),
            raw_unit: RawUnit::Count,
            name: None,
        };
        TextOpener::new(text, None).open(0)
    }

    #[test]
    fn stamps_in_another_unit_are_refused_within_seconds_with_the_column_that_they_are() {
        for (names, unit_s, is) in [("t_ms", 1e-6, "t_us"), ("t_us", 1e-3, "t_ms")] {
            let began = Instant::now();
            let error = paced(&CLOCKED.replace("t_us", names), unit_s)
                .err()
                .unwrap();
            let error = error.to_string();
            assert!(
                error.contains(&format!("as if its column were {is}")),
                "{error}"
            );
            assert!(began.elapsed() < Duration::from_secs(4));
        }
    }

    #[test]
    fn where_nothing_fits_the_error_shows_the_first_lines() {
        let text = "cut\nMPU6050 OK\n1,2,3\n1,2,3\n1,2,3\n".to_string();
        let stays = Duration::from_secs(1);
        let opened = board("ax,ay,az,gx,gy,gz", vec![text], stays).open(0);
        let error = opened.err().unwrap().to_string();
        let wanted = "no line within 5 s is 6 numbers, ax,ay,az,gx,gy,gz; the first are \"MPU6050 OK\", \"1,2,3\", \"1,2,3\"";
        assert!(error.contains(wanted), "{error}");
    }
}
