//! The quantisation step of raw readings, found from the readings themselves.
//!
//! A converter gives whole codes. If several are averaged, the step is a fraction of a code. A scale to volts makes it any number, and
//! rounding in a text file blurs it. The step is the greatest common divisor of the differences between neighbouring samples, to within
//! that blur. Only neighbours are compared, because converter nonlinearity shifts whole ranges of codes against each other.

/// Number of differences kept for a channel.
const KEPT: usize = 4096;
/// Number of differences taken from a block, so that all of a recording is sampled.
const OF_A_BLOCK: usize = 4;
/// Fewer differences do not determine a step.
const FEWEST: usize = 64;
/// Share of the differences that must be multiples, to within [`BLUR`] steps. A wrong bit spoils the differences between samples where it
/// changes: one in twenty, if its period is twenty times the noise.
const MULTIPLES: f64 = 0.85;
/// Largest distance from a multiple, in steps. By chance two fifths of the differences are within it.
const BLUR: f64 = 0.2;
/// The smallest differences are at most this many steps.
const SMALLEST: u32 = 6;
/// Number of different smallest differences that are tried: a wrong bit may have spoilt the first.
const TRIED: usize = 12;

/// Takes the samples of a channel in a stream.
#[derive(Debug, Clone)]
pub struct QuantisationFinder {
    differences: Vec<f64>,
    /// One in this many blocks is used.
    every: u64,
    blocks: u64,
}

impl Default for QuantisationFinder {
    fn default() -> Self {
        Self {
            differences: Vec::new(),
            every: 1,
            blocks: 0,
        }
    }
}

impl QuantisationFinder {
    /// Looks at the samples of a block.
    pub fn push(&mut self, samples: &[f64]) {
        self.blocks += 1;
        if !self.blocks.is_multiple_of(self.every) {
            return;
        }
        let moved = samples.windows(2).map(|w| (w[1] - w[0]).abs());
        self.differences
            .extend(moved.filter(|d| *d > 0.0 && d.is_finite()).take(OF_A_BLOCK));
        if self.differences.len() > KEPT {
            // Keeps every other block, of those seen and of those to come.
            let mut index = 0_usize;
            self.differences.retain(|_| {
                index += 1;
                (index / OF_A_BLOCK).is_multiple_of(2)
            });
            self.every *= 2;
        }
    }

    /// The step, raw; `None` if the readings have no step, or too few of them differ.
    pub fn find(mut self) -> Option<f64> {
        self.differences.sort_by(f64::total_cmp);
        if self.differences.len() < FEWEST {
            return None;
        }
        let mut smallest: Vec<f64> = Vec::new();
        for d in &self.differences {
            if smallest.last().is_none_or(|last| *d > last * (1.0 + 1e-6)) {
                smallest.push(*d);
            }
            if smallest.len() == TRIED {
                break;
            }
        }
        let tried = (1..=SMALLEST).flat_map(|k| smallest.iter().map(move |d| d / f64::from(k)));
        tried
            .filter_map(|guess| self.fits(guess))
            .max_by(f64::total_cmp)
    }

    /// The step near `guess` that the differences are multiples of, if they are.
    fn fits(&self, guess: f64) -> Option<f64> {
        let (mut of_both, mut of_squares, mut step) = (0.0, 0.0, guess);
        let mut multiples = 0;
        // Small differences first: they make the step exact enough to count the steps of large ones.
        for &d in &self.differences {
            let n = (d / step).round();
            if n > 0.0 && (d - n * step).abs() < BLUR * step {
                multiples += 1;
                of_both += n * d;
                of_squares += n * n;
                step = of_both / of_squares;
            }
        }
        (f64::from(multiples) >= MULTIPLES * self.differences.len() as f64).then_some(step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(reading: impl Fn(f64) -> f64) -> Option<f64> {
        let mut finder = QuantisationFinder::default();
        let mut random = mimu_rig::random::Random::new(1, "quantisation");
        let mut uniform = || random.uniform();
        for block in 0..3000 {
            let level = 1.1 + 7e-4 * f64::from(block);
            let samples: Vec<f64> = (0..10)
                .map(|_| reading(level + 5e-3 * (uniform() + uniform())))
                .collect();
            finder.push(&samples);
        }
        finder.find()
    }

    #[test]
    fn codes_scaled_averaged_and_rounded_have_their_step() {
        let code = 3.3 / 65536.0 / 0.694;
        let found = step(|v| (v / code).round() * code).unwrap();
        assert!((found / code - 1.0).abs() < 1e-9, "{found}");
        let found = step(|v| (v / code * 4.0).round() * code / 4.0).unwrap();
        assert!((found / code * 4.0 - 1.0).abs() < 1e-9, "{found}");
        // Six decimals of volts in a text file.
        let found = step(|v| ((v / code).round() * code * 1e6).round() / 1e6).unwrap();
        assert!((found / code - 1.0).abs() < 1e-4, "{found}");
        // The bit of 2048 codes is 5.3 codes too large.
        let wrong = |v: f64| {
            let whole = (v / code).round();
            let set = (whole as u32) & 2048 != 0;
            (whole + if set { 5.3 } else { 0.0 }) * code
        };
        let found = step(wrong).unwrap();
        assert!((found / code - 1.0).abs() < 1e-3, "{found}");
    }

    #[test]
    fn readings_that_are_not_in_steps_have_none() {
        assert_eq!(step(|v| v), None);
        assert_eq!(step(|_| 2.5), None);
    }
}
