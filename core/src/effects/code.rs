//! Errors of a converter by the bits of its code.

use nalgebra::{RealField, convert};

/// Bits of a code that may err, from the highest.
pub(super) const BITS: usize = 9;

/// Weights of bit 0 that the reading of code 0 may be away from a reading of 0: farther, rounding in single precision comes near
/// what a converter's codes are kept away from their turns by.
pub const FARTHEST_ZERO: f64 = 64.0;

/// Errors of the converter of one axis by the bits of its code, nine of them: in two tables, as a table of all would be ten times as
/// large.
#[derive(Debug, Clone, Copy)]
pub(super) struct Code<T> {
    /// Codes of the last bit, 1/raw.
    codes: T,
    /// Codes of the last bit at reading 0, and [`ABOVE_ZERO`]: in one constant, so that a reading is at its code by one product and one
    /// sum wherever the code is 0.
    at_zero: T,
    /// Errors, raw, by bits 0 to -3, and by bits -4 to -8; the least bit of an index is the last bit.
    first: [T; 16],
    last: [T; 32],
}

/// A multiple of what nine bits can count: keeps codes down to 32 weights below the zero positive, and their bits the same. More would
/// cost what single precision resolves, 1/1024 here. And half a code, where the last bit is worth 128: codes that are that of
/// a turn would be on either side by rounding.
const ABOVE_ZERO: f64 = 8192.0 + 1.0 / 256.0;

impl<T: RealField + Copy> Code<T> {
    /// Of errors in units of the weight of bit 0, `weight`, raw, where the reading `zero`, raw, has code 0.
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

    /// A reading without its error, raw. The error is one of the code that the reading should have had, so the code is looked at
    /// again without it; where that changes the error by more than it is, beside the turn of a bit that is far off, it would lead away.
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
        // Saturates: of no number it is 0.
        let bits = codes as u32;
        self.first[((bits >> 5) & 15) as usize] + self.last[(bits & 31) as usize]
    }
}

/// Sum of the errors of the bits that are set; the least bit is the last error.
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
