//! Which effects the rows ask for: one after the other, each tested again beside the others.
//!
//! A candidate is screened by the share of the scatter that it explains, with the noise of the model so far; the best are then
//! fitted with noise of their own, and judged by the likelihood ratio, as a probability after the whole search. The noise of
//! a model that lacks an effect is too large, and a test that keeps it would miss what makes it so.

use std::borrow::Cow;

use nalgebra::DMatrix;
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::candidate::{Candidate, Kind};
use super::rows::Rows;
use super::spread::{By, Components, Fitted, Spread};

/// Probability that a clean sensor is found to have an effect of the library.
pub const FALSE_LISTED: f64 = 1.5e-3;
/// That it is found to have a term found from the data, or a jump.
pub const FALSE_FOUND: f64 = 1e-3;
/// Candidates that are fitted with noise of their own.
const FINALISTS: usize = 8;
/// Most effects of one sensor.
const MOST: usize = 5;

/// A candidate as part of a model.
#[derive(Debug, Clone)]
pub struct Chosen {
    /// Which.
    pub candidate: Candidate,
    /// Value of its nonlinear constant, 0 if it has none.
    pub form: f64,
    /// Its columns.
    pub columns: DMatrix<f64>,
    /// Probability of chance, after the whole search.
    pub p: f64,
    /// By how much the deviance grows without it.
    pub worth: f64,
    /// Others that would do nearly as well in its place, and by how much worse their deviance is.
    pub alternatives: Vec<(String, f64)>,
}

/// The search over the rows of one sensor.
pub struct Search<'a> {
    /// Rows.
    pub rows: &'a Rows,
    /// Their scatter.
    pub spread: Spread<'a>,
    /// Basis of what the affine parameters can do.
    pub basis: DMatrix<f64>,
    candidates: Vec<Candidate>,
    /// Columns of those without a nonlinear constant.
    fixed: Vec<Option<DMatrix<f64>>>,
    tests: [f64; 2],
}

/// Columns that span what `columns` do.
pub fn basis(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let svd = columns.clone().svd(true, false);
    let largest = svd.singular_values.max();
    let kept: Vec<usize> = (0..svd.singular_values.len())
        .filter(|k| svd.singular_values[*k] > 1e-9 * largest)
        .collect();
    svd.u
        .map_or_else(|| columns.clone(), |u| u.select_columns(&kept))
}

/// `matrix` with more columns behind.
pub fn beside(matrix: &DMatrix<f64>, more: &DMatrix<f64>) -> DMatrix<f64> {
    let (p, q) = (matrix.ncols(), more.ncols());
    let mut all = matrix.clone().resize_horizontally(p + q, 0.0);
    all.columns_mut(p, q).copy_from(more);
    all
}

/// What the rows would still show of `columns` beside `others`, decorrelated.
fn across(others: &DMatrix<f64>, columns: &DMatrix<f64>) -> DMatrix<f64> {
    columns - others * others.tr_mul(columns)
}

/// Probability that chance makes F with these degrees of freedom as large.
fn exceeds(f: f64, p: f64, dof: f64) -> f64 {
    match FisherSnedecor::new(p, dof) {
        Ok(d) if f.is_finite() && f > 0.0 => d.sf(f),
        _ => 1.0,
    }
}

impl<'a> Search<'a> {
    /// Over `rows` for `candidates`.
    pub fn new(rows: &'a Rows, candidates: Vec<Candidate>) -> Self {
        let count = |listed: bool| -> f64 {
            let ours = candidates.iter().filter(|c| c.is_listed() == listed);
            ours.map(|c| c.tests()).sum::<f64>().max(1.0)
        };
        Self {
            rows,
            spread: Spread::new(rows, false),
            basis: basis(&rows.nuisance),
            tests: [count(true), count(false)],
            fixed: candidates
                .par_iter()
                .map(|c| c.form_range().is_none().then(|| c.columns(rows, 0.0)))
                .collect(),
            candidates,
        }
    }

    fn columns(&self, index: usize, form: f64) -> Cow<'_, DMatrix<f64>> {
        match &self.fixed[index] {
            Some(columns) => Cow::Borrowed(columns),
            None => Cow::Owned(self.candidates[index].columns(self.rows, form)),
        }
    }

    /// Columns of the affine parameters and of the chosen.
    pub fn model(&self, chosen: &[Chosen]) -> DMatrix<f64> {
        chosen
            .iter()
            .fold(self.basis.clone(), |m, c| beside(&m, &c.columns))
    }

    /// The model with the chosen effects, with noise of its own.
    pub fn fit(&self, chosen: &[Chosen]) -> Option<Fitted> {
        self.spread
            .fit(&self.model(chosen), &self.spread.none(), By::Likelihood)
    }

    /// Degrees of freedom that a model leaves.
    fn dof(&self, columns: usize) -> f64 {
        self.rows.y.len() as f64 - columns as f64
    }

    /// Probability of chance, after the search, of a drop of the deviance by `drop` for `p` more columns.
    ///
    /// By F: where the size of the noise is found from the rows, `n ln(1 + p F/dof)` is the drop, exactly; where it is known
    /// and F's `dof` is large, it is chi-square.
    fn chance(&self, drop: f64, p: usize, columns: usize, listed: bool) -> f64 {
        let n = self.rows.y.len() as f64;
        let dof = self.dof(columns + p);
        if !(drop > 0.0) || dof < 2.0 {
            return 1.0;
        }
        let f = ((drop / n).exp_m1()) * dof / p as f64;
        let tests = self.tests[usize::from(!listed)];
        (exceeds(f, p as f64, dof) * tests).min(1.0)
    }

    /// Screens all candidates beside the chosen ones; the most promising first: candidate, form, chance.
    fn screen(&self, chosen: &[Chosen], null: &Fitted) -> Vec<(usize, f64, f64)> {
        let Some(whitener) = self.spread.whitener(&null.components) else {
            return Vec::new();
        };
        let y = DMatrix::from_column_slice(self.rows.y.len(), 1, self.rows.y.as_slice());
        let (white, y) = (whitener.whiten(&self.model(chosen)), whitener.whiten(&y));
        let others = white.qr().q();
        let left = across(&others, &y);
        let total = left.norm_squared();
        let taken = |c: &Candidate| chosen.iter().any(|k| k.candidate.id() == c.id());
        let mut found: Vec<(usize, f64, f64)> = (0..self.candidates.len())
            .into_par_iter()
            .filter(|i| !taken(&self.candidates[*i]))
            .flat_map_iter(|i| {
                let candidate = &self.candidates[i];
                let mut best: Option<(usize, f64, f64)> = None;
                for form in candidate.forms() {
                    let white = whitener.whiten(&self.columns(i, form));
                    let Some(p) = self.explained(&others, &left, total, &white) else {
                        continue;
                    };
                    if best.is_none_or(|b| p < b.2) {
                        best = Some((i, form, p));
                    }
                }
                best
            })
            .collect();
        found.sort_by(|a, b| a.2.total_cmp(&b.2));
        found
    }

    fn explained(
        &self,
        others: &DMatrix<f64>,
        left: &DMatrix<f64>,
        total: f64,
        white: &DMatrix<f64>,
    ) -> Option<f64> {
        let raw: Vec<f64> = white.column_iter().map(|c| c.norm()).collect();
        let mut z = across(others, white);
        for (mut column, raw) in z.column_iter_mut().zip(&raw) {
            let norm = column.norm();
            // What rounding leaves of a column that the others span.
            if !(norm > 1e-7 * raw) || !norm.is_finite() {
                return None;
            }
            column /= norm;
        }
        let svd = z.svd(true, false);
        let rank = svd.singular_values.iter().filter(|s| **s > 1e-4).count();
        let u = svd.u?;
        let explained: f64 = (0..rank)
            .map(|k| u.column(k).dot(&left.column(0)).powi(2))
            .sum();
        let dof = self.dof(others.ncols() + rank);
        if rank == 0 || dof < 2.0 {
            return None;
        }
        let f = explained / rank as f64 / ((total - explained) / dof);
        Some(exceeds(f, rank as f64, dof))
    }

    /// `candidate` beside the chosen, its form refined, with noise of its own: the drop of the deviance and its chance.
    fn judge(&self, chosen: &[Chosen], null: &Fitted, index: usize, form: f64) -> Option<Chosen> {
        let candidate = &self.candidates[index];
        let model = self.model(chosen);
        let fit = |form: f64, start: &Components| {
            let columns = self.columns(index, form).into_owned();
            let both = beside(&model, &unit_columns(&columns));
            let with = self.spread.fit(&both, start, By::Likelihood)?;
            Some((
                (null.deviance - with.deviance).max(0.0),
                with.components,
                columns,
            ))
        };
        let mut best = (form, fit(form, &null.components)?);
        if let Some((from, to)) = candidate.form_range() {
            let mut step: f64 = 1.35;
            while step > 1.03 {
                let mut moved = false;
                for f in [best.0 * step, best.0 / step] {
                    if f < from || f > to {
                        continue;
                    }
                    if let Some(there) = fit(f, &best.1.1)
                        && there.0 > best.1.0
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
        }
        let (form, (drop, _, columns)) = best;
        let p = self.chance(drop, columns.ncols(), model.ncols(), candidate.is_listed());
        Some(Chosen {
            candidate: candidate.clone(),
            form,
            columns,
            p,
            worth: drop,
            alternatives: Vec::new(),
        })
    }

    /// The best candidates beside the chosen, each with noise of its own, the least by chance first.
    fn finalists(&self, chosen: &[Chosen], null: &Fitted) -> Vec<Chosen> {
        let screened = self.screen(chosen, null);
        let of = |listed: bool| {
            screened
                .iter()
                .filter(move |s| self.candidates[s.0].is_listed() == listed)
                .take(FINALISTS)
        };
        let picked: Vec<_> = of(true).chain(of(false)).collect();
        let mut judged: Vec<Chosen> = picked
            .into_par_iter()
            .filter_map(|&(i, form, _)| self.judge(chosen, null, i, form))
            .collect();
        judged.sort_by(|a, b| a.p.total_cmp(&b.p).then(b.worth.total_cmp(&a.worth)));
        judged
    }

    /// The named effects that are not among the chosen, each beside them with noise of its own.
    pub fn others(&self, chosen: &[Chosen], now: &Fitted) -> Vec<Chosen> {
        let screened = self.screen(chosen, now);
        let listed = screened
            .into_par_iter()
            .filter(|s| self.candidates[s.0].is_listed());
        listed
            .filter_map(|(i, form, _)| self.judge(chosen, now, i, form))
            .collect()
    }

    /// The effects that the rows ask for.
    ///
    /// A named effect goes before a term found from the data unless the term is better by 12 in deviance: with two thousand terms
    /// some product is always near an effect.
    pub fn run(&self) -> Option<(Vec<Chosen>, Fitted)> {
        let mut chosen: Vec<Chosen> = Vec::new();
        let mut now = self.fit(&chosen)?;
        while chosen.len() < MOST {
            let finalists = self.finalists(&chosen, &now);
            let significant = |c: &&Chosen| {
                c.p < if c.candidate.is_listed() {
                    FALSE_LISTED
                } else {
                    FALSE_FOUND
                }
            };
            let best_of = |listed: bool| {
                finalists
                    .iter()
                    .filter(significant)
                    .filter(|c| c.candidate.is_listed() == listed)
                    .max_by(|a, b| score(a).total_cmp(&score(b)))
            };
            let best = match (best_of(true), best_of(false)) {
                (Some(a), Some(b)) if score(b) > score(a) + PREFERENCE => b,
                (Some(a), _) => a,
                (None, Some(b)) => b,
                (None, None) => break,
            };
            let mut best = best.clone();
            best.alternatives = finalists
                .iter()
                .filter(|c| c.candidate.id() != best.candidate.id())
                .filter(|c| score(&best) - score(c) < CONFUSED && significant(c))
                .map(|c| (c.candidate.id(), score(&best) - score(c)))
                .collect();
            chosen.push(best);
            now = self.fit(&chosen)?;
            self.again(&mut chosen, &mut now)?;
        }
        Some((chosen, now))
    }

    /// Tests each of the chosen again beside the others: what they have made superfluous goes.
    fn again(&self, chosen: &mut Vec<Chosen>, now: &mut Fitted) -> Option<()> {
        let mut i = 0;
        while i < chosen.len() && chosen.len() > 1 {
            let mut rest = chosen.clone();
            let one = rest.remove(i);
            let without = self.fit(&rest)?;
            let model = self.model(&rest);
            let drop = (without.deviance - now.deviance).max(0.0);
            let listed = one.candidate.is_listed();
            let p = self.chance(drop, one.columns.ncols(), model.ncols(), listed);
            if p > if listed { FALSE_LISTED } else { FALSE_FOUND } {
                *chosen = rest;
                *now = without;
                i = 0;
            } else {
                chosen[i].p = p;
                chosen[i].worth = drop;
                i += 1;
            }
        }
        Some(())
    }
}

/// How good a candidate is among others with more or fewer coefficients: the drop of the deviance less what each coefficient
/// costs (Akaike's two, doubled, as for each there are several candidates). Of products that are the same in this recording the
/// shortest is told.
fn score(c: &Chosen) -> f64 {
    let coefficients = c.columns.ncols() as f64 + if c.form > 0.0 { 1.0 } else { 0.0 };
    let order = match &c.candidate.kind {
        Kind::Term(_, monomial) => monomial.0.len() as f64,
        _ => 0.0,
    };
    c.worth - 4.0 * coefficients - order
}

/// Deviance by which a term found from the data has to be better than an effect with a name.
const PREFERENCE: f64 = 12.0;
/// Deviance within which two candidates are told to be confused: odds of one to four hundred.
const CONFUSED: f64 = 12.0;

/// Columns of size 1.
pub fn unit_columns(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let mut columns = columns.clone();
    for mut column in columns.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column /= norm;
        }
    }
    columns
}

impl Candidate {
    /// How many independent tests it counts for.
    fn tests(&self) -> f64 {
        match self.kind {
            Kind::Effect(e) if e.form.is_some() => 4.0,
            _ => 1.0,
        }
    }
}
