//! A candidate beside a model, with what is not linear in it: a nonlinear constant, or the choice of bits.

use nalgebra::DMatrix;

use super::{COEFFICIENT, Columns, Search, beside, independent_of, unit_columns};
use crate::diagnose::variance::{By, Components, Fitted};
use crate::effects::candidate::Candidate;
use crate::effects::effect::NonlinearParameter;

/// A model with noise of its own that a candidate is put beside.
pub(super) struct Beside<'a> {
    pub search: &'a Search<'a>,
    pub model: DMatrix<f64>,
    pub null: &'a Fitted,
}

/// A candidate beside it.
#[derive(Clone)]
pub(super) struct With {
    /// By how much the deviance is less.
    pub drop: f64,
    pub columns: DMatrix<f64>,
    components: Components,
}

impl With {
    fn score(&self) -> f64 {
        self.drop - COEFFICIENT * self.columns.ncols() as f64
    }
}

impl Beside<'_> {
    fn fit(&self, columns: DMatrix<f64>, start: &Components) -> Option<With> {
        let both = beside(&self.model, &unit_columns(&columns));
        let fitted = self.search.variance.fit(&both, start, By::Likelihood)?;
        Some(With {
            drop: (self.null.deviance - fitted.deviance).max(0.0),
            components: fitted.components,
            columns,
        })
    }

    /// With the best value of its nonlinear constant, if it has one: a walk uphill from its columns at the `first` with ever smaller
    /// steps.
    pub fn parameter(&self, candidate: &Candidate, first: &Columns) -> Option<(f64, With)> {
        let at_first = self.fit(first.plain.clone(), &self.null.components)?;
        self.climb(candidate, (first.parameter, at_first), |columns| columns)
    }

    /// The same of a law that is to do what the model does not yet: what of it is in the model already is no fault of it, and costs nothing.
    pub fn law(&self, law: &Candidate, first: f64) -> Option<(f64, With)> {
        let part = |columns: DMatrix<f64>| independent_of(&columns, &self.model);
        let columns = part(law.columns(self.search.rows, first));
        let at_first = self.fit(columns, &self.null.components)?;
        self.climb(law, (first, at_first), part)
    }

    fn climb(
        &self,
        candidate: &Candidate,
        mut best: (f64, With),
        part: impl Fn(DMatrix<f64>) -> DMatrix<f64>,
    ) -> Option<(f64, With)> {
        let fit = |parameter: f64, start: &Components| {
            self.fit(part(candidate.columns(self.search.rows, parameter)), start)
        };
        let Some(NonlinearParameter { from, to, .. }) = candidate.parameter() else {
            return Some(best);
        };
        let mut step: f64 = 1.35;
        while step > 1.03 {
            let mut moved = false;
            for f in [best.0 * step, best.0 / step] {
                if f < from || f > to {
                    continue;
                }
                if let Some(there) = fit(f, &best.1.components)
                    && there.drop > best.1.drop
                {
                    best = (f, there);
                    moved = true;
                    break;
                }
            }
            if !moved {
                step = step.sqrt();
            }
        }
        Some(best)
    }

    /// With the best choice of bits: one is added or dropped as long as that makes the score better.
    pub fn bits(&self, from: &Candidate) -> Option<(Candidate, With)> {
        let conditions = self.search.freed(&self.model, self.null);
        let all = self.search.bits(from, &conditions)?;
        let columns = |c: &Candidate| c.columns_of(&all);
        let first = columns(from);
        let mut best = (from.clone(), self.fit(first, &self.null.components)?);
        loop {
            let toggled = from.offered.iter().filter_map(|&bit| {
                let mut other = best.0.clone();
                match other.active.binary_search(&bit) {
                    Ok(at) => drop(other.active.remove(at)),
                    Err(at) => other.active.insert(at, bit),
                }
                if other.active.is_empty() {
                    return None;
                }
                // By the noise so far: by its own it could only be better.
                let both = beside(&self.model, &unit_columns(&columns(&other)));
                let fitted = self.search.variance.fit_at(&both, &best.1.components)?;
                let score = -fitted.deviance - COEFFICIENT * other.active.len() as f64;
                Some((other, score))
            });
            let Some((other, _)) = toggled.max_by(|a, b| a.1.total_cmp(&b.1)) else {
                return Some(best);
            };
            let with = self.fit(columns(&other), &best.1.components)?;
            if with.score() <= best.1.score() {
                return Some(best);
            }
            best = (other, with);
        }
    }
}
