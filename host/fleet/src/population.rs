//! The population that units come from.
//!
//! The estimates `y` of unit i, with the covariance V of their fit, are `y = μ + u + e`, `u ~ N(0, T)`, `e ~ N(0, V)`: a multivariate random-effects model, as that of
//! [sessions](mimu::sessions::between), but with all covariances between parameters. T is estimated by restricted maximum likelihood (expectation and maximisation; Laird,
//! Ware 1982), of units that belong to the others.
//!
//! Whether a unit belongs is judged by its Mahalanobis distance, with T + V of its own. Location and covariance start from a robust estimate, and units beyond the 97.5 % quantile
//! do not enter the next one, corrected for what such a cut takes from a normal distribution. The probability of a distance has the distribution
//! of Cerioli (2010), JASA 105, 147, for units that were not used. With fewer than [`JOINTLY`] units for each parameter, covariances between parameters are not known;
//! each parameter is then judged alone.

use mimu::nalgebra::{Cholesky, DMatrix, DVector, Dyn, SymmetricEigen};
use mimu::sessions::between::Estimates;
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor, StudentsT};

use crate::robust;

/// Units for each parameter from which on covariances between parameters are estimated. Below, distances of a normal population have other distributions.
pub const JOINTLY: usize = 4;
/// Fewest units of a population.
pub const FEWEST: usize = 5;
/// Share of a normal population that is used.
const USED: f64 = 0.975;
/// Most rounds of leaving out units, and the share of units that changes in the last.
const ROUNDS: usize = 40;
const CHANGED: f64 = 1e-3;
/// Rounds of expectation and maximisation while units are still being left out, and afterwards; and the relative change of variances that ends them.
const EM_ROUNDS: [usize; 2] = [4, 100];
const EM_CHANGE: f64 = 1e-4;
/// Units of a block.
const BLOCK: usize = 256;

/// The population of a triad's parameters.
#[derive(Debug, Clone)]
pub struct Population {
    /// Expected parameters.
    pub mean: DVector<f64>,
    /// Covariance of the error of [`Self::mean`].
    pub mean_covariance: DMatrix<f64>,
    /// Covariance between units, the uncertainty of their fits removed.
    pub covariance: DMatrix<f64>,
    /// Whether covariances between parameters were estimated.
    pub jointly: bool,
    /// Units that belong to the others, and so were used.
    pub used: Vec<bool>,
    /// How far each unit is from the others.
    pub distances: Vec<Distance>,
}

/// How far a unit is from the population.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distance {
    /// Mahalanobis distance; of the most distant parameter alone if they are not judged jointly.
    pub distance: f64,
    /// Probability of a larger one in this population, without regard to how many units there are.
    pub p: f64,
    /// Number of the parameter that is farthest in standard deviations, with sign.
    pub most: usize,
    /// Its distance in standard deviations.
    pub sigmas: f64,
}

/// Estimates in units of the typical errors, with what is estimated of them.
struct Problem {
    values: Vec<DVector<f64>>,
    covariances: Vec<DMatrix<f64>>,
    /// The mean, if it is known.
    centre: Option<DVector<f64>>,
    jointly: bool,
}

/// An estimate of mean, its covariance and T.
#[derive(Clone)]
struct State {
    mean: DVector<f64>,
    mean_covariance: DMatrix<f64>,
    between: DMatrix<f64>,
}

/// The population of `estimates`. `centre` is its mean if that is known.
///
/// `None` for fewer than [`FEWEST`], or if a covariance is singular.
pub fn fit(estimates: &[Estimates], centre: Option<&DVector<f64>>) -> Option<Population> {
    if estimates.len() < FEWEST {
        return None;
    }
    let n = estimates[0].values.len();
    let units = DVector::from_fn(n, |i, _| {
        let scale = robust::location_and_scale(estimates.iter().map(|e| e.values[i])).1;
        let errors = estimates.iter().map(|e| e.covariance[(i, i)]);
        let least = errors.fold(f64::INFINITY, f64::min);
        scale.max(least.sqrt()).max(f64::MIN_POSITIVE.sqrt())
    });
    let by = |v: &DVector<f64>| v.component_div(&units);
    let problem = Problem {
        values: estimates.iter().map(|e| by(&e.values)).collect(),
        covariances: estimates
            .iter()
            .map(|e| DMatrix::from_fn(n, n, |i, j| e.covariance[(i, j)] / (units[i] * units[j])))
            .collect(),
        centre: centre.map(by),
        jointly: estimates.len() >= JOINTLY * n && n > 1,
    };
    let (state, used) = problem.solve()?;
    let distances = problem.judged(&state, &used)?;
    let back = |m: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| m[(i, j)] * units[i] * units[j]);
    Some(Population {
        mean: state.mean.component_mul(&units),
        mean_covariance: back(&state.mean_covariance),
        covariance: back(&state.between),
        jointly: problem.jointly,
        used,
        distances,
    })
}

/// What cutting a normal population of `n` parameters beyond this share of it takes from its covariance, as a factor to multiply it by: Croux, Haesbroeck (1999).
fn consistency(n: usize, share: f64) -> f64 {
    let n = n as f64;
    let cut = ChiSquared::new(n).map_or(f64::NAN, |d| d.inverse_cdf(share));
    share / ChiSquared::new(n + 2.0).map_or(f64::NAN, |d| d.cdf(cut))
}

impl Problem {
    fn n(&self) -> usize {
        self.values[0].len()
    }

    /// Mean and T of the units that belong to the others, and which these are.
    fn solve(&self) -> Option<(State, Vec<bool>)> {
        let n = self.n();
        let (mean, total) = robust::first(&self.values, self.centre.as_ref(), self.jointly);
        let inverse = total.clone().cholesky()?;
        let squares: Vec<Vec<f64>> = self
            .values
            .iter()
            .map(|v| self.squares(&(v - &mean), &inverse))
            .collect();
        let mut used = self.nearest(&squares);
        // Medians as in the first covariance: a few poor fits have hardly moved that.
        let errors = DMatrix::from_fn(n, n, |i, j| {
            let mut all: Vec<f64> = self.covariances.iter().map(|v| v[(i, j)]).collect();
            robust::median(&mut all)
        });
        let between = positive(total - errors);
        let mut state = State {
            mean,
            mean_covariance: DMatrix::zeros(n, n),
            between: match self.jointly {
                true => between,
                false => DMatrix::from_diagonal(&between.diagonal()),
            },
        };
        for _ in 0..ROUNDS {
            state = self.estimated(&state, &used, EM_ROUNDS[0])?;
            let squares = self.all_squares(&state)?;
            let cut = self.cut(used.iter().filter(|u| **u).count() as f64);
            let next: Vec<bool> = squares
                .iter()
                .map(|each| each.iter().all(|s| *s <= cut))
                .collect();
            let count = next.iter().filter(|u| **u).count();
            // A population of few needs half of them.
            if count < FEWEST.min(self.values.len() / 2 + 1) {
                break;
            }
            let changed = next.iter().zip(&used).filter(|(a, b)| a != b).count();
            used = next;
            if changed as f64 <= CHANGED * used.len() as f64 {
                break;
            }
        }
        Some((self.estimated(&state, &used, EM_ROUNDS[1])?, used))
    }

    /// Largest square of a distance of units that are used, if mean and T are of `count` units. Alone, a parameter has its own.
    fn cut(&self, count: f64) -> f64 {
        match self.jointly {
            true => quantile(1.0 - USED, self.n() as f64, count),
            false => quantile(1.0 - self.share_alone(), 1.0, count),
        }
    }

    /// Share of units that one of the parameters, judged alone, keeps; all together keep [`USED`].
    fn share_alone(&self) -> f64 {
        USED.powf(1.0 / self.n() as f64)
    }

    /// The factor of [`consistency`] for the cut.
    fn inflation(&self) -> f64 {
        match self.jointly {
            true => consistency(self.n(), USED),
            false => consistency(1, self.share_alone()),
        }
    }

    /// Squares of the distance of a unit from the mean: jointly one, else one for each parameter.
    fn squares(&self, from: &DVector<f64>, factor: &Cholesky<f64, Dyn>) -> Vec<f64> {
        if self.jointly {
            return vec![from.dot(&factor.solve(from))];
        }
        let l = factor.l_dirty();
        from.iter()
            .enumerate()
            .map(|(i, r)| r * r / l.row(i).columns(0, i + 1).norm_squared())
            .collect()
    }

    /// Those of all units, each with its own covariance.
    fn all_squares(&self, state: &State) -> Option<Vec<Vec<f64>>> {
        let each = self.values.par_iter().zip(&self.covariances);
        each.map(|(value, own)| {
            let total = &state.between + own;
            Some(self.squares(&(value - &state.mean), &total.cholesky()?))
        })
        .collect()
    }

    /// Units whose squares are below the cut, if the median of all is as in a normal population.
    fn nearest(&self, squares: &[Vec<f64>]) -> Vec<bool> {
        let count = squares[0].len();
        let dof = if self.jointly { self.n() as f64 } else { 1.0 };
        let middle = ChiSquared::new(dof).map_or(f64::NAN, |d| d.inverse_cdf(0.5));
        let typical = |k: usize| {
            let mut of: Vec<f64> = squares.iter().map(|s| s[k]).collect();
            (robust::median(&mut of) / middle).max(f64::MIN_POSITIVE)
        };
        let factors: Vec<f64> = (0..count).map(typical).collect();
        // Medians of distances know scales about as well as half of the units would.
        let cut = self.cut((0.5 * squares.len() as f64).max(self.n() as f64 + 2.0));
        squares
            .iter()
            .map(|each| each.iter().zip(&factors).all(|(s, f)| s / f <= cut))
            .collect()
    }

    /// Mean and T of the used units, from those of `before`.
    fn estimated(&self, before: &State, used: &[bool], rounds: usize) -> Option<State> {
        let n = self.n();
        let members: Vec<usize> = (0..used.len()).filter(|i| used[*i]).collect();
        let count = members.len() as f64;
        // For the mean that is estimated too, and for the cut.
        let lost = if self.centre.is_some() {
            1.0
        } else {
            count / (count - 1.0).max(1.0)
        };
        let inflation = lost * self.inflation();
        let mut state = before.clone();
        // Where T is zero, expectation and maximisation would leave it so.
        for i in 0..n {
            state.between[(i, i)] = state.between[(i, i)].max(1e-6);
        }
        for _ in 0..rounds {
            let weights = self.weights(&state, &members)?;
            if self.centre.is_none() {
                let zero = || (DMatrix::zeros(n, n), DVector::zeros(n));
                let (normal, right) =
                    members.iter().zip(&weights).fold(zero(), |(m, r), (i, w)| {
                        let right = r + w * &self.values[*i];
                        (m + w, right)
                    });
                state.mean_covariance = normal.cholesky()?.inverse();
                state.mean = &state.mean_covariance * right;
            }
            let t = &state.between;
            let mean = &state.mean;
            // Sums of equal blocks in their order: the same on any number of threads.
            let of_block = |(own, weights): (&[usize], &[DMatrix<f64>])| {
                let mut sum = DMatrix::zeros(n, n);
                for (i, w) in own.iter().zip(weights) {
                    let gain = t * w;
                    let expected = &gain * (&self.values[*i] - mean);
                    sum.ger(inflation, &expected, &expected, 1.0);
                    sum += t;
                    sum.gemm(-1.0, &gain, t, 1.0);
                }
                sum
            };
            let blocks = members.par_chunks(BLOCK).zip(weights.par_chunks(BLOCK));
            let blocks: Vec<DMatrix<f64>> = blocks.map(of_block).collect();
            let mut next = blocks.iter().fold(DMatrix::zeros(n, n), |sum, b| sum + b) / count;
            if !self.jointly {
                next = DMatrix::from_diagonal(&next.diagonal());
            }
            let change = (0..n).map(|i| (next[(i, i)] / t[(i, i)] - 1.0).abs());
            let change = change.fold(0.0, f64::max);
            state.between = 0.5 * (&next + next.transpose());
            if change < EM_CHANGE {
                break;
            }
        }
        Some(state)
    }

    /// Inverses of T + V of the members.
    fn weights(&self, state: &State, members: &[usize]) -> Option<Vec<DMatrix<f64>>> {
        members
            .par_iter()
            .map(|i| {
                Some(
                    (&state.between + &self.covariances[*i])
                        .cholesky()?
                        .inverse(),
                )
            })
            .collect()
    }

    fn judged(&self, state: &State, used: &[bool]) -> Option<Vec<Distance>> {
        let n = self.n();
        let left = used.iter().filter(|u| **u).count() as f64;
        // Of few units those that are left out are the most distant ones, and the others look closer together than they are: each costs a degree of freedom more.
        let count = (2.0 * left - used.len() as f64)
            .max(n as f64 * f64::from(u8::from(self.jointly)) + 2.0);
        let each = self.values.par_iter().zip(&self.covariances);
        each.map(|(value, own)| {
            let total = &state.between + own;
            let from = value - &state.mean;
            let sigmas = |i: usize| from[i] / total[(i, i)].sqrt();
            let most = (0..n).max_by(|a, b| sigmas(*a).abs().total_cmp(&sigmas(*b).abs()))?;
            let sigmas = sigmas(most);
            if !self.jointly {
                let alone = beyond(sigmas * sigmas, 1.0, count);
                return Some(Distance {
                    distance: sigmas.abs(),
                    p: (n as f64 * alone).min(1.0),
                    most,
                    sigmas,
                });
            }
            let square = from.dot(&total.cholesky()?.solve(&from));
            Some(Distance {
                distance: square.sqrt(),
                p: beyond(square, n as f64, count),
                most,
                sigmas,
            })
        })
        .collect()
    }
}

/// Probability of a larger square of the distance of a unit that `count` others of the same population with `n` parameters do not include.
fn beyond(square: f64, n: f64, count: f64) -> f64 {
    let rest = count - n;
    let scaled = square * rest * count / (n * (count * count - 1.0));
    if rest > 1e4 {
        return ChiSquared::new(n).map_or(1.0, |d| d.sf(square));
    }
    if n == 1.0 {
        return StudentsT::new(0.0, 1.0, rest).map_or(1.0, |d| 2.0 * d.sf(scaled.sqrt()));
    }
    FisherSnedecor::new(n, rest).map_or(1.0, |d| d.sf(scaled))
}

/// The square of a distance that is exceeded with probability `p`: the inverse of [`beyond`].
fn quantile(p: f64, n: f64, count: f64) -> f64 {
    let rest = (count - n).max(1.0);
    if rest > 1e4 {
        return ChiSquared::new(n).map_or(f64::NAN, |d| d.inverse_cdf(1.0 - p));
    }
    let scaled = match n == 1.0 {
        true => StudentsT::new(0.0, 1.0, rest)
            .map_or(f64::NAN, |d| d.inverse_cdf(1.0 - 0.5 * p).powi(2)),
        false => FisherSnedecor::new(n, rest).map_or(f64::NAN, |d| d.inverse_cdf(1.0 - p)),
    };
    scaled * n * (count * count - 1.0) / (rest * count)
}

/// The nearest matrix without negative variances.
fn positive(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let SymmetricEigen {
        eigenvectors,
        eigenvalues,
    } = SymmetricEigen::new(matrix);
    let kept = DMatrix::from_diagonal(&eigenvalues.map(|v| v.max(0.0)));
    &eigenvectors * kept * eigenvectors.transpose()
}
