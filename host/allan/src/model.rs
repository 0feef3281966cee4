//! The noise model of a channel: N, B, K, Q and R from its overlapping Allan curve, with intervals.
//!
//! IEEE Std 952, annex C: `σ²(τ) = 3 Q²/τ² + N²/τ + (2 ln 2/π) B² + K² τ/3 + R² τ²/2`. `B` is the coefficient; the floor that
//! a plot shows is 0.664 B.

mod covariance;
mod differences;
mod estimate;
mod estimator;
mod selection;
mod terms;
mod unseen;

pub use self::estimator::{Estimator, allan_factors, hadamard_factors};
pub(crate) use self::selection::PLAUSIBLE;
pub use self::terms::{Coefficient, FLOOR, NoiseModel, Reason, Term, Unseen};
