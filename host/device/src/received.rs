//! Messages of the device as owned values: a decoded message borrows from its frame, which the next byte overwrites.

use mimu_core::compensation::Sample;
use mimu_core::wire::{
    BatchHead, Counters, Decoder, Event as WireEvent, Frame, KalmanState, Message, Refusal, Reply,
    Version,
};
use serde::Serialize;

use super::identity::{Identity, beginning};
use super::reading::shortest;
use super::test_result::TestResult;
use mimu_recording::error::{Error, Result};

/// Answer to a call.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// The device's identity.
    Greeting(Box<Identity>),
    /// The request was carried out, and returns no data.
    Done,
    /// The device's counters.
    Counters(Counters),
    /// Results of the self-test.
    SelfTest(Vec<TestResult>),
    /// Part of the stored calibration.
    Stored {
        /// Offset of the first byte.
        offset: u32,
        /// Length of the whole calibration, bytes.
        length: u32,
        /// The bytes of this part.
        bytes: Vec<u8>,
    },
    /// Final state of a bank.
    Kalman(Box<KalmanState>),
    /// The request was refused.
    Refused(Refusal),
}

/// Consecutive samples: raw readings, or rad/s and m/s² in the body frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    /// Number of the first sample, flags and temperature, common to all samples.
    pub head: BatchHead,
    /// Temperatures of the thermometers in the order of the greeting, °C; for raw readings only.
    pub temperatures_c: Vec<f32>,
    /// Raw units per unit of the integers, for raw readings only: the size of a step.
    pub scale: Option<mimu_core::PerSensor<f32>>,
    /// Temperatures of the dies, °C; for compensated samples only.
    pub dies_c: Option<mimu_core::PerSensor<f32>>,
    /// Consecutive samples. The first has the number [`BatchHead::first`].
    pub values: Vec<Sample<f32>>,
}

impl Samples {
    /// Gyro x, y, z, accelerometer x, y, z of each sample, as short decimal numbers.
    ///
    /// # Errors
    /// One of them is not a number; `place` names the device.
    pub fn rows(&self, place: &str) -> Result<Vec<[f64; 6]>> {
        let row = |sample: &Sample<f32>| {
            let (g, a) = (sample.gyro, sample.accel);
            let row = [g.x, g.y, g.z, a.x, a.y, a.z];
            if row.iter().all(|v| v.is_finite()) {
                return Ok(row.map(shortest));
            }
            let problem = "the device sent a reading that is not a number";
            Err(Error::device(
                place,
                problem,
                "reset the board, and report this",
            ))
        };
        self.values.iter().map(row).collect()
    }
}

/// A message that the device sends without a call.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// The device has just started.
    Started(Box<Identity>),
    /// Raw readings, in the unit of the greeting.
    Raw(Samples),
    /// Compensated samples, SI.
    Compensated(Samples),
    /// State of a running bank.
    Kalman(Box<KalmanState>),
}

/// A message.
#[derive(Debug, Clone, PartialEq)]
pub enum Received {
    /// Answer to the call with this number.
    Answer(u16, Answer),
    /// Message without a call.
    Event(Event),
    /// Greeting of an incompatible device: number of the call, first bytes and version.
    Stranger(u16, [u8; 4], Version),
}

/// Counts of what was received.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct LineCount {
    /// Bytes received.
    pub bytes: u64,
    /// Complete frames.
    pub frames: u64,
    /// Garbled frames.
    pub garbled: u32,
    /// Complete frames that this program does not understand.
    pub not_understood: u32,
}

impl LineCount {
    /// Sum of both counts.
    pub fn and(&self, other: &Self) -> Self {
        Self {
            bytes: self.bytes + other.bytes,
            frames: self.frames + other.frames,
            garbled: self.garbled + other.garbled,
            not_understood: self.not_understood + other.not_understood,
        }
    }

    /// Counts since `before`.
    pub fn since(&self, before: &Self) -> Self {
        Self {
            bytes: self.bytes - before.bytes,
            frames: self.frames - before.frames,
            garbled: self.garbled - before.garbled,
            not_understood: self.not_understood - before.not_understood,
        }
    }
}

/// Decodes bytes into messages. No input makes it fail: garbled frames and unknown messages are counted.
#[derive(Debug, Default)]
pub struct Receiver {
    decoder: Decoder,
    count: LineCount,
}

impl Receiver {
    /// Decodes bytes and calls `hear` for each message that they complete.
    pub fn take(&mut self, bytes: &[u8], mut hear: impl FnMut(Received)) {
        for byte in bytes {
            self.count.bytes += 1;
            let Some(frame) = self.decoder.push(*byte) else {
                continue;
            };
            self.count.frames += 1;
            match understood(&frame) {
                Some(heard) => hear(heard),
                None => self.count.not_understood += 1,
            }
        }
        self.count.garbled = self.decoder.garbled();
    }

    /// Counts so far.
    pub fn count(&self) -> LineCount {
        self.count
    }
}

fn understood(frame: &Frame<'_>) -> Option<Received> {
    let message = frame.message();
    if let Some((id, magic, version)) = beginning(frame.0)
        && !matches!(&message, Some(Message::Greeting { greeting, .. })
            if super::identity::check("", greeting.magic, greeting.protocol).is_ok())
    {
        return Some(Received::Stranger(id, magic, version));
    }
    Some(match message? {
        // Calls are numbered from 1. Number 0 means that the device has just started.
        Message::Greeting { id: 0, greeting } => {
            Received::Event(Event::Started(Box::new(Identity::from(&greeting))))
        }
        Message::Greeting { id, greeting } => {
            Received::Answer(id, Answer::Greeting(Box::new(Identity::from(&greeting))))
        }
        Message::Refused { id, refusal } => Received::Answer(id, Answer::Refused(refusal)),
        Message::Reply { id, reply } => Received::Answer(id, answer(reply)?),
        Message::Event(WireEvent::Raw(batch)) if batch.is_whole() => {
            Received::Event(Event::Raw(Samples {
                head: batch.head,
                temperatures_c: batch.temperatures_c().collect(),
                scale: Some(batch.scale),
                dies_c: None,
                values: batch.readings().map(|(_, sample)| sample).collect(),
            }))
        }
        Message::Event(WireEvent::Compensated(batch)) if batch.is_whole() => {
            Received::Event(Event::Compensated(Samples {
                head: batch.head,
                temperatures_c: Vec::new(),
                scale: None,
                dies_c: Some(batch.dies_c()),
                values: batch.values().map(|(_, sample)| sample).collect(),
            }))
        }
        Message::Event(WireEvent::Kalman(state)) => Received::Event(Event::Kalman(Box::new(state))),
        Message::Event(_) => return None,
    })
}

fn answer(reply: Reply<'_>) -> Option<Answer> {
    Some(match reply {
        Reply::Done => Answer::Done,
        Reply::Counters(counters) => Answer::Counters(counters),
        Reply::SelfTest(test) if test.is_whole() => {
            Answer::SelfTest(test.rows().map(TestResult::from).collect())
        }
        Reply::SelfTest(_) => return None,
        Reply::Stored {
            offset,
            length,
            bytes,
        } => Answer::Stored {
            offset,
            length,
            bytes: bytes.to_vec(),
        },
        Reply::Kalman(state) => Answer::Kalman(Box::new(state)),
    })
}
