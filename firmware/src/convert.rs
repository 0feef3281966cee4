//! Sums of converter codes, and their conversion to volts and °C.
//!
//! A sample is the sum of [`SCANS`] conversions of every channel. It stays an integer until it is converted to volts, so the order of
//! additions does not matter and averaging loses nothing.
//! # What is removed
//!
//! The gyros' outputs are absolute, but the converter measures in units of its reference, the board's 3.3 V supply: a drift of 1 % would
//! look like 5 deg/s. The 2.5 V reference of gyro x is therefore converted too, through an equal divider. A ratio to it does not depend on
//! the supply or on the dividers. The accelerometer's output is proportional to that supply, so its codes do not depend on it.

use core::ops::AddAssign;

use heapless::Vec;
use mimu_core::PerSensor;
use mimu_core::compensation::Sample;
use mimu_core::wire::{Triad, flags};
use nalgebra::Vector3;

use crate::board::{REFERENCE_V, SCANS};
use crate::channels::Channels;
use crate::design_parameters::{
    ACCEL_NULL_V, ACCEL_RANGE_G, ACCEL_SENSITIVITY_V_PER_G, ACCEL_STOP_MARGIN_V, ACCEL_STOPS_V,
    DIVIDER_RATIO, GYRO_NULL_V, GYRO_RANGE_DPS, GYRO_REFERENCE_V, GYRO_SENSITIVITY_V_PER_DPS,
    GYRO_STOP_MARGIN_V, GYRO_STOPS_V, GYRO_TEMPERATURE_NULL_C, GYRO_TEMPERATURE_NULL_V,
    GYRO_TEMPERATURE_V_PER_C, RADIANS, REFERENCE_TOLERANCE, SAMPLE_HZ, STANDARD_GRAVITY,
};
use crate::front_end::FrontEnd;
use crate::lag::Lag;
use crate::source::{Counts, Scan, Source, THERMOMETERS};
use crate::temperature::Thermometer;

/// The code at the converter's reference voltage: full scale is 2^16 - 1 (RM0433 25.4.35).
pub const FULL_SCALE: u32 = u16::MAX as u32;

/// A sum at the end of the range.
pub const SUM_FULL_SCALE: u32 = SCANS as u32 * FULL_SCALE;

/// Bits of a sum with a sign.
const SUM_BITS: u8 = (SUM_FULL_SCALE.ilog2() + 2) as u8;
const _: () = assert!(SUM_BITS <= 24, "a sum is sent in three bytes");

/// Volts at the accelerometer per unit of its sum, 25.2 µV. With the nominal reference, because it is ratiometric.
pub const ACCEL_VOLTS: f32 = REFERENCE_V / SUM_FULL_SCALE as f32;

/// The sum of the gyros' reference at nominal voltages: 2.5 V after the divider.
pub const NOMINAL_REFERENCE: f32 =
    GYRO_REFERENCE_V * DIVIDER_RATIO / REFERENCE_V * SUM_FULL_SCALE as f32;

/// The analog sensors behind the converter: their slow quantities, filtered, which are the gyros' reference and temperatures.
///
/// Each batch is checked before filtering: the filter would hide a pin that has just come off, and would be distorted by it for seconds.
#[derive(Clone, Copy, Debug)]
pub struct Analog {
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

impl Analog {
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

    /// Processes `count` samples: totals of the sums of the reference and of the three temperatures.
    fn follow(&mut self, reference: u32, temperatures: [u32; 3], count: u32) {
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

    /// Temperatures of the TEMP pins of gyro x, y, z, °C, including pins that are not used.
    pub fn gyro_temps_c(&self) -> [f32; 3] {
        self.pins_c.map(|pin| pin.value)
    }

    /// Which of them are used.
    pub fn temperatures_that_count(&self) -> [bool; 3] {
        self.thermometer.that_count()
    }
}

/// Totals of a scan's slow channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlowSums {
    /// The gyros' reference.
    pub reference: u32,
    /// The TEMP pins of gyro x, y, z.
    pub temperature: [u32; 3],
}

impl AddAssign for SlowSums {
    fn add_assign(&mut self, other: Self) {
        self.reference += other.reference;
        for (total, sum) in self.temperature.iter_mut().zip(other.temperature) {
            *total += sum;
        }
    }
}

/// Time between samples, µs. The converter's clock is the crystal's, so this is exact.
const SAMPLE_US: u64 = 1_000_000 / SAMPLE_HZ as u64;

/// A sample of the converter as the pipeline takes it. `number` does not wrap, so that time goes on after 49.7 days, when the number in the stream wraps.
pub fn scan(number: u64, channels: &Channels<u32>) -> Scan<SlowSums> {
    let signed = |sums: [u32; 3]| sums.map(|sum| sum as i32);
    Scan {
        number: number as u32,
        tick_us: number * SAMPLE_US,
        period_ns: SAMPLE_US as u32 * 1000,
        counts: Counts {
            gyro: signed(channels.gyro),
            accel: signed(channels.accel),
        },
        slow: SlowSums {
            reference: channels.reference,
            temperature: channels.temperature,
        },
    }
}

impl Source for Analog {
    type Slow = SlowSums;

    const TRIADS: PerSensor<Triad<'static>> = PerSensor {
        gyro: Triad {
            part: "ADXRS300",
            unit: "V",
            bits: SUM_BITS,
            range: GYRO_RANGE_DPS * RADIANS,
            null: GYRO_NULL_V,
            per_si: GYRO_SENSITIVITY_V_PER_DPS / RADIANS,
            rate_hz: SAMPLE_HZ as f32,
            filter: "40 Hz",
        },
        accel: Triad {
            part: "MMA7260QT",
            unit: "V",
            bits: SUM_BITS,
            range: ACCEL_RANGE_G * STANDARD_GRAVITY,
            null: ACCEL_NULL_V,
            per_si: ACCEL_SENSITIVITY_V_PER_G / STANDARD_GRAVITY,
            rate_hz: SAMPLE_HZ as f32,
            filter: "1.6 kHz",
        },
    };

    const PLACES: &'static str = "gyro_x,gyro_y,gyro_z";

    fn new(kept: &FrontEnd) -> Self {
        kept.pins_c.map_or(Self::NEW, Self::of_pins)
    }

    fn keep(&self, kept: &mut FrontEnd) {
        kept.pins_c = self.thermometer.to_keep(kept.pins_c);
    }

    fn update(&mut self, total: &SlowSums, count: u32) {
        self.follow(total.reference, total.temperature, count);
    }

    fn begun(&self) -> bool {
        self.pins_c[0].samples > 0.0
    }

    fn scale(&self) -> PerSensor<f32> {
        PerSensor {
            gyro: self.gyro_volts(),
            accel: ACCEL_VOLTS,
        }
    }

    fn is_saturated(_: &Counts, raw: &Sample<f32>) -> bool {
        let at_a_stop = |volts: &Vector3<f32>, [low, high]: [f32; 2], margin: f32| {
            volts.min() <= low + margin || volts.max() >= high - margin
        };
        at_a_stop(&raw.gyro, GYRO_STOPS_V, GYRO_STOP_MARGIN_V)
            || at_a_stop(&raw.accel, ACCEL_STOPS_V, ACCEL_STOP_MARGIN_V)
    }

    /// From the pins that are used.
    fn temp_c(&self) -> f32 {
        match self.has_known_temperature() {
            true => self.temp_c.value,
            false => GYRO_TEMPERATURE_NULL_C,
        }
    }

    fn has_known_temperature(&self) -> bool {
        self.temp_c.samples > 0.0
    }

    fn temperatures_c(&self) -> Vec<f32, THERMOMETERS> {
        Vec::from_array(self.pins_c.map(|pin| pin.value))
    }

    fn flags(&self) -> u16 {
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
    fn settled(reference_v: f64, temp_v: f64, vref_v: f64, seconds: u32) -> Analog {
        let mut slow = Analog::NEW;
        for _ in 0..seconds * 50 {
            let reference = 20 * sum(reference_v * 0.6, vref_v);
            slow.follow(reference, [20 * sum(temp_v * 0.6, vref_v); 3], 20);
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
                    slow.follow(20 * REFERENCE, pins(volts), 20);
                    assert_eq!(slow.flags(), flags::TEMPERATURE_LEFT_OUT[pin]);
                    assert!((slow.temp_c() - 25.0).abs() < 0.02, "{}", slow.temp_c());
                }
                // As read it is told all the same.
                let read = slow.gyro_temps_c()[pin];
                assert!(!(-150.0..150.0).contains(&read), "{read}");
                // And is back as soon as it is.
                slow.follow(20 * REFERENCE, pins([2.5; 3]), 20);
                assert_eq!(slow.flags(), 0);
            }
        }
    }

    #[test]
    fn without_any_temperature_the_last_good_one_holds_and_without_that_25_degrees() {
        let mut slow = settled(2.5, 2.5 + 0.0084 * 15.0, 3.3, 5);
        for _ in 0..500 {
            slow.follow(20 * REFERENCE, pins([0.0; 3]), 20);
        }
        assert!((slow.temp_c() - 40.0).abs() < 0.02, "{}", slow.temp_c());
        let all = flags::TEMPERATURE_LEFT_OUT.iter().sum::<u16>() | flags::NO_TEMPERATURE;
        assert_eq!(slow.flags(), all);
        let mut slow = Analog::NEW;
        slow.follow(20 * REFERENCE, pins([0.0; 3]), 20);
        assert_eq!((slow.temp_c(), slow.flags()), (25.0, all));
    }

    #[test]
    fn a_reference_that_comes_off_moves_neither_a_rate_nor_a_temperature() {
        let mut slow = settled(2.5, 2.5, 3.3, 5);
        for _ in 0..50 {
            slow.follow(0, pins([2.5; 3]), 20);
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
        let mut slow = Analog::NEW;
        let nominal = NOMINAL_REFERENCE.round() as u32;
        for k in 0..500 {
            let sign = [-20, 20][k % 2];
            slow.follow(nominal.saturating_add_signed(sign), [nominal; 3], 1);
        }
        assert!((slow.reference.value + NOMINAL_REFERENCE - nominal as f32).abs() < 0.1);
        // A step of the reference: when the second is full the mean is halfway, and after three time constants more e⁻³ of that
        // half is left.
        for _ in 0..500 + 3000 {
            slow.follow(nominal + 200, [nominal; 3], 1);
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
