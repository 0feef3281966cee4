//! Continuous (approximate) D-optimal designs: weights on points, without regard to whole numbers of dwells.
//!
//! By the equivalence theorem of Kiefer and Wolfowitz (1960) weights are optimal if and only if the variance function
//! `Σ f' M⁻¹ f` nowhere exceeds the number of parameters p. Moreover `ln det M* - ln det M <= p ln(max/p)`, which bounds
//! the distance to the optimum. Weights are moved between pairs of points, each move the best of its pair (vertex
//! exchange of Böhning, Metrika 33, 1986; pairs as in the randomized exchange of Harman, Filová and Richtárik, JASA 115,
//! 2020). Then Newton's method moves all at once, as in Yang, Biedermann and Tang (JASA 108, 2013).

use nalgebra::{DMatrix, DVector};

use super::exchange;
use super::information::{Inverse, Rows, dot};
use super::refinement::{Region, climb};

/// A continuous D-optimal design.
#[derive(Debug, Clone)]
pub struct Optimum<P> {
    /// Points that carry weight. Only their information is unique: over the sphere many supports have the same.
    pub points: Vec<P>,
    /// Their weights, of sum 1.
    pub weights: Vec<f64>,
    /// Logarithm of `det M`.
    pub log_det: f64,
    /// Maximum of the variance function over the region, divided by p, minus 1: zero at the optimum.
    pub excess: f64,
    /// Number of parameters p.
    pub parameters: usize,
}

impl<P> Optimum<P> {
    /// D-efficiency of a design of `n` points with `log_det` of `F'F`: `(det(F'F/n) / det M*)^(1/p)`. The optimum would
    /// need this share of the dwells for the same determinant.
    pub fn efficiency(&self, log_det: f64, n: usize) -> f64 {
        let p = self.parameters as f64;
        (((log_det - self.log_det) / p).exp()) / n as f64
    }
}

/// Largest excess that is allowed over the region.
pub const TOLERANCE: f64 = 1e-6;
/// Largest excess on the candidates. It is smaller than [`TOLERANCE`], so that an exact design that attains the optimum has an
/// efficiency of 1 to eight digits.
const ON_CANDIDATES: f64 = 1e-8;
/// Rounds of exchanges on one list of candidates.
const ROUNDS: usize = 200;
/// Newton's steps after each round of pairs, at most: each may drop a point.
const NEWTON: usize = 200;
/// Newton's decrement at which they end: half of its square is the remaining distance in `ln det`.
const SETTLED: f64 = 1e-9;
/// Most times that maxima between the candidates are added to them.
const ADDITIONS: usize = 20;
/// Difference of regressors below which two maxima are the same.
const SAME: f64 = 1e-3;
/// Weight below which a point is dropped.
const NOTHING: f64 = 1e-12;
/// Most points on each side of a round's pairs.
const PAIRS: usize = 60;

/// The optimum over a region, starting from `candidates` that cover it.
///
/// Where the variance function rises above the bound between candidates, its maxima join them. `None` if the
/// candidates do not determine the parameters.
pub fn optimum<R: Region>(region: &R, candidates: &[R::Point]) -> Option<Optimum<R::Point>> {
    let mut points = candidates.to_vec();
    let mut rows = region.rows(&points);
    let p = rows.parameters();
    let mut weights = first_weights(&rows)?;
    let mut best: Option<Optimum<R::Point>> = None;
    for _ in 0..ADDITIONS {
        let inverse = exchange_weights(&rows, &mut weights)?;
        // Maxima between the candidates, from every candidate near the bound.
        let variances = variances(&rows, &inverse);
        let mut excess = variances.iter().copied().fold(0.0, f64::max) / p as f64 - 1.0;
        let mut tops: Vec<usize> = (0..rows.len())
            .filter(|&i| variances[i] > 0.9 * p as f64)
            .collect();
        tops.sort_by(|a, b| variances[*b].total_cmp(&variances[*a]));
        tops.truncate(10 * PAIRS);
        let mut new = Vec::new();
        for i in tops {
            let (point, height) = climb(region, &points[i], 0.05, |row| inverse.variance(row));
            excess = excess.max(height / p as f64 - 1.0);
            if height > p as f64 * (1.0 + ON_CANDIDATES) && height > variances[i] * (1.0 + 1e-9) {
                new.push((point, height));
            }
        }
        let found = Optimum {
            points: support(&points, &weights),
            weights: weights.iter().copied().filter(|w| *w > 0.0).collect(),
            log_det: inverse.log_det(),
            excess,
            parameters: p,
        };
        if best.as_ref().is_none_or(|b| found.excess < b.excess) {
            best = Some(found);
        }
        if excess <= 10.0 * ON_CANDIDATES || new.is_empty() {
            break;
        }
        // Climbs from all sides end at the same maxima.
        new.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut taken: Vec<Vec<f64>> = Vec::new();
        for (point, _) in new {
            let mut row = Vec::new();
            region.regressors(&point, &mut row);
            let same = |other: &Vec<f64>| row.iter().zip(other).all(|(a, b)| (a - b).abs() < SAME);
            if taken.len() < PAIRS && !taken.iter().any(same) {
                taken.push(row);
                points.push(point);
                weights.push(0.0);
            }
        }
        rows = region.rows(&points);
    }
    best
}

fn support<P: Clone>(points: &[P], weights: &[f64]) -> Vec<P> {
    let carrying = points.iter().zip(weights).filter(|(_, w)| **w > 0.0);
    carrying.map(|(point, _)| point.clone()).collect()
}

/// Equal weights on a good exact design.
fn first_weights(rows: &Rows) -> Option<Vec<f64>> {
    let n = 3 * rows.parameters();
    let found = exchange::search(rows, n, 1, 0).into_iter().next()?;
    let mut weights = vec![0.0; rows.len()];
    for i in found.points {
        weights[i] += 1.0 / n as f64;
    }
    Some(weights)
}

fn of_weights(rows: &Rows, weights: &[f64]) -> Option<Inverse> {
    let carrying = weights
        .iter()
        .copied()
        .enumerate()
        .filter(|(_, w)| *w > 0.0);
    Inverse::of(rows, carrying)
}

/// Variance function of every row.
fn variances(rows: &Rows, inverse: &Inverse) -> Vec<f64> {
    let blocks = 0..rows.widths().len();
    let each = (0..rows.len()).map(|i| {
        let of = |b| inverse.product(b, rows.row(b, i), rows.row(b, i));
        blocks.clone().map(of).sum()
    });
    each.collect()
}

/// Moves weight between candidates until the bound holds on them.
fn exchange_weights(rows: &Rows, weights: &mut [f64]) -> Option<Inverse> {
    let p = rows.parameters() as f64;
    let mut inverse = of_weights(rows, weights)?;
    for _ in 0..ROUNDS {
        let variances = variances(rows, &inverse);
        if variances.iter().all(|d| *d <= p * (1.0 + ON_CANDIDATES)) {
            break;
        }
        let mut high: Vec<usize> = (0..rows.len()).collect();
        high.sort_by(|a, b| variances[*b].total_cmp(&variances[*a]));
        let carry = |i: &usize| weights[*i] > 0.0;
        let mut low: Vec<usize> = high.iter().copied().rev().filter(carry).collect();
        low.truncate(PAIRS);
        high.truncate(low.len());
        for &from in &low {
            for &to in &high {
                if from == to || weights[from] == 0.0 {
                    continue;
                }
                let moved = best_move(rows, &inverse, to, from, weights[from]);
                if moved == 0.0 {
                    continue;
                }
                for b in 0..rows.widths().len() {
                    inverse.update(b, rows.row(b, to), moved);
                    inverse.update(b, rows.row(b, from), -moved);
                }
                weights[to] += moved;
                weights[from] -= moved;
                if weights[from] < NOTHING {
                    weights[from] = 0.0;
                }
            }
        }
        inverse = of_weights(rows, weights)?;
        for _ in 0..NEWTON {
            let settled = newton_step(rows, &inverse, weights)?;
            inverse = of_weights(rows, weights)?;
            if settled {
                break;
            }
        }
    }
    Some(inverse)
}

/// Newton's step for all weights at once on the points that carry any.
///
/// With `g` the variance function and `H` the squares of `f_i' M⁻¹ f_j`, summed over the blocks, it is
/// `δ = H⁻¹ (g - ν)`, with ν such that the sum of the weights stays 1. `ln det` is self-concordant, so that a step of
/// `δ/(1 + λ)`, `λ² = δ'Hδ`, never lowers it. The step ends where the first weight becomes zero. Returns whether the
/// weights have settled.
///
/// Exchanges of pairs find the points, but converge slowly where these are close together. For the magnitude of gravity
/// on a two-axis table they were still 8e-5 above the bound after 2000 rounds; with these steps they were below 1e-8
/// after one.
fn newton_step(rows: &Rows, inverse: &Inverse, weights: &mut [f64]) -> Option<bool> {
    let carrying: Vec<usize> = (0..rows.len()).filter(|i| weights[*i] > 0.0).collect();
    let k = carrying.len();
    let mut gradient = DVector::zeros(k);
    let mut curvature = DMatrix::zeros(k, k);
    for b in 0..rows.widths().len() {
        for (i, &point) in carrying.iter().enumerate() {
            let v = inverse.times(b, rows.row(b, point));
            for (j, &other) in carrying.iter().enumerate() {
                let cross = dot(&v, rows.row(b, other));
                curvature[(i, j)] += cross * cross;
                if i == j {
                    gradient[i] += cross;
                }
            }
        }
    }
    // H is singular if there are more points than moments; g then has no part in its null space.
    let damping = 1e-10 * curvature.trace();
    let damped = &curvature + DMatrix::from_diagonal_element(k, k, damping);
    let solver = damped.cholesky()?;
    let (own, ones) = (
        solver.solve(&gradient),
        solver.solve(&DVector::repeat(k, 1.0)),
    );
    let step = &own - &ones * (own.sum() / ones.sum());
    let lambda = step.dot(&(&curvature * &step)).sqrt();
    let ends = carrying.iter().zip(step.iter());
    let longest = ends.fold(f64::INFINITY, |least, (&i, s)| match *s < 0.0 {
        true => least.min(-weights[i] / s),
        false => least,
    });
    let length = longest.min(1.0 / (1.0 + lambda));
    for (&i, s) in carrying.iter().zip(step.iter()) {
        weights[i] += length * s;
        if weights[i] < NOTHING {
            weights[i] = 0.0;
        }
    }
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= sum);
    Some(lambda < SETTLED && length < longest)
}

/// Weight between 0 and `most` whose move to row `to` from row `from` makes the determinant largest.
///
/// `ln det` along the move is `Σ ln(1 + a (d_to - d_from) - a² (d_to d_from - d_cross²))` over the blocks,
/// concave in a; for one block the maximum is Böhning's closed form.
fn best_move(rows: &Rows, inverse: &Inverse, to: usize, from: usize, most: f64) -> f64 {
    let curve: Vec<(f64, f64)> = (0..rows.widths().len())
        .map(|b| {
            let (f, g) = (rows.row(b, from), rows.row(b, to));
            let v = inverse.times(b, g);
            let (d_to, cross) = (dot(&v, g), dot(&v, f));
            let d_from = inverse.product(b, f, f);
            (d_to - d_from, d_to * d_from - cross * cross)
        })
        .collect();
    let slope = |a: f64| -> f64 {
        let each = curve.iter();
        each.map(|(linear, square)| {
            let factor = 1.0 + a * linear - a * a * square;
            // The design is singular there; rounding must not change the sign.
            match factor > 1e-12 {
                true => (linear - 2.0 * a * square) / factor,
                false => f64::NEG_INFINITY,
            }
        })
        .sum()
    };
    if !(slope(0.0) > 0.0) {
        return 0.0;
    }
    if let [(linear, square)] = curve[..] {
        return match linear / (2.0 * square) {
            best if square > 0.0 => best.min(most),
            _ => most,
        };
    }
    if slope(most) > 0.0 {
        return most;
    }
    let (mut below, mut above) = (0.0, most);
    for _ in 0..50 {
        let middle = 0.5 * (below + above);
        if slope(middle) > 0.0 {
            below = middle;
        } else {
            above = middle;
        }
    }
    below
}
