//! Which effects the rows ask for: one after the other, each tested again beside the others.
//!
//! A candidate is screened by the share of the scatter that it explains, with the noise of the model so far; the best are then
//! fitted with noise of their own, and judged by the likelihood ratio, as a probability after the whole search. The noise of
//! a model that lacks an effect is too large, and a test that keeps it would miss what makes it so.

mod refine;
mod screen;

use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::rows::Rows;
use super::variance::{Fitted, LikelihoodKind, VarianceModel};
use crate::effects::candidate::{Candidate, Kind};
use crate::effects::effect::Effect;
use crate::effects::quantity::Conditions;
use refine::{Beside, With};
use screen::Screened;

/// Probability that a clean sensor is found to have an effect of the library.
pub const FALSE_LISTED: f64 = 1.5e-3;
/// That it is found to have a term found from the data, or a jump.
pub const FALSE_FOUND: f64 = 1e-3;
/// Products and jumps that are fitted with noise of their own.
const FINALISTS: usize = 8;
/// Most effects of one sensor, and most terms and jumps found from the data. Counted apart: over a wide range of temperatures the cubes of three
/// axes took three of five places, were not accepted, and kept out a lag that halved what was left.
pub const MOST: usize = 5;

/// A candidate as part of a model.
#[derive(Debug, Clone, Serialize)]
pub struct Chosen {
    /// Which.
    #[serde(skip)]
    pub candidate: Candidate,
    /// Value of its nonlinear constant, 0 if it has none.
    #[serde(skip)]
    pub parameter: f64,
    /// Its columns.
    #[serde(skip)]
    pub columns: DMatrix<f64>,
    /// Probability of chance, after the whole search.
    #[serde(rename = "chance")]
    pub p: f64,
    /// By how much the deviance grows without it.
    #[serde(skip)]
    pub drop: f64,
    /// By how much the sizes of its coefficients speak against it, in units of the deviance.
    #[serde(skip)]
    pub unlikely: f64,
    /// Others that would do nearly as well in its place.
    pub alternatives: Vec<Alternative>,
}

/// A candidate that would do nearly as well in the place of another.
#[derive(Debug, Clone, Serialize)]
pub struct Alternative {
    /// Public id.
    pub id: String,
    /// What it is.
    #[serde(skip)]
    pub kind: Kind,
    /// By how much its score is worse.
    pub score_worse_by: f64,
}

impl Alternative {
    /// A candidate whose score is worse by `score_worse_by`.
    pub fn of(candidate: &Candidate, score_worse_by: f64) -> Self {
        Self {
            id: candidate.id(),
            kind: candidate.kind.clone(),
            score_worse_by,
        }
    }
}

impl From<(&'static Effect, f64)> for Alternative {
    fn from((effect, score_worse_by): (&'static Effect, f64)) -> Self {
        Self {
            id: effect.id.into(),
            kind: Kind::Effect(effect),
            score_worse_by,
        }
    }
}

/// What a search led to.
pub struct Found {
    /// What the rows ask for.
    pub chosen: Vec<Chosen>,
    /// The model with it.
    pub fit: Fitted,
    /// Ids of what was chosen, and made superfluous by others.
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
    /// The same by dwells, for functions of the reading.
    by_dwell: Rows,
    /// Their scatter.
    pub variance: VarianceModel<'a>,
    /// Basis of what the affine parameters can do.
    pub basis: DMatrix<f64>,
    candidates: Vec<Candidate>,
    /// Columns of each for each parameter that is screened; none of those that are another beside other effects.
    screened: Vec<Vec<Columns>>,
    /// Codes with all of their bits, and their columns by slot in the rows by dwells.
    codes: Vec<(Candidate, DMatrix<f64>)>,
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

/// Part of a column beyond which it is no sum of others, rounding aside.
const OF_ITS_OWN: f64 = 1e-6;

/// Those of `columns`, at size 1, that are no sums of `model` and of those before them.
pub(super) fn independent_of(columns: &DMatrix<f64>, model: &DMatrix<f64>) -> DMatrix<f64> {
    let columns = unit_columns(columns);
    let mut spanned = basis(&unit_columns(model));
    let mut kept = Vec::new();
    for (k, column) in columns.column_iter().enumerate() {
        // Twice, as once leaves rounding in the direction of what was taken away.
        let once = column - &spanned * spanned.tr_mul(&column);
        let left = &once - &spanned * spanned.tr_mul(&once);
        if left.norm() > OF_ITS_OWN {
            let left = left.normalize();
            spanned = beside(
                &spanned,
                &DMatrix::from_column_slice(left.len(), 1, left.as_slice()),
            );
            kept.push(k);
        }
    }
    columns.select_columns(&kept)
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
            let ours = candidates.iter().enumerate().filter(|(i, c)| {
                // Variants of one follow each other.
                c.is_listed() == listed && !(*i > 0 && candidates[i - 1].is_variant_of(c))
            });
            ours.map(|(_, c)| c.tests()).sum::<f64>().max(1.0)
        };
        let variance = VarianceModel::new(rows, false);
        let alike = |a: &Candidate, b: &Candidate| a.is_same_of_another_axis(b);
        let alike: Vec<&[Candidate]> = candidates.chunk_by(alike).collect();
        let screened = alike
            .into_par_iter()
            .flat_map_iter(|group| {
                let axes: Vec<usize> = group.iter().flat_map(|c| c.axes()).collect();
                match (&group[0], group[0].columns_by_axis(rows, &axes)) {
                    (_, Some(plain)) => {
                        let rotated = variance.rotate(&plain);
                        let of_axis = |k| {
                            vec![Columns {
                                parameter: 0.0,
                                plain: plain.columns(k, 1).into_owned(),
                                rotated: rotated.columns(k, 1).into_owned(),
                            }]
                        };
                        (0..axes.len()).map(of_axis).collect()
                    }
                    (one, None) if one.reads_code() => vec![Vec::new()],
                    (one, None) => {
                        let at = |parameter| {
                            let plain = one.columns(rows, parameter);
                            let rotated = variance.rotate(&plain);
                            Columns {
                                parameter,
                                plain,
                                rotated,
                            }
                        };
                        vec![one.parameters().into_iter().map(at).collect()]
                    }
                }
            })
            .collect();
        let by_dwell = rows.by_dwell();
        let of_code = candidates.iter().filter(|c| c.reads_code());
        let mut codes: Vec<(Candidate, DMatrix<f64>)> = Vec::new();
        for code in of_code {
            if !codes.last().is_some_and(|last| last.0.is_variant_of(code)) {
                let all = code.with_all_offered();
                let slots = all.columns_by_slot(&by_dwell);
                codes.push((all, slots));
            }
        }
        Self {
            rows,
            screened,
            codes,
            basis: basis(&rows.nuisance),
            tests: [count(true), count(false)],
            by_dwell,
            variance,
            candidates,
        }
    }

    /// The rows by dwells, for functions of the reading.
    pub(super) fn by_dwell(&self) -> &Rows {
        &self.by_dwell
    }

    /// Moments by dwell, without what `fitted` of `model` does not explain of their readings.
    pub(super) fn freed(&self, model: &DMatrix<f64>, fitted: &Fitted) -> Vec<Conditions> {
        let left = &self.rows.y - model * &fitted.coefficients;
        self.by_dwell.conditions_without(&left)
    }

    /// Columns of all bits that are offered of a code, at the conditions of [`Rows::conditions_without`]; `None` of what is no code.
    pub(super) fn bits(&self, code: &Candidate, conditions: &[Conditions]) -> Option<DMatrix<f64>> {
        let (all, slots) = self.codes.iter().find(|(c, _)| c.is_variant_of(code))?;
        Some(all.columns_without(&self.by_dwell, slots, conditions))
    }

    /// Takes the bits of a code again from the readings without the errors of what has been added since: those move the readings too.
    fn read_again(&self, chosen: &mut [Chosen], now: &mut Fitted) {
        for k in 0..chosen.len() {
            if !chosen[k].candidate.reads_code() || chosen.len() == 1 {
                continue;
            }
            let conditions = self.conditions_beside(chosen, k, now);
            let one = &chosen[k].candidate;
            let Some(all) = self.bits(one, &conditions) else {
                continue;
            };
            let columns = one.columns_of(&all);
            let before = std::mem::replace(&mut chosen[k].columns, columns);
            match self.fit(chosen) {
                Some(fit) => *now = fit,
                // At these readings two bits turn together.
                None => chosen[k].columns = before,
            }
        }
    }

    /// Moments by dwell whose readings are free from noise and from the error of chosen effect `k`.
    fn conditions_beside(&self, chosen: &[Chosen], k: usize, now: &Fitted) -> Vec<Conditions> {
        let before = chosen[..k].iter().map(|c| c.columns.ncols()).sum::<usize>();
        let first = self.basis.ncols() + before;
        let columns = &chosen[k].columns;
        let own = columns * now.coefficients.rows(first, columns.ncols());
        let left = &self.rows.y - self.model(chosen) * &now.coefficients + own;
        self.by_dwell.conditions_without(&left)
    }

    /// Adds the [siblings](Candidate::siblings) of the coefficients of each chosen effect, as far as the rows would show them at the size of data
    /// sheets beside all others.
    pub fn complete(&self, chosen: &mut [Chosen], now: &mut Fitted) {
        for k in 0..chosen.len() {
            let before = chosen[k].clone();
            let Kind::Effect(effect) = before.candidate.kind else {
                continue;
            };
            let mut more = before.candidate.siblings();
            if before.candidate.reads_code() {
                continue;
            }
            let first: usize = chosen[..k].iter().map(|c| c.columns.ncols()).sum();
            while !more.is_empty() {
                let one = &mut chosen[k];
                one.candidate.active = [&before.candidate.active[..], &more[..]].concat();
                one.candidate.active.sort_unstable();
                one.columns = one.candidate.columns(self.rows, one.parameter);
                let active = one.candidate.active.clone();
                let fit = self.fit(chosen);
                let open = fit.as_ref().map(|fit| {
                    let sigma = |at: usize| {
                        let place = self.basis.ncols() + first + at;
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
        self.variance.fit(
            &self.model(chosen),
            &self.variance.none(),
            LikelihoodKind::Likelihood,
        )
    }

    /// Degrees of freedom that a model leaves.
    fn dof(&self, columns: usize) -> f64 {
        self.rows.y.len() as f64 - columns as f64
    }

    /// Probability of chance, after the search, of a drop of the deviance by `drop` for `p` more columns of `candidate`.
    ///
    /// By F: where the size of the noise is found from the rows, `n ln(1 + p F/dof)` is the drop, exactly; where it is known
    /// and F's `dof` is large, it is chi-square.
    pub(super) fn chance(&self, drop: f64, p: usize, columns: usize, candidate: &Candidate) -> f64 {
        let tests = self.tests[usize::from(!candidate.is_listed())] * candidate.choices;
        (self.exceeds_by_chance(drop, p, columns) * tests).min(1.0)
    }

    /// The same of one test.
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
        let (mut candidate, parameter, with, whole) = match candidate.reads_code() {
            true => {
                let (candidate, with) = beside_these.bits(candidate)?;
                (candidate, screened.parameter, with, 1.0)
            }
            false => {
                let at = |c: &&Columns| c.parameter == screened.parameter;
                let first = self.screened[screened.index].iter().find(at)?;
                let (parameter, with) = beside_these.parameter(candidate, first)?;
                // By all of its coefficients an effect is one test, whatever choice of them follows.
                let whole = chance(candidate, &with);
                let before = candidate.active.len();
                let (candidate, with) = beside_these.coefficients(candidate, parameter, with)?;
                let (parameter, with) = match candidate.active.len() == before {
                    true => (parameter, with),
                    false => beside_these.parameter_from(&candidate, (parameter, with))?,
                };
                (candidate, parameter, with, whole)
            }
        };
        candidate.choices *= candidate.choices_of_coefficients();
        let p = chance(&candidate, &with).min(whole);
        Some(Chosen {
            unlikely: candidate.unlikely(&with.values),
            columns: with.columns,
            drop: with.drop,
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

    /// By how much the score is less with `law` in the place of `one` beside `rest`; negative where it is better.
    pub fn worse_with(&self, law: &'static Effect, one: &Chosen, rest: &[Chosen]) -> Option<f64> {
        let null = self.fit(rest)?;
        let beside_these = Beside {
            search: self,
            model: self.model(rest),
            null: &null,
        };
        let law = Candidate::new(self.rows.sensor, Kind::Effect(law));
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

    /// The effects that the rows ask for.
    ///
    /// A named effect goes before a term found from the data unless the term is better by 12 in score: with two thousand terms
    /// some product is always near an effect.
    pub fn run(&self) -> Option<Found> {
        self.beside(Vec::new(), |_| true)
    }

    /// The same beside what is chosen already, of the candidates that `may` be tried.
    pub fn beside(
        &self,
        mut chosen: Vec<Chosen>,
        may: impl Fn(&Candidate) -> bool,
    ) -> Option<Found> {
        let mut now = self.fit(&chosen)?;
        let given = chosen.len();
        let mut exchanges = 0;
        // What others have made superfluous does not come back: two that make each other superfluous would take turns for ever.
        let mut gone: Vec<String> = Vec::new();
        loop {
            let full = [true, false].map(|listed| {
                let alike = chosen.iter().filter(|c| c.candidate.is_listed() == listed);
                alike.count() >= MOST
            });
            if full == [true; 2] {
                break;
            }
            let mut finalists = self.finalists(&chosen, &now);
            finalists.retain(|c| {
                let room = !full[usize::from(!c.candidate.is_listed())];
                room && may(&c.candidate) && !gone.contains(&c.candidate.id())
            });
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
                (None, None) => {
                    let more = exchanges < EXCHANGES;
                    if more && self.exchange(&mut chosen, &mut now, given, &may)? {
                        exchanges += 1;
                        continue;
                    }
                    break;
                }
            };
            let mut best = best.clone();
            best.alternatives = finalists
                .iter()
                .filter(|c| c.candidate.id() != best.candidate.id())
                .filter(|c| score(&best) - score(c) < CONFUSED && significant(c))
                .map(|c| Alternative::of(&c.candidate, score(&best) - score(c)))
                .collect();
            chosen.push(best);
            let before: Vec<String> = chosen.iter().map(|c| c.candidate.id()).collect();
            let Some(fit) = self.fit(&chosen) else {
                // Beside the others it is determined by some noise and not by other.
                gone.extend(chosen.pop().map(|c| c.candidate.id()));
                continue;
            };
            now = fit;
            self.read_again(&mut chosen, &mut now);
            self.again(&mut chosen, &mut now)?;
            let stays = |id: &String| chosen.iter().any(|c| c.candidate.id() == *id);
            gone.extend(before.into_iter().filter(|id| !stays(id)));
        }
        Some(Found {
            chosen,
            fit: now,
            superfluous: gone,
        })
    }

    /// Puts a named effect in the place of one of the chosen, from the `first` on, where that makes the score of the whole better; says
    /// whether it did.
    ///
    /// One after the other, the first effect takes what belongs to others: a bias over temperature that lags was a bias, a warm-up and a
    /// drift, and the lag was not significant beside them.
    fn exchange(
        &self,
        chosen: &mut Vec<Chosen>,
        now: &mut Fitted,
        first: usize,
        may: &impl Fn(&Candidate) -> bool,
    ) -> Option<bool> {
        let mut best: Option<(f64, usize, Chosen)> = None;
        for k in first..chosen.len() {
            let mut rest = chosen.clone();
            let mut one = rest.remove(k);
            let null = self.fit(&rest)?;
            one.drop = (null.deviance - now.deviance).max(0.0);
            let rivals = self.others(&rest, &null).into_iter();
            let rivals = rivals.filter(|r| r.p < FALSE_LISTED && may(&r.candidate));
            let rival = rivals
                .filter(|r| !r.candidate.is_variant_of(&one.candidate))
                .max_by(|a, b| score(a).total_cmp(&score(b)));
            let Some(mut rival) = rival else { continue };
            let gain = score(&rival) - score(&one);
            if gain > EXCHANGED && best.as_ref().is_none_or(|b| gain > b.0) {
                rival.alternatives = vec![Alternative::of(&one.candidate, gain)];
                best = Some((gain, k, rival));
            }
        }
        let Some((_, k, rival)) = best else {
            return Some(false);
        };
        let mut there = chosen.clone();
        there[k] = rival;
        let Some(fit) = self.fit(&there) else {
            return Some(false);
        };
        (*chosen, *now) = (there, fit);
        self.read_again(chosen, now);
        self.again(chosen, now)?;
        Some(true)
    }

    /// Tests each of the chosen again beside the others: what they have made superfluous goes.
    fn again(&self, chosen: &mut Vec<Chosen>, now: &mut Fitted) -> Option<()> {
        let mut i = 0;
        while i < chosen.len() && chosen.len() > 1 {
            let (drop, p, without) = self.without(chosen, i, now)?;
            let listed = chosen[i].candidate.is_listed();
            if p > if listed { FALSE_LISTED } else { FALSE_FOUND } {
                chosen.remove(i);
                *now = without;
                i = 0;
            } else {
                (chosen[i].drop, chosen[i].p) = (drop, p);
                i += 1;
            }
        }
        Some(())
    }

    /// Of chosen effect `k` beside the others: the drop in deviance, its chance after the whole search, and the fit without it.
    fn without(&self, chosen: &[Chosen], k: usize, now: &Fitted) -> Option<(f64, f64, Fitted)> {
        let mut rest = chosen.to_vec();
        let one = rest.remove(k);
        let without = self.fit(&rest)?;
        let columns = self.model(&rest).ncols();
        let drop = (without.deviance - now.deviance).max(0.0);
        let p = self.chance(drop, one.columns.ncols(), columns, &one.candidate);
        Some((drop, p, without))
    }
}

/// How good a candidate is among others with more or fewer coefficients: the drop of the deviance less what each coefficient
/// costs (Akaike's two, doubled, as for each there are several candidates), and what speaks against their sizes. Of products that are the
/// same in this recording the shortest is told.
///
/// A nonlinear parameter costs two coefficients. It has a limit, as a time constant that is infinite is a straight line, and should be
/// told from it by two sigmas.
fn score(c: &Chosen) -> f64 {
    let coefficients = c.columns.ncols() as f64 + if c.parameter > 0.0 { 2.0 } else { 0.0 };
    let order = match &c.candidate.kind {
        Kind::Term(_, product) => f64::from(product.order()),
        _ => 0.0,
    };
    c.drop - price(&c.candidate) * coefficients - order - c.unlikely
}

/// An effect whose coefficient of the size of a data sheet would not be this many sigmas is not excited.
pub(super) const EXCITED: f64 = 3.0;

/// A coefficient of this many times the size of data sheets is the largest that is looked for: what would not be seen even at that size is
/// not determined. In a temperature that is constant to a millikelvin, or at rates that are rounding, any coefficient fits.
pub(super) const LARGEST: f64 = 1e4;

/// Part of a column that the others of its effect have to leave of it. At rest in gravity the squares of the force add up to a constant but
/// for some 1e-4, by which the magnitude of a measured force scatters; at 1e-2 the line and the bend of a thermal bias over a narrow range
/// of temperatures would be one.
pub(super) const SEPARATE: f64 = 1e-3;

/// What a coefficient costs.
pub(super) const COEFFICIENT: f64 = 4.0;

/// The same of a candidate. Where no bit of a code would be seen at the size of data sheets, the search is among up to 36, and the best of
/// so many nothings is worth 7.
fn price(candidate: &Candidate) -> f64 {
    match candidate.reads_code() && candidate.excited.is_empty() {
        true => COEFFICIENT + 2.0 * (candidate.offered.len().max(1) as f64).ln(),
        false => COEFFICIENT,
    }
}

/// Score by which an effect has to be better to take the place of one that was chosen before it, and how often at most.
const EXCHANGED: f64 = 1.0;
const EXCHANGES: usize = 4;

/// Score by which a term found from the data has to be better than an effect with a name.
const PREFERENCE: f64 = 12.0;
/// Score within which two candidates are told to be confused: odds of one to four hundred.
pub(super) const CONFUSED: f64 = 12.0;

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
    /// Whether both are the same but for the choice of coefficients.
    fn is_variant_of(&self, other: &Self) -> bool {
        match (&self.kind, &other.kind) {
            (Kind::Effect(a), Kind::Effect(b)) => a.id == b.id,
            (Kind::Term(i, a), Kind::Term(j, b)) => i == j && a == b,
            (
                Kind::Jump {
                    axis: i,
                    session: r,
                    t_s: a,
                },
                Kind::Jump {
                    axis: j,
                    session: s,
                    t_s: b,
                },
            ) => i == j && r == s && a == b,
            _ => false,
        }
    }

    /// Whether both are a term or a jump, and the same but for the axis.
    fn is_same_of_another_axis(&self, other: &Self) -> bool {
        match (&self.kind, &other.kind) {
            (Kind::Term(_, a), Kind::Term(_, b)) => a == b,
            (
                Kind::Jump {
                    session: r, t_s: a, ..
                },
                Kind::Jump {
                    session: s, t_s: b, ..
                },
            ) => r == s && a == b,
            _ => false,
        }
    }

    /// How many independent tests it counts for, beside the choices that it is the best of.
    fn tests(&self) -> f64 {
        match self.kind {
            Kind::Effect(_) if self.parameter().is_some() => 4.0,
            _ => 1.0,
        }
    }
}
