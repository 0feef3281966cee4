//! A calibration on its way to the device.

use heapless::Vec;
use mimu_core::stored::{self, MAX_LENGTH, hash};
use mimu_core::wire::{CHUNK, Refusal};

/// What has been announced.
#[derive(Clone, Copy, Debug)]
struct Announced {
    length: usize,
    hash: u64,
}

/// A calibration as far as it has been received.
pub struct Upload<'a> {
    received: &'a mut Vec<u8, MAX_LENGTH>,
    announced: Option<Announced>,
}

impl<'a> Upload<'a> {
    /// Nothing has been announced.
    pub fn new(received: &'a mut Vec<u8, MAX_LENGTH>) -> Self {
        Self {
            received,
            announced: None,
        }
    }

    /// Announces one; another before it is forgotten.
    pub fn begin(&mut self, length: u32, hash: u64) -> Result<(), Refusal> {
        let room = MAX_LENGTH as u32;
        if length > room {
            return Err(Refusal::TooLong { room });
        }
        self.received.clear();
        self.announced = Some(Announced {
            length: length as usize,
            hash,
        });
        Ok(())
    }

    /// Takes a part.
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

    /// Whether all of it is there, has the hash that was announced, and can be used.
    #[inline(never)]
    pub fn check(&self) -> Result<(), Refusal> {
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
        stored::decode(bytes)
            .map(|_| ())
            .map_err(Refusal::NotUsable)
    }

    /// What has been received.
    pub fn bytes(&self) -> &[u8] {
        self.received
    }

    /// Forgets it.
    pub fn end(&mut self) {
        self.announced = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_have_to_come_in_order_and_may_be_repeated() {
        let mut received = Vec::new();
        let mut upload = Upload::new(&mut received);
        assert_eq!(upload.chunk(0, &[1]), Err(Refusal::NoUpload));
        let room = MAX_LENGTH as u32;
        assert_eq!(upload.begin(4097, 0), Err(Refusal::TooLong { room }));
        // CRC-64/XZ of "123456789", by the catalogue of CRC algorithms.
        upload.begin(9, 0x995d_c9bb_df19_39fa).unwrap();
        upload.chunk(0, b"12345").unwrap();
        let gap = upload.chunk(6, b"7");
        assert_eq!(gap, Err(Refusal::WrongOffset { expected: 5 }));
        assert_eq!(
            upload.check().err(),
            Some(Refusal::Incomplete { received: 5 })
        );
        upload.chunk(3, b"45678").unwrap();
        let over = upload.chunk(8, b"9!");
        assert_eq!(over, Err(Refusal::TooLong { room: 9 }));
        upload.chunk(8, b"9").unwrap();
        // The hash holds; it is no calibration.
        let foreign = Refusal::NotUsable(stored::Refused::NotACalibration);
        assert_eq!(upload.check().err(), Some(foreign));
        upload.chunk(0, b"0").unwrap();
        assert!(matches!(upload.check(), Err(Refusal::WrongHash { .. })));
        upload.end();
        assert_eq!(upload.check().err(), Some(Refusal::NoUpload));
    }
}
