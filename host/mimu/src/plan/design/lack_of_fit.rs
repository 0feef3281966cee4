//! What a design would notice if the model were too small.
//!
//! A term Z that the model F lacks shows in the residual only by its part outside the columns of F,
//! `(I - H) Z`, H the hat matrix. If that part is zero, the term is aliased: the fit is as good as ever, but
//! the parameters are wrong.

use nalgebra::{DMatrix, DVector};

use super::information::stacked;
use super::model::{Model, Setting, Term};

/// Sigmas at which 90 % of recordings show an effect in a two-sided test at 5 %: 1.960 + 1.282.
pub const NOTICED: f64 = 3.242;

/// Share of a regressor outside the model (squared) below which it is aliased.
pub(crate) const ALIASED: f64 = 1e-9;

/// What a design would notice of one term.
#[derive(Debug, Clone, PartialEq)]
pub struct Notice {
    /// The term.
    pub term: Term,
    /// Number of its parameters in all regressions.
    pub parameters: usize,
    /// How many directions among them leave a trace in the residuals.
    pub noticed: usize,
    /// Smallest size that is noticed, of the parameter that is noticed worst among those that leave a trace,
    /// each alone. It is a share of the full input, for a dwell mean whose sigma is the full input: times
    /// sigma over full input it is a ratio. `None` if none leaves a trace.
    pub size: Option<f64>,
}

/// Each term that `model` lacks and its sensor may have. Rows that are `given` ([`super::information::Rows::beside`]) contradict a term as dwells do.
pub fn notices(model: &Model, settings: &[Setting], given: Option<&DMatrix<f64>>) -> Vec<Notice> {
    missing(model)
        .map(|term| notice(model, settings, given, *term))
        .collect()
}

/// How much a design would notice of all terms that `model` lacks together: `ln det(1 + Z'(I - H)Z)`, summed
/// over the regressions; what the potential terms of DuMouchel and Jones (Technometrics 36, 1994) add to the
/// criterion.
pub fn potential(model: &Model, settings: &[Setting], given: Option<&DMatrix<f64>>) -> f64 {
    let of = |regression| {
        let fitted = columns(settings, |s, row| model.regressors(regression, s, row));
        let fitted = stacked(fitted, given);
        let lacking = columns(settings, |s, row| {
            for term in missing(model) {
                model.term(*term, regression, s, row);
            }
        });
        let lacking = unseen_by(given, lacking);
        let mut basis = Vec::new();
        for column in fitted.column_iter() {
            extend(&mut basis, column.into_owned());
        }
        let rest: Vec<_> = lacking
            .column_iter()
            .map(|c| outside(&basis, c.into_owned()))
            .collect();
        let q = rest.len();
        let unit = |i, j| if i == j { 1.0 } else { 0.0 };
        DMatrix::from_fn(q, q, |i, j| unit(i, j) + rest[i].dot(&rest[j]))
            .determinant()
            .ln()
    };
    (0..model.regressions()).map(of).sum()
}

fn missing(model: &Model) -> impl Iterator<Item = &'static Term> {
    Term::of(model.sensor)
        .iter()
        .filter(|t| !model.terms.contains(t))
}

/// The columns of terms that the rows `given` know nothing of.
fn unseen_by(given: Option<&DMatrix<f64>>, lacking: DMatrix<f64>) -> DMatrix<f64> {
    let rows = given.map_or(0, DMatrix::nrows);
    let zeros = DMatrix::zeros(rows, lacking.ncols());
    stacked(lacking, Some(&zeros))
}

fn notice(model: &Model, settings: &[Setting], given: Option<&DMatrix<f64>>, term: Term) -> Notice {
    let mut found = Notice {
        term,
        parameters: 0,
        noticed: 0,
        size: None,
    };
    for regression in 0..model.regressions() {
        let fitted = columns(settings, |s, row| model.regressors(regression, s, row));
        let fitted = stacked(fitted, given);
        let lacking = columns(settings, |s, row| model.term(term, regression, s, row));
        let lacking = unseen_by(given, lacking);
        found.parameters += lacking.ncols();
        let mut basis = Vec::new();
        for column in fitted.column_iter() {
            extend(&mut basis, column.into_owned());
        }
        let own = basis.len();
        for column in lacking.column_iter() {
            let rest = outside(&basis[..own], column.into_owned());
            if rest.norm_squared() > ALIASED * column.norm_squared() {
                let size = NOTICED / rest.norm();
                found.size = Some(found.size.map_or(size, |s| s.max(size)));
            }
            extend(&mut basis, column.into_owned());
        }
        found.noticed += basis.len() - own;
    }
    found
}

/// Regressors of all settings, settings by regressors.
fn columns(settings: &[Setting], regressors: impl Fn(&Setting, &mut Vec<f64>)) -> DMatrix<f64> {
    let mut rows = Vec::new();
    for setting in settings {
        regressors(setting, &mut rows);
    }
    let width = rows.len() / settings.len().max(1);
    DMatrix::from_row_slice(settings.len(), width, &rows)
}

/// Part of `column` outside an orthonormal basis. Projected twice: the first projection leaves rounding.
pub(crate) fn outside(basis: &[DVector<f64>], mut column: DVector<f64>) -> DVector<f64> {
    for _ in 0..2 {
        for unit in basis {
            column -= unit * unit.dot(&column);
        }
    }
    column
}

/// Adds the direction of `column` to an orthonormal basis, if it is a new one.
pub(crate) fn extend(basis: &mut Vec<DVector<f64>>, column: DVector<f64>) {
    let size = column.norm_squared();
    let rest = outside(basis, column);
    if rest.norm_squared() > ALIASED * size {
        basis.push(rest.normalize());
    }
}
