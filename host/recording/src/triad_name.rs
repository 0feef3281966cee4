//! Names of the triads of a body.

use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// What a triad measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, strum::IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
pub enum TriadKind {
    /// Angular rate.
    Gyro,
    /// Specific force.
    Accel,
    /// Magnetic field.
    Mag,
}

impl TriadKind {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::Gyro, Self::Accel, Self::Mag];

    /// Stem of its columns.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// A triad of a body: `gyro`, `accel`, `mag`, and further ones by number, such as `gyro2`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TriadName {
    /// What it measures.
    pub kind: TriadKind,
    /// Its number among those of its kind, from 1. The first has no number in its name.
    pub number: u8,
}

impl TriadName {
    /// Highest number of a triad.
    pub const MOST: u8 = 64;

    /// The first gyro.
    pub const GYRO: Self = Self::first(TriadKind::Gyro);
    /// The first accelerometer.
    pub const ACCEL: Self = Self::first(TriadKind::Accel);
    /// The first magnetometer.
    pub const MAG: Self = Self::first(TriadKind::Mag);

    /// All names, by number and kind: `gyro`, `accel`, `mag`, `gyro2` and so on.
    pub fn all() -> impl Iterator<Item = Self> {
        let numbers = 1..=Self::MOST;
        numbers.flat_map(|number| TriadKind::ALL.map(|kind| Self { kind, number }))
    }

    /// Its place in [`Self::all`].
    pub(crate) fn place(self) -> usize {
        let number = usize::from(self.number.clamp(1, Self::MOST));
        (number - 1) * TriadKind::ALL.len() + self.kind as usize
    }

    /// The first of a kind.
    pub const fn first(kind: TriadKind) -> Self {
        Self { kind, number: 1 }
    }

    /// The triad with this name; `None` if it names none, such as `gyro1` or `mag02`.
    pub fn parse(name: &str) -> Option<Self> {
        let kind = TriadKind::ALL.into_iter();
        let (kind, rest) = kind
            .filter_map(|kind| Some((kind, name.strip_prefix(kind.name())?)))
            .next()?;
        let number = match rest {
            "" => 1,
            _ if rest.starts_with(['0', '+']) => return None,
            _ => rest.parse().ok().filter(|n| (2..=Self::MOST).contains(n))?,
        };
        Some(Self { kind, number })
    }
}

impl fmt::Display for TriadName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind.name())?;
        match self.number {
            1 => Ok(()),
            number => write!(f, "{number}"),
        }
    }
}

impl Serialize for TriadName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for TriadName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::parse(&name).ok_or_else(|| {
            serde::de::Error::custom(format!(
                "{name:?} names no triad: write gyro, accel, mag, or one of these with a number from 2, such as gyro2"
            ))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_comes_back_and_others_name_no_triad() {
        for name in ["gyro", "accel", "mag", "gyro2", "accel12", "mag64"] {
            assert_eq!(TriadName::parse(name).unwrap().to_string(), name);
        }
        for name in ["gyro1", "mag0", "mag02", "mag65", "gyro_x", "magnet", ""] {
            assert_eq!(TriadName::parse(name), None, "{name}");
        }
    }
}
