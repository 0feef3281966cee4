//! The diagnosis for people.

use std::fmt::Write as _;

use super::{meaning, remarks};
use crate::report::text::{warn, wrap};
use mimu::calibration::ConverterTable;
use mimu::quantity::{p_value, plural, plus_minus, significant};
use mimu::readable::{self, Readable};
use mimu::result::diagnosis::{AcceptedResult, DiagnosisResult, SensorDiagnosisResult};

/// Why its figures are not those of `mimu fit`.
const FIGURES: &str = "The figures before are not quite those of `mimu fit`: residuals are weighted here by the variance components of \
                       this diagnosis.";

/// Result of `mimu diagnose`. `all`: with the whole reason of each effect that was not accepted.
pub fn diagnosis_text(d: &DiagnosisResult, all: bool) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{}: {}: {}", d.device, d.verdict.name(), meaning(d));
    for u in &d.untestable {
        wrap(&mut out, &format!("  {}: ", u.sensor), &u.reason);
    }
    for (name, s) in d.sensors.named() {
        let _ = writeln!(out);
        sensor(&mut out, d, name, s, all);
    }
    not_excited(&mut out, d);
    confused(&mut out, d);
    if let Some(second) = &d.second {
        let _ = writeln!(
            out,
            "\non {}{}\n  {:<8}{:>16}{:>16}{:>16}",
            second.recording,
            match second.fitted_to {
                true => ", which is the recording that was fitted to",
                false => ", which nothing was fitted to",
            },
            "",
            "before",
            "after",
            "noise floor"
        );
        let both = second
            .before
            .sensors
            .named()
            .zip(second.after.sensors.named());
        for ((name, before), (_, after)) in both {
            let figure = readable::error(before.unit);
            let [x, y, z] = [before.rms, after.rms, after.noise_floor].map(|v| figure.write(v));
            let _ = writeln!(out, "  {name:<8}{x:>16}{y:>16}{z:>16}");
        }
    }
    let _ = writeln!(out);
    wrap(&mut out, "", FIGURES);
    if !d.warnings.is_empty() {
        let _ = writeln!(out);
        warn(&mut out, d.warnings.iter());
    }
    out
}

/// An error figure of `s`; a dash where there are as many parameters as residuals, and only rounding is left.
fn shown(s: &SensorDiagnosisResult, value: f64) -> String {
    match value.is_finite() && s.says_anything() {
        true => readable::error(s.unit).write(value),
        false => "-".into(),
    }
}

fn sensor(out: &mut String, d: &DiagnosisResult, name: &str, s: &SensorDiagnosisResult, all: bool) {
    let _ = writeln!(
        out,
        "{name} ({}, rms)\n  {:<12}{:>16}{:>16}{:>16}",
        s.figure.description(),
        "",
        "before",
        "after",
        "noise floor"
    );
    let floor = readable::error(s.unit).write(s.noise_floor);
    let both = [
        ("in sample", s.rms_before, s.rms_after),
        ("held out", s.held_out_rms_before, s.held_out_rms_after),
    ];
    for (label, before, after) in both {
        let (before, after) = (shown(s, before), shown(s, after));
        let _ = writeln!(out, "  {label:<12}{before:>16}{after:>16}{floor:>16}");
    }
    for remark in remarks(s) {
        wrap(out, "  ", &remark);
    }
    if s.rows < s.affine_parameters + FEW {
        let _ = writeln!(
            out,
            "  {} residuals for {} affine parameters: nothing can be found in them, and nothing refuted",
            s.rows, s.affine_parameters
        );
    }
    for a in d.effects.iter().filter(|a| a.sensor == name) {
        effect(out, s, a);
    }
    for u in d.undecided.iter().filter(|u| u.sensor == name) {
        let law = format!("{} explains it {}", u.law, by_score(u.difference));
        wrap(out, &format!("  undecided, {}: ", u.id), &law);
        wrap(out, "    told apart by ", u.experiment);
    }
    for note in &s.notes {
        wrap(out, "  note: ", note);
    }
    let leftover = || d.leftover.iter().filter(|l| l.sensor == name);
    for l in leftover() {
        let _ = writeln!(
            out,
            "  left over, {}: {} rms beyond the noise; goes with {}",
            l.rows,
            readable::error(l.unit).write(l.strength),
            l.against
        );
    }
    if leftover().any(|l| l.usual) {
        wrap(out, "    ", USUAL);
    }
    rejected(out, d, name, all);
}

/// What was not accepted. Without `all`, of those whose reason takes more than a line the ids only.
fn rejected(out: &mut String, d: &DiagnosisResult, sensor: &str, all: bool) {
    let mut longer: Vec<&str> = Vec::new();
    for r in d.rejected.iter().filter(|r| r.sensor == sensor) {
        let mut text = String::new();
        wrap(&mut text, &format!("  - {}: ", r.id), &r.reason);
        match all || text.lines().count() == 1 {
            true => out.push_str(&text),
            false => longer.push(&r.id),
        }
    }
    if !longer.is_empty() {
        let count = plural(longer.len() as u64, "effect");
        let text = format!(
            "{} (--all prints the reasons, and the page has them)",
            longer.join(", ")
        );
        wrap(out, &format!("  - {count} not accepted: "), &text);
    }
}

/// What is said of what is left that usual sensors do.
pub(super) const USUAL: &str = "by up to four times the noise of a dwell mean the biases of usual sensors wander; `mimu allan` of the \
                                unit at rest, given as --noise, tells whether this one does";

fn effect(out: &mut String, s: &SensorDiagnosisResult, a: &AcceptedResult) {
    let _ = writeln!(out, "  + {}: {}", a.id, a.about);
    let _ = writeln!(
        out,
        "    held out {} without it, {} with it; {}",
        shown(s, a.held_out_rms_before),
        shown(s, a.held_out_rms_after),
        p_value(a.chance)
    );
    match &a.second {
        Some(second) if second.shows => {
            let [x, y] = [second.rms_before, second.rms_after].map(|v| shown(s, v));
            let _ = writeln!(
                out,
                "    second recording {x} without it, {y} with it, its affine parameters its own"
            );
        }
        Some(_) => {
            let _ = writeln!(
                out,
                "    the second recording does not excite it, and can say nothing of it"
            );
        }
        None => {}
    }
    for c in &a.coefficients {
        let Readable { factor, unit } = readable::coefficient(&c.unit);
        // Twice the standard deviation: with dwells by the dozen Student's factor is within a tenth of it.
        let both = plus_minus(c.value * factor, 2.0 * c.sigma * factor);
        let _ = writeln!(out, "    {:<12}{both:>19} {unit}", c.name);
    }
    if let Some(form) = &a.form {
        let (value, interval) = (significant(form.value), form.interval());
        let _ = writeln!(out, "    {:<12}{value:>12} (95 %: {interval})", form.name);
    }
    for c in &a.converters {
        let _ = writeln!(out, "    {}", converter(c));
    }
    for other in a.alternatives.iter().take(SHOWN) {
        let _ = writeln!(
            out,
            "    or {}, {} in score",
            other.id,
            by(other.score_worse_by)
        );
    }
    if a.alternatives.len() > SHOWN {
        let _ = writeln!(out, "    or one of {} more", a.alternatives.len() - SHOWN);
    }
}

/// A converter in words.
pub(super) fn converter(c: &ConverterTable) -> String {
    format!(
        "converter of {}, raw: bit 0 turns every {} from {} on; errors are in units of bit 0",
        c.axes,
        significant(c.weight_of_bit_0_raw),
        plus_minus(c.reading_of_code_0_raw, c.reading_of_code_0_within_raw)
    )
}

/// By how much a score is worse or, beside what was found since, better.
pub(super) fn by(worse: f64) -> String {
    match worse >= 0.0 {
        true => format!("worse by {worse:.1}"),
        false => format!("better by {:.1}", -worse),
    }
}

/// How an unlisted alternative model does in the place of an effect; `worse` in score.
pub(super) fn by_score(worse: f64) -> String {
    let how = if worse > 0.0 {
        "nearly as well"
    } else {
        "as well"
    };
    format!("{how}, {} in score", by(worse))
}

/// Fewer residuals beyond the affine parameters than this say nothing.
const FEW: usize = 3;
/// Alternatives that are listed.
const SHOWN: usize = 3;

/// What the recordings could not show, and what would. Recipes that differ in their size only are one: the largest shows them all.
fn not_excited(out: &mut String, d: &DiagnosisResult) {
    let mut alike: Vec<(&str, Vec<&str>)> = Vec::new();
    for (experiment, ids) in by_experiment(d, |_| true) {
        let same = |e: &str| without_numbers(e) == without_numbers(experiment);
        match alike.iter_mut().find(|(e, _)| same(e)) {
            Some((largest, all)) => {
                all.extend(ids);
                if first_number(experiment) > first_number(largest) {
                    *largest = experiment;
                }
            }
            None => alike.push((experiment, ids)),
        }
    }
    if !alike.is_empty() {
        let _ = writeln!(out);
    }
    for (experiment, ids) in alike {
        wrap(out, "not excited: ", &ids.join(", "));
        wrap(out, "  ", experiment);
    }
}

fn without_numbers(text: &str) -> String {
    text.chars().filter(|c| !c.is_ascii_digit()).collect()
}

/// Of a recipe: its dwells, or its minutes.
fn first_number(text: &str) -> u32 {
    let digits = text.split(|c: char| !c.is_ascii_digit());
    digits.filter_map(|d| d.parse().ok()).next().unwrap_or(0)
}

/// Effects that were not excited, of the sensors that `of` takes, by the experiment that would show them.
pub(super) fn by_experiment(
    d: &DiagnosisResult,
    of: impl Fn(&str) -> bool,
) -> Vec<(&str, Vec<&str>)> {
    let mut all: Vec<(&str, Vec<&str>)> = Vec::new();
    for n in d.not_excited.iter().filter(|n| of(n.sensor)) {
        match all.iter_mut().find(|(e, _)| *e == n.experiment) {
            Some((_, ids)) => ids.push(&n.id),
            None => all.push((&n.experiment, vec![&n.id])),
        }
    }
    all
}

fn confused(out: &mut String, d: &DiagnosisResult) {
    if !d.confused.is_empty() {
        let _ = writeln!(out);
    }
    for c in &d.confused {
        let _ = writeln!(
            out,
            "{} or {} ({} in score)",
            c.ids[0],
            c.ids[1],
            by(c.difference)
        );
        wrap(out, "  told apart by ", &c.experiment);
    }
}

/// What the plan of the next experiment does not show, by the reason.
pub fn not_in_plan_text(d: &DiagnosisResult) -> String {
    let mut out = String::new();
    let mut reasons: Vec<&str> = d.not_in_plan.iter().map(|n| n.reason).collect();
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
