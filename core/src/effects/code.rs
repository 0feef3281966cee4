//! Errors of a converter as a function of the bits of its code.

use nalgebra::{RealField, convert};

/// Number of bits of a code that may have errors, from the highest.
pub(super) const BITS: usize = 9;

/// Largest distance of the reading of code 0 from a reading of 0, in weights of bit 0. Beyond it, rounding in single precision approaches
/// the margin that keeps codes away from the transitions of their bits.
pub const FARTHEST_ZERO: f64 = 64.0;

/// Errors of one axis's converter for the nine highest bits of its code. Two tables, because a single one would be ten times as large.
#[derive(Debug, Clone, Copy)]
pub(super) struct Code<T> {
    /// Codes per raw unit, in codes of the last bit.
    codes: T,
    /// Code of the reading 0 plus [`ABOVE_ZERO`], in one constant: one product and one sum then give the code, wherever code 0 is.
    at_zero: T,
    /// Errors, raw, of bits 0 to -3 and of bits -4 to -8; the lowest bit of an index is the last of these bits.
    first: [T; 16],
    last: [T; 32],
}

/// A multiple of the nine bits' range: keeps codes down to 32 weights below zero positive, with the same bits. A larger multiple would cost
/// resolution of single precision, 1/1024 here. Plus half a code (the last bit weighs 128), so that rounding does not move a code across
/// the transition of a bit.
const ABOVE_ZERO: f64 = 8192.0 + 1.0 / 256.0;

impl<T: RealField + Copy> Code<T> {
    /// From errors in units of the weight of bit 0. `weight`: that weight, raw; `zero`: the reading of code 0, raw.
    pub fn new(errors: &[T; BITS], weight: T, zero: T) -> Self {
        let raw = errors.map(|error| error * weight);
        let (four, five) = raw.split_at(4);
        let codes = convert::<_, T>(256.0) / weight;
        Self {
            codes,
            at_zero: convert::<_, T>(ABOVE_ZERO) - zero * codes,
            first: core::array::from_fn(|bits| set(four, bits)),
            last: core::array::from_fn(|bits| set(five, bits)),
        }
    }

    /// A reading without its error, raw. The error is a function of the correct code, so it is looked up again at the corrected reading. If
    /// the second error differs from the first by more than the first itself (near the transition of a bit with a large error), the first
    /// is used, because the iteration would diverge.
    pub fn clean(&self, u: T) -> T {
        let first = self.error(u);
        let second = self.error(u - first);
        let moved = second - first;
        match moved * moved < first * first {
            true => u - second,
            false => u - first,
        }
    }

    #[inline(always)]
    fn error(&self, u: T) -> T {
        let codes: f32 = (u * self.codes + self.at_zero).to_subset_unchecked();
        // The conversion saturates; NaN gives 0.
        let bits = codes as u32;
        self.first[((bits >> 5) & 15) as usize] + self.last[(bits & 31) as usize]
    }
}

/// Sum of the errors of the bits that are set; the lowest bit has the last error.
fn set<T: RealField + Copy>(errors: &[T], bits: usize) -> T {
    let mut sum = T::zero();
    let mut left = bits;
    for error in errors.iter().rev() {
        if left & 1 == 1 {
            sum += *error;
        }
        left >>= 1;
    }
    sum
}
