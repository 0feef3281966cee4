//! Amplitudes of the terms of a noise model from a curve, with their covariance.

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::covariance::{Covariances, PROCESSES};
use super::differences::{Differences, PHASE, RAMP, TERMS};
use crate::Deviation;

/// Least relative error of the curve, whatever its degrees of freedom: a ramp without noise has infinitely many.
const NUMERICS: f64 = 1e-7;

/// Points of a curve: those of `covariances` in `range`, in units of the sample period.
#[derive(Clone)]
pub(super) struct Curve<'a> {
    /// Mean squares.
    pub y: Vec<f64>,
    /// Which points they are.
    pub range: Range<usize>,
    /// Covariances of all points of a record of this length.
    pub covariances: &'a Covariances,
}

/// Some terms fitted to a curve.
#[derive(Debug, Clone)]
pub(super) struct Fitted {
    /// Terms that are in it.
    pub terms: Vec<usize>,
    /// Amplitudes; zero where the term is not in it.
    pub a: [f64; TERMS],
    /// Covariance of the amplitudes in the order of `terms`.
    pub covariance: DMatrix<f64>,
    /// -2 ln of the likelihood, except for a constant of the curve.
    pub deviance: f64,
    /// Sum of the squares of the decorrelated residuals.
    pub chi2: f64,
}

impl Fitted {
    /// Standard deviation of the amplitude of `term`; zero where it is not in the model.
    pub fn sigma(&self, term: usize) -> f64 {
        let row = self.terms.iter().position(|k| *k == term);
        row.map_or(0.0, |i| self.covariance[(i, i)].sqrt())
    }
}

/// Expected values and covariance of the points for given amplitudes.
struct Expectation {
    mu: Vec<f64>,
    /// Cholesky factor of the relative covariance.
    factor: Cholesky<f64, Dyn>,
    /// Relative variances of the points.
    relative: Vec<f64>,
}

impl Curve<'_> {
    /// The points.
    pub fn points(&self) -> &[Differences] {
        &self.covariances.points()[self.range.clone()]
    }

    /// Shortest averaging factor.
    pub fn shortest(&self) -> f64 {
        self.points().last().map_or(f64::NAN, |d| d.m as f64)
    }

    /// Longest averaging factor.
    pub fn longest(&self) -> f64 {
        let all = self.points().iter().map(|d| d.m);
        all.max().map_or(f64::NAN, |m| m as f64)
    }

    /// How many of the points are of the Allan curve.
    pub fn allan_points(&self) -> usize {
        let allan = |d: &&Differences| d.kind == Deviation::Allan;
        self.points().iter().filter(allan).count()
    }

    /// Removes the shortest time.
    pub fn drop_shortest(&mut self) {
        self.y.pop();
        self.range.end -= 1;
    }

    fn expectation(&self, a: &[f64; TERMS]) -> Option<Expectation> {
        let points = self.points();
        let n = points.len();
        let size = |d: &Differences| d.basis().iter().zip(a).map(|(b, a)| b * a).sum();
        let mu: Vec<f64> = points.iter().map(size).collect();
        if mu.iter().any(|v: &f64| !(*v > 0.0)) {
            return None;
        }
        let noise: [f64; PROCESSES] = std::array::from_fn(|k| a[k].max(0.0));
        let mut relative = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in i..n {
                let (first, second) = (self.range.start + i, self.range.start + j);
                let v = self.covariances.of(first, second, &noise, a[RAMP].max(0.0));
                relative[(i, j)] = v / (mu[i] * mu[j]);
                relative[(j, i)] = relative[(i, j)];
            }
            relative[(i, i)] = relative[(i, i)] * (1.0 + 1e-9) + NUMERICS * NUMERICS;
        }
        Some(Expectation {
            relative: relative.diagonal().iter().copied().collect(),
            factor: Cholesky::new(relative)?,
            mu,
        })
    }

    /// Regressors of `terms` over the sizes of the points, decorrelated; and the covariance of the amplitudes.
    fn information(
        &self,
        expectation: &Expectation,
        terms: &[usize],
    ) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let points = self.points();
        let a = DMatrix::from_fn(points.len(), terms.len(), |i, k| {
            points[i].basis()[terms[k]] / expectation.mu[i]
        });
        let mut white = expectation.factor.l_dirty().solve_lower_triangular(&a)?;
        // Columns differ by the square of the longest time.
        let scale: Vec<f64> = white.column_iter().map(|c| c.norm()).collect();
        for (mut column, s) in white.column_iter_mut().zip(&scale) {
            column /= *s;
        }
        let mut covariance = Cholesky::new(white.tr_mul(&white))?.inverse();
        for i in 0..terms.len() {
            for j in 0..terms.len() {
                covariance[(i, j)] /= scale[i] * scale[j];
            }
        }
        for (mut column, s) in white.column_iter_mut().zip(&scale) {
            column *= *s;
        }
        Some((white, covariance))
    }

    /// Generalized least squares with the covariance of the points for the amplitudes `at`.
    fn solve(&self, at: &[f64; TERMS], terms: &[usize]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let expectation = self.expectation(at)?;
        let (white, covariance) = self.information(&expectation, terms)?;
        let y = DVector::from_fn(self.y.len(), |i, _| self.y[i] / expectation.mu[i]);
        let y = expectation.factor.l_dirty().solve_lower_triangular(&y)?;
        Some((&covariance * white.tr_mul(&y), covariance))
    }

    /// Fits `terms`; `None` if one of them would be negative. Only the term in 1/τ² may be.
    ///
    /// The covariance is that of the fitted model, and is iterated with it. With weights from the measured values the low ones would count
    /// more than the high ones.
    pub fn fit(&self, terms: &[usize]) -> Option<Fitted> {
        if terms.is_empty() || terms.len() > self.y.len() {
            return None;
        }
        let mut a = [0.0; TERMS];
        // Start from half the largest possible amplitude: that of the term alone through its lowest point.
        for &k in terms {
            let most = |(d, y): (&Differences, &f64)| y / d.basis()[k];
            let all = self.points().iter().zip(&self.y).map(most);
            let at_most = all.fold(f64::INFINITY, f64::min);
            a[k] = 0.5 * at_most;
        }
        for _ in 0..60 {
            let (solution, covariance) = self.solve(&a, terms)?;
            let mut next = [0.0; TERMS];
            let mut change: f64 = 0.0;
            for (i, &k) in terms.iter().enumerate() {
                let sigma = covariance[(i, i)].sqrt();
                // Instead of a step beyond zero, the amplitude falls to a tenth: it may recover.
                next[k] = match solution[i] > 0.0 || k == PHASE {
                    true => solution[i],
                    false => 0.1 * a[k],
                };
                change = change.max((next[k] - a[k]).abs() / sigma);
                if k != PHASE && next[k] < 1e-4 * sigma {
                    return None;
                }
            }
            a = next;
            if change < 1e-3 {
                break;
            }
        }
        let expectation = self.expectation(&a)?;
        let (_, covariance) = self.information(&expectation, terms)?;
        let (chi2, deviance) = self.deviance(&expectation)?;
        Some(Fitted {
            terms: terms.to_vec(),
            a,
            covariance,
            deviance,
            chi2,
        })
    }

    /// Chi-square and deviance.
    ///
    /// The cube root of a mean square is nearly normal down to two degrees of freedom (Wilson and Hilferty 1931). The roots are assumed to
    /// be jointly normal with the correlations of the points. The points themselves are not normal: with three degrees of freedom one value
    /// in fifty is 2.8 sigmas high, and would require a random walk.
    fn deviance(&self, expectation: &Expectation) -> Option<(f64, f64)> {
        let n = self.y.len();
        let mut logs = 0.0;
        let z = DVector::from_fn(n, |i, _| {
            let variance = expectation.relative[i] / 9.0;
            logs += (2.0 / 3.0) * expectation.mu[i].ln() + variance.ln();
            ((self.y[i] / expectation.mu[i]).cbrt() - (1.0 - variance)) / variance.sqrt()
        });
        // Decorrelated by the factor of the correlations.
        let sigma = DVector::from_fn(n, |i, _| expectation.relative[i].sqrt());
        let white = expectation
            .factor
            .l_dirty()
            .solve_lower_triangular(&z.component_mul(&sigma))?;
        let l = expectation.factor.l_dirty();
        let correlation: f64 = (0..n).map(|i| 2.0 * (l[(i, i)] / sigma[i]).ln()).sum();
        let chi2 = white.norm_squared();
        Some((chi2, chi2 + correlation + logs))
    }

    /// Standard deviation and skewness of the estimate of `term` among `terms` if the true amplitudes are `a`.
    fn error_at(&self, a: &[f64; TERMS], terms: &[usize], term: usize) -> Option<(f64, f64)> {
        let expectation = self.expectation(a)?;
        let (white, covariance) = self.information(&expectation, terms)?;
        let row = terms.iter().position(|k| *k == term)?;
        // The estimate is a weighted sum of decorrelated points. The first of them is the longest, a chi-square of few degrees of freedom.
        // Each other one is the part that the next point adds, with the skewness of that point.
        let weights = white * covariance.column(row);
        let sigma = weights.norm();
        let third: f64 = (0..weights.len())
            .map(|i| weights[i].powi(3) * 2.0 * expectation.relative[i].sqrt())
            .sum();
        Some((sigma, third / sigma.powi(3)))
    }

    /// End of the confidence interval of `term`: the true amplitude for which the estimate would be the quantile with the normal deviate
    /// `z`; `None` if no amplitude above zero is.
    ///
    /// The error is that at the hypothesis instead of the estimate, and it is skew: a coefficient from three degrees of freedom has a
    /// chi-square interval, and one that is a small share of its points a nearly symmetric one.
    pub fn end(&self, fitted: &Fitted, term: usize, z: f64, excess: f64) -> Option<f64> {
        let row = fitted.terms.iter().position(|k| *k == term)?;
        let estimate = fitted.a[term];
        let quantile = |theta: f64| {
            let mut a = fitted.a;
            for (i, &k) in fitted.terms.iter().enumerate() {
                let moved = fitted.covariance[(i, row)] / fitted.covariance[(row, row)];
                a[k] += moved * (theta - estimate);
                if k != PHASE {
                    a[k] = a[k].max(0.0);
                }
            }
            a[term] = theta;
            let (sigma, skew) = self.error_at(&a, &fitted.terms, term)?;
            Some(theta + excess.sqrt() * sigma * standard_gamma(z, skew))
        };
        let beyond = |theta: f64| quantile(theta).is_some_and(|q| q > estimate);
        let sigma = fitted.covariance[(row, row)].sqrt();
        let mut ends = if z > 0.0 {
            if beyond(0.0) || quantile(0.0).is_none() && beyond(1e-6 * sigma) {
                return None;
            }
            [0.0, estimate.max(0.0)]
        } else {
            let mut high = estimate.max(0.0) + 3.0 * sigma;
            for _ in 0..40 {
                if beyond(high) {
                    break;
                }
                high *= 1.5;
            }
            [estimate.max(0.0), high]
        };
        for _ in 0..50 {
            let middle = 0.5 * (ends[0] + ends[1]);
            match beyond(middle) {
                true => ends[1] = middle,
                false => ends[0] = middle,
            }
        }
        Some(0.5 * (ends[0] + ends[1]))
    }

    /// Estimates `term`, which is not in `fitted`, in addition to its terms, with the covariance of `fitted`. A negative amplitude counts
    /// as zero: otherwise a bound would be lower if the model fits worse.
    pub fn beside(&self, fitted: &Fitted, term: usize) -> Option<Fitted> {
        let mut terms = fitted.terms.clone();
        terms.push(term);
        let (solution, covariance) = self.solve(&fitted.a, &terms)?;
        let mut beside = Fitted {
            covariance,
            terms,
            ..fitted.clone()
        };
        beside.a[term] = solution[solution.len() - 1].max(0.0);
        Some(beside)
    }

    /// Standard deviation of the estimate of `term`, which is not in `fitted`, if its amplitude is `a`.
    pub fn error_of(&self, fitted: &Fitted, term: usize, a: f64) -> Option<f64> {
        let mut terms = fitted.terms.clone();
        terms.push(term);
        let mut truth = fitted.a;
        truth[term] = a;
        Some(self.error_at(&truth, &terms, term)?.0)
    }
}

/// Quantile of a gamma distribution with mean 0, variance 1 and skewness `skew` (Pearson's type III), at the probability of the normal
/// deviate `z` (Wilson and Hilferty).
fn standard_gamma(z: f64, skew: f64) -> f64 {
    if skew.abs() < 1e-6 {
        return z;
    }
    let root = (1.0 + skew * z / 6.0 - skew * skew / 36.0).max(0.0);
    2.0 / skew * (root.powi(3) - 1.0)
}
