//! Overlapping Allan, modified Allan and overlapping Hadamard deviation of one series.
//!
//! All three are differences of the integral x of the rates (x as in "phase"), averaged over every start j:
//!
//! | kind     | differences                                         | how many   | variance                 |
//! |----------|-----------------------------------------------------|------------|--------------------------|
//! | Allan    | `x(j+2m) - 2 x(j+m) + x(j)`                         | N - 2m + 1 | mean square over 2 m²    |
//! | Modified | the same, summed over m neighbouring j              | N - 3m + 2 | mean square over 2 m⁴    |
//! | Hadamard | `x(j+3m) - 3 x(j+2m) + 3 x(j+m) - x(j)`             | N - 3m + 1 | mean square over 6 m²    |
//!
//! for N rates and cluster length m. The first line is fang (8), whose inner sum of rates over m samples is one difference of the integral;
//! the others are NIST SP 1065 (2008), sections 5.2.5 and 5.2.9.

mod differences;
mod integrated;
mod squares;
mod window_sums;

pub(super) use differences::{difference, sums};
pub use integrated::Integrated;
pub(super) use squares::{Plan, Squares, sums_of_squares};
pub(super) use window_sums::BLOCK;

/// In a series of up to this many rates all differences are used.
pub const ALL_TERMS: usize = 1 << 20;
