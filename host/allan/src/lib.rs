//! Noise of a series at rest: Allan, modified and Hadamard deviation, the noise model behind them, and the lines of its spectrum.
//!
//! | module       | what                                                                       |
//! |--------------|----------------------------------------------------------------------------|
//! | [`deviation`] | overlapping differences of one series, fang (3)-(8)                       |
//! | `power_law`  | power law of the noise at each averaging time                              |
//! | [`bounds`]   | degrees of freedom for it, chi-square bounds                               |
//! | [`curve`]    | all of these at any averaging times                                        |
//! | [`gamma`]    | variances as sums of terms, by maximum likelihood                          |
//! | [`model`]    | N, B, K, Q and R fitted to the whole curve, with intervals                 |
//! | [`variance`] | N, B and K alone, as the variance of a mean                                |
//! | [`spectrum`] | lines and bumps that are not noise of the sensor, and the band in which it is white |

pub mod bounds;
pub mod curve;
pub mod deviation;
pub mod gamma;
pub mod model;
mod power_law;
pub mod spectrum;
pub mod variance;

use std::fmt;

/// Which deviation: of second or of third differences.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deviation {
    /// Overlapping Allan, fang (8).
    Allan,
    /// Modified Allan: distinguishes white from flicker phase noise, and so quantization from noise just above it.
    Modified,
    /// Overlapping Hadamard: blind to a linear drift.
    Hadamard,
}

impl Deviation {
    /// Name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Allan => "Allan",
            Self::Modified => "modified Allan",
            Self::Hadamard => "Hadamard",
        }
    }
}

impl Deviation {
    /// Number of neighbouring means in one difference.
    pub fn order(self) -> usize {
        match self {
            Self::Allan | Self::Modified => 2,
            Self::Hadamard => 3,
        }
    }

    /// Mean square of a difference over the variance, for differences of the integral over one sample.
    pub(crate) fn squares(self) -> f64 {
        match self {
            Self::Allan | Self::Modified => 2.0,
            Self::Hadamard => 6.0,
        }
    }

    /// This variance at `tau` of noise whose Allan variance is 1/τ², 1/τ, 1, τ or τ²; Allan and Hadamard only (NIST SP 1065, table 6).
    pub fn basis(self, tau: f64) -> [f64; 5] {
        let ratios = match self {
            Self::Allan | Self::Modified => [1.0; 5],
            Self::Hadamard => {
                let flicker = (256f64 / 27.0).ln() / (4.0 * std::f64::consts::LN_2);
                [10.0 / 9.0, 1.0, flicker, 0.5, 0.0]
            }
        };
        let allan = [1.0 / (tau * tau), 1.0 / tau, 1.0, tau, tau * tau];
        std::array::from_fn(|k| allan[k] * ratios[k])
    }

    /// Number of differences that `points` of the integral have at cluster length `m`.
    pub(crate) fn terms(self, points: usize, m: usize) -> usize {
        match self {
            Self::Allan => points.saturating_sub(2 * m),
            Self::Hadamard => points.saturating_sub(3 * m),
            Self::Modified => (points + 1).saturating_sub(3 * m),
        }
    }
}

/// A sample that cannot be averaged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NotFinite {
    /// Its index in the series.
    pub sample: usize,
    /// The sample.
    pub value: f64,
}

impl fmt::Display for NotFinite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { sample, value } = self;
        write!(f, "sample {sample}: {value} cannot be averaged")
    }
}

impl std::error::Error for NotFinite {}

/// Averaging times to compute.
#[derive(Debug, Clone, PartialEq)]
pub enum Spacing {
    /// Powers of two of the sample period.
    Octave,
    /// This many per decade, rounded to whole samples, each once.
    PerDecade(usize),
    /// These numbers of samples.
    Samples(Vec<usize>),
}

/// One point of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Averaging factor, samples.
    pub m: usize,
    /// Averaging time, s.
    pub tau_s: f64,
    /// Deviation, unit of the series.
    pub deviation: f64,
    /// Number of differences in the mean.
    pub terms: usize,
    /// Power law of frequency noise `S(f) ~ f^alpha` found at this time: 0 white (N), -1 flicker (B), -2 random walk (K), 2
    /// white phase (Q).
    pub alpha: i32,
    /// Equivalent degrees of freedom of the squared deviation, for that power law.
    pub edf: f64,
    /// Bounds of a confidence interval, unit of the series.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
    /// Standard deviation as if clusters did not overlap and were independent, fang (7): deviation times `1/√(2 (N/n - 1))`, for
    /// comparison.
    pub sigma_independent: f64,
}
