//! Accepted effects that another of the list does as well as under the inputs of the recording.
//!
//! The score of a whole effect pays for all of its coefficients: in one pose a bias that follows the temperature, with six of them, lost to a
//! scale factor with one by 20 in score, and the report named one of the two alone. Here the part of one axis is put to the test.

use nalgebra::DMatrix;

use crate::diagnose::note::Note;
use crate::diagnose::search::{COEFFICIENT, CONFUSED, Chosen, Search, beside};
use crate::diagnose::variance::Fitted;
use crate::effects;
use crate::effects::alternatives::one_at_a_constant_input;
use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::effect::Effect;
use crate::quantity::AXES;

/// A coefficient of this many times the size of data sheets is no explanation: at rest a gyro reads the Earth's rate, and the scale factor
/// that would do to that what 0.1 deg/s/K do to the bias is a million times too large.
pub(super) const PLAUSIBLE: f64 = 10.0;

/// A part of an accepted effect that the rows do not tell from another effect.
struct Part {
    axis: usize,
    /// By how much the score is less with the other effect in its place.
    worse: f64,
}

/// Lists with each of the kept effects the one that is the same at a constant input, where the rows do not tell them apart; and notes that
/// say so. `with` is the fit of all.
pub(super) fn together(search: &Search, kept: &mut [Chosen], with: &Fitted) -> Vec<Note> {
    let mut notes = Vec::new();
    for i in 0..kept.len() {
        let id = kept[i].candidate.id();
        let rival = one_at_a_constant_input(&id).and_then(effects::by_id);
        // Both of them: the rows do tell them apart.
        let beside_it = |r: &&Effect| kept.iter().all(|k| k.candidate.id() != r.id);
        let Some(rival) = rival.filter(beside_it) else {
            continue;
        };
        let parts: Vec<Part> = (0..3)
            .filter_map(|axis| part(search, kept, i, (rival, axis), with))
            .collect();
        let Some(worse) = parts.iter().map(|p| p.worse).reduce(f64::min) else {
            continue;
        };
        let axes: Vec<&str> = parts.iter().map(|p| AXES[p.axis]).collect();
        let found = format!(
            "{id} ({}): {} fits as well, because the input along the axis hardly changes in this recording",
            axes.join(", "),
            rival.id
        );
        let advice = "at other inputs the two differ; the calibration contains the first";
        notes.push(Note::new(found, advice));
        let others = &mut kept[i].alternatives;
        others.retain(|o| o.id != rival.id);
        others.insert(0, (rival, worse).into());
    }
    notes
}

/// The coefficients of one axis of kept effect `i` against those of `rival` that do best in their place; `None` where the rows do not ask for
/// them, and where they tell the two apart.
fn part(
    search: &Search,
    kept: &[Chosen],
    i: usize,
    (rival, axis): (&'static Effect, usize),
    with: &Fitted,
) -> Option<Part> {
    let CandidateKind::Effect(effect) = kept[i].candidate.kind else {
        return None;
    };
    let of_axis = |k: &usize| effect.coefficients[*k].axis == Some(axis);
    let active = &kept[i].candidate.active;
    let rest: Vec<usize> = (0..active.len())
        .filter(|k| !of_axis(&active[*k]))
        .collect();
    let count = active.len() - rest.len();
    let mut bare = kept.to_vec();
    bare[i].columns = kept[i].columns.select_columns(&rest);
    let bare = search.model(&bare);
    let fit = |model: &DMatrix<f64>| search.variance.fit_at(model, &with.components);
    let whole = fit(&search.model(kept))?.chi2 + COEFFICIENT * count as f64;
    let without = fit(&bare)?.chi2;
    if count == 0 || without - whole < CONFUSED {
        return None;
    }
    // Those of the rival that follow the same temperature; coefficients of it one after the other, the best first.
    let mut candidate = Candidate::new(search.rows.sensor, CandidateKind::Effect(rival));
    candidate.without_self_heating = kept[i].candidate.without_self_heating;
    let all = candidate.columns(search.rows, 0.0);
    let finite = |k: &usize| all.column(*k).iter().all(|v| v.is_finite());
    let mut left: Vec<usize> = (0..all.ncols()).filter(finite).collect();
    let (mut model, mut used, mut best) = (bare, Vec::new(), without);
    loop {
        let tried = left.iter().filter_map(|k| {
            let more = beside(&model, &all.columns(*k, 1).into_owned());
            let fitted = fit(&more)?;
            let of_rival = fitted.coefficients.iter().rev();
            let mut sizes = of_rival.zip(std::iter::once(k).chain(used.iter().rev()));
            let typical = |k: &usize| rival.coefficients[candidate.active[*k]].typical;
            let plausible = sizes.all(|(value, k)| value.abs() < PLAUSIBLE * typical(k));
            let score = fitted.chi2 + COEFFICIENT * (used.len() + 1) as f64;
            plausible.then_some((score, *k, more))
        });
        let Some((score, k, more)) = tried.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            break;
        };
        if score >= best {
            break;
        }
        (best, model) = (score, more);
        used.push(k);
        left.retain(|l| *l != k);
    }
    let worse = best - whole;
    (worse < CONFUSED).then_some(Part { axis, worse })
}
