//! Accepted effects that another listed effect explains as well at the inputs of the recording.
//!
//! The score of a whole effect includes the cost of all its coefficients. In one pose a thermal bias with six coefficients scored 20 less
//! than a thermal scale factor with one, and the report named only one of the two. Here the parts of each axis are compared separately.

use nalgebra::DMatrix;

use crate::diagnose::columns::beside;
use crate::diagnose::search::{Alternative, COEFFICIENT, CONFUSED, Chosen, Search};
use crate::diagnose::variance::Fitted;
use crate::effects;
use crate::effects::alternatives::one_at_a_constant_input;
use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::effect::Effect;
use crate::quantity::AXES;

/// A coefficient beyond this many times the data-sheet size is not plausible. A gyro at rest reads Earth rate, and a scale factor that
/// changes it as 0.1 deg/s/K change the bias is a million times too large.
pub(super) const PLAUSIBLE: f64 = 10.0;

/// A part of an accepted effect that the rows do not distinguish from another effect.
struct Part {
    axis: usize,
    /// How much lower the score is with the other effect in its place.
    worse: f64,
}

/// For each kept effect, puts the one that is the same at a constant input first among its alternatives, if the rows do not distinguish the
/// two; returns notes about these. `with` is the fit of all.
pub(super) fn together(search: &Search, kept: &mut [Chosen], with: &Fitted) -> Vec<String> {
    let mut notes = Vec::new();
    for i in 0..kept.len() {
        let id = kept[i].candidate.id();
        let rival = one_at_a_constant_input(&id).and_then(effects::by_id);
        // If both are kept, the rows distinguish them.
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
        notes.push(format!(
            "{id} ({}): {} fits as well, because the input along the axis hardly changes in this recording; at other inputs the two differ; the calibration contains the first",
            axes.join(", "),
            rival.id
        ));
        let others = &mut kept[i].alternatives;
        others.retain(|o| o.id != rival.id);
        let rival = Candidate::new(rival.sensor, CandidateKind::Effect(rival));
        others.insert(0, Alternative::of(&rival, worse));
    }
    notes
}

/// Compares the coefficients of one axis of kept effect `i` with those of `rival` that fit best in their place. `None` if the rows do not
/// need them, or if they distinguish the two.
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
    // The rival follows the same temperature. Its coefficients are added one after the other, the best first.
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
