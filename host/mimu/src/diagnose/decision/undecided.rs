//! Effects whose physics the rows do not decide.

use super::reading::worse_with_steps;
use crate::diagnose::search::{Chosen, Search};
use crate::effects::alternatives::alternatives;

/// An accepted effect that a law on no list explains the rows as well as.
#[derive(Debug, Clone)]
pub struct Undecided {
    /// Id of the effect.
    pub id: String,
    /// The law.
    pub law: &'static str,
    /// By how much the law is worse, in score, the deviance with what coefficients cost; negative where it is better.
    pub worse: f64,
    /// What would tell them apart.
    pub settled_by: &'static str,
}

/// Score by which an effect has to be better than a law that is on no list, for the verdict to name it: odds of one to twenty.
const DECIDED: f64 = 6.0;

/// Which of the kept effects a law that is on no list does as well as.
pub(super) fn undecided(search: &Search, kept: &[Chosen]) -> Vec<Undecided> {
    let mut all = Vec::new();
    for (i, one) in kept.iter().enumerate() {
        let mut rest = kept.to_vec();
        rest.remove(i);
        let id = one.candidate.id();
        for rival in alternatives(&id) {
            let worse = search.worse_with(&rival.law, one, &rest);
            if let Some(worse) = worse.filter(|w| *w < DECIDED) {
                all.push(Undecided {
                    id: id.clone(),
                    law: rival.law.about,
                    worse,
                    settled_by: rival.settled_by,
                });
            }
        }
        if one.candidate.is_nonlinearity()
            && let Some(worse) = worse_with_steps(search, kept, i).filter(|w| *w < DECIDED)
        {
            all.push(Undecided {
                id,
                law: "steps at some readings of an axis, as codes that never come,",
                worse,
                settled_by: "inputs a few noises apart, where the error changes: a step changes it at once",
            });
        }
    }
    all
}
