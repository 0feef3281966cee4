//! The quantities that are measured: names and units.

use mimu::quantity::AXES;

/// A quantity. Those of a sensor have a value for each axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Magnitude of the specific force minus local gravity.
    GravityError,
    /// Angle between the specific force and the side that is, or has to be, up.
    Tilt,
    /// Mean rate at rest.
    GyroOffset,
    /// Reading of the accelerometer at zero force, by three sides.
    AccelOffset,
    /// Deviation of its sensitivity from the nominal one, by three sides.
    AccelSensitivity,
    /// Rms of the gyro's noise.
    GyroNoise,
    /// One-sided density of its noise from 5 to 20 Hz.
    GyroDensity,
    /// Rms of the accelerometer's noise.
    AccelNoise,
    /// One-sided density of its noise from 5 to 20 Hz.
    AccelDensity,
    /// Bits that never change.
    GyroBits,
    /// The same.
    AccelBits,
    /// Longest run of equal readings.
    GyroRun,
    /// The same.
    AccelRun,
    /// Samples a second.
    SampleRate,
    /// Share of missing samples.
    LostSamples,
    /// Mean temperature.
    Temperature,
}

impl Quantity {
    /// All.
    pub const ALL: [Self; 16] = [
        Self::GravityError,
        Self::Tilt,
        Self::GyroOffset,
        Self::AccelOffset,
        Self::AccelSensitivity,
        Self::GyroNoise,
        Self::GyroDensity,
        Self::AccelNoise,
        Self::AccelDensity,
        Self::GyroBits,
        Self::AccelBits,
        Self::GyroRun,
        Self::AccelRun,
        Self::SampleRate,
        Self::LostSamples,
        Self::Temperature,
    ];

    /// Name, without the axis.
    pub fn without_axis(self) -> &'static str {
        match self {
            Self::GravityError => "gravity_error",
            Self::Tilt => "tilt",
            Self::GyroOffset => "gyro_offset",
            Self::AccelOffset => "accel_offset",
            Self::AccelSensitivity => "accel_sensitivity",
            Self::GyroNoise => "gyro_noise_rms",
            Self::GyroDensity => "gyro_noise_density",
            Self::AccelNoise => "accel_noise_rms",
            Self::AccelDensity => "accel_noise_density",
            Self::GyroBits => "gyro_stuck_bits",
            Self::AccelBits => "accel_stuck_bits",
            Self::GyroRun => "gyro_equal_run",
            Self::AccelRun => "accel_equal_run",
            Self::SampleRate => "sample_rate",
            Self::LostSamples => "lost_samples",
            Self::Temperature => "temperature",
        }
    }

    /// Unit, as in data sheets.
    pub fn unit(self) -> &'static str {
        match self {
            Self::GravityError | Self::AccelOffset | Self::AccelNoise => "mg",
            Self::Tilt => "deg",
            Self::GyroOffset | Self::GyroNoise => "deg/s",
            Self::AccelSensitivity | Self::LostSamples => "%",
            Self::GyroDensity => "deg/s/√Hz",
            Self::AccelDensity => "µg/√Hz",
            Self::GyroBits | Self::AccelBits => "bit",
            Self::GyroRun | Self::AccelRun => "sample",
            Self::SampleRate => "Hz",
            Self::Temperature => "°C",
        }
    }

    /// Name with the axis, if it has one: `gyro_x_offset`.
    pub fn name(self, axis: Option<usize>) -> String {
        let name = self.without_axis();
        match (axis, name.split_once('_')) {
            (Some(axis), Some((sensor, of))) => format!("{sensor}_{}_{of}", AXES[axis]),
            _ => name.into(),
        }
    }

    /// The quantity of a name with or without an axis.
    pub fn find(name: &str) -> Option<Self> {
        let is = |all: &&Self| {
            all.without_axis() == name || without_axis(name) == Some(all.without_axis().into())
        };
        Self::ALL.iter().find(is).copied()
    }
}

/// The name without its axis: `gyro_offset` of `gyro_x_offset`; `None` if it has none.
pub fn without_axis(name: &str) -> Option<String> {
    ["gyro", "accel"].iter().find_map(|sensor| {
        let of = name.strip_prefix(sensor)?.strip_prefix('_')?;
        let of = AXES
            .iter()
            .find_map(|axis| of.strip_prefix(axis)?.strip_prefix('_'))?;
        Some(format!("{sensor}_{of}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_found_with_and_without_its_axis() {
        for quantity in Quantity::ALL {
            assert_eq!(Quantity::find(quantity.without_axis()), Some(quantity));
            if quantity.without_axis().starts_with("gyro") {
                let name = quantity.name(Some(1));
                assert!(name.contains("_y_"), "{name}");
                assert_eq!(Quantity::find(&name), Some(quantity));
            }
        }
        assert_eq!(Quantity::find("gyro_w_offset"), None);
        assert_eq!(Quantity::find("gyro_x"), None);
    }
}
