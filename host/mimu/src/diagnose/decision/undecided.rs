//! Effects whose physics the rows do not decide.

use serde::Serialize;

use super::reading::worse_with_steps;
use crate::diagnose::search::{Chosen, Search, without};
use crate::effects::alternatives::alternatives;
use crate::quantity::Sensor;

/// An accepted effect whose physics the recordings do not decide: an unlisted alternative model explains the rows as well.
#[derive(Debug, Clone, Serialize)]
pub struct Undecided {
    /// Public id of the effect.
    pub id: String,
    /// Sensor whose readings err.
    pub sensor: Sensor,
    /// The unlisted alternative model.
    pub law: &'static str,
    /// How much lower the score of the law is: drop in deviance minus the cost of coefficients. Negative if it is higher.
    pub difference: f64,
    /// Experiment that would distinguish them.
    pub experiment: &'static str,
}

/// Lead in score over an unlisted alternative model that an effect needs for the verdict to name it: odds of one to twenty.
const DECIDED: f64 = 6.0;

/// The kept effects that do not explain the rows better than an unlisted alternative model.
pub(super) fn undecided(search: &Search, kept: &[Chosen]) -> Vec<Undecided> {
    let sensor = search.rows.sensor;
    let mut all = Vec::new();
    for (i, one) in kept.iter().enumerate() {
        let rest = without(kept, i);
        let id = one.candidate.id();
        for rival in alternatives(&id) {
            let worse = search.worse_with(&rival.law, one, &rest);
            if let Some(difference) = worse.filter(|w| *w < DECIDED) {
                all.push(Undecided {
                    id: id.clone(),
                    sensor,
                    law: rival.law.about,
                    difference,
                    experiment: rival.discriminating_experiment,
                });
            }
        }
        if one.candidate.is_nonlinearity()
            && let Some(difference) = worse_with_steps(search, kept, i).filter(|w| *w < DECIDED)
        {
            all.push(Undecided {
                id,
                sensor,
                law: "steps at some readings of an axis, as from missing codes,",
                difference,
                experiment: "inputs that differ by a few times the noise, where the error changes: a step changes it at once",
            });
        }
    }
    all
}
