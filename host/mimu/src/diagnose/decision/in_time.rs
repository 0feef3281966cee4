//! Effects of time and temperature that explain the rows as well as an accepted one.
//!
//! The search lists, with an effect, the finalists that were nearly as good when it was found. Effects that are found later, and refined
//! parameters, change their scores.

use nalgebra::DMatrix;

use super::together::PLAUSIBLE;
use crate::diagnose::columns::beside;
use crate::diagnose::search::{Alternative, COEFFICIENT, CONFUSED, Chosen, Search, without};
use crate::diagnose::variance::Fitted;
use crate::effects;
use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::effect::Effect;

/// For each kept effect that moves a bias with time or temperature, adds the other such effects with a nearly equal score to its
/// alternatives. `with` is the fit of all.
pub(super) fn others_in_time(search: &Search, kept: &mut [Chosen], with: &Fitted) {
    for i in 0..kept.len() {
        if !kept[i].candidate.is_slow_bias() {
            continue;
        }
        let ids: Vec<String> = kept.iter().map(|k| k.candidate.id()).collect();
        let listed = |e: &Effect| {
            let known = kept[i].alternatives.iter().any(|a| a.id == e.id);
            known || ids.iter().any(|id| id == e.id)
        };
        let rivals = effects::all().filter(|e| e.sensor == search.rows.sensor && !listed(e));
        let found: Vec<Alternative> = rivals
            .filter_map(|rival| {
                let worse = worse_with(search, kept, i, rival, with)?;
                let rival = Candidate::new(rival.sensor, CandidateKind::Effect(rival));
                Some(Alternative::of(&rival, worse))
            })
            .filter(|other| other.score_worse_by < CONFUSED)
            .collect();
        let all = &mut kept[i].alternatives;
        all.extend(found);
        all.sort_by(|a, b| a.score_worse_by.total_cmp(&b.score_worse_by));
    }
}

/// How much lower the score is with `rival`, on the same axes, in place of kept effect `i`. `None` if it does not move a bias with time or
/// temperature, is not determined, or would have to be far beyond data sheets.
fn worse_with(
    search: &Search,
    kept: &[Chosen],
    i: usize,
    rival: &'static Effect,
    with: &Fitted,
) -> Option<f64> {
    let candidate = kept[i].candidate.replaced_by(rival);
    if !candidate.is_slow_bias() || candidate.active.is_empty() {
        return None;
    }
    let (one, bare) = (&kept[i], search.model(&without(kept, i)));
    let cost =
        |columns: usize, nonlinear: bool| COEFFICIENT * (columns + usize::from(nonlinear)) as f64;
    let fit = |model: &DMatrix<f64>| search.variance.fit_at(model, &with.components);
    let whole = fit(&beside(&bare, &one.columns))?.chi2;
    let whole = whole + cost(one.columns.ncols(), one.parameter > 0.0);
    let tried = candidate.parameters().into_iter().filter_map(|parameter| {
        let columns = candidate.columns(search.rows, parameter);
        if !columns.iter().all(|v| v.is_finite()) {
            return None;
        }
        let fitted = fit(&beside(&bare, &columns))?;
        let values = fitted.coefficients.rows(bare.ncols(), columns.ncols());
        let plausible = values
            .iter()
            .zip(&candidate.active)
            .all(|(value, k)| value.abs() < PLAUSIBLE * rival.coefficients[*k].typical);
        plausible.then(|| fitted.chi2 + cost(columns.ncols(), parameter > 0.0))
    });
    Some(tried.reduce(f64::min)? - whole)
}
