//! The unit that a calibration belongs to, its date, and the samples that it was made from.

use super::bytes::{Reader, TooLong, Writer};

/// Origin of a calibration. In bytes an unknown field is zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Origin {
    /// The unit: its microcontroller's own 96-bit number, as it is in memory.
    pub unit_id: Option<[u8; 12]>,
    /// When it was made, seconds of UTC since 1970.
    pub created_s: Option<u64>,
    /// SHA-256 of the samples that it was made from.
    pub samples_sha256: Option<[u8; 32]>,
    /// Date of the last trim of its offsets on the device, seconds of UTC since 1970.
    pub trimmed_s: Option<u64>,
}

impl Origin {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self {
        unit_id: None,
        created_s: None,
        samples_sha256: None,
        trimmed_s: None,
    };

    pub(super) fn write(&self, to: &mut Writer<'_>) -> Result<(), TooLong> {
        to.bytes(&self.unit_id.unwrap_or_default())?;
        to.bytes(&self.created_s.unwrap_or_default().to_le_bytes())?;
        to.bytes(&self.samples_sha256.unwrap_or_default())?;
        to.bytes(&self.trimmed_s.unwrap_or_default().to_le_bytes())
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Option<Self> {
        let unit_id = from.bytes()?;
        let created_s = u64::from_le_bytes(from.bytes()?);
        let samples_sha256 = from.bytes()?;
        let trimmed_s = u64::from_le_bytes(from.bytes()?);
        Some(Self {
            unit_id: Some(unit_id).filter(|id| *id != [0; 12]),
            created_s: Some(created_s).filter(|s| *s != 0),
            samples_sha256: Some(samples_sha256).filter(|hash| *hash != [0; 32]),
            trimmed_s: Some(trimmed_s).filter(|s| *s != 0),
        })
    }
}
