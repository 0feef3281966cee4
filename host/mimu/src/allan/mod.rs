//! Noise from a recording at rest: Allan, modified and Hadamard deviation, and the noise model that follows from them.
//!
//! | module       | what                                                                       |
//! |--------------|----------------------------------------------------------------------------|
//! | [`deviation`] | overlapping deviations of one series, fang (3)-(8), at any averaging times |
//! | [`bounds`]   | power law of the noise at each time, degrees of freedom, chi-square bounds |
//! | [`model`]    | N, B, K, Q and R fitted to the whole curve, with intervals                 |
//! | [`recording`] | the stretch of a recording that is used, its channels' curves and models  |
//! | [`plot`], [`units`] | the curves as SVG; units of the coefficients as people write them   |

pub mod bounds;
pub mod deviation;
pub mod model;
pub mod recording;
pub mod units;

/// Which variance of second or third differences.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Overlapping Allan, fang (8).
    Allan,
    /// Modified Allan: tells white from flicker phase noise, that is quantization from what is just above it.
    Modified,
    /// Overlapping Hadamard: blind to a linear drift.
    Hadamard,
}

impl Kind {
    /// Name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Allan => "Allan",
            Self::Modified => "modified Allan",
            Self::Hadamard => "Hadamard",
        }
    }
}

/// Averaging times to compute.
#[derive(Debug, Clone, PartialEq)]
pub enum Spacing {
    /// Powers of two of the sample period.
    Octave,
    /// So many a decade, rounded to whole samples, each once.
    PerDecade(usize),
    /// These many samples.
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
    /// Differences that were averaged over.
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
    /// Half of a one-sigma interval by fang (7): deviation times `1/√(2 (N/n - 1))`, for comparison.
    pub fang_7: f64,
}
