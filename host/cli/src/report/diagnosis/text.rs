//! The diagnosis as text.

mod effect;
mod experiments;

use std::fmt::Write as _;

use super::{meaning, remarks};
use crate::hint;
use crate::report::table::{Cell, Table};
use crate::report::text::{counted, kinds, problems, wrap};
use effect::effect;
pub(super) use effect::table as coefficient_table;
pub(super) use experiments::by_experiment;
use experiments::experiments;
use mimu::diagnose::decision::Leftover;
use mimu::plan::next_experiment::NotShown;
use mimu::quantity::{Sensor, plural, significant};
use mimu::readable;
use mimu::result::diagnosis::{DiagnosisResult, SecondResult, SensorDiagnosisResult};
use mimu::warning::Warning;

/// Where the figures come from.
const FIGURES: &str = "The figures before are those of `mimu fit` for the same recording. Held out, the figures after are those of effects and calibration found without the part that is judged.";
/// Remark on residuals that can come from the biases of usual sensors.
pub(super) const USUAL: &str = "usual biases wander by up to four times the noise of a dwell; --noise (from `mimu allan` of the unit at rest) shows whether this one does";
/// Largest number of residuals of a sensor in the summary.
const LISTED: usize = 3;

/// Detail of the printed diagnosis.
#[derive(Debug, Clone, Copy)]
pub struct Detail {
    /// Everything, including why effects were not accepted.
    pub all: bool,
    /// Experiments that would show or distinguish more.
    pub next: bool,
}

/// Result of `mimu diagnose`.
pub fn diagnosis_text(d: &DiagnosisResult, detail: Detail) -> String {
    let Detail { all, next } = detail;
    let mut out = String::new();
    problems(&mut out, &d.recording_problems, d.has_several(), all);
    let _ = writeln!(out, "{}: {}: {}", d.device, d.verdict.name(), meaning(d));
    wrap(&mut out, "judgement: ", &d.judgement.to_string());
    for u in &d.untestable {
        wrap(&mut out, &format!("  {}: ", u.sensor), &u.reason);
    }
    let _ = writeln!(out);
    errors(&mut out, d);
    let _ = writeln!(out);
    for (name, s) in d.sensors.present() {
        sensor(&mut out, d, name, s, all);
    }
    if all && d.leftover.iter().any(|l| l.usual) {
        wrap(&mut out, "", USUAL);
    }
    let _ = writeln!(out);
    if all {
        if let Some(second) = &d.second {
            on_second(&mut out, second);
        }
        wrap(&mut out, "", FIGURES);
    } else if !d.rejected.is_empty() {
        let count = plural(d.rejected.len() as u64, "effect");
        let _ = writeln!(
            out,
            "tried and rejected: {count}; --verbose prints the reasons"
        );
    }
    match all || next {
        true => experiments(&mut out, d),
        false => open(&mut out, d),
    }
    warnings(&mut out, &d.warnings, all);
    out
}

/// An error figure of `s`; a dash if there are as many parameters as residuals, because then only rounding remains.
fn shown(s: &SensorDiagnosisResult, value: f64) -> String {
    match value.is_finite() && s.says_anything() {
        true => readable::error(s.unit).write(value),
        false => "-".into(),
    }
}

/// Errors of all sensors, before and after, in one table.
fn errors(out: &mut String, d: &DiagnosisResult) {
    let seconds = d.second.as_ref().map(|s| {
        let both = s.before.sensors.present().zip(s.after.sensors.present());
        both.map(|((name, b), (_, a))| (name, b, a))
            .collect::<Vec<_>>()
    });
    let second = |a: &str| match seconds {
        Some(_) => a.to_string(),
        None => String::new(),
    };
    let heads = [
        format!(
            "{:14}{:>18}{:>20}{:>10}{}",
            "",
            "in sample",
            "held out",
            "noise",
            second("    second recording")
        ),
        format!(
            "{:14}{:>9}{:>9}{:>11}{:>9}{:>10}{}",
            "rms error",
            "before",
            "after",
            "before",
            "after",
            "floor",
            second("     before     after")
        ),
    ];
    for head in heads {
        let _ = writeln!(out, "{head}");
    }
    for (name, s) in d.sensors.present() {
        let unit = readable::error(s.unit);
        let figure = |v: f64| match v.is_finite() && s.says_anything() {
            true => significant(v * unit.factor),
            false => "-".into(),
        };
        let _ = write!(
            out,
            "{:14}{:>9}{:>9}{:>11}{:>9}{:>10}",
            format!("{name}, {}", unit.unit),
            figure(s.rms_before),
            figure(s.rms_after),
            figure(s.held_out_rms_before),
            figure(s.held_out_rms_after),
            // The noise floor is known even if the residuals are not informative.
            significant(s.noise_floor * unit.factor),
        );
        let found = seconds.iter().flatten().find(|(of, ..)| *of == name);
        if let Some((_, before, after)) = found {
            let other = readable::error(before.unit);
            let [b, a] = [before.rms, after.rms].map(|v| significant(v * other.factor));
            let _ = write!(out, "{b:>11}{a:>10}");
            if before.unit != s.unit {
                let _ = write!(out, " {}", other.unit);
            }
        }
        let _ = writeln!(out);
    }
    if d.second.as_ref().is_some_and(|s| s.fitted_to) {
        let _ = writeln!(
            out,
            "The second recording is the fitted one, so it proves nothing."
        );
    }
}

/// Errors on the second recording, with its noise floor.
fn on_second(out: &mut String, second: &SecondResult) {
    let _ = writeln!(
        out,
        "on {}{}",
        second.recording,
        match second.fitted_to {
            true => ", the fitted recording itself",
            false => ", which was not used for the fit",
        }
    );
    *out += &second_errors(second).text("  ");
    let _ = writeln!(out);
}

/// Errors before and after, on a recording that was not fitted.
pub(super) fn second_errors(both: &SecondResult) -> Table {
    let mut table = Table::new(
        "Root mean square error with the calibration of the first recording",
        "rms error",
    )
    .numbers(["before", "after", "noise", "dwells or turns"])
    .on_page("error of");
    let sensors = both.before.sensors.present();
    for ((name, before), (_, after)) in sensors.zip(both.after.sensors.present()) {
        let unit = readable::error(before.unit);
        let figures = [before.rms, after.rms, after.noise_floor];
        let first = Cell::from(format!("{name}, {}", unit.unit));
        let figures = figures.map(|v| Cell::number(v, unit.factor));
        let last = [
            Cell::Count(after.count as u64),
            before.figure.description().into(),
        ];
        table.row(std::iter::once(first).chain(figures).chain(last));
    }
    table
}

fn sensor(
    out: &mut String,
    d: &DiagnosisResult,
    name: Sensor,
    s: &SensorDiagnosisResult,
    all: bool,
) {
    let effects = || d.effects.iter().filter(|a| a.effect.sensor() == name);
    let none = match effects().next() {
        Some(_) => "",
        None => ": no effect found",
    };
    let _ = writeln!(out, "{name} ({}){none}", s.figure.description());
    for remark in remarks(s, all) {
        wrap(out, "  ", &remark);
    }
    for a in effects() {
        effect(out, d, s, a, all);
    }
    for note in &s.notes {
        match all || note.advice.is_empty() {
            true => wrap(out, "  note: ", &note.to_string()),
            false => wrap(out, "  note: ", &format!("{} (--verbose)", note.found)),
        }
    }
    residuals(out, d, name, all);
    if all {
        for r in d.rejected.iter().filter(|r| r.sensor == name) {
            wrap(out, &format!("  - {}: ", r.id), &hint::of_rejected(r));
        }
    }
}

/// Residuals beyond the noise. Unless `all`, those that correlate with the same quantity are grouped, and only the first few are listed.
fn residuals(out: &mut String, d: &DiagnosisResult, name: Sensor, all: bool) {
    let mut groups: Vec<Vec<&Leftover>> = Vec::new();
    for l in d.leftover.iter().filter(|l| l.sensor == name) {
        let same = |g: &&mut Vec<&Leftover>| g[0].against == l.against && g[0].unit() == l.unit();
        match groups.iter_mut().find(same) {
            Some(group) if !all => group.push(l),
            _ => groups.push(vec![l]),
        }
    }
    let listed = if all { groups.len() } else { LISTED };
    for group in groups.iter().take(listed) {
        let rows: Vec<String> = group.iter().map(|l| l.stratum.to_string()).collect();
        let largest = group.iter().map(|l| l.strength).fold(0.0, f64::max);
        let up_to = if group.len() > 1 { "up to " } else { "" };
        let text = format!(
            "{up_to}{} rms beyond the noise; correlates with {}",
            readable::error(group[0].unit()).write(largest),
            group[0].against
        );
        wrap(out, &format!("  residual, {}: ", rows.join(", ")), &text);
    }
    if groups.len() > listed {
        let more: usize = groups[listed..].iter().map(Vec::len).sum();
        let _ = writeln!(out, "  and {more} more residuals (--verbose)");
    }
}

/// Difference in score: worse or, compared with later effects, better.
pub(super) fn by(worse: f64) -> String {
    match worse >= 0.0 {
        true => format!("worse by {worse:.1}"),
        false => format!("better by {:.1}", -worse),
    }
}

/// Quality of an unlisted alternative model instead of the effect; `worse` in score.
pub(super) fn by_score(worse: f64) -> String {
    let how = if worse > 0.0 {
        "nearly as well"
    } else {
        "as well"
    };
    format!("{how}, {} in score", by(worse))
}

/// One line about everything that the recordings could not show or distinguish.
fn open(out: &mut String, d: &DiagnosisResult) {
    let unseen = d.not_excited.len();
    let pairs = d.confused.len() + d.undecided.len();
    let unseen_words = format!(
        "too small to be seen here: {}",
        plural(unseen as u64, "effect")
    );
    let pairs_words = format!("not distinguished: {}", plural(pairs as u64, "pair"));
    let what = match (unseen > 0, pairs > 0) {
        (true, true) => format!("{unseen_words}; {pairs_words}; --next prints the experiments"),
        (true, false) => {
            format!("{unseen_words}; --next prints the experiments that would show them")
        }
        (false, true) => {
            format!("{pairs_words}; --next prints the experiments that distinguish them")
        }
        (false, false) => return,
    };
    let _ = writeln!(out, "{what}");
}

/// Warnings. Unless `all`, only the first of each kind with their number.
fn warnings(out: &mut String, warnings: &[Warning], all: bool) {
    let others = warnings.iter().filter(|w| !w.is_of_recording());
    for (warning, more) in kinds(others, |one, other| !all && one.is_like(other)) {
        wrap(out, "warning: ", &counted(hint::of_warning(warning), more));
    }
}

/// Effects that the plan of the next experiment does not show, by the reason.
pub fn not_in_plan_text(d: &DiagnosisResult) -> String {
    let mut out = String::new();
    let mut reasons: Vec<NotShown> = d.not_in_plan.iter().map(|n| n.reason).collect();
    reasons.sort_unstable();
    reasons.dedup();
    for reason in reasons {
        let of_it = d.not_in_plan.iter().filter(|n| n.reason == reason);
        let ids: Vec<&str> = of_it.map(|n| n.id.as_str()).collect();
        let head = format!("not in this plan, as {reason}: ");
        wrap(&mut out, &head, &ids.join(", "));
    }
    out
}
