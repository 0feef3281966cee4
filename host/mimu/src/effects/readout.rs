//! Errors that are a function of the converter's code.
//!
//! A converter adds up the weights of the bits that are set. If a capacitor is off, one bit weighs more or less than its nominal value. The error is
//! then a step wherever that bit changes, as high as the error of its weight. Missing codes, one or a range of them, are a step as well: that of a
//! bit so heavy that it changes once. Axes that share a converter behind a multiplexer share the errors. If each axis has its own converter, or a
//! firmware has subtracted a bias from each, the bits change at different readings on each axis.
//!
//! Readings of a converter are multiples of a step: of a code, or of a fraction of one if several are averaged. The weights of its bits are powers of
//! two times that step, and code 0 reads 0. Converters of any other weight and zero are read from a calibration and removed, but not searched for.
//! Among thousands of periods and phases one always fits a residual by chance, and such a search reported code errors in recordings that had none.
//!
//! Noise carries a reading across a change and back, so over a dwell a bit is set for a share of the time. The mean depends on this share, which
//! rises gradually where the code jumps.

use super::converter::BITS;
use super::effect::{Coefficient, Effect};
use super::regressor::Regressor;
use crate::quantity::Sensor;

/// Coefficients of a converter common to all axes, then of one for each axis.
const COEFFICIENTS: [Coefficient; 4 * BITS] = {
    let mut all = [Coefficient::of_all("", Regressor::Bit(0), TYPICAL); 4 * BITS];
    let mut bit = 0;
    while bit < BITS {
        all[bit] = Coefficient::of_all(NAMES[0][bit], Regressor::Bit(bit), TYPICAL);
        let mut axis = 0;
        while axis < 3 {
            all[first_of(axis) + bit] =
                Coefficient::of(axis, NAMES[1 + axis][bit], Regressor::Bit(bit), TYPICAL);
            axis += 1;
        }
        bit += 1;
    }
    all
};

/// Coefficient of the first bit of a converter of one axis.
pub const fn first_of(axis: usize) -> usize {
    (1 + axis) * BITS
}

#[rustfmt::skip]
const NAMES: [[&str; BITS]; 4] = [
    ["bit 0", "bit -1", "bit -2", "bit -3", "bit -4", "bit -5", "bit -6", "bit -7", "bit -8"],
    ["x bit 0", "x bit -1", "x bit -2", "x bit -3", "x bit -4", "x bit -5", "x bit -6", "x bit -7", "x bit -8"],
    ["y bit 0", "y bit -1", "y bit -2", "y bit -3", "y bit -4", "y bit -5", "y bit -6", "y bit -7", "y bit -8"],
    ["z bit 0", "z bit -1", "z bit -2", "z bit -3", "z bit -4", "z bit -5", "z bit -6", "z bit -7", "z bit -8"],
];

/// STM32H743: integral nonlinearity of 4 to 12 codes of 65536. 6 codes of the 32768 of the first bit are 2e-4.
pub const TYPICAL: f64 = 2e-4;
const NEEDS: &str = "unprocessed readings of the converter, at many levels over its range";
const ABOUT: &str = "converter nonlinearity (INL, DNL): bits weigh more or less than their nominal value, or codes are missing";

const SIZE: &str = "2e-4 of the weight of bit 0 (STM32H743: 4 to 12 codes of 65536)";
const TAKEN_FOR: &str = "scale nonlinearity, a bias beyond a limit";

pub(super) const EFFECTS: &[Effect] = &[
    Effect {
        id: "gyro_readout_code",
        sensor: Sensor::Gyro,
        about: ABOUT,
        coefficients: &COEFFICIENTS,
        parameter: None,
        size: SIZE,
        needs: NEEDS,
        taken_for: TAKEN_FOR,
    },
    Effect {
        id: "accel_readout_code",
        sensor: Sensor::Accel,
        about: ABOUT,
        coefficients: &COEFFICIENTS,
        parameter: None,
        size: SIZE,
        needs: NEEDS,
        taken_for: TAKEN_FOR,
    },
];
