//! Differences, and their sums over all positions of a stencil in a long series: the one inner loop of this module.

use std::ops::Range;

/// Independent partial sums in the inner loop: breaks the chain of additions (a latency of 3 to 4 cycles each) and
/// fills the vector registers.
const LANES: usize = 8;
/// Number of terms that are summed before they are added to the rest. Rounding then grows with the block and with the number of blocks, not
/// with their product.
const BLOCK: usize = 4096;

/// The zeroth to third difference of one to four equally spaced samples.
///
/// # Panics
/// For any other number of samples.
#[inline(always)]
pub fn difference(samples: &[f64]) -> f64 {
    match *samples {
        [a] => a,
        [a, b] => b - a,
        [a, b, c] => (c - b) - (b - a),
        [a, b, c, d] => (d - a) - 3.0 * (c - b),
        _ => unreachable!("{} samples", samples.len()),
    }
}

/// Sums of `f` over every `stride`-th of `positions` of the stencil `offsets`, from the first: `f` receives the samples at position plus
/// each offset.
///
/// # Panics
/// When the last position plus the largest offset is beyond the end of `x`.
pub fn sums<const K: usize, const R: usize>(
    x: &[f64],
    offsets: [usize; K],
    stride: usize,
    positions: Range<usize>,
    f: impl Fn([f64; K]) -> [f64; R],
) -> [f64; R] {
    let terms = positions.len().div_ceil(stride);
    let mut total = [0.0; R];
    for from in (0..terms).step_by(BLOCK) {
        let n = BLOCK.min(terms - from);
        let at = offsets.map(|o| positions.start + from * stride + o);
        let block = match stride {
            1 => neighbours(x, at, n, &f),
            _ => strided(x, at, stride, n, &f),
        };
        add(&mut total, block);
    }
    total
}

fn add<const R: usize>(total: &mut [f64; R], part: [f64; R]) {
    for (t, p) in total.iter_mut().zip(part) {
        *t += p;
    }
}

fn neighbours<const K: usize, const R: usize>(
    x: &[f64],
    at: [usize; K],
    n: usize,
    f: &impl Fn([f64; K]) -> [f64; R],
) -> [f64; R] {
    let mut lanes = [[0.0; LANES]; R];
    // Loops, because `map` of an array stays a call without link-time optimisation: a whole curve then takes three times as long.
    let mut taps: [&[[f64; LANES]]; K] = [&[]; K];
    for k in 0..K {
        taps[k] = x[at[k]..at[k] + n].as_chunks().0;
    }
    for i in 0..n / LANES {
        for l in 0..LANES {
            let mut values = [0.0; K];
            for k in 0..K {
                values[k] = taps[k][i][l];
            }
            let values = f(values);
            for r in 0..R {
                lanes[r][l] += values[r];
            }
        }
    }
    let mut total = lanes.map(|lane| lane.iter().sum());
    for i in n - n % LANES..n {
        let mut values = [0.0; K];
        for k in 0..K {
            values[k] = x[at[k] + i];
        }
        add(&mut total, f(values));
    }
    total
}

fn strided<const K: usize, const R: usize>(
    x: &[f64],
    at: [usize; K],
    stride: usize,
    n: usize,
    f: &impl Fn([f64; K]) -> [f64; R],
) -> [f64; R] {
    let mut lanes = [[0.0; LANES]; R];
    for i in 0..n {
        // As above: with `at.map` the whole curve takes an eighth longer.
        let mut taps = [0.0; K];
        for k in 0..K {
            taps[k] = x[at[k] + i * stride];
        }
        let values = f(taps);
        for (lane, value) in lanes.iter_mut().zip(values) {
            lane[i % LANES] += value;
        }
    }
    lanes.map(|lane| lane.iter().sum())
}
