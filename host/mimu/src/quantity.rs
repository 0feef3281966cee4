//! Sensors, axes, units, and how numbers are written: in one place, for messages, files and everything that people read.

use mimu_recording::RawUnit;
use serde::{Serialize, Serializer};

pub use mimu_core::{PerSensor, Sensor};
pub use mimu_recording::digits::{duration, plural, rounded, significant, unsigned_zero};

/// Names of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// Serialises the sensors that are present; an absent one has no key.
pub fn present<T: Serialize, S: Serializer>(
    sensors: &PerSensor<Option<T>>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(sensors.present())
}

/// The quantity of an error figure; a file contains [`Figure::description`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Figure {
    /// Compensated dwell mean minus known input, over dwells and axes: SI of the sensor.
    Input,
    /// Magnitude of the compensated dwell mean minus gravity, m/s².
    GravityMagnitude,
    /// Magnitude of the compensated dwell mean minus the rate of the turntable, rad/s.
    RateMagnitude,
    /// Angle between the predicted and the measured direction of gravity after each turn, rad.
    Direction,
}

impl Serialize for Figure {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.description())
    }
}

impl Figure {
    /// Unit of the figure.
    pub fn unit(self, sensor: Sensor) -> &'static str {
        match self {
            Self::Direction => "rad",
            _ => sensor.unit(),
        }
    }

    /// Whether only the magnitude of the input is known, so that the triad's own axes are its frame.
    pub fn is_magnitude(self) -> bool {
        matches!(self, Self::GravityMagnitude | Self::RateMagnitude)
    }

    /// Number of components of the error of a dwell or a turn: a direction has two angles.
    pub fn components(self) -> usize {
        match self {
            Self::Input => 3,
            Self::GravityMagnitude | Self::RateMagnitude => 1,
            Self::Direction => 2,
        }
    }

    /// The quantity, as a sentence fragment.
    pub fn description(self) -> &'static str {
        match self {
            Self::Input => "compensated dwell mean minus known input, over dwells and axes",
            Self::GravityMagnitude => "magnitude of the compensated dwell mean minus gravity",
            Self::RateMagnitude => {
                "magnitude of the compensated dwell mean minus the rate of the turntable"
            }
            Self::Direction => "angle between predicted and measured gravity after each turn",
        }
    }
}

/// Names of the twelve parameters of the inverse model, `C_xx` to `o_z`, in the order of the covariance.
pub fn inverse_names() -> [String; 12] {
    std::array::from_fn(|i| {
        if i < 9 {
            format!("C_{}{}", AXES[i / 3], AXES[i % 3])
        } else {
            format!("o_{}", AXES[i - 9])
        }
    })
}

/// Unit of a raw reading of a sensor whose SI unit is `si`.
pub fn raw_unit(raw: RawUnit, si: &str) -> String {
    match raw {
        RawUnit::Si => si.to_string(),
        other => other.to_string(),
    }
}

/// Unit of a scale factor, raw per SI.
pub fn scale_unit(raw: RawUnit, si: &str) -> String {
    match raw {
        RawUnit::Si => "1".to_string(),
        other => format!("{other}/({si})"),
    }
}

/// `value ± half`, both to the second significant digit of `half`.
pub fn plus_minus(value: f64, half: f64) -> String {
    if !(half > 0.0) || !half.is_finite() {
        return format!("{} (fixed)", significant(value + 0.0));
    }
    let digits = (1 - half.log10().floor() as i32).clamp(0, 9) as usize;
    // Rounding may give -0.00.
    let value = if value.abs() < 0.5 * 10f64.powi(-(digits as i32)) {
        0.0
    } else {
        value
    };
    format!("{value:.digits$} ± {half:.digits$}")
}

/// A time to the second: `90.0 s`, `2 min 30 s`.
pub fn minutes(seconds: f64) -> String {
    match seconds.round() {
        s if s < 120.0 => format!("{} s", significant(seconds)),
        s => format!("{} min {} s", (s / 60.0).floor(), s % 60.0),
    }
}

/// A p-value. No real noise is known to be Gaussian beyond one in a million.
pub fn p_value(p: f64) -> String {
    match p {
        p if p < 1e-6 => "p < 1e-6".into(),
        p => format!("p = {}", significant(p)),
    }
}

/// Normal gravity at sea level, m/s² (WGS 84, Somigliana), at a latitude in degrees. Local gravity differs by some
/// 3e-4 m/s², and by 3.1e-6 m/s² for each metre of height.
pub fn normal_gravity(latitude_deg: f64) -> f64 {
    let sin2 = latitude_deg.to_radians().sin().powi(2);
    9.780_325_335_9 * (1.0 + 0.001_931_852_652_41 * sin2)
        / (1.0 - 0.006_694_379_990_14 * sin2).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_gravity_is_that_of_the_ellipsoid_at_the_equator_and_the_poles() {
        // NIMA TR8350.2, table 3.4.
        assert!((normal_gravity(0.0) - 9.780_325_335_9).abs() < 1e-9);
        assert!((normal_gravity(-90.0) - 9.832_184_937_8).abs() < 1e-8);
    }
}
