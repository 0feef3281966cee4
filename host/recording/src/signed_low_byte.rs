//! Readings of two bytes whose low byte a firmware took for a signed number: `(high << 8) + (int8_t)low`.

use crate::cell::shorten;
use crate::columns::{Column, of_sensor};
use crate::error::{Error, Result};

/// Number of values of a byte.
const BYTE: f64 = 256.0;
/// Largest reading of two bytes.
const LARGEST: f64 = 32_767.0;

/// A reading in whole counts without this fault. A low byte of 128 or more makes the reading 256 counts low. The low byte itself is right, so the
/// correction is exact.
pub fn corrected(reading: f64) -> f64 {
    let mended = match reading.rem_euclid(BYTE) >= 0.5 * BYTE {
        true => reading + BYTE,
        false => reading,
    };
    // A variable of two bytes wraps from its smallest number to its largest.
    match mended > LARGEST {
        true => mended - BYTE * BYTE,
        false => mended,
    }
}

/// Raw channels that an import corrects: `gyro`, `accel` or a single one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SignedLowByte(String);

impl SignedLowByte {
    /// Whether `column` has this fault.
    pub(crate) fn applies_to(&self, column: Column) -> bool {
        column.name() == self.0 || of_sensor(&self.0, column)
    }
}

impl std::str::FromStr for SignedLowByte {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let channels = Self(text.to_owned());
        let raw = (0..6).map(Column::Raw);
        match raw.into_iter().any(|column| channels.applies_to(column)) {
            true => Ok(channels),
            false => Err(Error::new(
                "signed low byte",
                format!("{} is not a raw column", shorten(text.as_bytes())),
                "write gyro, accel or a single column such as gyro_x",
            )),
        }
    }
}

impl std::fmt::Display for SignedLowByte {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reading_of_two_bytes_is_mended_exactly_in_a_wide_and_in_a_narrow_variable() {
        for right in i16::MIN..=i16::MAX {
            let [high, low] = right.to_be_bytes();
            let wide = i32::from(high as i8) * 256 + i32::from(low as i8);
            assert_eq!(corrected(f64::from(wide)), f64::from(right));
            assert_eq!(corrected(f64::from(wide as i16)), f64::from(right));
        }
    }
}
