//! Sums of converter codes, and their conversion to volts and °C.
//!
//! A sample is the sum of [`SCANS`] conversions of every channel. It stays an integer until it is converted to volts, so the order of
//! additions does not matter and averaging loses nothing.
//! # What is removed
//!
//! The gyros' outputs are absolute, but the converter measures in units of its reference, the board's 3.3 V supply: a drift of 1 % would
//! look like 5 deg/s. The 2.5 V reference of gyro x is therefore converted too, through an equal divider. A ratio to it does not depend on
//! the supply or on the dividers. The accelerometer's output is proportional to that supply, so its codes do not depend on it.

use mimu_core::wire::flags;

use crate::board::{REFERENCE_V, SCANS};
use crate::design_parameters::{
    DIVIDER_RATIO, GYRO_REFERENCE_V, GYRO_TEMPERATURE_NULL_C, GYRO_TEMPERATURE_NULL_V,
    GYRO_TEMPERATURE_V_PER_C, REFERENCE_TOLERANCE, SAMPLE_HZ, SLOW_S,
};
use crate::temperature::Thermometer;

/// The code at the converter's reference voltage: full scale is 2^16 - 1 (RM0433 25.4.35).
pub const FULL_SCALE: u32 = u16::MAX as u32;

/// A sum at the end of the range.
pub const SUM_FULL_SCALE: u32 = SCANS as u32 * FULL_SCALE;

/// Volts at the accelerometer per unit of its sum, 25.2 µV. With the nominal reference, because it is ratiometric.
pub const ACCEL_VOLTS: f32 = REFERENCE_V / SUM_FULL_SCALE as f32;

/// The sum of the gyros' reference at nominal voltages: 2.5 V after the divider.
pub const NOMINAL_REFERENCE: f32 =
    GYRO_REFERENCE_V * DIVIDER_RATIO / REFERENCE_V * SUM_FULL_SCALE as f32;

/// A mean over the first [`SLOW_S`], then a first-order lag with that time constant: with the lag alone the noise of the first reading
/// would dominate the first seconds.
#[derive(Clone, Copy, Debug)]
struct Lag {
    value: f32,
    /// Number of samples in the mean so far.
    samples: f32,
}

impl Lag {
    const NEW: Self = Self {
        value: 0.0,
        samples: 0.0,
    };

    /// Takes in the mean of `count` samples.
    fn take(&mut self, mean: f32, count: f32) {
        self.samples = (self.samples + count).min(SLOW_S * SAMPLE_HZ as f32);
        self.value += count / self.samples * (mean - self.value);
    }
}

/// Slow quantities, filtered: the gyros' reference and temperatures.
///
/// Each batch is checked before filtering: the filter would hide a pin that has just come off, and would be distorted by it for seconds.
#[derive(Clone, Copy, Debug)]
pub struct Slow {
    /// Sum of the reference minus [`NOMINAL_REFERENCE`]. As a difference, so that a step of the filter is not lost to rounding of a large
    /// number.
    reference: Lag,
    /// The last one, unfiltered.
    reference_sum: f32,
    /// By the TEMP pins of gyro x, y, z, °C.
    pins_c: [Lag; 3],
    /// Which pins are used, and their common temperature.
    thermometer: Thermometer,
    /// The same filtered, °C.
    temp_c: Lag,
}

impl Slow {
    /// Before the first sample.
    pub const NEW: Self = Self {
        reference: Lag::NEW,
        reference_sum: 0.0,
        pins_c: [Lag::NEW; 3],
        thermometer: Thermometer::NEW,
        temp_c: Lag::NEW,
    };

    /// Before the first sample, with the offsets that the TEMP pins had when the calibration was stored, °C.
    pub const fn of_pins(pins_c: [f32; 3]) -> Self {
        Self {
            thermometer: Thermometer::of_pins(pins_c),
            ..Self::NEW
        }
    }

    /// Offsets between the TEMP pins, °C, to be stored with a calibration; `before`: those stored so far.
    pub fn pins_to_keep(&self, before: Option<[f32; 3]>) -> Option<[f32; 3]> {
        self.thermometer.to_keep(before)
    }

    /// Processes `count` samples: totals of the sums of the reference and of the three temperatures.
    pub fn update(&mut self, reference: u32, temperatures: [u32; 3], count: u32) {
        if count == 0 {
            return;
        }
        let count = count as f32;
        self.reference_sum = reference as f32 / count;
        if self.has_reference() {
            let off = self.reference_sum - NOMINAL_REFERENCE;
            self.reference.take(off, count);
        }
        // With the reference of the same samples: otherwise a step of the supply would look like a step of temperature until the filter has
        // settled.
        let volts = GYRO_REFERENCE_V
            / match self.has_reference() {
                true => self.reference_sum,
                false => NOMINAL_REFERENCE,
            };
        let pins_c = temperatures.map(|total| celsius(total as f32 / count * volts));
        for (pin, read) in self.pins_c.iter_mut().zip(pins_c) {
            pin.take(read, count);
        }
        let seconds = count / SAMPLE_HZ as f32;
        if let Some(together_c) = self.thermometer.take(pins_c, seconds) {
            self.temp_c.take(together_c, count);
        }
    }

    /// Whether the reference is in its range; otherwise its pin is open, and the nominal value is used.
    pub fn has_reference(&self) -> bool {
        (self.reference_sum - NOMINAL_REFERENCE).abs() <= REFERENCE_TOLERANCE * NOMINAL_REFERENCE
    }

    /// Whether any sample was processed.
    pub fn begun(&self) -> bool {
        self.pins_c[0].samples > 0.0
    }

    /// Volts at a gyro per unit of its sum, about 42 µV.
    pub fn gyro_volts(&self) -> f32 {
        let reference = match self.has_reference() {
            true => NOMINAL_REFERENCE + self.reference.value,
            false => NOMINAL_REFERENCE,
        };
        GYRO_REFERENCE_V / reference
    }

    /// Last reading of the gyros' reference, as a fraction of the converter's.
    pub fn reference_share(&self) -> f32 {
        self.reference_sum / SUM_FULL_SCALE as f32 / DIVIDER_RATIO
    }

    /// Temperature of the gyros from the pins that are used, °C. Without any, the last one; before the first one, 25 °C.
    pub fn temp_c(&self) -> f32 {
        match self.has_known_temperature() {
            true => self.temp_c.value,
            false => GYRO_TEMPERATURE_NULL_C,
        }
    }

    /// Whether there has been a good temperature.
    pub fn has_known_temperature(&self) -> bool {
        self.temp_c.samples > 0.0
    }

    /// Temperatures of the TEMP pins of gyro x, y, z, °C, including pins that are not used.
    pub fn gyro_temps_c(&self) -> [f32; 3] {
        self.pins_c.map(|pin| pin.value)
    }

    /// Which of them are used.
    pub fn temperatures_that_count(&self) -> [bool; 3] {
        self.thermometer.that_count()
    }

    /// Faults, as [`flags`].
    pub fn flags(&self) -> u16 {
        let count = self.temperatures_that_count();
        let left_out = flags::TEMPERATURE_LEFT_OUT.iter().zip(count);
        let left_out = left_out.filter(|(_, counts)| !counts);
        let mut all = left_out.fold(0, |all, (flag, _)| all | flag);
        if !self.has_reference() {
            all |= flags::NO_REFERENCE;
        }
        if count == [false; 3] {
            all |= flags::NO_TEMPERATURE;
        }
        all
    }
}

/// Temperature of a gyro, °C, from the voltage of its TEMP pin. The pin is proportional to the gyro's reference, so this is a ratio too.
fn celsius(temp_v: f32) -> f32 {
    GYRO_TEMPERATURE_NULL_C + (temp_v - GYRO_TEMPERATURE_NULL_V) / GYRO_TEMPERATURE_V_PER_C
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
            slow.update(reference, [20 * sum(temp_v * 0.6, vref_v); 3], 20);
        }
        slow
    }

    const REFERENCE: u32 = NOMINAL_REFERENCE as u32;

    /// Sums of twenty samples of TEMP pins, V.
    fn pins(volts: [f64; 3]) -> [u32; 3] {
        volts.map(|v| 20 * sum(v * 0.6, 3.3))
    }

    #[test]
    fn an_open_temperature_pin_moves_the_mean_by_nothing_and_is_flagged_at_once() {
        for wrong_v in [0.0, 5.0] {
            for pin in 0..3 {
                let mut slow = settled(2.5, 2.5, 3.3, 5);
                let mut volts = [2.5; 3];
                volts[pin] = wrong_v;
                for _ in 0..100 {
                    slow.update(20 * REFERENCE, pins(volts), 20);
                    assert_eq!(slow.flags(), flags::TEMPERATURE_LEFT_OUT[pin]);
                    assert!((slow.temp_c() - 25.0).abs() < 0.02, "{}", slow.temp_c());
                }
                // As read it is told all the same.
                let read = slow.gyro_temps_c()[pin];
                assert!(!(-150.0..150.0).contains(&read), "{read}");
                // And is back as soon as it is.
                slow.update(20 * REFERENCE, pins([2.5; 3]), 20);
                assert_eq!(slow.flags(), 0);
            }
        }
    }

    #[test]
    fn without_any_temperature_the_last_good_one_holds_and_without_that_25_degrees() {
        let mut slow = settled(2.5, 2.5 + 0.0084 * 15.0, 3.3, 5);
        for _ in 0..500 {
            slow.update(20 * REFERENCE, pins([0.0; 3]), 20);
        }
        assert!((slow.temp_c() - 40.0).abs() < 0.02, "{}", slow.temp_c());
        let all = flags::TEMPERATURE_LEFT_OUT.iter().sum::<u16>() | flags::NO_TEMPERATURE;
        assert_eq!(slow.flags(), all);
        let mut slow = Slow::NEW;
        slow.update(20 * REFERENCE, pins([0.0; 3]), 20);
        assert_eq!((slow.temp_c(), slow.flags()), (25.0, all));
    }

    #[test]
    fn a_reference_that_comes_off_moves_neither_a_rate_nor_a_temperature() {
        let mut slow = settled(2.5, 2.5, 3.3, 5);
        for _ in 0..50 {
            slow.update(0, pins([2.5; 3]), 20);
            assert_eq!(slow.flags(), flags::NO_REFERENCE);
            let read = sum(1.5, 3.3) as f32 * slow.gyro_volts();
            assert!((read - 2.5).abs() < 1e-3, "{read}");
            assert!((slow.temp_c() - 25.0).abs() < 0.1, "{}", slow.temp_c());
        }
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
            slow.update(nominal.saturating_add_signed(sign), [nominal; 3], 1);
        }
        assert!((slow.reference.value + NOMINAL_REFERENCE - nominal as f32).abs() < 0.1);
        // A step of the reference: when the second is full the mean is halfway, and after three time constants more e⁻³ of that
        // half is left.
        for _ in 0..500 + 3000 {
            slow.update(nominal + 200, [nominal; 3], 1);
        }
        let left = f64::from(nominal as f32 + 200.0 - (slow.reference.value + NOMINAL_REFERENCE));
        assert!((left - 100.0 * (-3.0_f64).exp()).abs() < 0.1, "{left}");
    }

    #[test]
    fn the_accelerometer_reads_half_its_supply_at_half_scale() {
        let read = SUM_FULL_SCALE as f32 * 0.5 * ACCEL_VOLTS;
        assert!((read - 1.65).abs() < 1e-6);
    }
}
