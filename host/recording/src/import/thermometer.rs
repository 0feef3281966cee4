//! Zeros of a thermometer: a logger without one, or one that did not answer, writes 0.

use crate::error::Result;

/// Distance from the reading that a zero in the file gives, K, beyond which all other readings have to be for single zeros to be missing answers.
/// Temperatures that really pass through 0 come closer.
const APART_K: f64 = 5.0;

/// What a thermometer's column contains besides temperatures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Zeros {
    /// Nothing.
    None,
    /// Zeros in some rows, far from all temperatures: the thermometer did not answer there.
    Missing(u64),
    /// Zeros throughout: there is no thermometer.
    Throughout(u64),
}

/// Counts the zeros in the cells of a thermometer.
#[derive(Debug, Clone, Copy)]
pub(super) struct ZeroTally {
    zeros: u64,
    others: u64,
    /// Reading of a zero, °C.
    of_zero_c: f64,
    /// Readings of the other cells, °C.
    lowest_c: f64,
    highest_c: f64,
}

impl Default for ZeroTally {
    fn default() -> Self {
        Self {
            zeros: 0,
            others: 0,
            of_zero_c: f64::NAN,
            lowest_c: f64::INFINITY,
            highest_c: f64::NEG_INFINITY,
        }
    }
}

impl ZeroTally {
    /// Takes a cell and its reading, °C: factors and offsets may make any temperature of a zero.
    pub fn push(&mut self, cell: f64, reading_c: f64) {
        match cell {
            0.0 => {
                self.zeros += 1;
                self.of_zero_c = reading_c;
            }
            _ if cell.is_nan() => {}
            _ => {
                self.others += 1;
                self.lowest_c = self.lowest_c.min(reading_c);
                self.highest_c = self.highest_c.max(reading_c);
            }
        }
    }

    /// What the column contains.
    pub fn found(&self) -> Zeros {
        let apart =
            self.lowest_c > self.of_zero_c + APART_K || self.highest_c < self.of_zero_c - APART_K;
        match (self.zeros, self.others) {
            (0, _) => Zeros::None,
            (zeros, 0) => Zeros::Throughout(zeros),
            (zeros, others) if apart && zeros < others => Zeros::Missing(zeros),
            _ => Zeros::None,
        }
    }
}

/// Parts of a file that an import leaves out, because a first reading of all rows showed that they are no readings.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct LeftOut {
    /// Whether gyro and accelerometer read only zeros.
    pub sensors: [bool; 2],
    /// Whether the thermometer reads only zeros.
    pub thermometer: bool,
    /// Whether zeros of the thermometer are missing answers.
    pub zero_temperatures: bool,
}

/// Calls `import` again with what it says is to be left out, until it leaves a result.
pub(super) fn repeated<T>(
    mut import: impl FnMut(LeftOut) -> Result<std::result::Result<T, LeftOut>>,
) -> Result<T> {
    let mut left_out = LeftOut::default();
    loop {
        match import(left_out)? {
            Ok(done) => return Ok(done),
            Err(more) => left_out = more,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(cells: &[f64], offset: f64) -> Zeros {
        let mut tally = ZeroTally::default();
        for cell in cells {
            tally.push(*cell, cell + offset);
        }
        tally.found()
    }

    #[test]
    fn zeros_are_missing_answers_only_far_from_all_temperatures() {
        assert_eq!(found(&[0.0; 9], 0.0), Zeros::Throughout(9));
        assert_eq!(found(&[0.0; 9], 36.53), Zeros::Throughout(9));
        assert_eq!(
            found(&[21.0, 0.0, 21.1, f64::NAN, 21.0], 0.0),
            Zeros::Missing(1)
        );
        assert_eq!(found(&[-21.0, 0.0, -21.1], 0.0), Zeros::Missing(1));
        // A chamber that passes through 0, and a thermometer with steps of a degree beside it.
        assert_eq!(found(&[-20.0, -1.0, 0.0, 1.0, 30.0], 0.0), Zeros::None);
        assert_eq!(found(&[2.0, 1.0, 0.0, 1.0], 0.0), Zeros::None);
        assert_eq!(found(&[21.0, 22.0], 0.0), Zeros::None);
    }
}
