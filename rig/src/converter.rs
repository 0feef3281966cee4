//! The microcontroller's converter, and the readings that its firmware reports.

use serde::{Deserialize, Serialize};

use crate::pins::Pins;
use crate::random::Random;
use crate::unit::UnitTruth;

/// Unit of a recording's raw readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum RawUnit {
    /// Volts at the sensors' pins, computed by the device with the nominal reference and divider.
    V,
    /// Codes of the converter, or of a digital part.
    #[serde(rename = "count")]
    Count,
}

/// The converter. Code = nearest whole number to `2^bits · divider · V / reference`, from 0 to `2^bits - 1`.
#[derive(Debug, Clone, PartialEq)]
pub struct ConverterTruth {
    /// Resolution, bits.
    pub bits: u32,
    /// Fraction of a gyro's voltages (rate and reference pin) behind its divider.
    pub gyro_divider: f64,
    /// Fraction of the accelerometer's voltages behind its divider.
    pub accel_divider: f64,
    /// Conversions averaged into one reading.
    pub conversions: u32,
    /// Noise of a single conversion, standard deviation, codes.
    pub noise_codes: f64,
    /// Whether the firmware also converts each gyro's reference pin and half the accelerometer's supply, and reports ratios to them: the converter's
    /// reference then cancels.
    pub take_out_reference: bool,
    /// Unit of the reported readings.
    pub raw_unit: RawUnit,
}

/// Raw readings of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings {
    /// Gyros x, y, z, raw.
    pub gyro: [f64; 3],
    /// Accelerometer x, y, z, raw.
    pub accel: [f64; 3],
    /// Temperature, °C.
    pub temp_c: f64,
}

/// Conversion of one triad.
#[derive(Debug, Clone, Copy)]
struct Channel {
    analog: bool,
    /// Codes per ratio of the voltage at the pin to the true reference.
    gain: f64,
    /// Reported unit per code.
    unit_per_code: f64,
    /// Code of the nominal reference pin, or of half the nominal supply, at the nominal reference.
    expected: f64,
}

/// The converter with its noise.
#[derive(Debug, Clone)]
pub struct Converter {
    gyro: Channel,
    accel: Channel,
    half_supply: f64,
    take_out_reference: bool,
    top: f64,
    conversions: u32,
    noise: f64,
    stream: Random,
}

impl Converter {
    /// The converter behind the pins of a unit. The seed determines its noise.
    pub fn new(truth: &ConverterTruth, unit: &UnitTruth, seed: u64) -> Self {
        let codes = f64::from(truth.bits).exp2();
        let nominal = unit.converter_reference.nominal_v;
        let channel = |analog: bool, divider: f64, known_v: f64| Channel {
            analog,
            gain: divider * codes,
            unit_per_code: match truth.raw_unit {
                RawUnit::V => nominal / (codes * divider),
                RawUnit::Count => 1.0,
            },
            expected: known_v * codes / nominal,
        };
        let pin = unit.gyro_reference_nominal_v * truth.gyro_divider;
        Self {
            gyro: channel(unit.gyro.analog, truth.gyro_divider, pin),
            accel: channel(
                unit.accel.analog,
                truth.accel_divider,
                unit.supply.nominal_v / 2.0,
            ),
            half_supply: codes / 2.0,
            take_out_reference: truth.take_out_reference,
            top: codes - 1.0,
            conversions: truth.conversions,
            noise: truth.noise_codes,
            stream: Random::new(seed, "converter noise"),
        }
    }

    /// Readings that the device reports for the voltages at its pins.
    pub fn read(&mut self, pins: &Pins) -> Readings {
        let per_volt = 1.0 / pins.converter_reference_v;
        let mut gyro = pins.gyro_v;
        if self.gyro.analog {
            for (i, v) in gyro.iter_mut().enumerate() {
                *v = self.gyro.unit_per_code * self.code(*v * self.gyro.gain * per_volt);
                if self.take_out_reference {
                    // A dead pin reads 0; a firmware avoids dividing by it.
                    let pin = self.code(pins.gyro_reference_v[i] * self.gyro.gain * per_volt);
                    *v *= self.gyro.expected / pin.max(1.0);
                }
            }
        } else {
            gyro = gyro.map(digital);
        }
        let mut accel = pins.accel_v;
        if self.accel.analog {
            let mut unit_per_code = self.accel.unit_per_code;
            if self.take_out_reference {
                let pin = self.code(pins.supply_v * self.half_supply * per_volt);
                unit_per_code *= self.accel.expected / pin.max(1.0);
            }
            for v in &mut accel {
                *v = unit_per_code * self.code(*v * self.accel.gain * per_volt);
            }
        } else {
            accel = accel.map(digital);
        }
        Readings {
            gyro,
            accel,
            temp_c: pins.temp_c,
        }
    }

    /// Mean code of the conversions of one reading.
    #[inline]
    fn code(&mut self, exact: f64) -> f64 {
        if self.noise == 0.0 {
            return exact.round().clamp(0.0, self.top);
        }
        let mut sum = 0.0;
        for _ in 0..self.conversions {
            sum += (exact + self.noise * self.stream.normal())
                .round()
                .clamp(0.0, self.top);
        }
        sum / f64::from(self.conversions)
    }
}

/// A 16-bit digital part rounds its own output.
fn digital(exact: f64) -> f64 {
    exact.round().clamp(-32768.0, 32767.0)
}
