//! Named effects that are not accepted although the search knows them, each with what it would have changed.

use crate::diagnose::rejected::{NotChosen, Passed, Reason, Rejected};
use crate::diagnose::search::{Chosen, FALSE_LISTED, MOST, Search};
use crate::diagnose::variance::Fitted;

/// The named effects beside `kept` and `jumps`, except those whose ids are `known` to be rejected or not excited.
pub(super) fn not_chosen(
    search: &Search,
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
    let mut out = Vec::new();
    for one in search.others(&with_jumps, &all) {
        let id = one.candidate.id();
        if known.contains(&id.as_str()) {
            continue;
        }
        out.push(Rejected {
            id,
            sensor: rows.sensor,
            reason: Reason::NotChosen(NotChosen {
                p: one.p,
                why: passed_over(&one, kept, superfluous),
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
