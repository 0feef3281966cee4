//! Errors of data that a model has not seen, compared with what is predicted of them.
//!
//! A right model errs on unseen data by the noise of these data, and by the errors of its own parameters, which noise in the data of the fit has caused. Both
//! are known before the data are seen, so the errors `e` have a predicted covariance S, and the mean of `eᵀ S⁻¹ e` over them is that of chi-square. The
//! errors of one part of a recording share the errors of the parameters, and are decorrelated together.
//!
//! What a misfit adds to an interval is not in S: an error that it excused would be excused the more, the larger it is.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::estimate::least_squares::{Errors, Scatter};

/// Share of sessions of a right model that are judged to err, all their tests together.
pub const FALSE_ALARM: f64 = 1.0 / 200.0;
/// Tests of a session: the figures of gyro and accelerometer, rates at rest, and headings after whole turns.
const TESTS: f64 = 4.0;
/// An error counts only if it is also this many times the predicted one. The noise within dwells predicts that between them no better: it does not show how a
/// bias moves while the unit is turned. Of 600 clean sessions by hand of three grades one in a hundred reached 2.2, and none 2.5.
pub const BEYOND_NOISE: f64 = 2.5;
/// If an error of more than this many times the noise would pass, the data do not test the model. Of n errors that determine p parameters, the parameters follow
/// the share p/n, so that eighteen poses for nine parameters are the fewest.
pub const VISIBLE: f64 = 3.3;

/// Errors of one part of the unseen data.
#[derive(Debug, Clone)]
pub struct Unseen {
    /// Errors.
    pub errors: DVector<f64>,
    /// Their variances by their own noise.
    pub noise: DVector<f64>,
    /// Their predicted covariance: noise, and what the parameters add.
    pub predicted: Errors,
}

impl Unseen {
    /// Errors with these variances by noise, whose derivatives by parameters are `by`; these have the covariance `factor factorᵀ`.
    pub fn of(
        errors: DVector<f64>,
        noise: DVector<f64>,
        by: &DMatrix<f64>,
        factor: &DMatrix<f64>,
    ) -> Self {
        let predicted = match factor.ncols() {
            0 => Errors::Independent(noise.clone()),
            _ => Errors::Shared(noise.clone(), by * factor),
        };
        Self {
            errors,
            noise,
            predicted,
        }
    }
}

/// How the errors of unseen data compare with what is predicted of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Test {
    /// Rms of the errors in predicted standard deviations, decorrelated: 1 if the model is right.
    pub ratio: f64,
    /// Largest [`Self::ratio`] that counts as right: of [`FALSE_ALARM`], and [`BEYOND_NOISE`].
    pub limit: f64,
    /// The smallest error that would exceed the limit, in standard deviations of the noise of the data.
    pub visible: f64,
    /// Predicted rms, in the unit of the errors; null if it is not computed.
    pub predicted: f64,
    /// The part of it by the noise of the data themselves.
    pub noise: f64,
    /// Number of errors.
    pub count: usize,
    /// Degrees of freedom of the mean square.
    pub dof: f64,
}

/// Largest rms, in predicted standard deviations, that chance and an inexact noise explain for so many degrees of freedom.
pub fn limit(dof: f64) -> f64 {
    let quantile = |d: ChiSquared| d.inverse_cdf(1.0 - FALSE_ALARM / TESTS);
    let by_chance = match dof >= 1.0 {
        true => ChiSquared::new(dof).map_or(f64::INFINITY, quantile) / dof,
        false => f64::INFINITY,
    };
    by_chance.sqrt().max(BEYOND_NOISE)
}

/// The smallest error that exceeds the limit, in standard deviations of the noise, if the parameters leave this `share` of it in the errors.
fn visible(limit: f64, share: f64) -> f64 {
    ((limit * limit - 1.0) / share).sqrt()
}

/// The fewest of equal dwells or turns that test a model: more than `count`, whose errors (`each` of one of them) determine so many `parameters`.
pub fn fewest(count: usize, each: f64, parameters: f64) -> Option<usize> {
    let enough = |n: &usize| {
        let rows = each * *n as f64;
        let dof = rows - parameters;
        dof >= 1.0 && visible(limit(dof), dof / rows) <= VISIBLE
    };
    (count + 1..count + 1000).find(enough)
}

impl Test {
    /// Of all `parts`, in each of which all errors were unseen. The model was fitted to `rows` errors like these, with so many degrees of freedom `dof`;
    /// infinite for a model that was fitted to other data. So many numbers were `taken` from the errors themselves, such as the biases of power-ons. `None`
    /// without an error, or if the noise is not known.
    pub fn of(parts: &[Unseen], (dof, rows): (f64, f64), taken: f64) -> Option<Self> {
        let count: usize = parts.iter().map(|p| p.errors.len()).sum();
        let noise: f64 = parts.iter().map(|p| p.noise.sum()).sum();
        if count == 0 || !(noise > 0.0) {
            return None;
        }
        let n = count as f64;
        let (mut squares, mut seen, mut predicted) = (0.0, 0.0, 0.0);
        for part in parts {
            squares += part.predicted.chi2(0.0, &part.errors);
            seen += part.noise.dot(&part.predicted.precisions()?);
            predicted += part.predicted.variances().sum();
        }
        let left = (n - taken).max(1.0);
        let dof = match dof.is_finite() {
            true => dof * n / rows,
            false => n,
        };
        let dof = dof - taken;
        let limit = limit(dof);
        Some(Self {
            ratio: (squares / left).sqrt(),
            limit,
            visible: visible(limit, seen / n * (left / n)),
            predicted: (predicted / n).sqrt(),
            noise: (noise / n).sqrt(),
            count,
            dof,
        })
    }

    /// Of the residuals of a fit, with their degrees of freedom. `None` if there are too few to tell.
    pub fn of_scatter(scatter: &Scatter, rows: f64) -> Option<Self> {
        let limit = limit(scatter.dof);
        (scatter.dof >= 1.0 && scatter.chi2.is_finite()).then(|| Self {
            ratio: (scatter.chi2 / scatter.dof).sqrt(),
            limit,
            visible: visible(limit, scatter.dof / rows),
            predicted: f64::NAN,
            noise: f64::NAN,
            count: rows as usize,
            dof: scatter.dof,
        })
    }

    /// Of an rms error of `count` data over their noise, if nothing more is known of either.
    pub fn of_ratio(ratio: f64, limit: f64, count: usize) -> Self {
        Self {
            ratio,
            limit,
            visible: visible(limit, 1.0),
            predicted: f64::NAN,
            noise: f64::NAN,
            count,
            dof: count as f64,
        }
    }

    /// Whether the errors exceed what is predicted.
    pub fn fails(&self) -> bool {
        !(self.ratio <= self.limit)
    }

    /// Whether errors of the model would show.
    pub fn can_fail(&self) -> bool {
        self.visible <= VISIBLE.max(self.limit)
    }
}
