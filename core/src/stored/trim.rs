//! Trim: new offsets for a stored calibration; everything else is kept.

use super::bytes::Reader;
use super::{CHECK, CRC, HEADER, StoredError, curves, decode, origin};
use crate::PerSensor;

/// Position of the time of the trim.
const TRIMMED_AT: usize = HEADER + origin::TRIMMED_AT;
/// Position of the first node: after the origin, the directions and the fields before the nodes.
const NODES_AT: usize = HEADER + origin::LENGTH + 144 + curves::BEFORE_NODES;
const NODE: usize = 196;
/// Positions of o of the gyro and o of the accelerometer in a node.
const OFFSETS_AT: PerSensor<usize> = PerSensor {
    gyro: 4 + 36,
    accel: 4 + 48 + 36,
};

/// Adds to o of the gyro (rad/s) and of the accelerometer (m/s²) of every node, which shifts the curves unchanged, and writes the time (UTC
/// seconds since 1970). All other bytes are unchanged.
///
/// # Errors
/// The reason why the bytes are not a calibration, before or after the trim.
pub fn trim(bytes: &mut [u8], add: PerSensor<[f32; 3]>, trimmed_s: u64) -> Result<(), StoredError> {
    decode(bytes)?;
    let nodes = usize::from(*bytes.get(HEADER - 4).ok_or(StoredError::Length)?);
    put(bytes, TRIMMED_AT, &trimmed_s.to_le_bytes())?;
    for node in 0..nodes {
        for (_, (triad, at)) in add.zip(OFFSETS_AT) {
            for (axis, add) in triad.iter().enumerate() {
                let at = NODES_AT + NODE * node + at + 4 * axis;
                let mut from = Reader(bytes.get(at..).ok_or(StoredError::Length)?);
                let offset = from.f32().ok_or(StoredError::Length)?;
                put(bytes, at, &(offset + add).to_le_bytes())?;
            }
        }
    }
    let (body, check) = bytes
        .split_last_chunk_mut::<CHECK>()
        .ok_or(StoredError::Length)?;
    *check = CRC.checksum(body).to_le_bytes();
    decode(bytes).map(|_| ())
}

fn put(bytes: &mut [u8], at: usize, new: &[u8]) -> Result<(), StoredError> {
    let room = bytes.get_mut(at..).ok_or(StoredError::Length)?;
    for (room, byte) in room.iter_mut().zip(new) {
        *room = *byte;
    }
    Ok(())
}
