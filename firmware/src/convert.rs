//! Sums of converter codes, and what they stand for.
//!
//! A sample is the sum of [`SCANS`] conversions of every channel: integers until the moment they become volts, so that no order of
//! adding changes them and nothing is lost by averaging.
//!
//! # What is taken out
//!
//! The gyros' outputs are absolute and the converter measures in units of its own reference, the 3.3 V supply of the board, whose
//! drift of 1 % would look like 5 deg/s. The 2.5 V reference of gyro x is converted along with the rest through an equal divider:
//! a ratio to it is free of the supply and of the dividers. The accelerometer follows that supply itself, as its codes do.

use crate::board::{REFERENCE_V, SCANS};
use crate::design_parameters::{
    DIVIDER_RATIO, GYRO_REFERENCE_V, GYRO_TEMPERATURE_NULL_C, GYRO_TEMPERATURE_NULL_V,
    GYRO_TEMPERATURE_V_PER_C, REFERENCE_TOLERANCE, SAMPLE_HZ, SLOW_S,
};

/// The code at the converter's reference voltage. A full scale of 2^16 - 1 and not 2^16 (RM0433 25.4.35).
pub const FULL_SCALE: u32 = u16::MAX as u32;

/// A sum at the end of the range.
pub const SUM_FULL_SCALE: u32 = SCANS as u32 * FULL_SCALE;

/// Volts at the accelerometer for a step of its sum, 25.2 µV. By the nominal reference: it is ratiometric.
pub const ACCEL_VOLTS: f32 = REFERENCE_V / SUM_FULL_SCALE as f32;

/// The sum that the reference of the gyros has at nominal voltages: 2.5 V behind the divider.
pub const NOMINAL_REFERENCE: f32 =
    GYRO_REFERENCE_V * DIVIDER_RATIO / REFERENCE_V * SUM_FULL_SCALE as f32;

/// What moves slowly and is filtered: the gyros' reference and their temperature.
///
/// A mean over the first [`SLOW_S`], and from then on a first-order lag of that length: with the lag alone the first reading would
/// weigh on the first seconds with all of its noise.
///
/// Both are kept as differences, to the nominal reference and to equal voltages, where a step of the filter is not lost in the
/// last digit of a large number.
#[derive(Clone, Copy, Debug)]
pub struct Slow {
    /// Sum of the reference less [`NOMINAL_REFERENCE`].
    reference: f32,
    /// Mean of the three temperature sums less the sum of the reference.
    temperature: f32,
    /// Samples so far, as far as the mean goes.
    samples: f32,
}

impl Slow {
    /// Before the first sample.
    pub const NEW: Self = Self {
        reference: 0.0,
        temperature: 0.0,
        samples: 0.0,
    };

    /// Takes in `count` samples: totals of the reference's sums, and of those of the three temperatures together.
    pub fn update(&mut self, reference: u32, temperatures: u32, count: u32) {
        if count == 0 {
            return;
        }
        let count = count as f32;
        let reference = reference as f32 / count;
        let temperature = temperatures as f32 / (3.0 * count);
        self.samples = (self.samples + count).min(SLOW_S * SAMPLE_HZ as f32);
        let weight = count / self.samples;
        self.reference += weight * (reference - NOMINAL_REFERENCE - self.reference);
        self.temperature += weight * (temperature - reference - self.temperature);
    }

    /// Whether the reference is where it can be; otherwise its pin is open, and the nominal one counts.
    pub fn has_reference(&self) -> bool {
        self.reference.abs() <= REFERENCE_TOLERANCE * NOMINAL_REFERENCE
    }

    /// Whether any sample was taken in.
    pub fn begun(&self) -> bool {
        self.samples > 0.0
    }

    fn reference(&self) -> f32 {
        match self.has_reference() {
            true => NOMINAL_REFERENCE + self.reference,
            false => NOMINAL_REFERENCE,
        }
    }

    /// Volts at a gyro for a step of its sum, about 42 µV.
    pub fn gyro_volts(&self) -> f32 {
        GYRO_REFERENCE_V / self.reference()
    }

    /// Mean temperature of the gyros, °C. TEMP is made from the gyro's reference as well: that, too, is a ratio.
    pub fn temp_c(&self) -> f32 {
        let above_null = match self.has_reference() {
            true => self.temperature,
            false => self.temperature + self.reference,
        } * self.gyro_volts();
        let null = GYRO_REFERENCE_V - GYRO_TEMPERATURE_NULL_V;
        GYRO_TEMPERATURE_NULL_C + (above_null + null) / GYRO_TEMPERATURE_V_PER_C
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sum of a pin at `pin_v` while the converter's reference is `vref_v`, rounded as the converter does.
    fn sum(pin_v: f64, vref_v: f64) -> u32 {
        2 * (pin_v / vref_v * 65_535.0).round() as u32
    }

    /// After `seconds` at these voltages of the sensors.
    fn settled(reference_v: f64, temp_v: f64, vref_v: f64, seconds: u32) -> Slow {
        let mut slow = Slow::NEW;
        for _ in 0..seconds * 50 {
            let reference = 20 * sum(reference_v * 0.6, vref_v);
            slow.update(reference, 3 * 20 * sum(temp_v * 0.6, vref_v), 20);
        }
        slow
    }

    #[test]
    fn drift_of_the_supply_moves_neither_a_rate_nor_a_temperature() {
        for vref_v in [3.3, 3.267, 3.333] {
            let slow = settled(2.5, 2.5 + 0.0084 * 30.0, vref_v, 5);
            // A gyro at its null and 100 deg/s above, through the divider.
            for gyro_v in [2.5, 3.0] {
                let read = sum(gyro_v * 0.6, vref_v) as f32 * slow.gyro_volts();
                // Half a step of a code is 42 µV; so is that of the reference.
                assert!((f64::from(read) - gyro_v).abs() < 1.0e-4, "{read}");
            }
            assert!((slow.temp_c() - 55.0).abs() < 0.02, "{}", slow.temp_c());
        }
    }

    #[test]
    fn without_the_reference_the_nominal_one_counts() {
        let slow = settled(0.0, 2.5 + 0.0084 * 10.0, 3.3, 5);
        assert!(!slow.has_reference());
        let read = sum(1.5, 3.3) as f32 * slow.gyro_volts();
        assert!((read - 2.5).abs() < 1e-4);
        assert!((slow.temp_c() - 35.0).abs() < 0.02, "{}", slow.temp_c());
    }

    #[test]
    fn the_first_second_is_a_mean_and_then_it_forgets() {
        let mut slow = Slow::NEW;
        let nominal = NOMINAL_REFERENCE.round() as u32;
        for k in 0..500 {
            let sign = [-20, 20][k % 2];
            slow.update(nominal.saturating_add_signed(sign), 3 * nominal, 1);
        }
        assert!((slow.reference + NOMINAL_REFERENCE - nominal as f32).abs() < 0.1);
        // A step of the reference: when the second is full the mean is halfway, and after three time constants more e⁻³ of that
        // half is left.
        for _ in 0..500 + 3000 {
            slow.update(nominal + 200, 3 * nominal, 1);
        }
        let left = f64::from(nominal as f32 + 200.0 - (slow.reference + NOMINAL_REFERENCE));
        assert!((left - 100.0 * (-3.0_f64).exp()).abs() < 0.1, "{left}");
    }

    #[test]
    fn the_accelerometer_reads_half_its_supply_at_half_scale() {
        let read = SUM_FULL_SCALE as f32 * 0.5 * ACCEL_VOLTS;
        assert!((read - 1.65).abs() < 1e-6);
    }
}
