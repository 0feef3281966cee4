//! Calls and answers on an open port, before and after the device is identified.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use mimu_core::wire::{Call, MAX_FRAME, Request, encode};

use super::identity::check;
use super::port::Port;
use super::received::{Answer, Event, Received, Receiver};
use mimu_recording::error::{Error, Result};

/// Attempts at a call. Garbled frames are lost in both directions, and every call may be repeated.
pub(super) const ATTEMPTS: u32 = 4;
/// Wait for an answer after a garbled frame: longer than the 1 to 4 s of erasing a sector, shorter than the 15 s wait for a commit.
const GARBLED: Duration = Duration::from_millis(4500);
/// Largest queue of unread events: a minute of both streams. If it is full, the caller has stopped reading.
const WAITING: usize = 6000;

/// Factor of all waits for a device: `MIMU_PATIENCE`, for one behind a slow line or beside a busy computer.
pub fn patience() -> u32 {
    let factor = std::env::var("MIMU_PATIENCE").ok();
    factor
        .and_then(|text| text.parse().ok())
        .unwrap_or(1)
        .max(1)
}

/// A port, and what was received on it.
#[derive(Debug)]
pub(super) struct Line {
    pub port: Port,
    pub receiver: Receiver,
    pub waiting: VecDeque<Event>,
    pub overflowed: u64,
    /// How many of the waiting events came before the last answer.
    pub before_answer: usize,
    /// Calls that had to be repeated.
    pub repeated: u32,
    last_id: u16,
}

impl Line {
    pub fn new(port: Port) -> Self {
        Self {
            port,
            receiver: Receiver::default(),
            waiting: VecDeque::new(),
            overflowed: 0,
            before_answer: 0,
            repeated: 0,
            // Not always 1, so that answers to an earlier program are ignored.
            last_id: std::process::id() as u16,
        }
    }

    /// Repeats a call until it is answered, waiting `wait` each time; `None` if no answer comes. The answer to an earlier attempt may be late, and serves as
    /// well.
    pub fn ask(&mut self, request: Request<'_>, wait: Duration) -> Result<Option<Answer>> {
        let mut frame = [0; MAX_FRAME];
        let mut asked = Vec::new();
        for attempt in 0..ATTEMPTS * patience() {
            if attempt > 0 {
                self.repeated += 1;
            }
            // 0 is for messages without a call.
            self.last_id = self.last_id.checked_add(1).unwrap_or(1);
            let id = self.last_id;
            asked.push(id);
            let call = Call { id, request };
            let length = encode(&call, &mut frame)
                .map_err(|e| Error::device(self.port.name(), e, "report this"))?;
            self.port.write(&frame[..length])?;
            let mut until = Instant::now() + wait;
            let garbled = self.receiver.count().garbled;
            let mut was_garbled = false;
            while Instant::now() < until {
                if let Some(answer) = self.listen(&asked)? {
                    return Ok(Some(answer));
                }
                // The garbled frame may have been the answer. The call is then repeated earlier.
                if !was_garbled && self.receiver.count().garbled > garbled {
                    was_garbled = true;
                    until = until.min(Instant::now() + GARBLED);
                }
            }
        }
        Ok(None)
    }

    /// Reads once, and returns the answer to one of the calls `wanted` if it came. Events are queued.
    pub fn listen(&mut self, wanted: &[u16]) -> Result<Option<Answer>> {
        let mut bytes = [0; 4096];
        let count = self.port.read(&mut bytes)?;
        let mut answer = None;
        let mut stranger = None;
        let (waiting, overflowed) = (&mut self.waiting, &mut self.overflowed);
        let before_answer = &mut self.before_answer;
        self.receiver.take(&bytes[..count], |heard| match heard {
            Received::Event(event) if waiting.len() < WAITING => waiting.push_back(event),
            Received::Event(_) => *overflowed += 1,
            // Late answers to abandoned calls are ignored.
            Received::Answer(id, of) if wanted.contains(&id) => {
                *before_answer = waiting.len();
                answer = Some(of);
            }
            Received::Answer(..) => {}
            Received::Stranger(_, magic, version) => stranger = Some((magic, version)),
        });
        match stranger {
            Some((magic, version)) => {
                check(self.port.name(), magic, version)?;
                // The protocol matches, but the rest of the greeting is not as it defines.
                Err(Error::device(
                    self.port.name(),
                    "the device uses this program's protocol, but its greeting cannot be read",
                    "flash the firmware that belongs to this program (docs/device/board.md)",
                ))
            }
            None => Ok(answer),
        }
    }
}
