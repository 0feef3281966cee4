//! Noise of the rows of an axis: white noise from within the dwells, and the slow wander of the bias from the residuals of the curves.
//!
//! If the bias wanders, means of neighbouring rows are correlated. Intervals that assume independence are too narrow.

use nalgebra::Vector3;

use crate::regression::{AxisNoise, LONGEST_S, MOST_PARTS, Normal, Problem};
use crate::smoothness::{Penalties, Smoothness, solve, times};

/// Correlation times that are tried, s. The longest is a random walk over most recordings.
const CORRELATION_S: [f64; 4] = [40.0, 200.0, 1000.0, 10_000.0];
/// Drop in deviance that a single process needs beyond that of flicker noise: a record of an hour or two hardly shows slower wander, and
/// cannot exclude it.
const SINGLE: f64 = 6.0;
/// Flicker noise, as in the bias of a MEMS sensor. A single process that fits its minutes misses its hours, and so the uncertainty of a
/// bias.
const FLICKER: (usize, f64) = (MOST_PARTS, LONGEST_S);
/// Variances of the wander over that of a row, in steps of a factor of ten and then of refinement.
const RATIOS: [f64; 6] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0];
/// Largest ratio that is tried, if the largest of [`RATIOS`] is the best: a bias that jumps by a hundred times the noise of a row.
const LARGEST_RATIO: f64 = 1e4;
/// Least drop in deviance for wander: two parameters at the price of Akaike's criterion.
const DEVIANCE: f64 = 4.0;

/// Inputs that differ by less are the same, SI: about a vertical axis a table turns twice the horizontal rate of the Earth through the axes.
const SAME_INPUT: f64 = 2.0 * mimu::estimate::earth::RATE;

/// White noise of rows of weight 1, SI², from the differences of neighbouring rows of a dwell, in which nothing else moves. `None` if no
/// dwell has two.
pub fn white(problem: &Problem) -> Option<[f64; 3]> {
    let (mut sum, mut n) = (Vector3::zeros(), 0.0);
    for pair in problem.rows.windows(2) {
        let [a, b] = [&pair[0], &pair[1]];
        let change = (a.input - b.input).norm();
        if a.offset == b.offset && a.step == b.step && change < SAME_INPUT {
            let difference = b.reading - a.reading;
            sum += difference.component_mul(&difference) / (1.0 / a.weight + 1.0 / b.weight);
            n += 1.0;
        }
    }
    (n > 0.0).then(|| [0, 1, 2].map(|k| (sum[k] / n).max(f64::MIN_POSITIVE)))
}

/// Noise of `axis` at the die temperatures `dies`, for curves with this `smoothness`; `before` is the noise found so far.
///
/// The restricted likelihood of the variance and the correlation time of the wander, with the white variance profiled out.
pub fn estimate(
    problem: &Problem,
    penalties: &Penalties,
    axis: usize,
    dies: &[f64],
    smoothness: &Smoothness,
    before: &AxisNoise,
) -> AxisNoise {
    let scaled = times(smoothness, 1.0 / before.white);
    let deviance = |ratio: f64, correlation_s: f64, parts: usize| {
        let relative = AxisNoise {
            white: 1.0,
            wander: ratio,
            correlation_s,
            parts,
        };
        let mut normal = Normal::of(problem, axis, dies, &relative, |_| true);
        normal.earth_precision = before.white;
        let solved = solve(problem, penalties, axis, &normal, &scaled)?;
        let free: usize = problem
            .parts(axis)
            .iter()
            .map(|p| problem.basis(p.kind).free())
            .sum();
        let n = normal.rows - (free + problem.offsets - 1) as f64;
        let white = solved.left / n;
        (white > 0.0).then(|| (n * white.ln() + solved.determinants, white))
    };
    let Some((without, white)) = deviance(0.0, 1.0, 1) else {
        return *before;
    };
    let mut best = (without - DEVIANCE, 0.0, 1.0, 1, white);
    let better = |best: &mut (f64, f64, f64, usize, f64), ratio, correlation_s, parts| {
        let against = if parts == 1 { SINGLE } else { 0.0 };
        if let Some((d, white)) = deviance(ratio, correlation_s, parts)
            && d + against < best.0
        {
            *best = (d + against, ratio, correlation_s, parts, white);
        }
    };
    let single = CORRELATION_S.map(|correlation_s| (1, correlation_s));
    for (parts, correlation_s) in single.into_iter().chain([FLICKER]) {
        for ratio in RATIOS {
            better(&mut best, ratio, correlation_s, parts);
        }
    }
    // A bias that jumps needs larger ratios.
    let mut largest = RATIOS[RATIOS.len() - 1];
    while best.1 >= largest && largest < LARGEST_RATIO {
        let (_, ratio, correlation_s, parts, _) = best;
        better(&mut best, 10.0 * ratio, correlation_s, parts);
        largest *= 10.0;
    }
    if best.1 > 0.0 {
        for factor in [2.5, 1.6, 1.25] {
            let (_, ratio, correlation_s, parts, _) = best;
            for [a, b] in [
                [factor, 1.0],
                [1.0 / factor, 1.0],
                [1.0, factor],
                [1.0, 1.0 / factor],
            ] {
                // Flicker noise has no single correlation time.
                let b = if parts == 1 { b } else { 1.0 };
                better(&mut best, ratio * a, correlation_s * b, parts);
            }
        }
    }
    let (_, ratio, correlation_s, parts, white) = best;
    AxisNoise {
        white,
        wander: ratio * white,
        correlation_s,
        parts,
    }
}
