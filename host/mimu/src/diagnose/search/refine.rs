//! Fits a candidate beside a model, and refines its nonlinear parameter or its choice of coefficients.

use nalgebra::DMatrix;

use super::{COEFFICIENT, Columns, Search};
use crate::diagnose::columns::{beside, independent_of, unit_columns};
use crate::diagnose::variance::{Components, Fitted, LikelihoodKind};
use crate::effects::candidate::Candidate;
use crate::effects::effect::NonlinearParameter;

/// A model with separately estimated noise, to which a candidate is added.
pub(super) struct Beside<'a> {
    pub search: &'a Search<'a>,
    pub model: DMatrix<f64>,
    pub null: &'a Fitted,
}

/// A candidate, fitted beside the model.
#[derive(Clone)]
pub(super) struct With {
    /// Drop in deviance.
    pub drop: f64,
    pub columns: DMatrix<f64>,
    /// Coefficients of the columns.
    pub values: Vec<f64>,
    components: Components,
}

impl Beside<'_> {
    fn fit(&self, columns: DMatrix<f64>, start: &Components) -> Option<With> {
        let both = beside(&self.model, &unit_columns(&columns));
        let fitted = self
            .search
            .variance
            .fit(&both, start, LikelihoodKind::Likelihood)?;
        let own = fitted
            .coefficients
            .rows(self.model.ncols(), columns.ncols());
        let each = own.iter().zip(columns.column_iter());
        Some(With {
            values: each.map(|(v, c)| v / c.norm()).collect(),
            drop: (self.null.deviance - fitted.deviance).max(0.0),
            components: fitted.components,
            columns,
        })
    }

    /// The fit at the best value of its nonlinear parameter, if it has one: a hill climb from its columns at the `first` value, with ever
    /// smaller steps.
    pub fn parameter(&self, candidate: &Candidate, first: &Columns) -> Option<(f64, With)> {
        let at_first = self.fit(first.plain.clone(), &self.null.components)?;
        self.climb(candidate, (first.parameter, at_first), |columns| columns)
    }

    /// The same for an unlisted alternative model. Only the part of it that is not in the model yet is fitted and costs degrees of freedom.
    pub fn law(&self, law: &Candidate, first: f64) -> Option<(f64, With)> {
        let part = |columns: DMatrix<f64>| independent_of(&columns, &self.model);
        let columns = part(law.columns(self.search.rows, first));
        let at_first = self.fit(columns, &self.null.components)?;
        self.climb(law, (first, at_first), part)
    }

    /// The best value of the nonlinear parameter from the `best` so far on. `part` of the columns is fitted.
    pub fn climb(
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

    /// An effect with the best choice of its coefficients at a value of its nonlinear parameter, from `start` on.
    pub fn coefficients(
        &self,
        from: &Candidate,
        parameter: f64,
        start: With,
    ) -> Option<(Candidate, With)> {
        if from.offered.len() < 2 {
            return Some((from.clone(), start));
        }
        let all = from.with_all_offered();
        self.choice(from, &all.columns(self.search.rows, parameter), start)
    }

    /// The best choice of coefficients, whose columns are `all`: one is added or dropped as long as that raises the score.
    fn choice(
        &self,
        from: &Candidate,
        all: &DMatrix<f64>,
        start: With,
    ) -> Option<(Candidate, With)> {
        let mut best = (from.clone(), start);
        // With few residual rows, a needless coefficient explains more of them (Akaike's correction for few rows).
        let (rows, model) = (self.search.rows.y.len() as f64, self.model.ncols() as f64);
        let cost = |c: &Candidate| {
            let count = c.active.len() as f64;
            COEFFICIENT * count * rows / (rows - model - count - 1.0).max(0.1)
        };
        loop {
            let toggled = from.offered.iter().filter_map(|&coefficient| {
                let other = best.0.toggled(coefficient)?;
                let columns = other.columns_of(all);
                if columns.iter().any(|v| !v.is_finite()) {
                    return None;
                }
                // With the noise so far: a separate estimate could only raise the score.
                let both = beside(&self.model, &unit_columns(&columns));
                let fitted = self.search.variance.fit_at(&both, &best.1.components)?;
                let score = -fitted.deviance - cost(&other);
                Some((other, score))
            });
            let Some((other, _)) = toggled.max_by(|a, b| a.1.total_cmp(&b.1)) else {
                return Some(best);
            };
            let with = self.fit(other.columns_of(all), &best.1.components)?;
            if with.drop - cost(&other) <= best.1.drop - cost(&best.0) {
                return Some(best);
            }
            best = (other, with);
        }
    }
}
