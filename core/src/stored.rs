//! A calibration as bytes: sent to the device, stored in its flash, and used there.
//!
//! Little end first, `f32` as IEEE 754, matrices by rows:
//!
//! | bytes | what                                                                                              |
//! |-------|---------------------------------------------------------------------------------------------------|
//! | 4     | `mimc`                                                                                            |
//! | 2     | version of this layout, [`VERSION`]                                                               |
//! | 2     | length of everything                                                                              |
//! | 1, 1  | number of nodes (1 to [`NODES`]), of effects                                                      |
//! | 1     | thermometer that temperatures are of: 0, the board's; there is no other yet                       |
//! | 1     | bits: 0, the range is known; 1, the lags are known                                                |
//! | 88    | [`Origin`], zero where it is unknown: number of the unit, 12; when it was made, UTC seconds since 1970, 8; SHA-256 of the samples that it was made from, 32; when its offsets were trimmed, UTC seconds since 1970, 8; unit of the raw readings (1 V, 2 count), 1, and three zeros; for gyro and accelerometer the range (rad/s, m/s²), 4, and [`Setting::id`], 8 |
//! | 144   | [`Directions`] of the gyro, D and R, then of the accelerometer: those of C that the effects were found with |
//! | 8, 8  | range of the dies' temperatures, °C, and lags of the dies of gyro and accelerometer behind the thermometer, s; zero where they are not known |
//! | 196   | each node: temperature of the dies, °C; C and o (rad/s) of the gyro; C and o (m/s²) of the accelerometer; the derivatives of these 24 numbers, per kelvin |
//! | ...   | each effect, see below                                                                            |
//! | 4     | CRC-32/ISO-HDLC of everything before                                                              |
//!
//! A named effect: 0; length of the id, the id; number of coefficients, these, `f32`; its nonlinear constant (time constant, s), or 0 if
//! it has none.
//! A term: 1; triad (0 gyro, 1 accelerometer); axis; number of variables, these, a byte each as in [`Variable`]; coefficient.
//!
//! [`Variable`]: crate::effects::Variable
//!
//! Other versions are not read: upload the calibration again from its file.
//!
//! Impossible values are refused, wherever the bytes come from: C and o beyond [`Affine::check`], temperatures beyond
//! [`TEMPERATURE_RANGE_C`](crate::table::TEMPERATURE_RANGE_C), lags and time constants beyond those of [`DieLag`] and of
//! [`DeviceEffect`], bits of a later version.
//!
//! [`Affine::check`]: crate::compensation::Affine::check
//!
//! Raw is volts at the sensor or counts, as in [`RawBatch`](crate::wire::RawBatch). The noise of biases and the sigmas of the parameters are left
//! out, because the device does not use them.

mod bytes;
mod curves;
mod effect;
mod origin;
mod trim;

use crc::{CRC_32_ISO_HDLC, CRC_64_XZ, Crc, NoTable};
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use crate::PerSensor;
use crate::Sensor;
use crate::compensator::Compensator;
use crate::die::DieLag;
use crate::effects::{self, DeviceEffect, Directions, Effects};
use crate::table::Node;
use bytes::{Reader, Writer};

pub use bytes::TooLong;
pub use curves::Curves;
pub use origin::{Origin, RawUnit, Setting};
pub use trim::trim;

/// Version of the layout: the only one that is read.
pub const VERSION: u16 = 7;
/// Most temperature nodes.
pub const NODES: usize = 16;
/// Most effects of a triad that run with every sample, and as many that do not.
pub const ROOM: usize = 8;
/// Most bytes of a calibration, 23 parts of an upload: all nodes and effects at their longest come to 5.6 kB.
pub const MAX_LENGTH: usize = 5888;

const MAGIC: [u8; 4] = *b"mimc";
const HEADER: usize = 12;
const CHECK: usize = 4;
/// Position of the length.
const LENGTH_AT: usize = 6;

// Bit by bit: it is computed rarely, over a few kB, which does not justify tables of 3 KiB.
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);
const HASH: Crc<u64, NoTable> = Crc::<u64, NoTable>::new(&CRC_64_XZ);

/// Hash that identifies a calibration: CRC-64/XZ over all of its bytes. A CRC-32 would be the same for every input that ends with its own
/// CRC-32.
pub fn hash(bytes: &[u8]) -> u64 {
    HASH.checksum(bytes)
}

/// [`hash`] over several pieces, each behind its length.
fn hash_of(pieces: &[&[u8]]) -> u64 {
    let mut digest = HASH.digest();
    for piece in pieces {
        digest.update(&(piece.len() as u64).to_le_bytes());
        digest.update(piece);
    }
    digest.finalize()
}

/// A calibration in use.
#[derive(Debug, Clone)]
pub struct Stored {
    /// Where it comes from.
    pub origin: Origin,
    /// What it does to a sample.
    pub compensator: Compensator<f32, NODES, ROOM>,
    /// Lags of the dies behind the thermometer, s, if known; otherwise no lag is applied.
    pub lags_s: Option<PerSensor<f32>>,
    /// Number of effects.
    pub effect_count: u8,
}

/// Why bytes are not a calibration that this build can use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum StoredError {
    /// They do not begin like a calibration.
    NotACalibration,
    /// They end too early, or go on after the end.
    Length,
    /// Another version of the layout.
    Version {
        /// Theirs.
        found: u16,
    },
    /// The CRC is wrong.
    Check,
    /// A node has impossible numbers or is not warmer than the one before, or the number of nodes is zero or too large.
    Node {
        /// Which, from 0.
        at: u8,
    },
    /// C of the gyro or of the accelerometer with which the effects were found is singular.
    Singular,
    /// An effect that this build does not know.
    EffectUnknown {
        /// Its index, from 0, in the given order.
        at: u8,
    },
    /// An effect with impossible numbers.
    EffectValue {
        /// Which, from 0.
        at: u8,
    },
    /// More effects than there is room for.
    EffectsFull {
        /// Index of the first effect without room.
        at: u8,
    },
    /// The temperature range or a lag is impossible, or this build does not know the thermometer.
    Temperature,
    /// Bits of the header are set that this build does not know.
    Header,
    /// The sensors of a triad were set otherwise, or its readings had another unit, when it was made.
    Setting {
        /// Which.
        sensor: Sensor,
    },
}

impl core::fmt::Display for StoredError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotACalibration => f.write_str("the bytes do not begin like a calibration"),
            Self::Length => f.write_str("the number of bytes differs from the one in the header"),
            Self::Version { found } => write!(
                f,
                "the layout has version {found}; this program reads {VERSION}"
            ),
            Self::Check => f.write_str("the CRC is wrong"),
            Self::Node { at } => write!(
                f,
                "temperature node {at} has impossible numbers, is not warmer than the one before, or exceeds the room"
            ),
            Self::Singular => f.write_str("the C with which the effects were found is singular"),
            Self::EffectUnknown { at } => write!(f, "effect {at} is unknown"),
            Self::EffectValue { at } => write!(f, "effect {at} has an impossible coefficient"),
            Self::EffectsFull { at } => write!(f, "there is no room for effect {at}"),
            Self::Temperature => {
                f.write_str("the temperature range, a lag or the thermometer is impossible")
            }
            Self::Header => f.write_str("the header has bits of a later version"),
            Self::Setting { sensor } => write!(
                f,
                "it was made with the {sensor} at another range, filter or unit than it has now"
            ),
        }
    }
}

impl core::error::Error for StoredError {}

/// Writes a calibration to the beginning of `out`; returns its length. `found_with`: C with which the effects were found. This function
/// does not validate; [`decode`] does.
pub fn encode(
    origin: &Origin,
    found_with: PerSensor<&Matrix3<f32>>,
    curves: &Curves<'_>,
    effects: &[DeviceEffect<f32>],
    out: &mut [u8],
) -> Result<usize, TooLong> {
    let count = |n: usize| u8::try_from(n).map_err(|_| TooLong);
    let mut to = Writer::new(out);
    to.bytes(&MAGIC)?;
    to.u16(VERSION)?;
    to.u16(0)?;
    to.bytes(&[count(curves.nodes.len())?, count(effects.len())?])?;
    to.bytes(&[curves::TEMP_PINS, curves.known()])?;
    origin.write(&mut to)?;
    for (_, matrix) in found_with {
        // The device computes no inverse, so NaN marks a singular matrix.
        let nothing = Matrix3::repeat(f32::NAN);
        let none = Directions {
            sensed: nothing,
            to_body: nothing,
        };
        let found = Directions::of(&matrix.map(f64::from)).unwrap_or(none);
        to.matrix(&found.sensed)?;
        to.matrix(&found.to_body)?;
    }
    curves.write(&mut to)?;
    effects
        .iter()
        .try_for_each(|one| effect::write(one, &mut to))?;
    let length = to.length() + CHECK;
    let length_bytes = u16::try_from(length).map_err(|_| TooLong)?.to_le_bytes();
    if length > MAX_LENGTH {
        return Err(TooLong);
    }
    to.put_at(LENGTH_AT, &length_bytes)?;
    let check = CRC.checksum(to.written());
    to.bytes(&check.to_le_bytes())?;
    Ok(length)
}

/// The calibration in `bytes`, all of them.
pub fn decode(bytes: &[u8]) -> Result<Stored, StoredError> {
    read(bytes, |_| {}, |_| {})
}

/// The same, and passes each node and each effect as it is stored to a callback; the device's tables do not give them back. If the bytes
/// are refused, the callback may have received the first ones.
pub fn read(
    bytes: &[u8],
    node: impl FnMut(&Node<f32>),
    show: impl FnMut(&DeviceEffect<f32>),
) -> Result<Stored, StoredError> {
    let mut from = Reader(bytes);
    if from.bytes::<4>() != Some(MAGIC) {
        return Err(StoredError::NotACalibration);
    }
    let version = from.u16().ok_or(StoredError::Length)?;
    if version != VERSION {
        return Err(StoredError::Version { found: version });
    }
    let length = from.u16().ok_or(StoredError::Length)?;
    if usize::from(length) != bytes.len() || bytes.len() < HEADER + CHECK {
        return Err(StoredError::Length);
    }
    let (body, check) = bytes
        .split_last_chunk::<CHECK>()
        .ok_or(StoredError::Length)?;
    if CRC.checksum(body) != u32::from_le_bytes(*check) {
        return Err(StoredError::Check);
    }
    let mut from = Reader(body.get(LENGTH_AT + 2..).ok_or(StoredError::Length)?);
    let [nodes, effects, thermometer, known] = from.bytes().ok_or(StoredError::Length)?;
    let origin = Origin::read(&mut from)?;
    let both = PerSensor::from_fn(|_| directions(&mut from)).transpose();
    let both = both.ok_or(StoredError::Length)?;
    let head = curves::Head {
        nodes,
        thermometer,
        known,
    };
    let (table, lags_s) = curves::read(&mut from, head, node)?;
    if !both.gyro.are_inverse() || !both.accel.are_inverse() {
        return Err(StoredError::Singular);
    }
    let none = Effects::of(both).within(table.limits());
    let all = read_effects(&mut from, effects, none, show)?;
    match from.0.is_empty() {
        true => Ok(Stored {
            origin,
            compensator: Compensator {
                table,
                lags: DieLag::of_triads(lags_s),
                effects: (effects > 0).then_some(all),
            },
            lags_s,
            effect_count: effects,
        }),
        false => Err(StoredError::Length),
    }
}

fn read_effects(
    from: &mut Reader<'_>,
    count: u8,
    mut all: Effects<f32, ROOM>,
    mut show: impl FnMut(&DeviceEffect<f32>),
) -> Result<Effects<f32, ROOM>, StoredError> {
    for at in 0..count {
        let effect = effect::read(from).ok_or(StoredError::Length)?;
        effect
            .inspect(&mut show)
            .and_then(|effect| all.push(effect))
            .map_err(|refused| match refused {
                effects::EffectError::Unknown => StoredError::EffectUnknown { at },
                effects::EffectError::Full => StoredError::EffectsFull { at },
                effects::EffectError::Count { .. } | effects::EffectError::Value => {
                    StoredError::EffectValue { at }
                }
            })?;
    }
    Ok(all)
}

fn directions(from: &mut Reader<'_>) -> Option<Directions<f32>> {
    Some(Directions {
        sensed: from.matrix()?,
        to_body: from.matrix()?,
    })
}
