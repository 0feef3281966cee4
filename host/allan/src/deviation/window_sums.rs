//! Sums of the integral over windows of any length, for the modified Allan variance.
//!
//! Its term is a sum of m neighbouring second differences. With windows of m it is `W(j+2m) - 2 W(j+m) + W(j)`, and the next term adds one
//! third difference: O(N) for any m. Such updates accumulate rounding errors, and can neither begin in the middle nor skip ahead. The
//! running sum of the integral is therefore kept at every 64th sample (3 % more memory), and any term costs four look-ups and at most 252
//! additions.

use std::ops::Range;

use super::differences::difference;

/// Samples from one kept running sum to the next.
pub const BLOCK: usize = 64;
/// Number of runs of terms that are updated at the same time: a single one would wait for its own additions.
const RUNS: usize = 4;
/// Number of terms in a run; the next run starts from the kept sums again.
const RUN: usize = 1024;

/// A series with its running sum at every 64th sample.
pub struct WindowSums<'a> {
    x: &'a [f64],
    /// Sum of all samples before the k-th kept one, as the unevaluated sum of two numbers. With one, its last
    /// digit is 6e-5 for 1e8 samples of unit white rates (the sum reaches 3e11), and worse for redder ones.
    before: Vec<[f64; 2]>,
}

impl<'a> WindowSums<'a> {
    /// One pass over the integral.
    pub fn new(x: &'a [f64]) -> Self {
        let blocks = x.len() / BLOCK;
        let mut before = Vec::with_capacity(blocks + 1);
        let [mut high, mut low] = [0.0_f64; 2];
        before.push([high, low]);
        for block in 0..blocks {
            let part = sum(&x[block * BLOCK..][..BLOCK]);
            let next = high + part;
            // Knuth's error-free addition: which of the two is larger changes along the way.
            let back = next - high;
            low += (high - (next - back)) + (part - back);
            high = next;
            before.push([high, low]);
        }
        Self { x, before }
    }

    /// Sum of the squares of every `stride`-th term of those that begin in `positions`, from the first, for
    /// clusters of `m`.
    pub fn sum_of_squares(&self, m: usize, stride: usize, positions: Range<usize>) -> f64 {
        match stride {
            1 => positions
                .clone()
                .step_by(RUN * RUNS)
                .map(|from| self.consecutive(m, from, (RUN * RUNS).min(positions.end - from)))
                .sum(),
            _ => positions
                .step_by(stride)
                .map(|j| self.term(m, j).powi(2))
                .sum(),
        }
    }

    /// `W(j+2m) - 2 W(j+m) + W(j)`.
    fn term(&self, m: usize, j: usize) -> f64 {
        let x = self.x;
        if m <= BLOCK {
            // As cheap as the windows. Their sums of 64 samples have 64 times the rounding error of the integral, which would show here.
            let second = |i: usize| difference(&[x[i], x[i + m], x[i + 2 * m]]);
            return (j..j + m).map(second).sum();
        }
        let sums = [0, 1, 2, 3].map(|k| {
            let at = j + k * m;
            let [high, low] = self.before[at / BLOCK];
            [high, low + sum(&x[at / BLOCK * BLOCK..at])]
        });
        difference(&sums.map(|[high, _]| high)) + difference(&sums.map(|[_, low]| low))
    }

    /// Sum of the squares of `n` consecutive terms.
    fn consecutive(&self, m: usize, from: usize, n: usize) -> f64 {
        let each = n / RUNS;
        let mut total = 0.0;
        if each > 0 {
            let starts: [usize; RUNS] = std::array::from_fn(|r| from + r * each);
            let mut terms = starts.map(|j| self.term(m, j));
            let mut squares = terms.map(|t| t * t);
            let taps = starts.map(|j| [0, 1, 2, 3].map(|k| &self.x[j + k * m..][..each - 1]));
            for i in 0..each - 1 {
                for r in 0..RUNS {
                    let [a, b, c, d] = taps[r];
                    terms[r] += difference(&[a[i], b[i], c[i], d[i]]);
                    squares[r] += terms[r] * terms[r];
                }
            }
            total = squares.iter().sum();
        }
        for j in from + RUNS * each..from + n {
            total += self.term(m, j).powi(2);
        }
        total
    }
}

fn sum(samples: &[f64]) -> f64 {
    let (rows, rest) = samples.as_chunks::<4>();
    let mut lanes = [0.0; 4];
    for row in rows {
        for (lane, v) in lanes.iter_mut().zip(row) {
            *lane += v;
        }
    }
    lanes.iter().sum::<f64>() + rest.iter().sum::<f64>()
}
