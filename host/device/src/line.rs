//! Calls and answers on an open port, before and after it is known who is there.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use mimu_core::wire::{Call, MAX_FRAME, Request, encode};

use super::heard::{Answer, Event, Heard, Receiver};
use super::identity::check;
use super::port::Port;
use mimu_recording::error::{Error, Result};

/// Times that a call is made: a garbled frame is lost, either way, and every call may be repeated.
pub(super) const ATTEMPTS: u32 = 4;
/// Wait for an answer behind a frame that was garbled: longer than the 1 to 4 s that a sector takes to be erased, of the 15 that a commit is
/// waited for otherwise.
const GARBLED: Duration = Duration::from_millis(4500);
/// Largest queue of unread events: a minute of both streams. Beyond, the caller has stopped reading.
const WAITING: usize = 6000;

/// A port, and what has been heard on it.
#[derive(Debug)]
pub(super) struct Line {
    pub port: Port,
    pub ear: Receiver,
    pub waiting: VecDeque<Event>,
    pub overflowed: u64,
    /// How many of those that wait came before the last answer.
    pub before_answer: usize,
    /// Calls that had to be repeated.
    pub repeated: u32,
    last_id: u16,
}

impl Line {
    pub fn new(port: Port) -> Self {
        Self {
            port,
            ear: Receiver::default(),
            waiting: VecDeque::new(),
            overflowed: 0,
            before_answer: 0,
            repeated: 0,
            // Not always 1, so that answers to an earlier program are ignored.
            last_id: std::process::id() as u16,
        }
    }

    /// Makes a call until it is answered, each time waiting so long; `None` if it never is.
    pub fn ask(&mut self, request: Request<'_>, wait: Duration) -> Result<Option<Answer>> {
        let mut frame = [0; MAX_FRAME];
        for attempt in 0..ATTEMPTS {
            if attempt > 0 {
                self.repeated += 1;
            }
            // 0 is for messages without a call.
            self.last_id = self.last_id.checked_add(1).unwrap_or(1);
            let id = self.last_id;
            let call = Call { id, request };
            let length = encode(&call, &mut frame)
                .map_err(|e| Error::device(self.port.name(), e, "report this"))?;
            self.port.write(&frame[..length])?;
            let mut until = Instant::now() + wait;
            let garbled = self.ear.count().garbled;
            let mut was_garbled = false;
            while Instant::now() < until {
                if let Some(answer) = self.listen(Some(id))? {
                    return Ok(Some(answer));
                }
                // That may have been the answer, and a call may be repeated.
                if !was_garbled && self.ear.count().garbled > garbled {
                    was_garbled = true;
                    until = until.min(Instant::now() + GARBLED);
                }
            }
        }
        Ok(None)
    }

    /// Reads once; the answer to the call of this number, if it came. Events wait.
    pub fn listen(&mut self, wanted: Option<u16>) -> Result<Option<Answer>> {
        let mut bytes = [0; 4096];
        let count = self.port.read(&mut bytes)?;
        let mut answer = None;
        let mut stranger = None;
        let (waiting, overflowed) = (&mut self.waiting, &mut self.overflowed);
        let before_answer = &mut self.before_answer;
        self.ear.take(&bytes[..count], |heard| match heard {
            Heard::Event(event) if waiting.len() < WAITING => waiting.push_back(event),
            Heard::Event(_) => *overflowed += 1,
            // Late answers to abandoned calls are ignored.
            Heard::Answer(id, of) if Some(id) == wanted => {
                *before_answer = waiting.len();
                answer = Some(of);
            }
            Heard::Answer(..) => {}
            Heard::Stranger(_, magic, version) => stranger = Some((magic, version)),
        });
        match stranger {
            Some((magic, version)) => {
                check(self.port.name(), magic, version)?;
                // Of this protocol, whose greeting is read whatever its length.
                Err(Error::device(
                    self.port.name(),
                    "the device uses this program's protocol, but its greeting cannot be read",
                    "flash the firmware that belongs to this program (README, flashing)",
                ))
            }
            None => Ok(answer),
        }
    }
}
