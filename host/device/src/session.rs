//! A session with a device: calls, each answered or refused, and events.

use std::time::{Duration, Instant};

use mimu_core::wire::{Refusal, Request};

use super::identity::Identity;
use super::line::{ATTEMPTS, Line, patience};
use super::origin;
use super::port::{Port, ports};
use super::received::{Answer, Event, LineCount};
use mimu_recording::error::{Argument, Error, Result};

/// Longest wait for an answer without work. A frame takes 5 ms, and a frame of samples may be sent before it. With all attempts of a call, the wait
/// also covers a device that is still storing what an earlier program committed.
pub(super) const PATIENCE: Duration = Duration::from_millis(1500);
/// Longest silence of a stream.
pub(super) const SILENCE: Duration = Duration::from_secs(3);

/// An open line to a compatible device that has sent its greeting.
#[derive(Debug)]
pub struct Session {
    line: Line,
    who: Identity,
}

impl Session {
    /// Opens the port and asks for the greeting. Without a name, tries the ports where a board can be; exactly one must answer.
    pub fn open(port: Option<&str>) -> Result<Self> {
        if let Some(name) = port {
            return Self::greet(Port::open(name)?);
        }
        let ports = ports();
        let mut found: Vec<Self> = Vec::new();
        let mut reasons = Vec::new();
        for name in &ports.of_boards {
            match Port::open(name).and_then(Self::greet) {
                Ok(session) => found.push(session),
                Err(error) => {
                    let refused = error.refused();
                    reasons.push(format!("{}: {}", refused.place, refused.problem));
                }
            }
        }
        let refuse = |problem: String, remedy: String| {
            Err(Error::device("ports", problem, remedy).about(Argument::Port))
        };
        match (found.pop(), found.as_slice()) {
            (Some(only), []) => Ok(only),
            (Some(_), _) => refuse("more than one device greets".into(), ports.listed()),
            (None, _) => {
                let problem = match reasons.is_empty() {
                    true if ports.unlisted => {
                        return refuse("no port is named".into(), ports.listed());
                    }
                    true => "this computer has no serial port of a board (ST-LINK, or the board's own USB)"
                        .to_string(),
                    false => format!(
                        "no device greets ({})",
                        reasons.join("; ").replace(';', ",")
                    ),
                };
                let remedy = "plug the board in, or name its port";
                refuse(problem + &ports.left_alone(), remedy.into())
            }
        }
    }

    /// Whether the port has vanished: the board was unplugged or lost its power.
    pub fn is_lost(&self) -> bool {
        self.line.port.is_lost()
    }

    fn greet(port: Port) -> Result<Self> {
        let mut line = Line::new(port);
        let mut greeting = line.ask(Request::Hello, PATIENCE)?;
        if greeting.is_none() && line.receiver.count().frames > 0 {
            // It speaks, but is busy: a commit to its flash takes seconds.
            greeting = line.ask(Request::Hello, PATIENCE)?;
        }
        let Some(Answer::Greeting(who)) = greeting else {
            return Err(no_greeting(line.port.name(), &line.receiver.count()));
        };
        let mut session = Self { line, who: *who };
        if !session.line.waiting.is_empty() {
            // The device may still stream for an earlier program.
            session.done(Request::Stop, "to stop streaming")?;
            session.forget_events();
        }
        Ok(session)
    }

    /// The device's identity, from its last greeting.
    pub fn who(&self) -> &Identity {
        &self.who
    }

    /// Path of the port.
    pub fn port(&self) -> &str {
        self.line.port.name()
    }

    /// Counts of what was received so far.
    pub fn count(&self) -> LineCount {
        self.line.receiver.count()
    }

    /// Calls that had to be repeated because no answer came.
    pub fn repeated(&self) -> u32 {
        self.line.repeated
    }

    /// Asks for the greeting again.
    pub fn hello(&mut self) -> Result<&Identity> {
        match self.call(Request::Hello, "to greet", PATIENCE)? {
            Answer::Greeting(who) => self.who = *who,
            _ => return Err(self.unexpected("to greet")),
        }
        Ok(&self.who)
    }

    /// Repeats a call until it is answered; `purpose` completes "the request ...". A refusal is an error.
    pub fn call(&mut self, request: Request<'_>, purpose: &str, wait: Duration) -> Result<Answer> {
        match self.attempt(request, purpose, wait)? {
            Answer::Refused(refusal) => Err(refused(self.line.port.name(), purpose, &refusal)),
            answer => Ok(answer),
        }
    }

    /// Like [`Self::call`], for requests that are answered by [`Answer::Done`].
    pub fn done(&mut self, request: Request<'_>, purpose: &str) -> Result<()> {
        match self.call(request, purpose, PATIENCE)? {
            Answer::Done => Ok(()),
            _ => Err(self.unexpected(purpose)),
        }
    }

    /// Like [`Self::call`], but returns a refusal as an answer.
    pub(super) fn attempt(
        &mut self,
        request: Request<'_>,
        purpose: &str,
        wait: Duration,
    ) -> Result<Answer> {
        let attempts = ATTEMPTS * patience();
        match self.line.ask(request, wait)? {
            Some(answer) => Ok(answer),
            None => Err(Error::device(
                self.line.port.name(),
                format!(
                    "the device does not answer the request {purpose}, made {attempts} times in {:.0} s ({} frames were garbled)",
                    wait.as_secs_f64() * f64::from(attempts),
                    self.line.receiver.count().garbled
                ),
                "check the cable, reset the board and run it again",
            )),
        }
    }

    /// Error for an answer of the wrong kind.
    pub fn unexpected(&self, purpose: &str) -> Error {
        Error::device(
            self.line.port.name(),
            format!("its answer to the request {purpose} has another type"),
            "report this, with the output of `mimu device info`",
        )
    }

    /// The next event, or `None` if none came within the wait of [`Port::read`].
    pub fn event(&mut self) -> Result<Option<Event>> {
        if self.line.waiting.is_empty() {
            self.line.listen(&[])?;
        }
        if self.line.overflowed > 0 {
            return Err(Error::device(
                self.line.port.name(),
                format!("{} events arrived and were not read", self.line.overflowed),
                "close other programs and run it again",
            ));
        }
        let event = self.line.waiting.pop_front();
        if let Some(Event::Started(who)) = &event {
            self.who = (**who).clone();
        }
        Ok(event)
    }

    /// The next event of a stream, whose last samples came at `last`; `name` is "raw stream", for example. A restart or a silence of 3 s is an error.
    pub(super) fn stream_event(&mut self, last: Instant, name: &str) -> Result<Option<Event>> {
        let event = self.event()?;
        let (problem, remedy) = match &event {
            Some(Event::Started(_)) => (
                "the device restarted meanwhile".into(),
                "run it again; `mimu device info` shows the reset cause",
            ),
            None if last.elapsed() > SILENCE * patience() => (
                format!("the {name} does not arrive"),
                "reset the board and run it again",
            ),
            _ => return Ok(event),
        };
        Err(Error::device(self.port(), problem, remedy))
    }

    /// Starts a stream, and discards events from before its confirmation. They may be batches of an earlier stream, which a gap would follow.
    pub fn begin_stream(&mut self, request: Request<'_>) -> Result<()> {
        self.done(request, "to stream")?;
        let old = self.line.before_answer.min(self.line.waiting.len());
        self.line.waiting.drain(..old);
        self.line.overflowed = 0;
        Ok(())
    }

    /// Discards the waiting events.
    pub fn forget_events(&mut self) {
        self.line.waiting.clear();
        self.line.overflowed = 0;
    }
}

/// Error for a port without a mimu device.
fn no_greeting(port: &str, count: &LineCount) -> Error {
    match (count.bytes, count.frames) {
        (0, _) => Error::device(
            port,
            "nothing answers: it is not a mimu device, or it is not running",
            "check its power and its firmware, or choose another port",
        ),
        (bytes, 0) => Error::device(
            port,
            format!(
                "garbage: {bytes} bytes came but no complete frame, so this is not a mimu device"
            ),
            "choose another port, or flash mimu-firmware (1 Mbaud, 8N1)",
        ),
        (_, frames) => Error::device(
            port,
            format!("{frames} complete frames came, but no greeting within 9 s"),
            "reset the board and run it again; if its firmware is another one, choose another port, or flash mimu-firmware",
        ),
    }
}

/// Error for a refusal by the device.
pub fn refused(port: &str, purpose: &str, refusal: &Refusal) -> Error {
    let (why, remedy) = match refusal {
        Refusal::Unknown => (
            "it does not know this request".into(),
            "flash the firmware that belongs to this program",
        ),
        Refusal::NoCalibration => (
            "it stores no calibration".into(),
            "upload one: `mimu device upload CAL`",
        ),
        Refusal::NoUpload => (
            "it has no upload in progress: it has restarted, or another program has ended the upload".into(),
            "upload again",
        ),
        Refusal::TooLong { room } => (
            format!("it has room for {room} bytes"),
            "use fewer temperature nodes or effects",
        ),
        // Every frame has a checksum, so that bytes that differ are somebody else's.
        Refusal::WrongOffset { .. } | Refusal::Incomplete { .. } | Refusal::WrongHash { .. } => (
            "it has another upload in hand than this program's: two programs upload at once".into(),
            "end the other program, and upload again",
        ),
        Refusal::NotUsable(reason) => (
            format!("it cannot use the bytes as a calibration: {}", reason),
            "update device and program to the same version",
        ),
        Refusal::FlashFailed => (
            "its flash failed to write or read it; the previous calibration is still in use".into(),
            "upload again; if that fails too, the flash is worn out",
        ),
        Refusal::SupplyLow => (
            "its supply is below 2.76 V, and might fail while the flash is written; the previous calibration is still in use".into(),
            "check the supply: USB cable, regulator, battery",
        ),
        Refusal::BanksSwapped => (
            "the banks of its flash are swapped, so that it would erase something else".into(),
            "clear the option byte SWAP_BANK_OPT with a debugger",
        ),
        Refusal::NoBank => (
            "no Kalman bank of this triad is running: the device has restarted, or the bank was ended".into(),
            "run it again",
        ),
        Refusal::BadNumber => (
            "a number is not finite, or a variance is not positive".into(),
            "check the numbers",
        ),
        Refusal::Busy => (
            "it is busy with something else".into(),
            "wait a few seconds and run it again",
        ),
        Refusal::OtherUnit { unit_id } => (
            format!("it belongs to unit {}", origin::digits(unit_id)),
            "upload the calibration of this unit, or confirm that another one is meant",
        ),
        Refusal::NotKnown => (
            "for a cause that this program does not know".into(),
            "update mimu on this computer",
        ),
    };
    let error = Error::device(
        port,
        format!("the device refuses the request {purpose}: {why}"),
        remedy,
    );
    match refusal {
        Refusal::OtherUnit { .. } => error.about(Argument::OtherUnit),
        _ => error,
    }
}
