//! The table of messages. Variants and fields are numbered by their order: append, never insert.

use serde::{Deserialize, Serialize};

use super::batch::{CompensatedBatch, RawBatch};
use super::greeting::Greeting;
use super::self_test::SelfTest;
use crate::Sensor;

/// Most bytes of a stored calibration in one message, either way.
pub const CHUNK: usize = 256;

/// What the host sends: a request and a number of its choice, which the answer repeats.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Call<'a> {
    /// Number of the call; the answer repeats it. 0 is for messages without a call.
    pub id: u16,
    /// The request.
    #[serde(borrow)]
    pub request: Request<'a>,
}

/// Requests of the host. Each gets one [`Message`] with its id: the reply named here, or [`Message::Refused`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Request<'a> {
    /// Ask for the identity. → [`Message::Greeting`]. Number and answer are the same in all versions.
    Hello,
    /// Send samples from the next batch on, as [`Event::Raw`], [`Event::Compensated`] or both; neither means [`Request::Stop`].
    /// Both start with the same sample. → [`Reply::Done`]
    Stream {
        /// Raw readings.
        raw: bool,
        /// SI, compensated on the device: refused without a stored calibration.
        compensated: bool,
    },
    /// Send no more samples. → [`Reply::Done`]
    Stop,
    /// → [`Reply::Counters`]
    Counters,
    /// Set the counters to zero, except those that describe the present. → [`Reply::Done`]
    ResetCounters,
    /// Deflect the sensors electrically and measure it; the unit has to stand still for a second. Samples meanwhile carry
    /// [`flags::SELF_TEST`](super::flags::SELF_TEST). → [`Reply::SelfTest`], after about a second.
    SelfTest,
    /// Start an upload. An earlier one that was not committed is discarded. → [`Reply::Done`]
    UploadBegin {
        /// Bytes, at most [`stored::MAX_LENGTH`](crate::stored::MAX_LENGTH).
        length: u32,
        /// [`stored::hash`](crate::stored::hash) over all of them.
        hash: u64,
        /// Whether it is stored even if it belongs to another unit. One of an unknown unit is always stored.
        other_unit: bool,
    },
    /// Send a part, in order of the offset and without gaps; a part that was received already may be repeated. → [`Reply::Done`]
    UploadChunk {
        /// Of the first byte.
        offset: u32,
        /// 1 to [`CHUNK`] bytes.
        bytes: &'a [u8],
    },
    /// Check the hash and the contents, then store and use it. → [`Reply::Done`], once it is in flash and has been read back; the old
    /// calibration is used until then. Takes some seconds.
    UploadCommit,
    /// Part of the calibration in use. → [`Reply::Stored`]
    Download {
        /// Of the first byte.
        offset: u32,
        /// At most [`CHUNK`]; fewer come at the end.
        length: u16,
    },
    /// Restart the Kalman bank of a triad; it uses no sample before its input is known. → [`Reply::Done`]
    KalmanStart {
        /// Of the sensors.
        sensor: Sensor,
        /// Variances of single readings of the sensors x, y, z, raw units squared.
        noise: [f32; 3],
        /// The prior.
        prior: Prior,
    },
    /// Set the known input of the triad, from the next sample until the next such request. → [`Reply::Done`]
    KalmanInput {
        /// Of the sensors.
        sensor: Sensor,
        /// True input in the body frame: rate, rad/s, or specific force (at rest it points up), m/s². `None`: unknown, as while the table
        /// moves; samples are not used.
        input: Option<[f32; 3]>,
    },
    /// Stop the bank. → [`Reply::Kalman`], the last state.
    KalmanEnd {
        /// Of the sensors.
        sensor: Sensor,
    },
    /// Save the state of the bank, for [`Request::KalmanBack`]. → [`Reply::Done`]
    KalmanKeep {
        /// Of the sensors.
        sensor: Sensor,
    },
    /// Restore the saved state, or the prior; the input is unknown from now on. Samples in between are discarded, as after a dwell in which
    /// the unit moved. → [`Reply::Done`]
    KalmanBack {
        /// Of the sensors.
        sensor: Sensor,
    },
}

/// What the device sends.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Message<'a> {
    /// Greeting: answer to [`Request::Hello`], and sent once after every start with the id 0.
    Greeting {
        /// That of the call.
        id: u16,
        /// Who.
        #[serde(borrow)]
        greeting: Greeting<'a>,
    },
    /// The call was done.
    Reply {
        /// That of the call.
        id: u16,
        /// The reply.
        #[serde(borrow)]
        reply: Reply<'a>,
    },
    /// The call was not done, and nothing has changed.
    Refused {
        /// That of the call; 0 if the frame was complete but its contents could not be read.
        id: u16,
        /// Why.
        refusal: Refusal,
    },
    /// Sent without a request for each message.
    Event(#[serde(borrow)] Event<'a>),
}

/// Answers to calls.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Reply<'a> {
    /// Done, without further data.
    Done,
    /// The counters.
    Counters(Counters),
    /// Results of the self-test.
    SelfTest(#[serde(borrow)] SelfTest<'a>),
    /// Part of the stored calibration.
    Stored {
        /// Of the first byte.
        offset: u32,
        /// Total length, bytes.
        length: u32,
        /// The part; shorter than requested at the end.
        bytes: &'a [u8],
    },
    /// Last state of a bank.
    Kalman(KalmanState),
}

/// Messages without a request for each.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Event<'a> {
    /// Raw readings.
    Raw(#[serde(borrow)] RawBatch<'a>),
    /// Compensated samples.
    Compensated(#[serde(borrow)] CompensatedBatch<'a>),
    /// A running bank, five times a second.
    Kalman(KalmanState),
}

/// Why a call was not done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// This version does not know the request, or its contents are invalid.
    Unknown,
    /// Compensation and download need a stored calibration, but none is stored.
    NoCalibration,
    /// No upload is in progress.
    NoUpload,
    /// The calibration is longer than the room for it.
    TooLong {
        /// Room, bytes.
        room: u32,
    },
    /// The part does not continue what was received.
    WrongOffset {
        /// Where to continue.
        expected: u32,
    },
    /// Not all parts were received.
    Incomplete {
        /// Bytes received.
        received: u32,
    },
    /// The received bytes do not have the announced hash.
    WrongHash {
        /// Their hash.
        found: u64,
    },
    /// The received bytes are not a calibration that this device can use.
    NotUsable(crate::stored::StoredError),
    /// Writing the flash failed; the previous calibration is still stored.
    FlashFailed,
    /// No bank of this triad is running.
    NoBank,
    /// A number is not finite, or a variance is not positive.
    BadNumber,
    /// The device is busy with something incompatible; try again later.
    Busy,
    /// The calibration belongs to another unit, and the upload does not allow this.
    OtherUnit {
        /// Which.
        unit_id: [u8; 12],
    },
    /// The supply is too low to write the flash safely; nothing was begun.
    SupplyLow,
    /// The banks of the flash have exchanged their addresses (option byte SWAP_BANK_OPT), so the place for calibrations holds something else.
    BanksSwapped,
    /// A reason that this build does not know; never sent.
    #[serde(skip)]
    NotKnown,
}

/// Prior of a Kalman bank.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Prior {
    /// Nothing.
    Diffuse {
        /// Size of the inputs to come, rad/s or m/s².
        span: f32,
    },
    /// Independent parameters.
    Known {
        /// `[b, P1, P2, P3]` of the sensors x, y, z: raw units, and raw units per rad/s or per m/s².
        mean: [[f32; 4]; 3],
        /// Their variances, the units squared.
        variance: [[f32; 4]; 3],
    },
}

/// A Kalman bank.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct KalmanState {
    /// Of the sensors.
    pub sensor: Sensor,
    /// Number of the last sample that it was given, as in [`BatchHead::first`](super::BatchHead::first).
    pub last: u32,
    /// Number of samples used.
    pub updates: u32,
    /// Samples that at least one of its filters rejected.
    pub rejected: u32,
    /// Samples that the device lost, or that were not used because the input was unknown.
    pub skipped: u32,
    /// Sensors x, y, z.
    pub axes: [KalmanAxis; 3],
}

/// Estimate of one sensor: forward model, SI to raw.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct KalmanAxis {
    /// `[b, P1, P2, P3]`: raw units, and raw units per rad/s or per m/s².
    pub mean: [f32; 4],
    /// Upper triangle of their covariance, by rows: 00 01 02 03 11 12 13 22 23 33.
    pub covariance: [f32; 10],
}

/// Counters of the device since its start, or since [`Request::ResetCounters`]. Later versions append fields, as to [`Greeting`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counters {
    /// Since the start, ms. Not reset.
    pub uptime_ms: u32,
    /// Samples taken.
    pub samples: u32,
    /// Number of the last one. Not reset.
    pub last: u32,
    /// Restarts of sampling because a sample was read too late.
    pub late: u32,
    /// The same because the converter's buffer overran.
    pub converter_overruns: u32,
    /// The same because the converter stood still.
    pub stalls: u32,
    /// Samples lost because processing was late.
    pub queue_overruns: u32,
    /// Batches lost because the line was too slow.
    pub batches_dropped: u32,
    /// Frames from the host that were garbled.
    pub frames_garbled: u32,
    /// Number of times that bytes from the host were lost before they were read.
    pub receiver_overruns: u32,
    /// Calls refused.
    pub refused: u32,
    /// Words of the calibration flash with an error that was corrected when they were read.
    pub flash_corrected: u32,
    /// The same, with an error that could not be corrected.
    pub flash_uncorrectable: u32,
    /// Longest time between a sample and the end of its processing, µs.
    pub longest_us: u32,
}
