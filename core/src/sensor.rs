//! The two triads of an inertial unit, and values for each.

use core::fmt;
use core::ops::{Index, IndexMut, Range};
use core::str::FromStr;

use serde::{Deserialize, Serialize};

/// A triad of sensors.
///
/// Its numbers on the wire are the order of its variants, and its names in files are those of [`Self::name`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sensor {
    /// Gyro; inputs and errors in rad/s.
    Gyro,
    /// Accelerometer; inputs and errors in m/s².
    Accel,
}

impl Sensor {
    /// Both triads.
    pub const BOTH: [Self; 2] = [Self::Gyro, Self::Accel];

    /// Its three channels among the six: gyro x, y, z, accelerometer x, y, z.
    pub const fn channels(self) -> Range<usize> {
        match self {
            Self::Gyro => 0..3,
            Self::Accel => 3..6,
        }
    }

    /// `gyro` or `accel`, as in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gyro => "gyro",
            Self::Accel => "accel",
        }
    }

    /// SI unit of its input.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Gyro => "rad/s",
            Self::Accel => "m/s^2",
        }
    }

    /// `gyro` for a gyro, `accel` for an accelerometer.
    pub fn pick<T>(self, gyro: T, accel: T) -> T {
        match self {
            Self::Gyro => gyro,
            Self::Accel => accel,
        }
    }

    /// The other triad.
    pub const fn other(self) -> Self {
        match self {
            Self::Gyro => Self::Accel,
            Self::Accel => Self::Gyro,
        }
    }
}

impl fmt::Display for Sensor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The name of a sensor is neither `gyro` nor `accel`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnknownSensor;

impl fmt::Display for UnknownSensor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a sensor is gyro or accel")
    }
}

impl core::error::Error for UnknownSensor {}

impl FromStr for Sensor {
    type Err = UnknownSensor;

    fn from_str(name: &str) -> Result<Self, UnknownSensor> {
        let mut both = Self::BOTH.into_iter();
        both.find(|s| s.name() == name).ok_or(UnknownSensor)
    }
}

/// One value for each triad.
///
/// ```
/// # use mimu_core::{PerSensor, Sensor};
/// let lags_s = PerSensor { gyro: 60.0, accel: 30.0 };
/// assert_eq!(lags_s[Sensor::Accel], 30.0);
/// assert_eq!(lags_s.map(|s| s / 60.0), PerSensor { gyro: 1.0, accel: 0.5 });
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PerSensor<T> {
    /// Of the gyro.
    pub gyro: T,
    /// Of the accelerometer.
    pub accel: T,
}

impl<T> PerSensor<T> {
    /// Values of a function of the sensor, the gyro first.
    #[inline]
    pub fn from_fn(mut of: impl FnMut(Sensor) -> T) -> Self {
        Self {
            gyro: of(Sensor::Gyro),
            accel: of(Sensor::Accel),
        }
    }

    /// The same value for both.
    #[inline]
    pub fn both(of: T) -> Self
    where
        T: Clone,
    {
        Self {
            gyro: of.clone(),
            accel: of,
        }
    }

    /// Applies a function to each, the gyro first.
    #[inline]
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> PerSensor<U> {
        PerSensor {
            gyro: f(self.gyro),
            accel: f(self.accel),
        }
    }

    /// References to both.
    #[inline]
    pub const fn as_ref(&self) -> PerSensor<&T> {
        PerSensor {
            gyro: &self.gyro,
            accel: &self.accel,
        }
    }

    /// Mutable references to both.
    #[inline]
    pub const fn as_mut(&mut self) -> PerSensor<&mut T> {
        PerSensor {
            gyro: &mut self.gyro,
            accel: &mut self.accel,
        }
    }

    /// Pairs each value with that of `other`.
    #[inline]
    pub fn zip<U>(self, other: PerSensor<U>) -> PerSensor<(T, U)> {
        PerSensor {
            gyro: (self.gyro, other.gyro),
            accel: (self.accel, other.accel),
        }
    }

    /// Each value with its sensor, the gyro first.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = (Sensor, &T)> {
        self.as_ref().into_iter()
    }
}

impl<T> PerSensor<Option<T>> {
    /// Both values, if both exist.
    #[inline]
    pub fn transpose(self) -> Option<PerSensor<T>> {
        Some(PerSensor {
            gyro: self.gyro?,
            accel: self.accel?,
        })
    }

    /// The existing ones, the gyro first.
    pub fn present(&self) -> impl DoubleEndedIterator<Item = (Sensor, &T)> {
        self.iter().filter_map(|(s, of)| Some((s, of.as_ref()?)))
    }
}

impl<T> IntoIterator for PerSensor<T> {
    type Item = (Sensor, T);
    type IntoIter = core::array::IntoIter<(Sensor, T), 2>;

    fn into_iter(self) -> Self::IntoIter {
        [(Sensor::Gyro, self.gyro), (Sensor::Accel, self.accel)].into_iter()
    }
}

impl<T> From<[T; 2]> for PerSensor<T> {
    #[inline]
    fn from([gyro, accel]: [T; 2]) -> Self {
        Self { gyro, accel }
    }
}

impl<T> Index<Sensor> for PerSensor<T> {
    type Output = T;

    #[inline]
    fn index(&self, sensor: Sensor) -> &T {
        match sensor {
            Sensor::Gyro => &self.gyro,
            Sensor::Accel => &self.accel,
        }
    }
}

impl<T> IndexMut<Sensor> for PerSensor<T> {
    #[inline]
    fn index_mut(&mut self, sensor: Sensor) -> &mut T {
        match sensor {
            Sensor::Gyro => &mut self.gyro,
            Sensor::Accel => &mut self.accel,
        }
    }
}
