//! Transform of a whole series.

use std::f64::consts::TAU;

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

/// Fourier transform of a series, padded with zeros to a length with a fast transform. That of 10 801 000 samples, which have the factor
/// 1543, takes as long as that of three times as many.
pub(super) struct Transform {
    /// Bins from zero up.
    pub bins: Vec<Complex<f64>>,
    /// Samples with the padding.
    pub length: usize,
    /// Samples of the series.
    pub samples: usize,
}

impl Transform {
    /// Transforms `rates` without the line `first + slope i`.
    pub fn of(rates: &[f64], [first, slope]: [f64; 2]) -> Self {
        let length = smooth(rates.len());
        let transform = RealFftPlanner::new().plan_fft_forward(length);
        let mut input = Vec::with_capacity(length);
        let each = rates.iter().enumerate();
        input.extend(each.map(|(i, rate)| rate - (first + slope * i as f64)));
        input.resize(length, 0.0);
        let mut bins = transform.make_output_vec();
        // Fails only for buffers of the wrong length.
        let _ = transform.process(&mut input, &mut bins);
        Self {
            bins,
            length,
            samples: rates.len(),
        }
    }

    /// The padded series, times its length.
    pub fn inverse(mut self) -> Vec<f64> {
        let transform = RealFftPlanner::new().plan_fft_inverse(self.length);
        let mut output = transform.make_output_vec();
        // The ends are real.
        self.bins[0].im = 0.0;
        if let (Some(last), true) = (self.bins.last_mut(), self.length.is_multiple_of(2)) {
            last.im = 0.0;
        }
        let _ = transform.process(&mut self.bins, &mut output);
        output
    }

    /// Distance of the bins, rad a sample.
    pub fn step(&self) -> f64 {
        TAU / self.length as f64
    }
}

/// The least even number of at least `n` without factors other than 2, 3 and 5.
fn smooth(n: usize) -> usize {
    let mut best = n.next_power_of_two().max(2);
    let mut fives = 1;
    while fives < best {
        let mut threes = fives;
        while threes < best {
            let twos = n.div_ceil(threes).next_power_of_two().max(2);
            best = best.min(threes * twos);
            threes *= 3;
        }
        fives *= 5;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_is_padded_to_the_next_even_one_of_small_factors() {
        for (n, padded) in [
            (1, 2),
            (7, 8),
            (15, 16),
            (97, 100),
            (1_000_000, 1_000_000),
            (10_801_000, 10_935_000),
        ] {
            assert!(smooth(n) >= n);
            assert_eq!(smooth(n), padded);
        }
    }
}
