//! Averaged periodograms (Welch 1967).

use std::f64::consts::TAU;

use rayon::prelude::*;
use realfft::RealFftPlanner;

/// Noise bandwidth of a Hann window, bins.
pub(super) const NOISE_BINS: f64 = 1.5;
/// Variance of a mean of neighbouring bins behind a Hann window, over that of as many independent ones: `1 + 2 (4/9 + 1/36)`.
pub(super) const BIN_OVERLAP: f64 = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0);
/// Squared correlation of the periodograms of segments that overlap by half, behind a Hann window.
const SEGMENT_OVERLAP: f64 = 1.0 / 36.0;

/// Longer segments are transformed one after the other: a second copy of those of three hours at 1 kHz would take 60 MB, and the other core
/// computes the other resolutions.
const LONG: usize = 1 << 19;

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
    /// From `rates` (any unit) that are `dt_s` apart, in segments of `length`, which is even and not longer than they are.
    pub fn of(rates: &[f64], dt_s: f64, length: usize) -> Self {
        let hop = length / 2;
        let segments = (rates.len() - length) / hop + 1;
        let transform = RealFftPlanner::new().plan_fft_forward(length);
        let window = Hann::of(length);
        // The number of sums does not depend on the machine, so the digits are the same everywhere.
        let sums = |of: std::ops::Range<usize>| {
            let (mut input, mut output) = (transform.make_input_vec(), transform.make_output_vec());
            let mut scratch = transform.make_scratch_vec();
            let mut sum = vec![0.0; output.len()];
            for segment in of {
                let part = &rates[segment * hop..segment * hop + length];
                window.apply(part, &mut input);
                // Fails only for buffers of the wrong length.
                let _ = transform.process_with_scratch(&mut input, &mut output, &mut scratch);
                for (sum, bin) in sum.iter_mut().zip(&output) {
                    *sum += bin.norm_sqr();
                }
            }
            sum
        };
        let power = match length > LONG {
            true => sums(0..segments),
            false => {
                let halves = [0..segments / 2, segments / 2..segments];
                let mut halves: Vec<Vec<f64>> = halves.into_par_iter().map(sums).collect();
                let second = halves.pop().unwrap_or_default();
                let mut first = halves.pop().unwrap_or_default();
                first.iter_mut().zip(second).for_each(|(a, b)| *a += b);
                first
            }
        };
        let density = dt_s / (0.375 * length as f64 * segments as f64);
        let k = segments as f64;
        Self {
            df_hz: 1.0 / (length as f64 * dt_s),
            power: power.into_iter().map(|p| density * p).collect(),
            dof: 2.0 * k / (1.0 + 2.0 * SEGMENT_OVERLAP * (k - 1.0) / k),
        }
    }

    /// Mean density over neighbouring bins, unit²/Hz, and its degrees of freedom.
    pub fn mean(&self, bins: &[usize]) -> (f64, f64) {
        let n = bins.len() as f64;
        let mean = bins.iter().map(|k| self.power[*k]).sum::<f64>() / n;
        // Segments that overlap by half share 1/6 of the variance of a band; the bins of one, less at the ends of a band.
        let overlap = BIN_OVERLAP * (1.0 - 0.5 / n) + 2.0 / 6.0;
        (mean, self.dof * n / overlap)
    }
}

/// Fewest bins of a band.
const FEWEST_IN_BAND: usize = 4;

/// Root of the mean density of `rates` (any unit, `dt_s` apart) over a band of frequencies, Hz, one-sided, unit/√Hz, with its standard uncertainty. `None` if the
/// series is too short, or its rate too low, for the band.
///
/// Hann windows keep vibration and drift outside the band from leaking into it.
pub fn density_in(rates: &[f64], dt_s: f64, band_hz: [f64; 2]) -> Option<(f64, f64)> {
    let length = fast_length(rates.len() / 2);
    let [from, to] = band_hz.map(|hz| hz * length as f64 * dt_s);
    let bins: Vec<usize> = (from.ceil() as usize..=to as usize).collect();
    if bins.len() < FEWEST_IN_BAND || 2 * bins[bins.len() - 1] >= length {
        return None;
    }
    let (mean, dof) = Welch::of(rates, dt_s, length).mean(&bins);
    let density = (2.0 * mean).sqrt();
    Some((density, 0.5 * density * (2.0 / dof).sqrt()))
}

/// A Hann window that is computed on the fly: stored, it would be as long as the longest segment.
struct Hann {
    /// Cosine and sine of the first [`TURNED`] samples.
    turned: Vec<[f64; 2]>,
    length: usize,
}

/// Number of samples after which its phase is computed anew.
const TURNED: usize = 512;
/// Independent partial sums: one sum waits for its own additions, four cycles each.
const LANES: usize = 8;

impl Hann {
    fn of(length: usize) -> Self {
        let step = TAU / length as f64;
        let turned = (0..TURNED.min(length)).map(|i| {
            let (sin, cos) = (i as f64 * step).sin_cos();
            [cos, sin]
        });
        Self {
            turned: turned.collect(),
            length,
        }
    }

    /// `part` without its mean and behind the window, into `to`.
    fn apply(&self, part: &[f64], to: &mut [f64]) {
        let n = self.length as f64;
        let mean = part[0] + sum_over(part, part[0]) / n;
        let chunks = to.chunks_mut(TURNED).zip(part.chunks(TURNED));
        for (k, (to, part)) in chunks.enumerate() {
            let (sin, cos) = (TAU * (k * TURNED) as f64 / n).sin_cos();
            // Each from a sum of angles instead of its predecessor: the vector unit then takes a fifth of the time.
            for ((to, rate), [c, s]) in to.iter_mut().zip(part).zip(&self.turned) {
                *to = (0.5 - 0.5 * (cos * c - sin * s)) * (rate - mean);
            }
        }
    }
}

/// Sum of `values`, each minus `reference`.
pub(crate) fn sum_over(values: &[f64], reference: f64) -> f64 {
    let mut lanes = [0.0; LANES];
    let (rows, rest) = values.as_chunks::<LANES>();
    for row in rows {
        for (lane, value) in lanes.iter_mut().zip(row) {
            *lane += value - reference;
        }
    }
    lanes.iter().sum::<f64>() + rest.iter().map(|value| value - reference).sum::<f64>()
}

/// The longest even length up to `most` with a fast transform: powers of two, and three times them.
pub(super) fn fast_length(most: usize) -> usize {
    let power = 1 << most.max(2).ilog2();
    match 3 * power / 2 <= most && power > 2 {
        true => 3 * power / 2,
        false => power,
    }
}
