//! The quantities that are measured: names and units.

use mimu::quantity::AXES;

use crate::measured::Measured;

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

/// Each in the order of [`Quantity`], with its name without the axis, and its unit as in data sheets.
const TABLE: [(Quantity, &str, &str); 16] = [
    (Quantity::GravityError, "gravity_error", "mg"),
    (Quantity::Tilt, "tilt", "deg"),
    (Quantity::GyroOffset, "gyro_offset", "deg/s"),
    (Quantity::AccelOffset, "accel_offset", "mg"),
    (Quantity::AccelSensitivity, "accel_sensitivity", "%"),
    (Quantity::GyroNoise, "gyro_noise_rms", "deg/s"),
    (Quantity::GyroDensity, "gyro_noise_density", "deg/s/√Hz"),
    (Quantity::AccelNoise, "accel_noise_rms", "mg"),
    (Quantity::AccelDensity, "accel_noise_density", "µg/√Hz"),
    (Quantity::GyroBits, "gyro_stuck_bits", "bit"),
    (Quantity::AccelBits, "accel_stuck_bits", "bit"),
    (Quantity::GyroRun, "gyro_equal_run", "sample"),
    (Quantity::AccelRun, "accel_equal_run", "sample"),
    (Quantity::SampleRate, "sample_rate", "Hz"),
    (Quantity::LostSamples, "lost_samples", "%"),
    (Quantity::Temperature, "temperature", "°C"),
];

impl Quantity {
    /// All.
    pub fn all() -> impl Iterator<Item = Self> {
        TABLE.into_iter().map(|(quantity, ..)| quantity)
    }

    /// Name, without the axis.
    pub fn without_axis(self) -> &'static str {
        TABLE[self as usize].1
    }

    /// Unit, as in data sheets.
    pub fn unit(self) -> &'static str {
        TABLE[self as usize].2
    }

    /// This quantity of an axis, if it has one, in its unit.
    pub(crate) fn measured(self, axis: Option<usize>, value: f64, sigma: f64) -> Measured {
        Measured::new(self.name(axis), value, self.unit(), sigma)
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
        let bare = without_axis(name);
        Self::all().find(|of| [Some(name), bare.as_deref()].contains(&Some(of.without_axis())))
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
        for quantity in Quantity::all() {
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
