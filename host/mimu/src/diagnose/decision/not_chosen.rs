//! Named effects that are not accepted although the search knows them, each with what it would have changed.

use super::acceptance::Acceptance;
use super::hold_out::rms;
use crate::diagnose::rejected::{ErrorRms, NotChosen, Passed, Reason, Rejected};
use crate::diagnose::search::{Chosen, FALSE_LISTED, MOST, Search};
use crate::diagnose::variance::Fitted;

/// The named effects beside `kept` and `jumps`, except those whose ids are `known` to be rejected or not excited.
pub(super) fn not_chosen(
    search: &Search,
    judge: &Acceptance,
    (kept, with): (&[Chosen], &Fitted),
    jumps: &[Chosen],
    superfluous: &[String],
    known: &[&str],
) -> Option<Vec<Rejected>> {
    let rows = search.rows;
    // The jumps that were found stay in the model: otherwise every slow effect would seem to explain a part of them.
    let with_jumps: Vec<Chosen> = kept.iter().chain(jumps).cloned().collect();
    let all = match jumps.is_empty() {
        true => with.clone(),
        false => search.fit(&with_jumps)?,
    };
    let errors = |of: &[Chosen], fit: &Fitted| {
        let residuals = &rows.y - search.model(of) * &fit.coefficients;
        let held_out = judge.held_rms(of, fit, judge.usual);
        Some([rms(rows, &residuals), held_out?])
    };
    let now = errors(kept, with);
    let mut out = Vec::new();
    for one in search.others(&with_jumps, &all) {
        let id = one.candidate.id();
        if known.contains(&id.as_str()) {
            continue;
        }
        let more: Vec<Chosen> = kept.iter().chain([&one]).cloned().collect();
        let then = search.fit(&more).and_then(|fit| errors(&more, &fit));
        let changed = now
            .zip(then)
            .map(|(now, then)| [0, 1].map(|k| [now[k], then[k]].map(|v| ErrorRms::of(rows, v))));
        out.push(Rejected {
            id,
            sensor: rows.sensor,
            reason: Reason::NotChosen(NotChosen {
                p: one.p,
                why: passed_over(&one, kept, superfluous),
                errors: changed,
            }),
        });
    }
    Some(out)
}

/// Why a named effect that is significant is not among the `kept`. `None` if it is not significant.
fn passed_over(one: &Chosen, kept: &[Chosen], superfluous: &[String]) -> Option<Passed> {
    let listed = kept.iter().filter(|k| k.candidate.is_listed()).count();
    match one.p {
        p if p > FALSE_LISTED => None,
        _ if superfluous.contains(&one.candidate.id()) => Some(Passed::GivenUp),
        _ if listed >= MOST => Some(Passed::Enough(listed)),
        _ => Some(Passed::NotAtFirst),
    }
}
