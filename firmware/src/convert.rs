//! Converter codes, their sums, and what they stand for.
//!
//! Averages are integer sums until the moment they become volts: no order of adding changes them.

use crate::design_parameters::{
    DIVIDER_RATIO, GYRO_TEMPERATURE_NULL_C, GYRO_TEMPERATURE_NULL_V, GYRO_TEMPERATURE_V_PER_C,
    REFERENCE_V,
};

/// Result of one conversion: 0 at 0 V to 65 535 at the reference, straight binary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(transparent)]
pub struct Code(pub u16);

impl Code {
    /// The code at the reference voltage. A full scale of 2^16 - 1 and not 2^16 (RM0433 25.4.35).
    pub const FULL_SCALE: u16 = u16::MAX;

    /// Volts per step at the pin, 50.355 µV.
    pub const VOLTS_PER_STEP: f32 = REFERENCE_V / Self::FULL_SCALE as f32;
}

/// Sum of conversions of one channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CodeSum {
    sum: u64,
    count: u32,
}

impl CodeSum {
    /// The sum of no conversions.
    pub const EMPTY: Self = Self { sum: 0, count: 0 };

    /// Adds one conversion.
    pub const fn push(&mut self, code: Code) {
        self.sum += code.0 as u64;
        self.count += 1;
    }

    /// Adds the conversions of another sum.
    pub const fn add(&mut self, other: Self) {
        self.sum += other.sum;
        self.count += other.count;
    }

    /// Number of conversions.
    pub const fn count(self) -> u32 {
        self.count
    }

    /// Mean voltage at the pin, V; zero for no conversions.
    pub fn mean_v(self) -> f32 {
        if self.count == 0 {
            return 0.0;
        }
        // Whole and part apart, each exact in an f32: the sum of a second's conversions has 27
        // bits.
        let count = u64::from(self.count);
        let whole = (self.sum / count) as f32;
        let part = (self.sum % count) as f32 / self.count as f32;
        (whole + part) * Code::VOLTS_PER_STEP
    }
}

/// Voltage at a gyro's own pin, V, from that behind its divider.
pub fn gyro_v(pin_v: f32) -> f32 {
    pin_v / DIVIDER_RATIO
}

/// Temperature of a gyro's die, °C, from its TEMP output behind the divider, V.
pub fn gyro_temperature_c(pin_v: f32) -> f32 {
    GYRO_TEMPERATURE_NULL_C + (gyro_v(pin_v) - GYRO_TEMPERATURE_NULL_V) / GYRO_TEMPERATURE_V_PER_C
}

#[cfg(test)]
mod tests {
    use super::*;

    fn repeated(codes: &[u16], times: u32) -> CodeSum {
        let mut sum = CodeSum::EMPTY;
        for _ in 0..times {
            for &code in codes {
                sum.push(Code(code));
            }
        }
        sum
    }

    #[test]
    fn full_scale_is_the_reference_voltage_and_zero_is_ground() {
        assert_eq!(repeated(&[Code::FULL_SCALE], 1).mean_v(), REFERENCE_V);
        assert_eq!(repeated(&[0], 1).mean_v(), 0.0);
    }

    #[test]
    fn a_mean_does_not_depend_on_how_its_conversions_were_grouped() {
        let mut by_parts = CodeSum::EMPTY;
        for _ in 0..500 {
            by_parts.add(repeated(&[40_000, 40_003], 2));
        }
        assert_eq!(by_parts, repeated(&[40_000, 40_003], 1000));
    }

    #[test]
    fn an_hour_at_full_scale_neither_overflows_nor_moves() {
        let second = repeated(&[Code::FULL_SCALE], 2000);
        let mut hour = CodeSum::EMPTY;
        for _ in 0..3600 {
            hour.add(second);
        }
        assert_eq!(hour.count(), 7_200_000);
        assert_eq!(hour.mean_v(), REFERENCE_V);
    }

    #[test]
    fn a_quarter_of_a_step_survives_the_mean_of_a_second() {
        let below = repeated(&[30_000], 2000).mean_v();
        let above = repeated(&[30_000, 30_000, 30_000, 30_001], 500).mean_v();
        let quarter_v = Code::VOLTS_PER_STEP / 4.0;
        assert!(((above - below) - quarter_v).abs() < 0.02 * quarter_v);
    }

    #[test]
    fn the_temperature_output_reads_298_kelvin_at_its_null_and_its_absolute_zero_near_zero_volts() {
        assert!((gyro_temperature_c(2.5 * DIVIDER_RATIO) - 25.0).abs() < 1e-3);
        assert!((gyro_temperature_c(0.0) - -273.15).abs() < 1.0);
    }
}
