//! The schematic of the board in numbers: what is wired to which pin.
//!
//! Written from the wiring table, not from the firmware's constants, so a mistake in either shows as a wrong voltage.

use mimu_rig::filter::LowPass;
use mimu_rig::pins::Pins;

/// Inputs of ADC1 that exist on the part.
pub const INPUTS: usize = 20;

/// Frequency of the clock that the debugger supplies to the oscillator input, Hz.
pub const HSE_HZ: u64 = 8_000_000;

/// Frequency of the board's crystal for the real-time clock, Hz.
pub const LSE_HZ: u64 = 32_768;

/// Upper and lower resistor of the divider at every output of a gyro, Ω, and the capacitor across the lower one, F.
const DIVIDER: [f64; 2] = [24e3, 36e3];
const DIVIDER_F: f64 = 47e-9;

/// Fraction of a gyro's voltages that reaches the pin.
pub const DIVIDER_RATIO: f64 = DIVIDER[1] / (DIVIDER[0] + DIVIDER[1]);

/// Corner of the divider's low-pass, Hz: both resistors feed the capacitor, 235 Hz.
pub fn divider_bandwidth_hz() -> f64 {
    let parallel = DIVIDER[0] * DIVIDER[1] / (DIVIDER[0] + DIVIDER[1]);
    1.0 / (std::f64::consts::TAU * parallel * DIVIDER_F)
}

/// A voltage of the unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Net {
    /// RATEOUT of the gyro of an axis, behind the divider.
    Rate(usize),
    /// TEMP of the gyro of an axis, behind the divider.
    Temperature(usize),
    /// The 2.5 V reference pin of the gyro of an axis, behind the divider.
    Reference(usize),
    /// Output of the accelerometer along an axis, whose RC filter is part of the unit.
    Force(usize),
}

/// The nets, each with the pin and its input of ADC1.
pub const WIRING: [(Net, &str, usize); 10] = [
    (Net::Rate(0), "PA3", 15),
    (Net::Rate(1), "PC0", 10),
    (Net::Rate(2), "PB1", 5),
    (Net::Force(0), "PA6", 3),
    (Net::Force(1), "PA5", 19),
    (Net::Force(2), "PA4", 18),
    (Net::Temperature(0), "PA0", 16),
    (Net::Temperature(1), "PF11", 2),
    (Net::Temperature(2), "PF12", 6),
    (Net::Reference(0), "PA7", 7),
];

/// Levels that the microcontroller drives at the sensors' own inputs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Drives {
    /// ST1 of all three gyros, PE13 through a 5 V buffer.
    pub st1: bool,
    /// ST2 of all three gyros, PE11 likewise.
    pub st2: bool,
    /// g-Select1 and g-Select2 of the accelerometer, PE9 and PD15.
    pub g_select: [bool; 2],
}

/// The pins of [`Drives`] in the order of its fields: index of the port from A, pin.
pub const DRIVEN: [(usize, u8); 4] = [(4, 13), (4, 11), (4, 9), (3, 15)];

/// Voltages that the converter sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volts {
    /// At each input of ADC1, V.
    pub input: [f64; INPUTS],
    /// VREF+ and the accelerometer's supply, which are one net, V.
    pub rail: f64,
}

impl Volts {
    /// Every pin at ground.
    pub const GROUND: Self = Self {
        input: [0.0; INPUTS],
        rail: 3.3,
    };

    /// Linear interpolation between two times.
    pub fn between(&self, other: &Self, fraction: f64) -> Self {
        let mix = |a: f64, b: f64| a + fraction * (b - a);
        Self {
            input: std::array::from_fn(|i| mix(self.input[i], other.input[i])),
            rail: mix(self.rail, other.rail),
        }
    }
}

/// State of the filters between the unit and the pins.
#[derive(Debug, Clone)]
pub struct Filters {
    dividers: [LowPass; WIRING.len()],
    started: bool,
}

impl Filters {
    /// The filters at steps of `dt_s`, settled at their first voltages.
    pub fn new(dt_s: f64) -> Self {
        Self {
            dividers: [LowPass::of_bandwidth(divider_bandwidth_hz(), dt_s); WIRING.len()],
            started: false,
        }
    }

    /// Advances one step: voltages at the converter from those at the unit's pins.
    pub fn step(&mut self, pins: &Pins) -> Volts {
        let mut volts = Volts {
            rail: pins.converter_reference_v,
            ..Volts::GROUND
        };
        for (filter, (net, _, input)) in self.dividers.iter_mut().zip(WIRING) {
            let sensor = match net {
                Net::Rate(axis) => pins.gyro_v[axis],
                Net::Temperature(axis) => pins.gyro_temp_v[axis],
                Net::Reference(axis) => pins.gyro_reference_v[axis],
                // The rig's unit has a separate supply for the accelerometer. Here it is the converter's reference, and the outputs are proportional
                // to it.
                Net::Force(axis) => {
                    volts.input[input] = pins.accel_v[axis] / pins.supply_v * volts.rail;
                    continue;
                }
            };
            let divided = DIVIDER_RATIO * sensor;
            if !self.started {
                filter.settle(divided);
            }
            volts.input[input] = filter.step(divided);
        }
        self.started = true;
        volts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_net_has_a_pin_of_its_own() {
        let mut seen = [false; INPUTS];
        for (_, pin, input) in WIRING {
            assert!(!std::mem::replace(&mut seen[input], true), "{pin}");
        }
    }

    #[test]
    fn the_divider_fits_5_25_v_under_the_reference_and_ends_at_235_hz() {
        const { assert!(5.25 * DIVIDER_RATIO < 3.3) }
        assert!((divider_bandwidth_hz() - 235.2).abs() < 0.1);
    }
}
