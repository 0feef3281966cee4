//! Little-endian numbers in and out of bytes.

use nalgebra::Matrix3;

/// The calibration exceeds the room for it, or an effect exceeds the largest one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooLong;

impl core::fmt::Display for TooLong {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("the calibration is longer than the room for it")
    }
}

impl core::error::Error for TooLong {}

/// The remaining bytes. All reads return `None` after the end.
pub(super) struct Reader<'a>(pub &'a [u8]);

impl<'a> Reader<'a> {
    pub fn slice(&mut self, length: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(taken)
    }

    pub fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    pub fn u8(&mut self) -> Option<u8> {
        self.bytes().map(u8::from_le_bytes)
    }

    pub fn u16(&mut self) -> Option<u16> {
        self.bytes().map(u16::from_le_bytes)
    }

    pub fn f32(&mut self) -> Option<f32> {
        self.bytes().map(f32::from_le_bytes)
    }

    /// By rows.
    pub fn matrix(&mut self) -> Option<Matrix3<f32>> {
        let mut by_columns = Matrix3::zeros();
        for value in by_columns.iter_mut() {
            *value = self.f32()?;
        }
        Some(by_columns.transpose())
    }
}

/// Buffer that is written from its beginning.
pub(super) struct Writer<'a> {
    out: &'a mut [u8],
    length: usize,
}

impl<'a> Writer<'a> {
    pub fn new(out: &'a mut [u8]) -> Self {
        Self { out, length: 0 }
    }

    pub fn length(&self) -> usize {
        self.length
    }

    pub fn written(&self) -> &[u8] {
        self.out.get(..self.length).unwrap_or(&[])
    }

    pub fn put_at(&mut self, at: usize, bytes: &[u8]) -> Result<(), TooLong> {
        let end = at.checked_add(bytes.len()).ok_or(TooLong)?;
        let room = self.out.get_mut(at..end).ok_or(TooLong)?;
        for (room, byte) in room.iter_mut().zip(bytes) {
            *room = *byte;
        }
        Ok(())
    }

    pub fn bytes(&mut self, bytes: &[u8]) -> Result<(), TooLong> {
        self.put_at(self.length, bytes)?;
        self.length += bytes.len();
        Ok(())
    }

    pub fn u16(&mut self, value: u16) -> Result<(), TooLong> {
        self.bytes(&value.to_le_bytes())
    }

    pub fn f32(&mut self, value: f32) -> Result<(), TooLong> {
        self.bytes(&value.to_le_bytes())
    }

    /// By rows.
    pub fn matrix(&mut self, matrix: &Matrix3<f32>) -> Result<(), TooLong> {
        matrix.transpose().iter().try_for_each(|v| self.f32(*v))
    }
}
