//! The unit that a calibration belongs to, its sensors as they were set, its date, and the samples that it was made from.

use super::bytes::{Reader, TooLong, Writer};
use super::{StoredError, hash_of};
use crate::PerSensor;
use crate::triad::Triad;

/// Bytes of an [`Origin`].
pub(super) const LENGTH: usize = 88;
/// Position of the time of the trim in it.
pub(super) const TRIMMED_AT: usize = 52;

/// Origin of a calibration. In bytes an unknown field is zero.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Origin {
    /// The unit: its microcontroller's own 96-bit number, as it is in memory.
    pub unit_id: Option<[u8; 12]>,
    /// When it was made, seconds of UTC since 1970.
    pub created_s: Option<u64>,
    /// SHA-256 of the samples that it was made from.
    pub samples_sha256: Option<[u8; 32]>,
    /// Date of the last trim of its offsets on the device, seconds of UTC since 1970.
    pub trimmed_s: Option<u64>,
    /// Unit of the raw readings.
    pub raw_unit: Option<RawUnit>,
    /// The sensors as they were set.
    pub settings: Option<PerSensor<Setting>>,
}

/// Unit of raw readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RawUnit {
    /// Volts at the sensor.
    Volt,
    /// Counts of a digital sensor.
    Count,
}

/// The setting of a triad's sensors. A calibration belongs to it: with another range, bits, filter or part the same input makes other counts or
/// comes at another time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// Range, rad/s or m/s².
    pub range: f32,
    /// Hash of part, unit, bits, range and filter.
    pub id: u64,
}

impl RawUnit {
    /// Its name, as in [`Triad::unit`].
    pub fn name(self) -> &'static str {
        match self {
            Self::Volt => "V",
            Self::Count => "count",
        }
    }

    /// From its name.
    pub fn named(name: &str) -> Option<Self> {
        [Self::Volt, Self::Count]
            .into_iter()
            .find(|unit| unit.name() == name)
    }
}

impl Setting {
    /// That of a triad as the greeting describes it.
    pub fn of(triad: &Triad<'_>) -> Self {
        let range = triad.range;
        let parts = [
            triad.part.as_bytes(),
            triad.unit.as_bytes(),
            &[triad.bits],
            &range.to_le_bytes(),
            triad.filter.as_bytes(),
        ];
        Self {
            range,
            id: hash_of(&parts),
        }
    }
}

impl Origin {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self {
        unit_id: None,
        created_s: None,
        samples_sha256: None,
        trimmed_s: None,
        raw_unit: None,
        settings: None,
    };

    /// Whether a device with these triads can use the calibration, as far as both are known.
    ///
    /// # Errors
    /// The first triad whose sensors were set otherwise, or whose readings have another unit.
    pub fn check_sensors(&self, triads: &PerSensor<Triad<'_>>) -> Result<(), StoredError> {
        for (sensor, triad) in triads.iter() {
            let unit = self.raw_unit.is_none_or(|unit| unit.name() == triad.unit);
            let setting = Setting::of(triad);
            let set = self.settings.is_none_or(|of| of[sensor].id == setting.id);
            if !(unit && set) {
                return Err(StoredError::Setting { sensor });
            }
        }
        Ok(())
    }

    pub(super) fn write(&self, to: &mut Writer<'_>) -> Result<(), TooLong> {
        to.bytes(&self.unit_id.unwrap_or_default())?;
        to.bytes(&self.created_s.unwrap_or_default().to_le_bytes())?;
        to.bytes(&self.samples_sha256.unwrap_or_default())?;
        to.bytes(&self.trimmed_s.unwrap_or_default().to_le_bytes())?;
        let unit = match self.raw_unit {
            None => 0,
            Some(RawUnit::Volt) => 1,
            Some(RawUnit::Count) => 2,
        };
        to.bytes(&[unit, 0, 0, 0])?;
        for (_, setting) in PerSensor::from_fn(|sensor| self.settings.map(|of| of[sensor])) {
            to.f32(setting.map_or(0.0, |of| of.range))?;
            to.bytes(&setting.map_or(0, |of| of.id).to_le_bytes())?;
        }
        Ok(())
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, StoredError> {
        let mut all = Reader(from.slice(LENGTH).ok_or(StoredError::Length)?);
        Self::fields(&mut all).ok_or(StoredError::Header)
    }

    /// `None` if there is a unit that this build does not know.
    fn fields(from: &mut Reader<'_>) -> Option<Self> {
        let unit_id = from.bytes()?;
        let created_s = u64::from_le_bytes(from.bytes()?);
        let samples_sha256 = from.bytes()?;
        let trimmed_s = u64::from_le_bytes(from.bytes()?);
        let raw_unit = match from.bytes()? {
            [0, 0, 0, 0] => None,
            [1, 0, 0, 0] => Some(RawUnit::Volt),
            [2, 0, 0, 0] => Some(RawUnit::Count),
            _ => return None,
        };
        let mut setting = || {
            Some(Setting {
                range: from.f32()?,
                id: u64::from_le_bytes(from.bytes()?),
            })
        };
        let settings = PerSensor {
            gyro: setting()?,
            accel: setting()?,
        };
        let is_known = settings.iter().all(|(_, of)| of.id != 0);
        Some(Self {
            unit_id: Some(unit_id).filter(|id| *id != [0; 12]),
            created_s: Some(created_s).filter(|s| *s != 0),
            samples_sha256: Some(samples_sha256).filter(|hash| *hash != [0; 32]),
            trimmed_s: Some(trimmed_s).filter(|s| *s != 0),
            raw_unit,
            settings: is_known.then_some(settings),
        })
    }
}
