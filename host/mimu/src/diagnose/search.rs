//! Search for the effects that explain the rows: one after the other, each tested again beside the others.
//!
//! A candidate is screened by the share of the scatter that it explains, with the noise of the model so far. The best are then fitted with
//! separately estimated noise, and judged by the likelihood ratio, as a probability that allows for the number of tests. The noise of a model
//! that lacks an effect is too large, so a test with that noise would miss the effect.

mod chosen;
mod forward;
mod refine;
mod screen;

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::columns::{basis, beside};
use super::rows::Rows;
use super::variance::{Fitted, LikelihoodKind, VarianceModel};
use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::effect::Effect;
use chosen::score;
pub(super) use chosen::without;
pub use chosen::{Alternative, COEFFICIENT, Chosen};
use refine::{Beside, With};
use screen::Screened;

/// Probability that a clean sensor is found to have an effect of the library.
pub const FALSE_LISTED: f64 = 1.5e-3;
/// The same for a term found from the data, or a jump.
pub const FALSE_FOUND: f64 = 1e-3;
/// Number of products and jumps that are fitted with separately estimated noise.
const FINALISTS: usize = 8;
/// Most effects of one sensor, and most terms and jumps found from the data. They are counted separately: over a wide range of temperatures the
/// cubes of three axes took three of five places, were not accepted, and kept out a lag that halved the residual.
pub const MOST: usize = 5;

/// Result of a search.
pub struct Found {
    /// Effects that explain the rows.
    pub chosen: Vec<Chosen>,
    /// The fit with these.
    pub fit: Fitted,
    /// Ids of effects that were chosen at first, and made superfluous by others.
    pub superfluous: Vec<String>,
}

/// Columns of a candidate at a value of its nonlinear parameter.
struct Columns {
    parameter: f64,
    plain: DMatrix<f64>,
    /// See [`VarianceModel::rotate`].
    rotated: DMatrix<f64>,
}

/// The search over the rows of one sensor.
pub struct Search<'a> {
    /// Rows.
    pub rows: &'a Rows,
    /// Model of their variance.
    pub variance: VarianceModel<'a>,
    /// Basis of the columns of the affine parameters.
    pub basis: DMatrix<f64>,
    candidates: Vec<Candidate>,
    /// Columns of each candidate at each parameter that is screened.
    screened: Vec<Vec<Columns>>,
    tests: [f64; 2],
}

/// Probability by chance of an F this large, with these degrees of freedom.
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
            let ours = candidates.iter().enumerate().filter(|(i, c)| {
                // Variants of one candidate follow each other.
                c.is_listed() == listed && !(*i > 0 && candidates[i - 1].is_variant_of(c))
            });
            ours.map(|(_, c)| c.tests()).sum::<f64>().max(1.0)
        };
        let variance = VarianceModel::new(rows, false);
        let screened = candidates.par_iter().map(|one| {
            let at = |parameter| {
                let plain = one.columns(rows, parameter);
                let rotated = variance.rotate(&plain);
                Columns {
                    parameter,
                    plain,
                    rotated,
                }
            };
            one.parameters().into_iter().map(at).collect()
        });
        let screened = screened.collect();
        Self {
            rows,
            screened,
            basis: basis(&rows.nuisance),
            tests: [count(true), count(false)],
            variance,
            candidates,
        }
    }

    /// The columns of each of the chosen among those of the [model](Self::model).
    pub(super) fn places(&self, chosen: &[Chosen]) -> Vec<Range<usize>> {
        let counts = chosen.iter().map(|one| one.columns.ncols());
        let places = counts.scan(self.basis.ncols(), |end, count| {
            *end += count;
            Some(*end - count..*end)
        });
        places.collect()
    }

    /// The coefficients of each of the chosen.
    pub(super) fn coefficients(&self, chosen: &[Chosen], fit: &Fitted) -> Vec<DVector<f64>> {
        let places = self.places(chosen).into_iter();
        let each = places.map(|of| fit.coefficients.rows_range(of).into_owned());
        each.collect()
    }

    /// The prior of the coefficients of the chosen: column of the [model](Self::model), and standard deviation.
    pub(super) fn prior(&self, chosen: &[Chosen]) -> Vec<(usize, f64)> {
        let each = chosen.iter().zip(self.places(chosen));
        let each = each.flat_map(|(one, columns)| columns.map(|k| Some((k, one.size?))));
        each.flatten().collect()
    }

    /// The axes of a chosen nonlinearity stay together, as one law acts on all. The search chooses those that its score can pay for; with the others at
    /// zero these take their share. Of an accelerometer's cubic of 12 mg/g³ along all axes, in poses within 15° of the faces, x came out as 21.9 ± 2.0
    /// and z as 11.5 ± 4.0, without y.
    fn join_axes(&self, chosen: &mut [Chosen], k: usize, now: &mut Fitted) {
        let CandidateKind::Effect(effect) = chosen[k].candidate.kind else {
            return;
        };
        let own = now.coefficients.rows_range(self.places(chosen)[k].clone());
        let typical = effect.coefficients.iter().map(|c| c.typical);
        let size = typical
            .chain(own.iter().map(|v| v.abs()))
            .fold(0.0, f64::max);
        let before = chosen[k].clone();
        // All of its coefficients together are no choice among them.
        let candidate = Candidate {
            choices: before.candidate.choices / before.candidate.choices_of_coefficients(),
            ..before.candidate.with_all_offered()
        };
        chosen[k].columns = candidate.columns(self.rows, before.parameter);
        chosen[k].candidate = candidate;
        chosen[k].size = Some(size);
        match self.fit(chosen) {
            Some(fit) => *now = fit,
            None => chosen[k] = before,
        }
    }

    /// Adds the [siblings](Candidate::siblings) of each chosen effect's coefficients, if the rows would show them at data-sheet size beside all
    /// others. A nonlinearity gets those of all axes.
    pub fn complete(&self, chosen: &mut [Chosen], now: &mut Fitted) {
        for k in 0..chosen.len() {
            if chosen[k].candidate.is_nonlinearity() {
                if chosen[k].size.is_none() {
                    self.join_axes(chosen, k, now);
                }
                continue;
            }
            let before = chosen[k].clone();
            let CandidateKind::Effect(effect) = before.candidate.kind else {
                continue;
            };
            let mut more = before.candidate.siblings();
            let first = self.places(chosen)[k].start;
            while !more.is_empty() {
                let one = &mut chosen[k];
                one.candidate.active = [&before.candidate.active[..], &more[..]].concat();
                one.candidate.active.sort_unstable();
                one.columns = one.candidate.columns(self.rows, one.parameter);
                let active = one.candidate.active.clone();
                let fit = self.fit(chosen);
                let open = fit.as_ref().map(|fit| {
                    let sigma = |at: usize| {
                        let place = first + at;
                        fit.covariance[(place, place)].sqrt()
                    };
                    let ratio = |k: &usize| {
                        let at = active.binary_search(k).unwrap_or(0);
                        EXCITED * sigma(at) / effect.coefficients[*k].typical
                    };
                    let each = more.iter().map(|k| (*k, ratio(k)));
                    each.filter(|e| !(e.1 < 1.0))
                        .max_by(|a, b| a.1.total_cmp(&b.1))
                });
                match (fit, open) {
                    (Some(fit), Some(None)) => {
                        *now = fit;
                        break;
                    }
                    (Some(_), Some(Some((worst, _)))) => more.retain(|k| *k != worst),
                    _ => more.clear(),
                }
                chosen[k] = before.clone();
            }
        }
    }

    /// Columns of the affine parameters and of the chosen.
    pub fn model(&self, chosen: &[Chosen]) -> DMatrix<f64> {
        chosen
            .iter()
            .fold(self.basis.clone(), |m, c| beside(&m, &c.columns))
    }

    /// The model with the chosen effects and separately estimated noise.
    pub fn fit(&self, chosen: &[Chosen]) -> Option<Fitted> {
        let fitted = self.variance.fit(
            &self.model(chosen),
            &self.variance.none(),
            LikelihoodKind::Likelihood,
        )?;
        Some(fitted.with_prior(self.prior(chosen)))
    }

    /// Residual degrees of freedom of a model with so many columns.
    fn dof(&self, columns: usize) -> f64 {
        self.rows.y.len() as f64 - columns as f64
    }

    /// Probability by chance of a drop in deviance of `drop` for `p` more columns of `candidate`, corrected for the number of tests.
    ///
    /// By F: if the noise is estimated from the rows, the drop is exactly `n ln(1 + p F/dof)`. If the noise is known and F's `dof` is large, it
    /// is chi-square.
    pub(super) fn chance(&self, drop: f64, p: usize, columns: usize, candidate: &Candidate) -> f64 {
        let tests = self.tests[usize::from(!candidate.is_listed())] * candidate.choices;
        (self.exceeds_by_chance(drop, p, columns) * tests).min(1.0)
    }

    /// The same for a single test.
    pub(super) fn exceeds_by_chance(&self, drop: f64, p: usize, columns: usize) -> f64 {
        let n = self.rows.y.len() as f64;
        let dof = self.dof(columns + p);
        if !(drop > 0.0) || dof < 2.0 {
            return 1.0;
        }
        let f = ((drop / n).exp_m1()) * dof / p as f64;
        exceeds(f, p as f64, dof)
    }

    /// A candidate beside the chosen effects, with refined parameter and separately estimated noise: the drop in deviance and its
    /// probability by chance.
    fn judge(&self, chosen: &[Chosen], null: &Fitted, screened: &Screened) -> Option<Chosen> {
        let candidate = &self.candidates[screened.index];
        let beside_these = Beside {
            search: self,
            model: self.model(chosen),
            null,
        };
        let affine = beside_these.model.ncols();
        let chance = |candidate: &Candidate, with: &With| {
            self.chance(with.drop, with.columns.ncols(), affine, candidate)
        };
        let at = |c: &&Columns| c.parameter == screened.parameter;
        let first = self.screened[screened.index].iter().find(at)?;
        let (parameter, with) = beside_these.parameter(candidate, first)?;
        // With all of its coefficients an effect is one test, whichever of them are chosen afterwards.
        let whole = chance(candidate, &with);
        let before = candidate.active.len();
        let (mut candidate, with) = beside_these.coefficients(candidate, parameter, with)?;
        let (parameter, with) = match candidate.active.len() == before {
            true => (parameter, with),
            false => beside_these.climb(&candidate, (parameter, with), |c| c)?,
        };
        candidate.choices *= candidate.choices_of_coefficients();
        let p = chance(&candidate, &with).min(whole);
        Some(Chosen {
            unlikely: candidate.unlikely(&with.values),
            columns: with.columns,
            drop: with.drop,
            size: None,
            candidate,
            parameter,
            p,
            alternatives: Vec::new(),
        })
    }

    /// The best candidates beside the chosen effects, each with separately estimated noise, the least probable by chance first.
    fn finalists(&self, chosen: &[Chosen], null: &Fitted) -> Vec<Chosen> {
        let screened = self.screen(chosen, null);
        // Every named effect is a rival of every other.
        let of = |listed: bool| {
            let alike = move |s: &&Screened| self.candidates[s.index].is_listed() == listed;
            let count = if listed { usize::MAX } else { FINALISTS };
            screened.iter().filter(alike).take(count)
        };
        let picked: Vec<_> = of(true).chain(of(false)).collect();
        let mut judged: Vec<Chosen> = picked
            .into_par_iter()
            .filter_map(|s| self.judge(chosen, null, s))
            .collect();
        judged.sort_by(|a, b| a.p.total_cmp(&b.p).then(b.drop.total_cmp(&a.drop)));
        judged
    }

    /// The named effects that were not chosen, each beside the chosen ones with separately estimated noise.
    pub fn others(&self, chosen: &[Chosen], now: &Fitted) -> Vec<Chosen> {
        let screened = self.screen(chosen, now);
        let listed = screened
            .into_par_iter()
            .filter(|s| self.candidates[s.index].is_listed());
        let mut judged: Vec<Chosen> = listed.filter_map(|s| self.judge(chosen, now, &s)).collect();
        judged.sort_by(|a, b| a.p.total_cmp(&b.p));
        judged
    }

    /// The candidate of a named effect with all of its coefficients that the rows determine; `None` if it is not tried.
    pub(super) fn candidate_of(&self, effect: &Effect) -> Option<&Candidate> {
        let mut all = self.candidates.iter();
        all.find(|c| matches!(c.kind, CandidateKind::Effect(e) if e == effect))
    }

    /// How much lower the score is with `law` in place of `one` beside `rest`; negative if it is higher.
    pub fn worse_with(&self, law: &'static Effect, one: &Chosen, rest: &[Chosen]) -> Option<f64> {
        let null = self.fit(rest)?;
        let beside_these = Beside {
            search: self,
            model: self.model(rest),
            null: &null,
        };
        let law = Candidate::new(self.rows.sensor, CandidateKind::Effect(law));
        let best_of = |parameter| beside_these.law(&law, parameter);
        let found = law.parameters().into_par_iter().filter_map(best_of);
        let (parameter, with) = found.max_by(|a, b| a.1.drop.total_cmp(&b.1.drop))?;
        let shadow = Chosen {
            drop: with.drop,
            columns: with.columns,
            candidate: law,
            parameter,
            ..one.clone()
        };
        Some(score(one) - score(&shadow))
    }
}

/// An effect is not excited if its coefficient at data-sheet size would be fewer sigmas than this.
pub(super) const EXCITED: f64 = 3.0;

/// Largest coefficient that is sought, in data-sheet sizes. A coefficient that would not be seen even at that size is not determined: if the
/// temperature is constant to a millikelvin, or the rates are only rounding, any coefficient fits.
pub(super) const LARGEST: f64 = 1e4;

/// Part of a column that must be independent of the other columns of its effect. At rest the squares of the force add up to a constant to within
/// some 1e-4, the scatter of the measured magnitude. At 1e-2 the linear and the quadratic part of a thermal bias over a narrow range of
/// temperatures would not be distinguished.
pub(super) const SEPARATE: f64 = 1e-3;

/// Difference in score below which two candidates are reported as confused: odds of one to four hundred.
pub(super) const CONFUSED: f64 = 12.0;

impl Candidate {
    /// Whether both are the same but for the choice of coefficients.
    fn is_variant_of(&self, other: &Self) -> bool {
        self.kind == other.kind
    }

    /// Number of independent tests that it counts as, apart from the choice among its variants.
    fn tests(&self) -> f64 {
        match self.kind {
            CandidateKind::Effect(_) if self.parameter().is_some() => 4.0,
            _ => 1.0,
        }
    }
}
