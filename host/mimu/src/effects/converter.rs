//! Relation between a converter's codes and readings, and how often a bit is set.

use statrs::function::erf::erfc;

use super::quantity::{Conditions, Reading};

/// Bits that are distinguished, from the first down.
pub const BITS: usize = 9;

/// Converters of the axes.
pub type Converters = [Option<Converter>; 3];

/// Relation between a converter's codes and readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converter {
    /// Weight of bit 0, raw.
    pub weight: f64,
    /// Reading of code 0, raw.
    pub zero: f64,
}

impl Converter {
    /// A converter with this weight and zero.
    pub fn of(weight: f64, zero: f64) -> Self {
        Self { weight, zero }
    }
}

impl Conditions {
    /// The conditions with each axis's reading in units of its converter's first bit, counted from code 0; not a number for an axis without one.
    pub(crate) fn in_bits(&self, codes: &Converters) -> Self {
        let mut out = *self;
        let Reading { mean, sd, scale } = &mut out.reading;
        for (i, converter) in codes.iter().enumerate() {
            let (weight, zero) = converter.map_or((f64::NAN, 0.0), |c| (c.weight, c.zero));
            mean[i] = (mean[i] - zero) / weight;
            sd[i] /= weight;
            scale[i] /= weight;
        }
        out
    }
}

/// Weight, raw, of the largest bit that changes within readings from `lowest` to `highest` in multiples of `step`.
pub fn first_weight(step: f64, lowest: f64, highest: f64) -> f64 {
    let largest = lowest.abs().max(highest.abs());
    let below = step * (largest / step).log2().floor().exp2();
    // In two's complement the sign bit changes at zero and nowhere else within the range.
    if lowest < 0.0 && highest > 0.0 {
        2.0 * below
    } else {
        below
    }
}

/// Share of the time in which the bit of this weight is set, for readings that scatter about `mean` by `sd`, all three in one unit.
pub(super) fn share_set(mean: f64, sd: f64, weight: f64) -> f64 {
    // The pattern repeats every two weights. Reducing the mean keeps the next turn distinct from this one even far from zero.
    let (mean, sd) = (mean / weight, sd / weight);
    let mean = mean - 2.0 * (0.5 * mean).floor();
    if !mean.is_finite() || !sd.is_finite() {
        return f64::NAN;
    }
    if sd > 0.5 {
        // The bit is a square wave. The noise leaves its first two harmonics; the next one is below 10⁻¹⁴.
        use std::f64::consts::PI;
        let harmonic =
            |n: f64| (PI * n * mean).sin() * (-0.5 * (PI * n * sd).powi(2)).exp() * 2.0 / (PI * n);
        return 0.5 - harmonic(1.0) - harmonic(3.0);
    }
    // The bit changes at every whole number: it is set from odd ones and cleared from even ones.
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

    /// The same share, found by counting codes.
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
        // Codes of 16 bits, 50 µV each, from 1.1 to 3.2 V: the bit of 32768 codes, 1.6384 V.
        assert!((first_weight(50e-6, 1.1, 3.2) - 1.6384).abs() < 1e-9);
        // Averages of four.
        assert!((first_weight(12.5e-6, 1.1, 3.2) - 1.6384).abs() < 1e-9);
        // Signed counts of 16 bits over a quarter of the range: the sign acts as a bit of 8192 that changes only at 0.
        assert!((first_weight(1.0, -8000.0, 8100.0) - 8192.0).abs() < 1e-9);
    }
}
