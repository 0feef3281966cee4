//! A filter for slow quantities.

use crate::design_parameters::{SAMPLE_HZ, SLOW_S};

/// A mean over the first [`SLOW_S`], then a first-order lag with that time constant: with the lag alone the noise of the first reading
/// would dominate the first seconds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lag {
    pub value: f32,
    /// Number of samples in the mean so far.
    pub samples: f32,
}

impl Lag {
    pub const NEW: Self = Self {
        value: 0.0,
        samples: 0.0,
    };

    /// Takes in the mean of `count` samples.
    pub fn take(&mut self, mean: f32, count: f32) {
        self.samples = (self.samples + count).min(SLOW_S * SAMPLE_HZ as f32);
        self.value += count / self.samples * (mean - self.value);
    }
}
