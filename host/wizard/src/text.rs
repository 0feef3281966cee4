//! A board of another maker that writes its readings as lines of text: the usual sketch for an Arduino, a Teensy or an ESP32, or the format of
//! MotionCal. Converts bytes with their times of arrival into samples. Port and clock are handled by [`crate::text_port`] and [`crate::relay`].

use std::collections::VecDeque;

use mimu::signal::increment::pause_periods;
use mimu_core::compensation::Affine;
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::health::{StreamRails, Unanswered};
use mimu_recording::{ClockRate, REFUSED_SHARE, RawUnit, Times};

use crate::clock::Clocks;
use crate::regular::{Regular, Timed};
use crate::source::{Chunk, SourceEvent, Unit};
use crate::text_line::{Columns, Lines, Reading};

/// Longest wait for a line of numbers, s. A board that resets when its port is opened has started by then.
pub(crate) const NOTHING_S: f64 = 5.0;
/// Silence after which the port is opened again, s: a port may be unplugged without an error.
const SILENCE_S: f64 = 5.0;
/// Ratio of the clocks that indicates a wrong unit, which gives 1000 or a million. No replay of a recording is so fast.
const WRONG_UNIT: f64 = 100.0;
/// Lines without data are reported again when their number has grown by this factor.
const TOLD_AGAIN: u64 = 10;

/// A board's port, columns and units.
#[derive(Debug, Clone)]
pub struct Text {
    /// Path of the serial port, or `tcp://HOST:PORT`.
    pub port: String,
    /// Bits per second; ignored for USB and TCP.
    pub baud: u32,
    /// Meaning of each place in a line.
    pub columns: Columns,
    /// Unit of the readings.
    pub raw_unit: RawUnit,
    /// Name of the board; by default its port.
    pub name: Option<String>,
    /// Whether its clock is right although it differs from the computer's, as in a replay.
    pub clock_trusted: bool,
}

/// Converts lines of a board into samples.
#[derive(Debug)]
pub struct TextBoard {
    port: String,
    lines: Lines,
    regular: Regular,
    unit: Unit,
    is_open: bool,
    patience_s: f64,
    /// When the last line of numbers came, or when the port was opened.
    heard_s: f64,
    /// Refused lines whose time is impossible.
    garbled: u64,
    /// The clock of the samples and the computer's.
    clocks: Clocks,
    clock_trusted: bool,
    rails: StreamRails,
    unanswered: Unanswered,
    ready: VecDeque<SourceEvent>,
    /// Number of lines without data at which they are reported next.
    tell_at: u64,
}

impl TextBoard {
    /// A board at a port that was opened at `now_s`; all times are by one clock of the computer. `rate_hz`: rate of the resumed session, if any;
    /// `next`: the first tick that it may use.
    pub fn new(text: &Text, rate_hz: Option<f64>, next: u64, now_s: f64) -> Self {
        let name = text.name.clone().unwrap_or_else(|| text.port.clone());
        let unit = Unit {
            id: name.clone(),
            name,
            raw_unit: text.raw_unit,
            sensors: None,
            rate_hz: rate_hz.unwrap_or(f64::NAN),
            has_mag: false,
            nominal: (text.raw_unit == RawUnit::Si)
                .then(|| [Affine::identity(), Affine::identity()]),
            told: Vec::new(),
            is_device: false,
            start: None,
        };
        Self {
            port: text.port.clone(),
            lines: Lines::new(text.columns.clone()),
            // Of a board that is back, nobody knows how long it was away.
            regular: Regular::new(
                rate_hz,
                text.columns.has_clock(),
                next + rate_hz.map_or(1, pause_periods),
            ),
            unit,
            is_open: false,
            patience_s: NOTHING_S,
            heard_s: now_s,
            garbled: 0,
            clocks: Clocks::default(),
            clock_trusted: text.clock_trusted,
            rails: StreamRails::new(text.raw_unit == RawUnit::Count),
            unanswered: Unanswered::default(),
            ready: VecDeque::new(),
            tell_at: 1,
        }
    }

    /// Sets the longest wait for a line.
    pub(crate) fn with_patience(self, patience_s: f64) -> Self {
        Self { patience_s, ..self }
    }

    /// The unit. Its rate is known once [`Self::is_open`] returns true.
    pub fn unit(&self) -> &Unit {
        &self.unit
    }

    /// Whether its rate is known and a line has come.
    ///
    /// Errors: within 5 s no line matched the description, or its times are impossible.
    pub fn is_open(&mut self, now_s: f64) -> Result<bool> {
        if self.is_open {
            return Ok(true);
        }
        self.check_clock()?;
        if self.regular.rate_hz().is_some() && self.lines.count() > 0 {
            self.greet()?;
            self.is_open = true;
            return Ok(true);
        }
        if now_s - self.heard_s < self.patience_s {
            return Ok(false);
        }
        Err(match self.lines.count() {
            0 => self.nothing_fits(),
            _ => Error::device(
                &self.port,
                "the lines have stopped before their rate was known",
                "reset the board and run it again",
            ),
        })
    }

    /// Reports the board once its rate is known.
    fn greet(&mut self) -> Result<()> {
        let rate_hz = self.regular.rate_hz().unwrap_or(f64::NAN);
        self.unit.rate_hz = rate_hz;
        // MotionCal's lines are known once they come.
        self.unit.has_mag = self.lines.has_mag();
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
        self.unit.told.extend(self.lines.others_in_words());
        self.unit.told.extend(self.lines.refused_in_words());
        self.tell_at = TOLD_AGAIN * self.lines.refused().max(1);
        Ok(())
    }

    /// Compares the board's clock with the computer's before the session begins.
    ///
    /// Errors: the clock column has another unit, or the clock is wrong.
    fn check_clock(&self) -> Result<()> {
        let Some(rate) = self.clocks.rate() else {
            return Ok(());
        };
        if (1.0 / WRONG_UNIT..WRONG_UNIT).contains(&rate.factor) {
            return match self.clock_trusted {
                true => Ok(()),
                false => refuse_clock(&self.port, &rate),
            };
        }
        let problem = format!(
            "its clock runs {} times as fast as this computer's, as if its column were {}",
            mimu::quantity::significant(rate.factor),
            self.lines.clock_in_words(rate.factor)
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

    /// Takes the bytes received until `now_s`; empty if only time has passed.
    pub fn take(&mut self, bytes: &[u8], now_s: f64) {
        for reading in self.lines.take(bytes) {
            self.heard_s = now_s;
            let Reading { t_s, .. } = reading;
            if let Some(t_s) = t_s {
                self.compare_clocks(t_s, now_s);
            }
            let timed = Timed {
                t_s: t_s.unwrap_or(now_s),
                raw: reading.raw,
                mag: reading.mag,
                temp_c: reading.temp_c,
            };
            if self.regular.take(timed) {
                while let Some((tick, sample)) = self.regular.rest() {
                    self.emit(tick, &sample);
                }
                self.regular.begin_anew();
                self.clocks = Clocks::default();
                let why = "its clock has gone back".to_string();
                self.ready.push_back(SourceEvent::Restarted(why));
            }
        }
        self.lines.refuse(self.regular.garbled() - self.garbled);
        self.garbled = self.regular.garbled();
        // By the computer's clock, time advances without lines too.
        let now = (!self.lines.has_clock()).then_some(now_s);
        while let Some((tick, sample)) = self.regular.certain(now) {
            self.emit(tick, &sample);
        }
    }

    /// Compares a time by the clock of the samples with the computer's.
    fn compare_clocks(&mut self, t_s: f64, now_s: f64) {
        if let Some(mut rate) = self.clocks.take(t_s, now_s) {
            if self.clock_trusted {
                rate.times = Times::Trusted;
            }
            self.ready.push_back(SourceEvent::Clock(rate));
        }
    }

    /// Appends a sample to the current chunk, unless the board only repeats its last readings.
    fn emit(&mut self, tick: u64, sample: &Timed) {
        let rate_hz = self.unit.rate_hz;
        if !self.lines.has_clock() {
            // Without a clock the lines are counted, at the rate of the first seconds.
            self.compare_clocks(tick as f64 / rate_hz, sample.t_s);
        }
        let (raw, pause) = (&sample.raw, pause_periods(rate_hz));
        if self.unanswered.take(raw, rate_hz, pause) {
            return;
        }
        if let Some(found) = self.unanswered.ended() {
            self.ready.push_back(SourceEvent::Note(found.to_string()));
        }
        let saturated = self.rails.take(&sample.raw).is_some();
        let fits = |c: &Chunk| {
            let same = c.temp_c == sample.temp_c || c.temp_c.is_nan() && sample.temp_c.is_nan();
            same && c.saturated == saturated && c.end() == tick
        };
        match self.ready.back_mut() {
            Some(SourceEvent::Samples(chunk)) if fits(chunk) => {
                chunk.values.push(sample.raw);
                chunk.mag.extend(sample.mag);
            }
            _ => self.ready.push_back(SourceEvent::Samples(Chunk {
                tick,
                values: vec![sample.raw],
                mag: sample.mag.into_iter().collect(),
                temp_c: sample.temp_c,
                saturated,
                self_test: false,
                crystal_ns: None,
                power_on_s: None,
            })),
        }
    }

    /// The next event at `now_s` that was not reported yet.
    ///
    /// Errors: the board is silent.
    pub fn next(&mut self, now_s: f64) -> Result<SourceEvent> {
        if now_s - self.heard_s > SILENCE_S {
            return Err(Error::device(
                &self.port,
                "no line of numbers arrived for 5 s",
                "check the cable, and reset the board",
            ));
        }
        if self.lines.refused() >= self.tell_at {
            self.tell_at = TOLD_AGAIN * self.lines.refused();
            if let Some(words) = self.lines.refused_in_words() {
                return Ok(SourceEvent::Note(words));
            }
        }
        Ok(self.ready().unwrap_or(SourceEvent::Nothing))
    }

    /// The next event that is known already.
    pub(crate) fn ready(&mut self) -> Option<SourceEvent> {
        self.ready.pop_front()
    }

    /// Number of lines without data.
    #[cfg(test)]
    pub(crate) fn refused(&self) -> u64 {
        self.lines.refused()
    }
}

/// Error if the clock of the board at `port` is certainly wrong.
pub(crate) fn refuse_clock(port: &str, rate: &ClockRate) -> Result<()> {
    if rate.differs_by() <= REFUSED_SHARE || rate.times == Times::Trusted {
        return Ok(());
    }
    let problem = format!(
        "{}, and every rate of the gyro would err by that factor",
        rate.words()
    );
    let remedy = "correct the times that the board writes, or name their column `-` to use this computer's clock";
    Err(Error::device(port, problem, remedy)
        .about(Argument::TextColumns)
        .about(Argument::TrustClock))
}
