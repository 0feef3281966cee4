//! The limit of an effect with a nonlinear parameter, where the rows do not exclude it.
//!
//! A warm-up whose time constant exceeds the recording by far is a straight line. Its coefficients and its time constant can then grow together
//! without bound, and the score may prefer it to the drift: 12 deg/s in 1200 s are 24 times the typical warm-up, but 120 times the typical drift.
//! The rows show the line alone, so the line is named.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::diagnose::search::{Chosen, Search};
use crate::diagnose::variance::Fitted;
use crate::effects;
use crate::effects::candidate::{Candidate, CandidateKind};

/// Confidence at which the limit has to be excluded: that of the intervals.
const CONFIDENCE: f64 = 0.95;

/// Replaces each of the kept effects by the limit of its nonlinear parameter, on the same axes, if that is within the 95 % interval. One whose limit
/// is among the ids that `failed` keeps its name, and is judged by it.
pub(super) fn name_limits(
    search: &Search,
    kept: &mut [Chosen],
    with: &mut Fitted,
    failed: &[String],
) {
    for i in 0..kept.len() {
        let limit = limit_of(search, kept, i);
        let Some(limit) = limit.filter(|l| !failed.contains(&l.candidate.id())) else {
            continue;
        };
        let mut there = kept.to_vec();
        there[i] = limit;
        if !is_within(search, [kept, &there], i, with) {
            continue;
        }
        let Some(fitted) = search.fit(&there) else {
            continue;
        };
        if let Some((drop, p, _)) = search.without(&there, i, &fitted) {
            (there[i].drop, there[i].p) = (drop, p);
            kept.clone_from_slice(&there);
            *with = fitted;
        }
    }
}

/// The limit of kept effect `i`; `None` if it has none, or if that is kept already: then the rows show both.
fn limit_of(search: &Search, kept: &[Chosen], i: usize) -> Option<Chosen> {
    let CandidateKind::Effect(effect) = kept[i].candidate.kind else {
        return None;
    };
    let limit = effects::by_id(effect.parameter?.limit?)?;
    if kept.iter().any(|k| k.candidate.id() == limit.id) {
        return None;
    }
    let all = search.candidate_of(limit)?;
    let on_axes = kept[i].candidate.replaced_by(limit).active;
    let mut candidate = Candidate {
        without_self_heating: kept[i].candidate.without_self_heating,
        choices: kept[i].candidate.choices,
        ..all.clone()
    };
    // A curvature is not part of the limit.
    let is_part = |k: &usize| on_axes.contains(k) && all.rests_on(*k).is_none();
    candidate.active.retain(is_part);
    let columns = candidate.columns(search.rows, 0.0);
    (!candidate.active.is_empty()).then(|| Chosen {
        columns,
        candidate,
        parameter: 0.0,
        ..kept[i].clone()
    })
}

/// Whether the second of the `models`, with the limit in the place `i` of the first, is within the confidence region of the first, at the noise of
/// `with`.
fn is_within(search: &Search, models: [&[Chosen]; 2], i: usize, with: &Fitted) -> bool {
    let chi2 = |chosen: &[Chosen]| {
        let fitted = search
            .variance
            .fit_at(&search.model(chosen), &with.components)?;
        Some(fitted.chi2)
    };
    let (Some(best), Some(limit)) = (chi2(models[0]), chi2(models[1])) else {
        return false;
    };
    let [more, fewer] = models.map(|chosen| chosen[i].columns.ncols());
    // The parameter, and the coefficients that the limit lacks.
    let numbers = 1 + more.saturating_sub(fewer);
    let most = ChiSquared::new(numbers as f64).map(|d| d.inverse_cdf(CONFIDENCE));
    most.is_ok_and(|most| limit - best < most)
}
