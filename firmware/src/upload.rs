//! An upload in progress.

use heapless::Vec;
use mimu_core::stored::{MAX_LENGTH, hash};
use mimu_core::wire::{CHUNK, Refusal};

use crate::source::usable;

/// The announced upload.
#[derive(Clone, Copy, Debug)]
struct Announced {
    length: usize,
    hash: u64,
    other_unit: bool,
}

/// The received part of a calibration.
pub struct Upload<'a> {
    received: &'a mut Vec<u8, MAX_LENGTH>,
    announced: Option<Announced>,
}

impl<'a> Upload<'a> {
    /// No upload was announced.
    pub fn new(received: &'a mut Vec<u8, MAX_LENGTH>) -> Self {
        Self {
            received,
            announced: None,
        }
    }

    /// Starts an upload, and sets whether it may belong to another unit; an earlier upload is discarded.
    pub fn begin(&mut self, length: u32, hash: u64, other_unit: bool) -> Result<(), Refusal> {
        let room = MAX_LENGTH as u32;
        if length > room {
            return Err(Refusal::TooLong { room });
        }
        self.received.clear();
        self.announced = Some(Announced {
            length: length as usize,
            hash,
            other_unit,
        });
        Ok(())
    }

    /// Adds a part.
    pub fn chunk(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Refusal> {
        let announced = self.announced.ok_or(Refusal::NoUpload)?;
        if bytes.is_empty() || bytes.len() > CHUNK {
            return Err(Refusal::Unknown);
        }
        let too_long = Refusal::TooLong {
            room: announced.length as u32,
        };
        let offset = offset as usize;
        let Some(again) = self.received.len().checked_sub(offset) else {
            return Err(Refusal::WrongOffset {
                expected: self.received.len() as u32,
            });
        };
        if offset + bytes.len() > announced.length {
            return Err(too_long);
        }
        let (again, new) = bytes.split_at(again.min(bytes.len()));
        self.received[offset..offset + again.len()].copy_from_slice(again);
        self.received.extend_from_slice(new).map_err(|_| too_long)
    }

    /// Checks that the upload is complete, has the announced hash, can be used, and belongs to this unit. The unit is checked because
    /// another unit's calibration, wrong by up to a tenth in scale, passes every other test.
    #[inline(never)]
    pub fn check(&self, unit_id: &[u8; 12]) -> Result<(), Refusal> {
        let announced = self.announced.ok_or(Refusal::NoUpload)?;
        if self.received.len() < announced.length {
            return Err(Refusal::Incomplete {
                received: self.received.len() as u32,
            });
        }
        let bytes = self.bytes();
        let found = hash(bytes);
        if found != announced.hash {
            return Err(Refusal::WrongHash { found });
        }
        let stored = usable(bytes).map_err(Refusal::NotUsable)?;
        match stored.origin.unit_id {
            Some(other) if other != *unit_id && !announced.other_unit => {
                Err(Refusal::OtherUnit { unit_id: other })
            }
            _ => Ok(()),
        }
    }

    /// The received bytes.
    pub fn bytes(&self) -> &[u8] {
        self.received
    }

    /// Discards the upload.
    pub fn end(&mut self) {
        self.announced = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mimu_core::PerSensor;
    use mimu_core::Sensor;
    use mimu_core::compensation::{Affine, Compensation};
    use mimu_core::stored::{self, Curves, Origin, RawUnit, Setting, StoredError};
    use mimu_core::table::Node;
    use mimu_core::wire::Triad;
    use nalgebra::{Matrix3, Vector3};

    const UNIT: [u8; 12] = *b"unit-number1";
    const OTHER: [u8; 12] = *b"unit-number2";

    /// What the device says to a calibration with this origin.
    fn checked(origin: Origin, other_unit: bool) -> Result<(), Refusal> {
        let affine = Affine {
            matrix: Matrix3::identity(),
            offset: Vector3::zeros(),
        };
        let model = Compensation {
            gyro: affine,
            accel: affine,
        };
        let nodes = [Node::constant(25.0, model)];
        let curves = Curves::of(&nodes);
        let mut bytes = [0; MAX_LENGTH];
        let matrices = PerSensor::both(&affine.matrix);
        let length = stored::encode(&origin, matrices, &curves, &[], &mut bytes).unwrap();
        let bytes = &bytes[..length];
        let mut received = Vec::new();
        let mut upload = Upload::new(&mut received);
        let begun = upload.begin(length as u32, hash(bytes), other_unit);
        assert_eq!(begun, Ok(()));
        for (k, part) in bytes.chunks(CHUNK).enumerate() {
            upload.chunk((k * CHUNK) as u32, part).unwrap();
        }
        upload.check(&UNIT)
    }

    #[test]
    fn a_calibration_of_another_unit_is_refused_unless_the_upload_insists() {
        let refused = Err(Refusal::OtherUnit { unit_id: OTHER });
        for (unit_id, other_unit, expected) in [
            (None, false, Ok(())),
            (Some(UNIT), false, Ok(())),
            (Some(OTHER), false, refused),
            (Some(OTHER), true, Ok(())),
        ] {
            let origin = Origin {
                unit_id,
                ..Origin::UNKNOWN
            };
            assert_eq!(checked(origin, other_unit), expected);
        }
    }

    #[test]
    fn a_calibration_of_another_range_filter_or_unit_is_refused_always() {
        let own = <crate::board::Source as crate::source::Source>::TRIADS;
        let other_unit = match own.gyro.unit {
            "V" => RawUnit::Count,
            _ => RawUnit::Volt,
        };
        let of = |accel: Triad<'_>| Origin {
            settings: Some(PerSensor {
                gyro: Setting::of(&own.gyro),
                accel: Setting::of(&accel),
            }),
            raw_unit: RawUnit::named(own.gyro.unit),
            ..Origin::UNKNOWN
        };
        assert_eq!(checked(of(own.accel), false), Ok(()));
        let refused = |sensor| Err(Refusal::NotUsable(StoredError::Setting { sensor }));
        let range = 0.5 * own.accel.range;
        let accel = refused(Sensor::Accel);
        assert_eq!(checked(of(Triad { range, ..own.accel }), true), accel);
        let filter = "another";
        assert_eq!(
            checked(
                of(Triad {
                    filter,
                    ..own.accel
                }),
                true
            ),
            accel
        );
        // The rate is measured, and no setting.
        let rate_hz = 0.97 * own.accel.rate_hz;
        assert_eq!(
            checked(
                of(Triad {
                    rate_hz,
                    ..own.accel
                }),
                false
            ),
            Ok(())
        );
        let origin = Origin {
            raw_unit: Some(other_unit),
            ..Origin::UNKNOWN
        };
        assert_eq!(checked(origin, true), refused(Sensor::Gyro));
    }

    #[test]
    fn parts_have_to_come_in_order_and_may_be_repeated() {
        let mut received = Vec::new();
        let mut upload = Upload::new(&mut received);
        assert_eq!(upload.chunk(0, &[1]), Err(Refusal::NoUpload));
        let room = MAX_LENGTH as u32;
        assert_eq!(
            upload.begin(room + 1, 0, false),
            Err(Refusal::TooLong { room })
        );
        // CRC-64/XZ of "123456789", by the catalogue of CRC algorithms.
        upload.begin(9, 0x995d_c9bb_df19_39fa, false).unwrap();
        upload.chunk(0, b"12345").unwrap();
        let gap = upload.chunk(6, b"7");
        assert_eq!(gap, Err(Refusal::WrongOffset { expected: 5 }));
        assert_eq!(
            upload.check(&UNIT).err(),
            Some(Refusal::Incomplete { received: 5 })
        );
        upload.chunk(3, b"45678").unwrap();
        let over = upload.chunk(8, b"9!");
        assert_eq!(over, Err(Refusal::TooLong { room: 9 }));
        upload.chunk(8, b"9").unwrap();
        // The hash holds; it is no calibration.
        let foreign = Refusal::NotUsable(stored::StoredError::NotACalibration);
        assert_eq!(upload.check(&UNIT).err(), Some(foreign));
        upload.chunk(0, b"0").unwrap();
        assert!(matches!(
            upload.check(&UNIT),
            Err(Refusal::WrongHash { .. })
        ));
        upload.end();
        assert_eq!(upload.check(&UNIT).err(), Some(Refusal::NoUpload));
    }
}
