//! Which of the effects found are accepted: search and judgement in turn until nothing changes.

use super::acceptance::Acceptance;
use super::limit::name_limits;
use crate::diagnose::rejected::Rejected;
use crate::diagnose::search::{Chosen, Found, Search};
use crate::diagnose::variance::Fitted;
use crate::effects::candidate::CandidateKind;
use crate::effects::effect::Effect;

/// What search and judgement end with.
pub(super) struct Choice {
    /// Accepted effects.
    pub(super) kept: Vec<Chosen>,
    /// The fit with them.
    pub(super) with: Fitted,
    /// Jumps of a bias, which are reported and not fitted.
    pub(super) jumps: Vec<Chosen>,
    /// Products without known physics, which need a second recording.
    pub(super) suggested: Vec<Chosen>,
    /// Effects that were found and not accepted.
    pub(super) rejected: Vec<Rejected>,
    /// Effects that the experiment could not show, or with too few dwells.
    pub(super) not_excited: Vec<&'static Effect>,
}

/// Judges what the search has `found`, and searches again beside what stays. `without` are effects that are not tried.
pub(super) fn choose(
    search: &Search,
    judge: &Acceptance,
    found: Found,
    mut not_excited: Vec<&'static Effect>,
    without: &[Rejected],
) -> Option<Choice> {
    let is_jump = |one: &Chosen| matches!(one.candidate.kind, CandidateKind::Jump { .. });
    let (jumps, mut kept): (Vec<_>, Vec<_>) = found.chosen.into_iter().partition(is_jump);
    let mut with = match jumps.is_empty() {
        true => found.fit,
        false => search.fit(&kept)?,
    };
    let mut rejected = without.to_vec();
    let mut suggested = Vec::new();
    // Ids that failed, in order. An effect that failed beside another that failed later is tried once more without the latter.
    let mut failures: Vec<String> = Vec::new();
    // Ids that passed. They are not judged again once suggestions are removed: with what the suggestions explained still in the rows, held-out
    // dwells would not show the effect.
    let mut passed: Vec<String> = Vec::new();
    let ids = |all: &[Chosen]| -> Vec<String> { all.iter().map(|c| c.candidate.id()).collect() };
    loop {
        let mut failed_any = false;
        // Effects are judged with the coefficients that would be stored.
        search.complete(&mut kept, &mut with);
        name_limits(search, &mut kept, &mut with, &failures);
        // Effects that are not accepted are removed, the last in the list first.
        while let Some(failed) = judge.first_to_fail(&kept, &with, &passed)? {
            failed_any = true;
            let candidate = kept.remove(failed.at).candidate;
            // More dwells may prove it, so the next experiment asks for it.
            if let CandidateKind::Effect(effect) = &candidate.kind
                && failed.too_few_dwells
                && !not_excited.iter().any(|n| n.id == effect.id)
            {
                not_excited.push(effect);
            }
            failures.push(candidate.id());
            rejected.retain(|r| r.id != candidate.id());
            rejected.push(Rejected {
                id: candidate.id(),
                sensor: search.rows.sensor,
                reason: failed.why,
            });
            with = search.fit(&kept)?;
        }
        passed = ids(&kept);
        let set_aside = judge.suggestions(&mut kept, &with);
        if set_aside.is_empty() && !failed_any {
            break;
        }
        suggested.extend(set_aside);
        with = search.fit(&kept)?;
        // What a suggestion or a rejected effect had explained, a named effect may explain as well. An accelerometer's warm-up of p < 1e-6
        // was reported as not significant, because the effect that had replaced it in the search was rejected afterwards.
        let more = search.beside(kept.clone(), |c| {
            let id = c.id();
            let times = failures.iter().filter(|f| **f == id).count();
            let beside_others = times == 1 && failures.last() != Some(&id);
            let tried = without.iter().any(|w| w.id == id) || times > 0;
            c.is_listed() && (!tried || beside_others)
        })?;
        if ids(&more.chosen) == ids(&kept) {
            break;
        }
        (kept, with) = (more.chosen, more.fit);
    }
    rejected.retain(|r| kept.iter().all(|k| k.candidate.id() != r.id));
    Some(Choice {
        kept,
        with,
        jumps,
        suggested,
        rejected,
        not_excited,
    })
}
