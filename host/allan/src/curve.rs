//! Deviation over averaging time, with bounds.
//!
//! # Terms that are left out
//!
//! Neighbouring differences of a long cluster are nearly equal. In a series of more than [`ALL_TERMS`] rates only every s-th is used. At
//! least [`STARTS_PER_CLUSTER`] of those begin within a cluster, and for Allan and Hadamard at least [`KEPT_TERMS`] are kept in all.
//! `tests/all/vectors` computes the loss of equivalent degrees of freedom for every noise. It is under 0.05 % for white rate noise and
//! redder (alpha 0 to -4), the only noises of an inertial sensor at such cluster lengths, and for any noise with the modified variance. For
//! white and flicker phase noise, which are hardly correlated between samples, the loss is larger (up to a factor s for white, whose
//! deviation is then still known to 0.6 %); the edf of the point includes it. With this rule the cost of a curve grows about as N from 1e6
//! samples on, however densely the times are spaced.

use super::bounds::{self, Estimator, Sampling};
use super::deviation::{ALL_TERMS, BLOCK, Integrated, Plan, Squares, sums_of_squares};
use super::power_law::power_law;
use super::{Deviation, NotFinite, Point, Spacing};

use rayon::prelude::*;

/// In a series longer than [`ALL_TERMS`], at least this many differences begin within a cluster.
pub const STARTS_PER_CLUSTER: usize = 64;
/// In a series longer than [`ALL_TERMS`], at least this many Allan and Hadamard differences are kept.
pub const KEPT_TERMS: usize = 1 << 15;
/// Number of averaging times computed together: more would only need memory for more sums of tiles.
const AT_A_TIME: usize = 256;

/// Deviation of rates (any unit) at every averaging time of `spacing` that the series is long enough for, with
/// bounds at `confidence` (between 0 and 1). Empty for fewer than two rates (three for [`Deviation::Hadamard`]).
///
/// # Errors
/// The first rate that is not a finite number. Do not close or fill a gap: both put a step into the integral. Give the longest segment
/// without a gap.
pub fn curve(
    rates: &[f64],
    dt_s: f64,
    kind: Deviation,
    spacing: &Spacing,
    confidence: f64,
) -> Result<Vec<Point>, NotFinite> {
    Ok(Integrated::new(rates.to_vec(), dt_s)?.curve(kind, spacing, confidence))
}

impl Spacing {
    /// The cluster lengths up to `longest`, ascending.
    fn clusters(&self, longest: usize) -> Vec<usize> {
        let mut all: Vec<usize> = match self {
            Self::Octave => std::iter::successors(Some(1), |m| Some(2 * m))
                .take_while(|&m| m <= longest)
                .collect(),
            Self::PerDecade(count) => {
                let step = 1.0 / (*count).max(1) as f64;
                (0..)
                    .map(|i| 10f64.powf(f64::from(i) * step).round() as usize)
                    .take_while(|&m| m <= longest)
                    .collect()
            }
            Self::Samples(given) => given.clone(),
        };
        all.retain(|m| (1..=longest).contains(m));
        all.sort_unstable();
        all.dedup();
        all
    }
}

impl Integrated {
    /// Number of all differences of a `kind`, Allan or Hadamard, over clusters of `m`, and the sum of their variances, each on its own.
    pub fn variances(&self, kind: Deviation, m: usize) -> (usize, f64) {
        let terms = kind.terms(self.x().len(), m);
        let sum = Squares::new(self.x(), kind).sum(m, 1, 0..terms);
        (terms, sum / (kind.squares() * (m * m) as f64))
    }

    /// Deviation at every averaging time of `spacing` that has at least one difference, ascending, with bounds at
    /// `confidence` (between 0 and 1).
    pub fn curve(&self, kind: Deviation, spacing: &Spacing, confidence: f64) -> Vec<Point> {
        let x = self.x();
        let longest = match kind {
            Deviation::Allan => x.len().saturating_sub(1) / 2,
            Deviation::Hadamard => x.len().saturating_sub(1) / 3,
            Deviation::Modified => x.len() / 3,
        };
        let plan = |m| Plan {
            m,
            stride: stride(kind, x.len(), m),
            all: kind.terms(x.len(), m),
        };
        let plans: Vec<Plan> = spacing.clusters(longest).into_iter().map(plan).collect();
        plans
            .chunks(AT_A_TIME)
            .flat_map(|plans| {
                let sums = sums_of_squares(x, kind, plans);
                let points: Vec<Point> = plans
                    .par_iter()
                    .zip(sums)
                    .map(|(plan, sum)| self.point(kind, plan, sum, confidence))
                    .collect();
                points
            })
            .collect()
    }

    fn point(&self, kind: Deviation, plan: &Plan, sum_of_squares: f64, confidence: f64) -> Point {
        let &Plan { m, stride, all } = plan;
        let x = self.x();
        let terms = all.div_ceil(stride);
        let (tau, mean) = (m as f64, sum_of_squares / terms as f64);
        let power = if kind == Deviation::Modified { 4 } else { 2 };
        let variance = mean / (kind.squares() * tau.powi(power));
        let deviation = variance.sqrt();
        let alpha = power_law(x, kind, m);
        let edf = Estimator {
            kind,
            sampling: Sampling::Instants,
            m,
            stride,
            terms,
        }
        .edf(alpha);
        let (lower, upper) = bounds::interval(deviation, edf, confidence);
        let clusters = (x.len() - 1) as f64 / tau;
        Point {
            m,
            tau_s: tau * self.dt_s(),
            deviation,
            terms,
            alpha,
            edf,
            lower,
            upper,
            sigma_independent: deviation / (2.0 * (clusters - 1.0)).sqrt(),
        }
    }
}

/// Step between the differences that are used, for clusters of `m` and this many `points` of the integral.
fn stride(kind: Deviation, points: usize, m: usize) -> usize {
    if points <= ALL_TERMS + 1 {
        return 1;
    }
    let by_starts = m / STARTS_PER_CLUSTER;
    let stride = match kind {
        Deviation::Allan | Deviation::Hadamard => by_starts.min(kind.terms(points, m) / KEPT_TERMS),
        // Only a term at a kept sum is cheap to reach by skipping. The other terms add no information: the mean over the cluster correlates
        // neighbouring terms of phase noise too.
        Deviation::Modified => by_starts / BLOCK * BLOCK,
    };
    stride.max(1)
}
