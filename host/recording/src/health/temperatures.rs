//! Temperatures that are none: counts of a converter, a failed bus, a thermometer that is absent or does not answer.

use std::fmt;

use super::{Fault, Finding};
use crate::columns::Column;

/// Possible temperatures in °C, from absolute zero on. Counts of a converter are mostly outside. A thermometer with an unknown offset may read 379 °C
/// throughout and still show what follows temperature.
const POSSIBLE_C: std::ops::RangeInclusive<f64> = -273.15..=1000.0;
/// Temperatures at which boards are used, °C: parts are specified from -55 to 125, some to 150.
const USUAL_C: std::ops::RangeInclusive<f64> = -60.0..=150.0;
/// Distance from the reading that a zero in the file gives, K, beyond which all other readings have to be for single zeros to be missing answers.
/// Temperatures that really pass through 0 come closer.
const APART_K: f64 = 5.0;

/// Where a temperature is in a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum At {
    /// Row of a file.
    Row(u64),
    /// Time, s.
    Time(f64),
}

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Row(row) => write!(f, "in row {row}"),
            Self::Time(t_s) => write!(f, "at {t_s:.1} s"),
        }
    }
}

/// The finding about a reading that cannot be a temperature in °C.
pub(crate) fn impossible_temperature(c: f64, at: Option<At>) -> Option<Finding> {
    let (of, first_c) = (1, c);
    let fault = Fault::NoTemperatures { of, first_c, at };
    (!c.is_nan() && !POSSIBLE_C.contains(&c)).then(|| finding(1, fault))
}

/// The finding about temperatures from `low_c` to `high_c` at which no board is used.
pub fn unusual_temperatures(low_c: f64, high_c: f64) -> Option<Finding> {
    let usual = USUAL_C.contains(&low_c) && USUAL_C.contains(&high_c);
    let fault = Fault::UnusualTemperatures { low_c, high_c };
    (low_c <= high_c && !usual).then(|| finding(0, fault))
}

fn finding(count: u64, fault: Fault) -> Finding {
    Finding::new(Column::Temperature.name(), count, fault)
}

/// Watches the readings of a thermometer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Temperatures {
    /// Readings.
    of: u64,
    impossible: Option<Finding>,
    /// Range of the possible ones, °C.
    range_c: [f64; 2],
    /// Zeros in the file, and their reading, °C.
    zeros: u64,
    of_zero_c: f64,
    /// Cells that are not 0, and the range of their readings, °C.
    others: u64,
    others_c: [f64; 2],
}

impl Default for Temperatures {
    fn default() -> Self {
        let nothing = [f64::INFINITY, f64::NEG_INFINITY];
        Self {
            of: 0,
            impossible: None,
            range_c: nothing,
            zeros: 0,
            of_zero_c: f64::NAN,
            others: 0,
            others_c: nothing,
        }
    }
}

impl Temperatures {
    /// Takes a reading, °C, and returns it, or NaN if it is impossible.
    pub fn take(&mut self, c: f64, at: At) -> f64 {
        if c.is_nan() {
            return c;
        }
        self.of += 1;
        let Some(found) = impossible_temperature(c, Some(at)) else {
            self.range_c = widened(self.range_c, c);
            return c;
        };
        match &mut self.impossible {
            Some(first) => first.rows.count += 1,
            None => self.impossible = Some(found),
        }
        f64::NAN
    }

    /// Takes a cell of a file and its reading, °C: factors and offsets may make any temperature of a zero.
    pub fn take_cell(&mut self, cell: f64, reading_c: f64) {
        if cell == 0.0 {
            self.zeros += 1;
            self.of_zero_c = reading_c;
        } else if !cell.is_nan() {
            self.others += 1;
            self.others_c = widened(self.others_c, reading_c);
        }
    }

    /// The finding about readings that cannot be temperatures.
    pub fn impossible(&self) -> Option<Finding> {
        let mut found = self.impossible?;
        if let Fault::NoTemperatures { of, .. } = &mut found.fault {
            *of = self.of;
        }
        Some(found)
    }

    /// The same, if these are more than half of all.
    pub fn mostly_impossible(&self) -> Option<Finding> {
        self.impossible()
            .filter(|found| 2 * found.rows.count > self.of)
    }

    /// The finding about temperatures at which no board is used.
    pub fn unusual(&self) -> Option<Finding> {
        let [low_c, high_c] = self.range_c;
        unusual_temperatures(low_c, high_c)
    }

    /// The finding about zeros that are no temperatures.
    pub fn zeros(&self) -> Option<Finding> {
        let [lowest_c, highest_c] = self.others_c;
        let apart = lowest_c > self.of_zero_c + APART_K || highest_c < self.of_zero_c - APART_K;
        let fault = match (self.zeros, self.others) {
            (0, _) => return None,
            (_, 0) => Fault::NoThermometer,
            (zeros, others) if apart && zeros < others => Fault::SilentThermometer,
            _ => return None,
        };
        Some(finding(self.zeros, fault))
    }
}

fn widened([low, high]: [f64; 2], by: f64) -> [f64; 2] {
    [low.min(by), high.max(by)]
}
