//! The points of a curve: mean squares of differences of the integral of the rates.

use crate::Deviation;

/// Terms of the Allan variance: 1/τ², 1/τ, 1, τ, τ².
pub(super) const TERMS: usize = 5;
/// 1/τ²: quantization where positive, a low-pass filter where negative.
pub(super) const PHASE: usize = 0;
/// τ²: the ramp.
pub(super) const RAMP: usize = 4;

/// Differences of one kind over one averaging factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Differences {
    /// Allan or Hadamard.
    pub kind: Deviation,
    /// Averaging factor, samples.
    pub m: usize,
}

impl Differences {
    /// Weights of the integral at steps of m.
    pub fn weights(self) -> &'static [f64] {
        match self.kind {
            Deviation::Hadamard => &[-1.0, 3.0, -3.0, 1.0],
            Deviation::Allan | Deviation::Modified => &[1.0, -2.0, 1.0],
        }
    }

    /// Root of the variance of [`Differences::weights`] over that of the point.
    pub fn norm(self) -> f64 {
        self.kind.squares().sqrt() * self.m as f64
    }

    /// Samples that one difference is taken over.
    pub fn span(self) -> usize {
        self.kind.order() * self.m
    }

    /// How many there are in a record of `n` samples.
    pub fn count(self, n: usize) -> usize {
        (n + 1).saturating_sub(self.span())
    }

    /// Expected mean square by term of the noise, each of Allan variance 1 at τ = 1 sample.
    pub fn basis(self) -> [f64; TERMS] {
        self.kind.basis(self.m as f64)
    }

    /// Mean of the differences of a ramp of amplitude 1.
    pub fn ramp(self) -> f64 {
        match self.kind {
            Deviation::Hadamard => 0.0,
            Deviation::Allan | Deviation::Modified => self.m as f64,
        }
    }
}
