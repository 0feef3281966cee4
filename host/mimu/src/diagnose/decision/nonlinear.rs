//! Nonlinear parameters of the accepted effects, such as a lag or a time constant: refined together, each with an interval, and their part
//! in the uncertainty of the coefficients.
//!
//! The search finds a parameter in steps of 4 %, which is enough to compare candidates. A good recording determines a lag to 1 %, so that
//! an interval about the last step would miss the truth. Hence Gauss-Newton steps from there.

use nalgebra::DMatrix;

use super::model::Model;
use crate::diagnose::columns::beside;
use crate::diagnose::search::{Chosen, Search};
use crate::diagnose::variance::{Components, Fitted};
use crate::effects::fitted::Interval;
use crate::triad::half_width_95;

/// Most steps of the refinement: each reduces an error of some per cent by far more than half.
const STEPS: usize = 8;
/// Drop in deviance below which the steps end: a hundredth of a sigma.
const SETTLED: f64 = 1e-4;
/// Longest step of the logarithm of a parameter: beyond a factor of 1.35 the columns are no longer near their tangent.
const LONGEST: f64 = 0.3;
/// Bisections of the segment in which an end of an interval lies, usually two sigmas long.
const HALVINGS: usize = 10;

/// Nonlinear parameters of the accepted effects, and their part in the uncertainty.
#[derive(Debug, Clone)]
pub struct Nonlinear {
    /// Interval of the parameter of each accepted effect; `None` of one that has no parameter.
    pub intervals: Vec<Option<Interval>>,
    /// Derivatives of the rows by the natural logarithm of each parameter, unit of the rows.
    pub slopes: DMatrix<f64>,
    /// Covariance of the coefficients of the accepted effects, one effect after the other, and then of these logarithms. That of a
    /// coefficient allows for the uncertainty of the parameter: another lag would give another coefficient.
    pub covariance: DMatrix<f64>,
}

/// Indices of the effects with a nonlinear parameter.
fn with_parameter(kept: &[Chosen]) -> Vec<usize> {
    let has = |k: &usize| kept[*k].candidate.parameter().is_some();
    (0..kept.len()).filter(has).collect()
}

/// Derivatives of the rows by the logarithms of the parameters of `which` of the kept, at the coefficients of `fitted`.
fn slopes(search: &Search, kept: &[Chosen], which: &[usize], fitted: &Fitted) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(search.rows.y.len(), which.len());
    let all = search.coefficients(kept, fitted);
    for (column, k) in which.iter().enumerate() {
        let one = &kept[*k];
        let slope = one.candidate.slope(search.rows, one.parameter, &all[*k]);
        out.set_column(column, &slope);
    }
    out
}

/// `one` at another value of its parameter, clamped to the range that is searched.
fn at(search: &Search, one: &Chosen, parameter: f64) -> Chosen {
    let (from, to) = one
        .candidate
        .parameter()
        .map_or((parameter, parameter), |p| (p.from, p.to));
    let parameter = parameter.clamp(from, to);
    Chosen {
        columns: one.candidate.columns(search.rows, parameter),
        parameter,
        ..one.clone()
    }
}

/// Moves the nonlinear parameters of the kept effects, all together, to the maximum of the likelihood, with the noise of `with`. If
/// nothing improves, they stay.
pub(super) fn refine(search: &Search, kept: &mut Vec<Chosen>, with: &mut Fitted) {
    let which = with_parameter(kept);
    if which.is_empty() {
        return;
    }
    let mut better = kept.clone();
    let components = with.components.clone();
    let fit_at = |chosen: &[Chosen]| search.variance.fit_at(&search.model(chosen), &components);
    let Some(mut now) = fit_at(&better) else {
        return;
    };
    for _ in 0..STEPS {
        let model = search.model(&better);
        let tangent = beside(&model, &slopes(search, &better, &which, &now));
        let Some(joint) = search.variance.fit_at(&tangent, &components) else {
            break;
        };
        let step = |i: usize| joint.coefficients[model.ncols() + i].clamp(-LONGEST, LONGEST);
        let moved = [1.0, 0.5, 0.25].into_iter().find_map(|share| {
            let mut there = better.clone();
            for (i, k) in which.iter().enumerate() {
                there[*k] = at(
                    search,
                    &there[*k],
                    there[*k].parameter * (share * step(i)).exp(),
                );
            }
            let fitted = fit_at(&there)?;
            (fitted.chi2 < now.chi2).then_some((there, fitted))
        });
        let Some((there, fitted)) = moved else {
            break;
        };
        let gain = now.chi2 - fitted.chi2;
        (better, now) = (there, fitted);
        if gain < SETTLED {
            break;
        }
    }
    if let Some(fitted) = search.fit(&better) {
        (*kept, *with) = (better, fitted);
    }
}

impl Nonlinear {
    /// Of the kept effects, whose model was fitted as `last`.
    pub(super) fn of(search: &Search, kept: &[Chosen], last: &Model) -> Self {
        let which = with_parameter(kept);
        let (first, all) = (search.basis.ncols(), last.columns.ncols());
        let effects = all - first;
        let components = &last.fitted.components;
        let slopes = slopes(search, kept, &which, &last.fitted);
        let tangent = beside(&last.columns, &slopes);
        let joint = match which.is_empty() {
            true => None,
            false => search.variance.fit_at(&tangent, components),
        };
        let joint = joint.map(|joint| joint.with_prior(search.prior(kept)));
        let Some(joint) = joint else {
            // There is no parameter, or the coefficients compensate for it wholly, so that any value fits.
            let open = |k: usize| {
                which.contains(&k).then_some(Interval {
                    lower: None,
                    upper: None,
                })
            };
            return Self {
                intervals: (0..kept.len()).map(open).collect(),
                slopes: slopes.columns(0, 0).into_owned(),
                covariance: last
                    .fitted
                    .covariance
                    .view((first, first), (effects, effects))
                    .into_owned(),
            };
        };
        let size = effects + which.len();
        let mut covariance = joint
            .covariance
            .view((first, first), (size, size))
            .into_owned();
        for (i, k) in which.iter().enumerate() {
            // A parameter stays within the range that is searched. If the rows hardly determine it, its variance is at most that of a
            // uniform distribution over this range.
            let Some(p) = kept[*k].candidate.parameter() else {
                continue;
            };
            let most = (p.to / p.from).ln().powi(2) / 12.0;
            let by = covariance.column(effects + i).into_owned();
            covariance -= &by * by.transpose() / (by[effects + i] + most);
        }
        let mut intervals = vec![None; kept.len()];
        for (i, k) in which.iter().enumerate() {
            let sigma = covariance[(effects + i, effects + i)].sqrt();
            let others: Vec<usize> = (0..which.len()).filter(|j| *j != i).collect();
            let others = slopes.select_columns(&others);
            intervals[*k] = Some(profile(search, kept, *k, (&others, sigma, components)));
        }
        Self {
            intervals,
            slopes,
            covariance,
        }
    }
}

/// Interval of the parameter of the kept effect `k` by the profile of the likelihood: at each value all coefficients are fitted again, and
/// the other parameters along their `slopes`. `sigma` is approximately that of its logarithm.
fn profile(
    search: &Search,
    kept: &[Chosen],
    k: usize,
    (slopes, sigma, components): (&DMatrix<f64>, f64, &Components),
) -> Interval {
    let one = &kept[k];
    let chi2 = |parameter: f64| {
        let mut there = kept.to_vec();
        there[k] = at(search, one, parameter);
        let model = beside(&search.model(&there), slopes);
        Some(search.variance.fit_at(&model, components)?.chi2)
    };
    let (Some(best), Some(range)) = (chi2(one.parameter), one.candidate.parameter()) else {
        return Interval {
            lower: None,
            upper: None,
        };
    };
    let most = half_width_95([(1.0, f64::INFINITY)].into_iter()).powi(2);
    let inside = |parameter: f64| chi2(parameter).is_none_or(|c| c - best < most);
    let end = |bound: f64| -> Option<f64> {
        let (mut within, mut step) = (one.parameter, 2.0 * sigma.clamp(1e-6, LONGEST));
        let direction = (bound / one.parameter).ln();
        if direction == 0.0 {
            return None;
        }
        let mut beyond = loop {
            let next = within * (direction.signum() * step).exp();
            if (next / bound).ln() * direction >= 0.0 {
                if inside(bound) {
                    return None;
                }
                break bound;
            }
            if !inside(next) {
                break next;
            }
            within = next;
            step *= 1.5;
        };
        for _ in 0..HALVINGS {
            let middle = (within * beyond).sqrt();
            match inside(middle) {
                true => within = middle,
                false => beyond = middle,
            }
        }
        Some((within * beyond).sqrt())
    };
    Interval {
        lower: end(range.from),
        upper: end(range.to),
    }
}
