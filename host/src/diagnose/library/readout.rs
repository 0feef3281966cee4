//! Errors that are a function of the converter's code.
//!
//! A converter adds up the weights of the bits that it finds, and a capacitor that is off makes one of them worth more or less
//! than the others say. The error is then a step wherever the bit turns, as high as the weight is wrong, and in the readings
//! of all channels alike: they share the converter. Neither its width nor its scale has to be told. Readings are multiples of a
//! step (of a code, or of a fraction of one where several are averaged), powers of two times that are the weights, and the
//! largest within the range of the readings is the first that can be seen.
//!
//! Noise carries a reading across a turn and back, so over a dwell a bit is set for a share of the time: that is what a mean
//! depends on, and it bends where the code jumps.

use statrs::function::erf::erfc;

use super::all_axes;
use crate::diagnose::effect::{Coefficient, Effect, Form, FormKind, Moment};
use crate::dwell::Sensor;

const BITS: [Coefficient; 9] = [
    all_axes("bit 0", "1"),
    all_axes("bit -1", "1"),
    all_axes("bit -2", "1"),
    all_axes("bit -3", "1"),
    all_axes("bit -4", "1"),
    all_axes("bit -5", "1"),
    all_axes("bit -6", "1"),
    all_axes("bit -7", "1"),
    all_axes("bit -8", "1"),
];

const WEIGHT: Option<Form> = Some(Form {
    name: "weight_of_bit_0_raw",
    from: 0.0,
    to: f64::INFINITY,
    kind: FormKind::Steps,
});

/// STM32H743: integral nonlinearity of 4 to 12 in 65536, which is 6 in the 32768 of the first bit.
const TYPICAL: f64 = 2e-4;
const NEEDS: &str = "raw readings as the converter gave them, at many levels over its range";
const ABOUT: &str = "bits of the converter are worth more or less than they say: error by the code, alike on all axes";

pub(super) const EFFECTS: [Effect; 2] = [
    Effect {
        id: "gyro_readout_code",
        sensor: Sensor::Gyro,
        about: ABOUT,
        coefficients: &BITS,
        typical: &[TYPICAL; 9],
        form: WEIGHT,
        regressors: bits,
        needs: NEEDS,
    },
    Effect {
        id: "accel_readout_code",
        sensor: Sensor::Accel,
        about: ABOUT,
        coefficients: &BITS,
        typical: &[TYPICAL; 9],
        form: WEIGHT,
        regressors: bits,
        needs: NEEDS,
    },
];

/// Of each bit, from `weight` on downwards, and of each axis: what 1 of `weight` too much in that of the bit adds, SI.
fn bits(at: &Moment, weight: f64, out: &mut [f64]) {
    let reading = &at.reading;
    let mut of_bit = weight;
    for all in out.as_chunks_mut::<3>().0 {
        for (i, out) in all.iter_mut().enumerate() {
            *out = weight * share_set(reading.mean[i], reading.sd[i], of_bit) / reading.scale[i];
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
    let (mean, sd) = (mean / weight, sd / weight);
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
    let odd = |turn: f64| turn.rem_euclid(2.0) == 1.0;
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
