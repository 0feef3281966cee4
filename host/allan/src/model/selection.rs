//! Which terms a curve needs, and which other choices it does not rule out.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::differences::{PHASE, RAMP, TERMS};
use super::estimate::{Curve, Fitted};
use super::terms::Term;
use crate::Deviation;
use crate::gamma::TERM_DEVIANCE;

/// Sigmas at which a coefficient is shown.
pub(super) const SEEN: f64 = 3.0;

/// Models whose deviance, with [`TERM_DEVIANCE`] for each term, is within this of the best are plausible (an additional term with a
/// significance between 10 % and 0.5 %): the intervals include theirs. If one of them replaces a term by another, the term is not reported.
pub(crate) const PLAUSIBLE: f64 = 5.3;
/// The same for models that replace a ramp: a random walk too weak to be seen drifts as far by chance. Of 1000 in white noise 46 were
/// reported as ramps with [`PLAUSIBLE`], and 25 with this.
const RAMP_PLAUSIBLE: f64 = 8.0;
/// The shortest times are left out until the misfit has at least this probability.
const FITS: f64 = 1e-3;
/// Shortest time used, in time constants of the filter that the curve shows. The term in 1/τ² represents it only to `4 exp(-τ/T)` of
/// itself. At 4 T the misfit was not significant yet, but moved N by three of its sigmas.
const FILTER_TIMES: f64 = 8.0;
/// Points of the Allan curve that must remain.
pub(super) const FEWEST: usize = 6;

/// A model with its cost.
struct Choice {
    /// Deviance, and [`TERM_DEVIANCE`] for each term.
    cost: f64,
    fitted: Fitted,
}

/// The models that a curve allows.
pub(super) struct Selection<'a> {
    /// The part of the curve that is used.
    pub curve: Curve<'a>,
    /// Misfit over its expectation if no model fits, else 1.
    pub excess: f64,
    /// Whether shorter times were left out.
    pub shortened: bool,
    /// Cheapest first, and at least one.
    choices: Vec<Choice>,
}

impl<'a> Selection<'a> {
    /// Leaves out the shortest times if no model fits. `None` if there is no model even for the [`FEWEST`] longest.
    pub fn of(mut curve: Curve<'a>) -> Option<Self> {
        let mut least: Option<Self> = None;
        let mut shortened = false;
        loop {
            let choices = choices(&curve, shortened);
            if let Some(Choice { fitted: best, .. }) = choices.first() {
                let dof = (curve.y.len() - best.terms.len()).max(1) as f64;
                let chance = ChiSquared::new(dof).map_or(0.0, |c| c.sf(best.chi2));
                let n = best.a[Term::N as usize];
                let least_bend = -best.a[PHASE] - best.sigma(PHASE);
                let bent = least_bend > curve.shortest() * 1.5 * n / FILTER_TIMES;
                let excess = match chance >= FITS {
                    true => 1.0,
                    false => best.chi2 / dof,
                };
                if !bent && least.as_ref().is_none_or(|l| excess < l.excess) {
                    least = Some(Self {
                        curve: curve.clone(),
                        excess,
                        shortened,
                        choices,
                    });
                    if chance >= FITS {
                        return least;
                    }
                }
            }
            if curve.allan_points() == FEWEST {
                return least;
            }
            curve.drop_shortest();
            shortened = true;
        }
    }

    /// The model with the lowest cost.
    pub fn best(&self) -> &Fitted {
        &self.choices[0].fitted
    }

    /// The plausible models, the best first.
    pub fn plausible(&self) -> Vec<&Fitted> {
        self.within(PLAUSIBLE).collect()
    }

    fn within(&self, margin: f64) -> impl Iterator<Item = &Fitted> {
        let Choice { cost, fitted } = &self.choices[0];
        self.choices
            .iter()
            .filter(move |c| {
                c.cost <= cost + margin && c.fitted.deviance <= fitted.deviance + margin
            })
            .map(|c| &c.fitted)
    }

    /// The best model without `term`.
    pub fn without(&self, term: Term) -> Option<&Fitted> {
        let mut fitted = self.choices.iter().map(|c| &c.fitted);
        fitted.find(|m| !m.terms.contains(&(term as usize)))
    }

    /// Terms that the data do not distinguish from `term`: a plausible model has one of them where the best has `term`, or the other way round.
    pub fn instead_of(&self, term: Term) -> Vec<Term> {
        let (k, best) = (term as usize, self.best());
        let mut terms = Vec::new();
        for model in self.within(if k == RAMP { RAMP_PLAUSIBLE } else { PLAUSIBLE }) {
            let (with, without) = match (model.terms.contains(&k), best.terms.contains(&k)) {
                (true, false) => (model, best),
                (false, true) => (best, model),
                _ => continue,
            };
            let others = without.terms.iter().filter(|t| !with.terms.contains(t));
            terms.extend(others.map(|t| Term::ALL[*t]));
        }
        terms.sort_by_key(|t| t.letter());
        terms.dedup();
        terms
    }

    /// Whether the curve, whose shortest point was (`m`, `y`), falls below white noise there as behind a low-pass filter.
    pub fn filtered(&self, (m, y): (f64, f64)) -> bool {
        let a = &self.best().a;
        let others = Deviation::Allan.basis(m).into_iter().zip(a).enumerate();
        let expected: f64 = others
            .filter(|(k, _)| *k != PHASE)
            .map(|(_, (basis, a))| basis * a)
            .sum();
        match self.shortened {
            true => y < expected,
            false => a[PHASE] < 0.0,
        }
    }
}

/// All subsets of the terms that fit, cheapest first.
///
/// If shorter times were left out, all subsets include the term in 1/τ²: whatever bends the curve there, if its correlation time is short,
/// this term is what remains of it at longer times. When the term had to be significant, N behind a filter was outside its intervals in 35
/// of 200 runs.
fn choices(curve: &Curve, shortened: bool) -> Vec<Choice> {
    let mut choices: Vec<Choice> = (1..1usize << TERMS)
        .filter(|subset| !shortened || subset & (1 << PHASE) != 0)
        .filter_map(|subset| {
            let terms: Vec<usize> = (0..TERMS).filter(|k| subset & (1 << k) != 0).collect();
            let fitted = curve.fit(&terms)?;
            let cost = fitted.deviance + TERM_DEVIANCE * terms.len() as f64;
            Some(Choice { cost, fitted })
        })
        .collect();
    choices.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    choices
}
