//! The line between device and host: messages, frames, batches of samples.
//!
//! ```text
//! 0x00  COBS( postcard(message) CRC-32 )  0x00        at most MAX_FRAME bytes
//! ```
//!
//! * A message is a [`Call`] from the host or a [`Message`] from the device, in
//!   [postcard](https://postcard.jamesmunns.com/wire-format): a variant is its number, integers are varints of 7 bits a byte, `f32`
//!   and fixed arrays of bytes are as they are in memory, little end first, text and byte strings begin with their length.
//! * CRC-32 is that of Ethernet and zip (CRC-32/ISO-HDLC), over the message, little end first.
//! * COBS removes every zero, so a zero always marks the end of a frame: after lost or garbled bytes, reading resumes at the next zero. The
//!   leading zero costs a byte and saves the first frame after noise. Empty frames are ignored.
//!
//! The order of variants and fields is the protocol. A minor version appends variants of requests, messages and refusals, and fields
//! behind the last of [`Greeting`], [`Counters`], [`SelfTest`] and [`CompensatedBatch`], which may have any length: missing fields are
//! zero, unknown ones are skipped. [`Start`] and [`Slot`] begin with their length, so a reader can skip a variant that it does not know. A
//! major version may change everything except [`Request::Hello`] and the beginning of [`Message::Greeting`] up to [`Greeting::protocol`],
//! by which both sides identify each other.
//!
//! | longest, by a test                | bytes a frame | frames a second | kB/s |
//! |-----------------------------------|---------------|-----------------|------|
//! | raw stream, 20 samples a frame    | 427           | 50              | 21.4 |
//! | compensated, 20 samples a frame   | 531           | 50              | 26.6 |

mod batch;
mod extensible;
mod frame;
mod greeting;
mod message;
mod self_test;

pub use crate::triad::Triad;
pub use batch::{
    BATCH, BatchHead, COMPENSATED_BYTES, CompensatedBatch, Counts, RAW_BYTES, RawBatch, flags,
    reading,
};
pub use frame::{Decoder, EncodeError, Frame, MAX_FRAME, MAX_PAYLOAD, encode};
pub use greeting::{
    Capabilities, Compatibility, EFFECTS, Greeting, MAGIC, PROTOCOL, Slot, Start, StoredInfo,
    Version, WrongRegister, compatibility, effects_of_this_build,
};
pub use message::{
    CHUNK, Call, Counters, Event, KalmanAxis, KalmanState, Message, Prior, Refusal, Reply, Request,
};
pub use self_test::{SelfTest, TestRow, TestTable, Verdict};
