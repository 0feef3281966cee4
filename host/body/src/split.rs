//! What turns err by, split into the part that all pairs of a body share and the part of each.
//!
//! After a turn each gyro predicts the direction of gravity, and errs. Errors of a sensor differ from pair to pair of one carrier; errors by the motion, its sampling or
//! its dwells are the same for all. With `r_i` the error of pair i in the frame of the reference, c the common part and independent parts `e_i`,
//!
//! ```text
//! r_i = c + e_i,   E[r_i·r_k] = E[|c|²],   E[|r_i - r_k|²] = E[|e_i|²] + E[|e_k|²]
//! ```
//!
//! The second equation gives the common part, the third the part of each pair: the N-cornered hat (J. E. Gray and D. W. Allan, 1974). The errors are residuals of fits,
//! and so are all figures here: those of turns that no fit has seen are larger.

mod of_fits;
mod own;

use std::collections::BTreeMap;

use mimu::effects::temperature::rank_correlation;
use mimu::judgement::Judgement;
use mimu::unseen::FALSE_ALARM;
use nalgebra::{DMatrix, Matrix3, Vector3};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor, StudentsT};

pub use of_fits::turn_errors;
pub use own::own_turns;

/// Fewest turns that two pairs have to share.
const FEWEST: usize = 6;

/// The errors of one pair after all turns of the reference.
#[derive(Debug, Clone)]
pub struct PairErrors {
    /// Number of the pair: `gyroN` with `accelN`.
    pub pair: u8,
    /// Error of the direction of gravity after each turn, a rotation vector across gravity in the frame of the reference, rad; not a number where the pair lacks the turn.
    pub errors: Vec<Vector3<f64>>,
    /// Their covariances by the noise of the pair, rad².
    pub noise: Vec<Matrix3<f64>>,
    /// Share of the degrees of freedom that its fit has left to these errors: 1 if they were unseen.
    pub left: f64,
}

/// The errors of all pairs after the turns of a recording.
#[derive(Debug, Clone)]
pub struct TurnErrors {
    /// The pairs, the reference first.
    pub pairs: Vec<PairErrors>,
    /// What each turn was like, in the order of [`COVARIATES`]: angle of rotation (rad), largest rate (rad/s), roughness (rad/s), instant (s). Roughness is the root of
    /// the sum of squared second differences of the rate between neighbouring increments, of a sample or 10 ms, whichever is longer.
    pub conditions: Vec<[f64; 4]>,
    /// Mean square of each turn's error by what is known to be common, rad²: the Earth's rate about an unknown heading.
    pub shared: Vec<f64>,
    /// For each pair its dwell in which each turn ends; empty if the turns are of several recordings.
    pub places: Vec<Vec<Option<usize>>>,
}

/// A part of the errors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Part {
    /// Rms, noise included, rad.
    pub rms: f64,
    /// Lower bound of its 95 % interval, rad.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
    /// The same by noise alone: that of the pair, or what is known to be common.
    pub noise_floor: f64,
}

/// What the size of the common part may correlate with, and the error of a whole carrier that shows so.
pub const COVARIATES: [(&str, &str); 4] = [
    ("angle", "clock error"),
    ("rate", "bandwidth of the sampled rate"),
    ("roughness", "aliasing and coning between samples"),
    ("time", "drift"),
];

/// A rank correlation of the size of the common part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Correlation {
    /// With what, and the error that shows so: of [`COVARIATES`].
    pub covariate: &'static str,
    /// See `covariate`.
    pub term: &'static str,
    /// Spearman's coefficient.
    pub coefficient: f64,
    /// Probability of one as large by chance, two-sided, for this covariate alone.
    pub p: f64,
    /// Whether chance does not explain it, all covariates together: [`FALSE_ALARM`].
    pub is_significant: bool,
}

/// The errors of turns, split.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Split {
    /// Number of turns that at least two pairs have.
    pub turns: usize,
    /// The part that all pairs share.
    pub common: Part,
    /// The part of each pair, by its number.
    pub own: BTreeMap<u8, Part>,
    /// Probability that the pairs agree as well without a common part beyond what is known.
    pub p: f64,
    /// Whether there is one: the share of bodies without one that show one is [`FALSE_ALARM`].
    pub exceeds_noise: bool,
    /// What the common part correlates with; empty if it does not exceed the noise.
    pub correlations: Vec<Correlation>,
    /// How a fit of each pair is judged by its own part, without the common one; empty for two pairs.
    pub judged: BTreeMap<u8, Judgement>,
}

/// Products of the errors of each two pairs, over the turns that both have.
struct Products {
    /// Means of `r_i·r_k`, rad².
    product: DMatrix<f64>,
    /// Degrees of freedom of `r_i·r_k`: the fewer, the more of both sizes is in a few turns.
    dof: DMatrix<f64>,
    pairs: usize,
}

impl Products {
    fn of(pairs: &[PairErrors]) -> Option<Self> {
        let zeros = DMatrix::zeros(pairs.len(), pairs.len());
        let [mut product, mut dof] = [zeros.clone(), zeros];
        for (i, k) in (0..pairs.len()).flat_map(|i| (0..pairs.len()).map(move |k| (i, k))) {
            let both = pairs[i].errors.iter().zip(&pairs[k].errors);
            let both: Vec<_> = both.filter(|(a, b)| is_known(a) && is_known(b)).collect();
            let n = both.len() as f64;
            let mean = |of: &dyn Fn(&Vector3<f64>, &Vector3<f64>) -> f64| -> f64 {
                both.iter().map(|(a, b)| of(a, b)).sum::<f64>() / n
            };
            let sizes = mean(&|a, _| a.norm_squared()) * mean(&|_, b| b.norm_squared());
            if both.len() < FEWEST || !(sizes > 0.0) {
                return None;
            }
            product[(i, k)] = mean(&|a, b| a.dot(b));
            // Vectors of these sizes and any direction in a plane: the mean of (a·b)² is |a|²|b|²/2.
            let left = (pairs[i].left * pairs[k].left).sqrt();
            let unequal = mean(&|a, b| a.norm_squared() * b.norm_squared());
            dof[(i, k)] = 2.0 * left * n * sizes / unequal;
        }
        let pairs = pairs.len();
        Some(Self {
            product,
            dof,
            pairs,
        })
    }

    /// Mean over each two pairs, weighted by the product of their weights.
    fn mean(&self, weights: &[f64], of: impl Fn((usize, usize)) -> f64) -> f64 {
        let each = (0..self.pairs).flat_map(|i| (0..i).map(move |k| (i, k)));
        let (sum, weight) = each.fold((0.0, 0.0), |(sum, weight), (i, k)| {
            let both = weights[i] * weights[k];
            (sum + both * of((i, k)), weight + both)
        });
        sum / weight
    }

    /// Probability of the agreement without a common part other than the mean square `known`.
    fn chance(&self, own: &[f64], known: f64) -> f64 {
        let (equal, n) = (vec![1.0; self.pairs], self.pairs as f64);
        let others = n - 1.0;
        let sf = |ratio: f64, dof: f64, of: f64| {
            FisherSnedecor::new(dof, of).map_or(1.0, |f| f.sf(ratio.max(0.0)))
        };
        // The sum of n unit vectors of any direction has mean and variance of a ratio of chi-squares with 2/n fewer degrees of freedom. Whatever the sizes of the errors.
        let dof = self.mean(&equal, |at| self.dof[at]) - 2.0 / n;
        let size = |i: usize| self.product[(i, i)];
        let both = |(i, k)| (size(i) * size(k)).sqrt();
        let cosine = self.mean(&equal, |at| self.product[at] / both(at));
        let ratio = (1.0 + others * cosine) / (1.0 - cosine).max(1e-12);
        let none = sf(ratio, dof, others * dof);
        if known <= 0.0 {
            return none;
        }
        // Beyond what is known: the square of the mean of all, by Satterthwaite's degrees of freedom.
        let in_mean = own.iter().sum::<f64>() / (n * n);
        let own = own.iter().map(|own| own.max(0.0));
        let [sum, squares] = own.fold([0.0; 2], |[a, b], own| [a + own, b + own * own]);
        let found = self.mean(&equal, |at| self.product[at]) + in_mean;
        let expected = known + in_mean;
        let of = (sum * sum / squares) * others / n * dof * (expected / in_mean).powi(2);
        none.max(sf(found / expected, dof, of))
    }
}

/// Splits the errors. `None` for fewer than two pairs, or if two of them share fewer than six turns.
pub fn split(of: &TurnErrors) -> Option<Split> {
    let count = of.pairs.len();
    let products = (count > 1).then(|| Products::of(&of.pairs))??;
    let own = of.own();
    let noise: Vec<f64> = of.pairs.iter().map(PairErrors::noise_square).collect();
    // No pair errs by less than its noise.
    let least = |i: usize| noise[i].max(1e-4 * products.product[(i, i)]);
    let weights: Vec<f64> = (0..count).map(|i| own[i].max(least(i)).recip()).collect();
    let in_mean = weights.iter().sum::<f64>().recip();
    let common = products.mean(&weights, |at| products.product[at]);
    let dof = products.mean(&weights, |at| products.dof[at]);
    let others = (count - 1) as f64 * dof;
    let left = of.pairs.iter().map(|pair| pair.left).sum::<f64>() / count as f64;
    let known = left * of.shared.iter().sum::<f64>() / of.shared.len() as f64;
    let part = |i: usize| {
        // In the difference between this pair and the mean of the others, or what both of two share.
        let beside = match count {
            2 => common.max(0.0),
            n => (own.iter().sum::<f64>() - own[i]).max(0.0) / ((n - 1) as f64).powi(2),
        };
        let dof = 2.0 * of.pairs[i].left * of.pairs[i].known().count() as f64;
        let part = Part::of([own[i] + beside, beside], [dof, others], noise[i]);
        (of.pairs[i].pair, part)
    };
    let p = products.chance(&own, known);
    let means = of.means(&weights);
    Some(Split {
        turns: means.iter().filter(|mean| is_known(mean)).count(),
        common: Part::of([common + in_mean, in_mean], [dof, others], known),
        own: (0..count).map(part).collect(),
        p,
        exceeds_noise: p < FALSE_ALARM,
        correlations: (0..COVARIATES.len())
            .filter(|_| p < FALSE_ALARM)
            .filter_map(|number| of.correlation(&means, number))
            .collect(),
        judged: BTreeMap::new(),
    })
}

impl Part {
    /// The difference of two mean squares with their degrees of freedom; its interval is by the method of variance estimates recovery (G. Y. Zou and A. Donner, 2008).
    fn of(squares: [f64; 2], dof: [f64; 2], floor: f64) -> Self {
        let bound = |k: usize, p: f64| {
            let dof = dof[k].max(1.0);
            let chi = ChiSquared::new(dof).map_or(f64::NAN, |d| d.inverse_cdf(p));
            squares[k] * dof / chi
        };
        let difference = squares[0] - squares[1];
        let below = (squares[0] - bound(0, 0.975)).hypot(bound(1, 0.025) - squares[1]);
        let above = (bound(0, 0.025) - squares[0]).hypot(squares[1] - bound(1, 0.975));
        let root = |square: f64| square.max(0.0).sqrt();
        Self {
            rms: root(difference),
            lower: root(difference - below),
            upper: root(difference + above),
            noise_floor: root(floor),
        }
    }
}

impl PairErrors {
    fn known(&self) -> impl Iterator<Item = usize> {
        (0..self.errors.len()).filter(|j| is_known(&self.errors[*j]))
    }

    /// Mean square of the errors by noise.
    fn noise_square(&self) -> f64 {
        let sum: f64 = self.known().map(|j| self.noise[j].trace()).sum();
        self.left * sum / self.known().count().max(1) as f64
    }
}

impl TurnErrors {
    /// Those of several recordings, of the pairs that all of them have. `None` without a recording.
    pub fn joined(all: &[Self]) -> Option<Self> {
        let (first, more) = all.split_first()?;
        let mut joined = first.clone();
        for next in more {
            let turns = [&joined, next].map(|of| of.conditions.len() as f64);
            joined.pairs.retain_mut(|pair| {
                let Some(of) = next.pairs.iter().find(|of| of.pair == pair.pair) else {
                    return false;
                };
                pair.errors.extend(&of.errors);
                pair.noise.extend(&of.noise);
                pair.left = (turns[0] * pair.left + turns[1] * of.left) / (turns[0] + turns[1]);
                true
            });
            joined.conditions.extend(&next.conditions);
            joined.shared.extend(&next.shared);
            joined.places.clear();
        }
        Some(joined)
    }

    /// Mean square of the own part of each pair over the turns that it has. Two pairs are divided by what each has in common with the other.
    fn own(&self) -> Vec<f64> {
        let mut own = vec![[0.0; 2]; self.pairs.len()];
        for j in 0..self.conditions.len() {
            let errors = self.pairs.iter().map(|pair| pair.errors[j]);
            let known: Vec<_> = errors.enumerate().filter(|of| is_known(&of.1)).collect();
            let n = known.len() as f64;
            let sum: Vector3<f64> = known.iter().map(|of| of.1).sum();
            let squares: f64 = known.iter().map(|of| of.1.norm_squared()).sum();
            let differences = (n * squares - sum.norm_squared()) / (n - 1.0);
            for (i, error) in known.iter().filter(|_| n > 1.0) {
                let to_others = n * error.norm_squared() - 2.0 * error.dot(&sum) + squares;
                own[*i][0] += match known.len() {
                    2 => error.dot(&(error * 2.0 - sum)),
                    _ => (to_others - differences) / (n - 2.0),
                };
                own[*i][1] += 1.0;
            }
        }
        own.iter().map(|[sum, turns]| sum / turns).collect()
    }

    /// Weighted mean of each turn's errors; not a number unless two pairs have it.
    fn means(&self, weights: &[f64]) -> Vec<Vector3<f64>> {
        let mean = |j: usize| {
            let own = self.pairs.iter().zip(weights);
            let own = own.filter(|(pair, _)| is_known(&pair.errors[j]));
            let [weight, count] = own.clone().fold([0.0; 2], |[w, n], of| [w + of.1, n + 1.0]);
            let sum: Vector3<f64> = own.map(|(pair, of)| pair.errors[j] * *of).sum();
            sum / if count > 1.0 { weight } else { f64::NAN }
        };
        (0..self.conditions.len()).map(mean).collect()
    }

    fn correlation(&self, means: &[Vector3<f64>], number: usize) -> Option<Correlation> {
        let known = self
            .conditions
            .iter()
            .zip(means)
            .filter(|of| is_known(of.1));
        let mut sizes: Vec<_> = known.map(|(at, mean)| (at[number], mean.norm())).collect();
        sizes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (covariate, term) = COVARIATES[number];
        let coefficient = rank_correlation(&sizes)?;
        let dof = sizes.len() as f64 - 2.0;
        let t = coefficient * (dof / (1.0 - coefficient * coefficient).max(1e-12)).sqrt();
        let p = 2.0 * StudentsT::new(0.0, 1.0, dof).ok()?.sf(t.abs());
        Some(Correlation {
            covariate,
            term,
            coefficient,
            p,
            is_significant: p < FALSE_ALARM / COVARIATES.len() as f64,
        })
    }
}

fn is_known(error: &Vector3<f64>) -> bool {
    error.iter().all(|x| x.is_finite())
}

#[cfg(test)]
mod tests;
