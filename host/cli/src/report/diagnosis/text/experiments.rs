//! Experiments for the effects that the recordings could not show or distinguish.

use std::fmt::Write as _;

use super::by;
use crate::report::text::wrap;
use mimu::plan::next_experiment::NotExcited;
use mimu::result::diagnosis::DiagnosisResult;

/// All experiments.
pub(super) fn experiments(out: &mut String, d: &DiagnosisResult) {
    for (shown_by, ids) in by_recipe(d) {
        wrap(
            out,
            "too small to be seen here at the sizes of data sheets: ",
            &ids.join(", "),
        );
        wrap(out, "  ", &shown_by.experiment);
    }
    for c in &d.confused {
        let [found, other] = &c.ids;
        let _ = writeln!(out, "{found} or {other} ({} in score)", by(c.difference));
        wrap(out, "  distinguished by: ", &c.experiment);
    }
    for u in &d.undecided {
        wrap(out, &format!("{} or ", u.id), u.law);
        wrap(out, "  distinguished by: ", u.experiment);
    }
}

/// Effects that were not excited, by recipe. The largest size in a recipe shows all of them.
fn by_recipe(d: &DiagnosisResult) -> Vec<(&NotExcited, Vec<&str>)> {
    let mut all: Vec<(&NotExcited, Vec<&str>)> = Vec::new();
    for n in &d.not_excited {
        let same = |other: &NotExcited| match (n.recipe, other.recipe) {
            (Some(a), Some(b)) => (a.recipe, a.fixture) == (b.recipe, b.fixture),
            _ => n.experiment == other.experiment,
        };
        let size = |n: &NotExcited| n.recipe.map_or(0.0, |r| r.size);
        match all.iter_mut().find(|(other, _)| same(other)) {
            Some((largest, ids)) => {
                ids.push(n.id);
                if size(n) > size(largest) {
                    *largest = n;
                }
            }
            None => all.push((n, vec![n.id])),
        }
    }
    all
}

/// Effects that were not excited, by the exact text of the experiment that would show them.
pub(in crate::report::diagnosis) fn by_experiment(d: &DiagnosisResult) -> Vec<(&str, Vec<&str>)> {
    let mut all: Vec<(&str, Vec<&str>)> = Vec::new();
    for n in &d.not_excited {
        match all.iter_mut().find(|(e, _)| *e == n.experiment) {
            Some((_, ids)) => ids.push(n.id),
            None => all.push((&n.experiment, vec![n.id])),
        }
    }
    all
}
