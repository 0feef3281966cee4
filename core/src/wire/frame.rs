//! Frames: limits of a message, and whether it arrived complete.

use cobs::{DecodeResult, DecoderState};
use crc::{CRC_32_ISO_HDLC, Crc};
use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::extensible::Tolerant;
use super::greeting::MAGIC;
use super::message::{Call, Event, Message, Refusal, Reply};

/// Most bytes of a message. The longest is a compensated batch, some bytes shorter.
pub const MAX_PAYLOAD: usize = 528;

const CHECK: usize = 4;

/// Most bytes of a frame: message and CRC, one byte of COBS for every 254 begun, and the zeros.
pub const MAX_FRAME: usize = cobs::max_encoding_length(MAX_PAYLOAD + CHECK) + 2;

/// With a table of 1 KiB: bit by bit it would need about fifty instructions per byte, at 45 kB/s.
// A static, because the table of a constant would be in the image once for each use.
static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// The message is longer than [`MAX_PAYLOAD`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EncodeError;

impl core::fmt::Display for EncodeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("the message is longer than a frame")
    }
}

impl core::error::Error for EncodeError {}

/// Writes the frame of a [`Call`] or [`Message`] to the beginning of `out`; returns its length.
pub fn encode<T: Serialize>(message: &T, out: &mut [u8; MAX_FRAME]) -> Result<usize, EncodeError> {
    let mut payload = [0; MAX_PAYLOAD + CHECK];
    let room = payload.get_mut(..MAX_PAYLOAD).ok_or(EncodeError)?;
    let length = postcard::to_slice(message, room)
        .map_err(|_| EncodeError)?
        .len();
    let check = CRC.checksum(payload.get(..length).ok_or(EncodeError)?);
    let room = payload.get_mut(length..).ok_or(EncodeError)?;
    for (byte, of) in room.iter_mut().zip(check.to_le_bytes()) {
        *byte = of;
    }
    let whole = payload.get(..length + CHECK).ok_or(EncodeError)?;

    let (zero, out) = out.split_first_mut().ok_or(EncodeError)?;
    *zero = 0;
    let length = cobs::try_encode(whole, out).map_err(|_| EncodeError)?;
    *out.get_mut(length).ok_or(EncodeError)? = 0;
    Ok(length + 2)
}

/// Payload of a frame that arrived complete.
#[derive(Debug, PartialEq, Eq)]
pub struct Frame<'a>(pub &'a [u8]);

impl<'a> Frame<'a> {
    /// The message in it: all of it, or `None`. A [greeting](Message::Greeting), [counters](Reply::Counters), the results of a
    /// [self-test](Reply::SelfTest) and a [compensated batch](Event::Compensated) may be followed by fields of later versions, and may lack
    /// fields of this one, which are then zero.
    /// A refusal for a reason that this build does not know is [`Refusal::NotKnown`].
    pub fn message(&self) -> Option<Message<'a>> {
        let Ok((message, tolerant)) = Tolerant::read::<Message<'a>>(self.0) else {
            let Ok((Beginning::Refused { id }, _)) = postcard::take_from_bytes(self.0) else {
                return None;
            };
            let refusal = Refusal::NotKnown;
            return Some(Message::Refused { id, refusal });
        };
        let any_length = match &message {
            // A message that begins differently is not one of these; and only a complete one counts.
            Message::Greeting { greeting, .. } => !tolerant.is_cut() || greeting.magic == MAGIC,
            Message::Reply { reply, .. } => {
                matches!(reply, Reply::Counters(_) | Reply::SelfTest(_))
            }
            Message::Event(event) => matches!(event, Event::Compensated(_)),
            Message::Refused { .. } => false,
        };
        (any_length || tolerant.is_exact()).then_some(message)
    }

    /// The call in it: all of it, or `None`.
    pub fn call(&self) -> Option<Call<'a>> {
        self.all()
    }

    /// The number of the call, which can be read even if the rest cannot.
    pub fn id(&self) -> Option<u16> {
        let (id, _) = postcard::take_from_bytes(self.0).ok()?;
        Some(id)
    }

    fn all<T: Deserialize<'a>>(&self) -> Option<T> {
        let (message, rest) = postcard::take_from_bytes(self.0).ok()?;
        rest.is_empty().then_some(message)
    }
}

/// The part of a [`Message`] that shows a refusal.
#[derive(Deserialize)]
enum Beginning {
    Greeting,
    Reply,
    Refused { id: u16 },
}

/// Finds frames in a stream of bytes.
#[derive(Debug)]
pub struct Decoder {
    cobs: DecoderState,
    decoded: Vec<u8, { MAX_PAYLOAD + CHECK }>,
    /// The rest until the next zero is skipped.
    discarding: bool,
    garbled: u32,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// At the beginning of a frame.
    pub const fn new() -> Self {
        Self {
            cobs: DecoderState::Idle,
            decoded: Vec::new(),
            discarding: false,
            garbled: 0,
        }
    }

    /// Takes the next byte; returns the frame that it ends, if that arrived whole.
    pub fn push(&mut self, byte: u8) -> Option<Frame<'_>> {
        if byte == 0 {
            return self.end();
        }
        if self.discarding {
            return None;
        }
        if matches!(self.cobs, DecoderState::Idle) {
            self.decoded.clear();
        }
        match self.cobs.feed(byte) {
            Ok(DecodeResult::NoData) => {}
            Ok(DecodeResult::DataContinue(decoded)) => {
                self.discarding = self.decoded.push(decoded).is_err();
            }
            // Both need a zero.
            Ok(DecodeResult::DataComplete) | Err(_) => self.discarding = true,
        }
        None
    }

    /// Number of frames so far that did not arrive complete: too short, too long, not COBS, wrong CRC.
    pub const fn garbled(&self) -> u32 {
        self.garbled
    }

    /// Resets the counter.
    pub const fn reset_garbled(&mut self) {
        self.garbled = 0;
    }

    fn end(&mut self) -> Option<Frame<'_>> {
        let discarded = core::mem::replace(&mut self.discarding, false);
        let state = core::mem::replace(&mut self.cobs, DecoderState::Idle);
        if matches!(state, DecoderState::Idle) {
            return None;
        }
        let complete = matches!(state, DecoderState::Grab(0) | DecoderState::GrabChain(0));
        let payload = self
            .decoded
            .split_last_chunk()
            .filter(|(payload, check)| **check == CRC.checksum(payload).to_le_bytes())
            .map(|(payload, _)| payload)
            // The CRC of nothing is 0.
            .filter(|payload| !payload.is_empty() && complete && !discarded);
        if payload.is_none() {
            self.garbled = self.garbled.saturating_add(1);
        }
        payload.map(Frame)
    }
}
