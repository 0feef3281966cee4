//! Averaged periodograms (Welch 1967).

use std::f64::consts::TAU;

use rayon::prelude::*;
use realfft::RealFftPlanner;

/// Bins of a Hann window's own noise bandwidth.
pub(super) const NOISE_BINS: f64 = 1.5;
/// Variance of a mean of neighbouring bins behind a Hann window, over that of as many independent ones: `1 + 2 (4/9 + 1/36)`.
pub(super) const BIN_OVERLAP: f64 = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0);
/// Squared correlation of the periodograms of segments that overlap by half, behind a Hann window.
const SEGMENT_OVERLAP: f64 = 1.0 / 36.0;

/// Mean periodogram of segments that overlap by half, each without its mean and behind a Hann window.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Welch {
    /// Distance of the bins, Hz.
    pub df_hz: f64,
    /// Two-sided density by bin from zero, unit²/Hz: white noise N has N².
    pub power: Vec<f64>,
    /// Degrees of freedom of a bin.
    pub dof: f64,
}

impl Welch {
    /// Of `rates` (any unit) that are `dt_s` apart, in segments of `length`, which is even and not longer than they are.
    pub fn of(rates: &[f64], dt_s: f64, length: usize) -> Self {
        let hop = length / 2;
        let segments = (rates.len() - length) / hop + 1;
        let transform = RealFftPlanner::new().plan_fft_forward(length);
        let window = Hann::of(length);
        // Two sums whatever the machine has: the same digits everywhere, and two copies of the longest transform at most.
        let sums = |of: std::ops::Range<usize>| {
            let (mut input, mut output) = (transform.make_input_vec(), transform.make_output_vec());
            let mut scratch = transform.make_scratch_vec();
            let mut sum = vec![0.0; output.len()];
            for segment in of {
                let part = &rates[segment * hop..segment * hop + length];
                window.apply(part, &mut input);
                // Refused only for buffers of another length than its own.
                let _ = transform.process_with_scratch(&mut input, &mut output, &mut scratch);
                for (sum, bin) in sum.iter_mut().zip(&output) {
                    *sum += bin.norm_sqr();
                }
            }
            sum
        };
        let halves = [0..segments / 2, segments / 2..segments];
        let halves: Vec<Vec<f64>> = halves.into_par_iter().map(sums).collect();
        let density = dt_s / (0.375 * length as f64 * segments as f64);
        let both = halves[0].iter().zip(&halves[1]);
        let k = segments as f64;
        Self {
            df_hz: 1.0 / (length as f64 * dt_s),
            power: both.map(|(a, b)| density * (a + b)).collect(),
            dof: 2.0 * k / (1.0 + 2.0 * SEGMENT_OVERLAP * (k - 1.0) / k),
        }
    }
}

/// A Hann window that is computed as it goes: kept, it would be as long as the longest segment.
struct Hann {
    /// Sine and cosine of a step.
    step: [f64; 2],
    length: usize,
}

/// Samples after which its phase is set anew.
const TURNED: usize = 512;

impl Hann {
    fn of(length: usize) -> Self {
        let (sin, cos) = (TAU / length as f64).sin_cos();
        Self {
            step: [sin, cos],
            length,
        }
    }

    /// `part` without its mean and behind the window, into `to`.
    fn apply(&self, part: &[f64], to: &mut [f64]) {
        let n = self.length as f64;
        let mean = part.iter().sum::<f64>() / n;
        let [ds, dc] = self.step;
        let chunks = to.chunks_mut(TURNED).zip(part.chunks(TURNED));
        for (k, (to, part)) in chunks.enumerate() {
            let (mut s, mut c) = (TAU * (k * TURNED) as f64 / n).sin_cos();
            for (to, rate) in to.iter_mut().zip(part) {
                *to = (0.5 - 0.5 * c) * (rate - mean);
                (s, c) = (s * dc + c * ds, c * dc - s * ds);
            }
        }
    }
}

/// The longest even length up to `most` of which a transform is fast: powers of two, and three times them.
pub(super) fn fast_length(most: usize) -> usize {
    let power = 1 << most.max(2).ilog2();
    match 3 * power / 2 <= most && power > 2 {
        true => 3 * power / 2,
        false => power,
    }
}
