//! What comes from the device, kept: messages borrow from a frame, and the frame is gone with the next byte.

use mimu_core::compensation::Sample;
use mimu_core::wire::{
    BatchHead, Counters, Decoder, Event as WireEvent, Frame, KalmanState, Message, Refusal, Reply,
    SelfTest, Version,
};
use serde::Serialize;

use super::identity::{Identity, beginning};

/// Answer to a call.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// Who it is.
    Greeting(Box<Identity>),
    /// Done, and there is nothing to tell.
    Done,
    /// What has been counted.
    Counters(Counters),
    /// How the sensors answered.
    SelfTest(SelfTest),
    /// Part of the stored calibration.
    Stored {
        /// Of the first byte.
        offset: u32,
        /// Length of the whole, bytes.
        length: u32,
        /// The part.
        bytes: Vec<u8>,
    },
    /// Last state of a bank.
    Kalman(Box<KalmanState>),
    /// Not done.
    Refused(Refusal),
}

/// Consecutive samples: V at the sensors, or rad/s and m/s² in the body frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    /// What holds for all of them.
    pub head: BatchHead,
    /// Temperatures by the TEMP pins of gyro x, y, z, °C; of raw readings only.
    pub gyro_temps_c: Option<[f32; 3]>,
    /// Temperatures of the dies, °C; of compensated samples only.
    pub dies_c: Option<mimu_core::PerSensor<f32>>,
    /// One after the other, the first of the number [`BatchHead::first`].
    pub values: Vec<Sample<f32>>,
}

/// What comes without being asked each time.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// The device has just started.
    Started(Box<Identity>),
    /// Raw readings, V.
    Raw(Samples),
    /// Compensated samples, SI.
    Compensated(Samples),
    /// A running bank.
    Kalman(Box<KalmanState>),
}

/// A message.
#[derive(Debug, Clone, PartialEq)]
pub enum Heard {
    /// Answer to the call of this number.
    Answer(u16, Answer),
    /// Nobody asked.
    Event(Event),
    /// A greeting of an incompatible device: number of the call, its first bytes, its version.
    Stranger(u16, [u8; 4], Version),
}

/// What has been heard, counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct LineCount {
    /// Bytes received.
    pub bytes: u64,
    /// Frames that arrived whole.
    pub frames: u64,
    /// Frames that did not.
    pub garbled: u32,
    /// Whole frames that this program does not understand.
    pub not_understood: u32,
}

impl LineCount {
    /// Both together.
    pub fn and(&self, other: &Self) -> Self {
        Self {
            bytes: self.bytes + other.bytes,
            frames: self.frames + other.frames,
            garbled: self.garbled + other.garbled,
            not_understood: self.not_understood + other.not_understood,
        }
    }

    /// What has been heard since `before`.
    pub fn since(&self, before: &Self) -> Self {
        Self {
            bytes: self.bytes - before.bytes,
            frames: self.frames - before.frames,
            garbled: self.garbled - before.garbled,
            not_understood: self.not_understood - before.not_understood,
        }
    }
}

/// Bytes in, messages out. Nothing that comes over the line makes it fail: what is not a whole frame, and what is not a message, is
/// counted.
#[derive(Debug, Default)]
pub struct Receiver {
    decoder: Decoder,
    count: LineCount,
}

impl Receiver {
    /// Takes bytes; `hear` is given the messages that they end.
    pub fn take(&mut self, bytes: &[u8], mut hear: impl FnMut(Heard)) {
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

    /// What has been heard so far.
    pub fn count(&self) -> LineCount {
        self.count
    }
}

fn understood(frame: &Frame<'_>) -> Option<Heard> {
    let message = frame.message();
    if let Some((id, magic, version)) = beginning(frame.0)
        && !matches!(&message, Some(Message::Greeting { greeting, .. })
            if super::identity::check("", greeting.magic, greeting.protocol).is_ok())
    {
        return Some(Heard::Stranger(id, magic, version));
    }
    Some(match message? {
        // Nobody's call has the number 0: it has just started.
        Message::Greeting { id: 0, greeting } => {
            Heard::Event(Event::Started(Box::new(Identity::from(&greeting))))
        }
        Message::Greeting { id, greeting } => {
            Heard::Answer(id, Answer::Greeting(Box::new(Identity::from(&greeting))))
        }
        Message::Refused { id, refusal } => Heard::Answer(id, Answer::Refused(refusal)),
        Message::Reply { id, reply } => Heard::Answer(id, answer(reply)),
        Message::Event(WireEvent::Raw(batch)) if batch.is_whole() => {
            Heard::Event(Event::Raw(Samples {
                head: batch.head,
                gyro_temps_c: Some(batch.gyro_temps_c),
                dies_c: None,
                values: batch.volts().map(|(_, sample)| sample).collect(),
            }))
        }
        Message::Event(WireEvent::Compensated(batch)) if batch.is_whole() => {
            Heard::Event(Event::Compensated(Samples {
                head: batch.head,
                gyro_temps_c: None,
                dies_c: Some(batch.dies_c()),
                values: batch.values().map(|(_, sample)| sample).collect(),
            }))
        }
        Message::Event(WireEvent::Kalman(state)) => Heard::Event(Event::Kalman(Box::new(state))),
        Message::Event(_) => return None,
    })
}

fn answer(reply: Reply<'_>) -> Answer {
    match reply {
        Reply::Done => Answer::Done,
        Reply::Counters(counters) => Answer::Counters(counters),
        Reply::SelfTest(result) => Answer::SelfTest(result),
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
    }
}
