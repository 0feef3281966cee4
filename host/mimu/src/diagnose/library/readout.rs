//! Errors that are a function of the converter's code.
//!
//! A converter adds up the weights of the bits that it finds, and a capacitor that is off makes one of them worth more or less
//! than the others say. The error is then a step wherever the bit turns, as high as the weight is wrong. Codes that never come, one or
//! a range of them, are a step as well: that of a bit so heavy that it turns once. Where the axes share the converter, as they do
//! behind a multiplexer, they share the errors; where each has its own, or a firmware has subtracted a bias from each, the bits
//! turn elsewhere on each.
//!
//! Readings of one converter are multiples of a step: of a code, or of a fraction of one where several are averaged. The weights of
//! its bits are powers of two times that, from a code 0 that reads 0. Converters of any other weight and zero are read from a
//! calibration and removed, but not searched for: among thousands of periods and phases one is always near a residual, and such a
//! search named codes in recordings that had none.
//!
//! Noise carries a reading across a turn and back, so over a dwell a bit is set for a share of the time: that is what a mean
//! depends on, and it bends where the code jumps.

use statrs::function::erf::erfc;

use super::{all_axes, of};
use crate::diagnose::effect::{Coefficient, Effect, Moment};
use crate::quantity::Sensor;

/// Bits that are told apart, from the first down.
pub const BITS: usize = 9;

/// Of a converter of all axes, and then of each axis.
const COEFFICIENTS: [Coefficient; 4 * BITS] = {
    let mut all = [all_axes("", "1"); 4 * BITS];
    let mut bit = 0;
    while bit < BITS {
        all[bit] = all_axes(NAMES[0][bit], "1");
        let mut axis = 0;
        while axis < 3 {
            all[first_of(axis) + bit] = of(axis, NAMES[1 + axis][bit], "1");
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

/// STM32H743: integral nonlinearity of 4 to 12 in 65536, which is 6 in the 32768 of the first bit.
pub const TYPICAL: f64 = 2e-4;
const NEEDS: &str = "raw readings as the converter gave them, at many levels over its range";
const ABOUT: &str = "bits of the converter are worth more or less than they say, or codes never come: error by the code";

pub(super) static EFFECTS: [Effect; 2] = [
    Effect {
        id: "gyro_readout_code",
        sensor: Sensor::Gyro,
        about: ABOUT,
        coefficients: &COEFFICIENTS,
        typical: &[TYPICAL; 4 * BITS],
        form: None,
        regressors: bits,
        needs: NEEDS,
    },
    Effect {
        id: "accel_readout_code",
        sensor: Sensor::Accel,
        about: ABOUT,
        coefficients: &COEFFICIENTS,
        typical: &[TYPICAL; 4 * BITS],
        form: None,
        regressors: bits,
        needs: NEEDS,
    },
];

/// How the codes of a converter stand behind readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converter {
    /// Of bit 0, raw.
    pub weight: f64,
    /// Reading of code 0, raw.
    pub zero: f64,
}

impl Converter {
    /// One of a given zero.
    pub fn of(weight: f64, zero: f64) -> Self {
        Self { weight, zero }
    }

    /// Share of the time that bit `-bit` is set while readings scatter about `mean` with `sd`, raw.
    pub fn share(&self, bit: usize, mean: f64, sd: f64) -> f64 {
        share_set(mean - self.zero, sd, self.weight * 0.5_f64.powi(bit as i32))
    }
}

/// Whether an effect is one of these.
pub fn is(effect: &Effect) -> bool {
    EFFECTS.iter().any(|e| e.id == effect.id)
}

/// Of each bit of a converter of all axes, and then of each axis: what 1 of the weight of bit 0 too much in that of the bit adds, SI.
///
/// Readings are in units of bit 0, from code 0, which are those of [`Converter`] of each axis.
fn bits(at: &Moment, _: f64, out: &mut [f64]) {
    let reading = &at.reading;
    let (of_all, of_axes) = out.split_at_mut(3 * BITS);
    let mut of_bit = 1.0;
    for (bit, all) in of_all.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        for (axis, out) in all.iter_mut().enumerate() {
            *out = share_set(reading.mean[axis], reading.sd[axis], of_bit) / reading.scale[axis];
            of_axes[axis * BITS + bit] = *out;
        }
        of_bit *= 0.5;
    }
}

/// Weight of the first bit that can be seen to turn, raw: of readings in multiples of `step` from `lowest` to `highest`.
pub fn first_weight(step: f64, lowest: f64, highest: f64) -> f64 {
    let largest = lowest.abs().max(highest.abs());
    let below = step * (largest / step).log2().floor().exp2();
    // The sign of two's complement turns at zero, and nowhere else within the range.
    if lowest < 0.0 && highest > 0.0 {
        2.0 * below
    } else {
        below
    }
}

/// Share of the time that the bit of this weight is set while readings scatter about `mean` with `sd`, both in its unit.
fn share_set(mean: f64, sd: f64, weight: f64) -> f64 {
    // It is the same every two weights; far from the zero there is no number beside the next turn.
    let (mean, sd) = (mean / weight, sd / weight);
    let mean = mean - 2.0 * (0.5 * mean).floor();
    if !mean.is_finite() || !sd.is_finite() {
        return f64::NAN;
    }
    if sd > 0.5 {
        // The bit is a square wave, of which noise leaves the first two harmonics: of the next 10⁻¹⁴.
        use std::f64::consts::PI;
        let harmonic =
            |n: f64| (PI * n * mean).sin() * (-0.5 * (PI * n * sd).powi(2)).exp() * 2.0 / (PI * n);
        return 0.5 - harmonic(1.0) - harmonic(3.0);
    }
    // It turns at every whole number: on at odd ones, off at even ones.
    let reach = 6.0 * sd;
    let (first, last) = ((mean - reach).ceil(), (mean + reach).floor());
    let odd = |turn: f64| (turn as i64) & 1 == 1;
    let mut share = f64::from(u8::from(odd(first - 1.0)));
    let mut turn = first;
    while turn <= last {
        let above = match sd > 0.0 {
            true => 0.5 * erfc((turn - mean) / (sd * std::f64::consts::SQRT_2)),
            false => 1.0,
        };
        share += if odd(turn) { above } else { -above };
        turn += 1.0;
    }
    share
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same by counting codes.
    fn counted(mean: f64, sd: f64, weight: f64) -> f64 {
        let (mut set, mut all) = (0.0, 0.0);
        for k in -4000..=4000 {
            let z = f64::from(k) / 500.0;
            let p = (-0.5 * z * z).exp();
            let code = (mean + sd * z).floor() as i64;
            all += p;
            set += p * f64::from(u8::from(code & weight as i64 != 0));
        }
        set / all
    }

    #[test]
    fn a_bit_is_set_for_the_share_of_the_codes_that_have_it() {
        for sd in [0.0, 3.0, 60.0, 130.0, 400.0] {
            for weight in [64.0, 256.0, 1024.0] {
                for k in -30..60 {
                    let mean = 0.3 + 73.7 * f64::from(k);
                    let off = share_set(mean, sd, weight) - counted(mean, sd, weight);
                    assert!(off.abs() < 6e-3, "{mean} {sd} {weight}: {off}");
                }
            }
        }
    }

    #[test]
    fn the_first_bit_is_the_largest_that_turns() {
        // Codes of 16 bits, 50 µV each, of 1.1 to 3.2 V: that of 32768 codes, 1.6384 V.
        assert!((first_weight(50e-6, 1.1, 3.2) - 1.6384).abs() < 1e-9);
        // Averages of four.
        assert!((first_weight(12.5e-6, 1.1, 3.2) - 1.6384).abs() < 1e-9);
        // Counts with a sign, of 16 bits, a quarter of the range: the sign, by a bit that turns at 0 only.
        assert!((first_weight(1.0, -8000.0, 8100.0) - 8192.0).abs() < 1e-9);
    }
}
