//! The diagnosis for people.

use std::fmt::Write as _;

use super::DiagnosisReport;
use crate::report::text::{warn, wrap};
use mimu::calibration::ConverterTable;
use mimu::diagnose::decision::{Accepted, Decision, Split};
use mimu::diagnose::{SensorDiagnosis, Verdict};
use mimu::next_experiment::Next;
use mimu::quantity::Figure;
use mimu::quantity::{plus_minus, significant};

/// Result of `mimu diagnose`.
pub fn diagnosis_text(report: &DiagnosisReport) -> String {
    let mut out = String::new();
    let d = &report.diagnosis;
    let said = match d.verdict {
        Verdict::Clean => "clean: noise explains what the affine calibration leaves",
        Verdict::Explained => "explained: with the effects below, noise explains what is left",
        Verdict::Unexplained
            if d.sensors
                .iter()
                .any(|s| s.decision.unexplained().next().is_some()) =>
        {
            "unexplained: something is left that nothing here explains"
        }
        Verdict::Unexplained => {
            "unexplained: a law that is on no list does as well as what was found"
        }
    };
    let _ = writeln!(out, "{}: {said}", d.before.prepared.manifest.device);
    for s in &d.sensors {
        let figure = d
            .before
            .sensor(s.sensor)
            .map_or(Figure::Input, |f| f.figure);
        let _ = writeln!(out);
        sensor(&mut out, s, figure);
        not_excited(&mut out, s, &report.next);
    }
    confused(&mut out, &report.next);
    if let Some((name, [before, after])) = &report.second {
        let _ = writeln!(out, "\non {name}, which nothing was fitted to");
        let _ = writeln!(
            out,
            "  {:<8}{:>16}{:>16}{:>16}",
            "", "before", "after", "noise floor"
        );
        for (b, a) in before.sensors.iter().zip(&after.sensors) {
            let (factor, unit) = b.figure.readable(b.sensor);
            let [x, y, z] = [b.rms, a.rms, a.noise_floor]
                .map(|v| format!("{} {unit}", significant(v * factor)));
            let _ = writeln!(out, "  {:<8}{x:>16}{y:>16}{z:>16}", b.sensor.name());
        }
    }
    let warnings: Vec<&String> = report.warnings().collect();
    if !warnings.is_empty() {
        let _ = writeln!(out);
        warn(&mut out, warnings.into_iter());
    }
    out
}

fn sensor(out: &mut String, s: &SensorDiagnosis, figure: Figure) {
    let d = &s.decision;
    let (factor, unit) = figure.readable(s.sensor);
    // As many parameters as residuals leave rounding.
    let [rows, parameters] = d.rows;
    let shown = |v: f64| match v.is_finite() && rows > parameters {
        true => format!("{} {unit}", significant(v * factor)),
        false => "-".into(),
    };
    let _ = writeln!(
        out,
        "{} ({}, rms)\n  {:<12}{:>16}{:>16}{:>16}",
        s.sensor,
        figure.description(),
        "",
        "before",
        "after",
        "noise floor"
    );
    let floor = format!("{} {unit}", significant(d.noise_floor * factor));
    for (name, [before, after]) in [("in sample", d.rms), ("held out", d.held_out_rms)] {
        let _ = writeln!(
            out,
            "  {name:<12}{:>16}{:>16}{floor:>16}",
            shown(before),
            shown(after)
        );
    }
    if d.split == Split::Interleaved {
        let _ = writeln!(
            out,
            "  held out every fourth dwell: one block of time alone shows what is needed"
        );
    }
    if rows < parameters + FEW {
        let _ = writeln!(
            out,
            "  {rows} residuals for {parameters} affine parameters: nothing can be found in them, and nothing refuted"
        );
    }
    for a in &d.accepted {
        effect(out, a, &shown);
    }
    for u in &d.undecided {
        let law = format!("{} explains it {}", u.law, by_score(u.worse));
        wrap(out, &format!("  undecided, {}: ", u.id), &law);
        wrap(out, "    told apart by ", u.settled_by);
    }
    for note in &d.notes {
        wrap(out, "  note: ", note);
    }
    for l in &d.leftover {
        let (factor, unit) = match l.stratum.starts_with("turns") {
            true => (1f64.to_degrees(), "deg"),
            false => Figure::Input.readable(s.sensor),
        };
        let _ = writeln!(
            out,
            "  left over, {}: {} {unit} rms beyond the noise; goes with {}",
            l.stratum,
            significant(l.strength * factor),
            l.against
        );
    }
    if d.leftover.iter().any(|l| l.usual) {
        wrap(out, "    ", USUAL);
    }
    tried(out, d);
}

/// What is said of what is left that usual sensors do.
pub(super) const USUAL: &str = "by up to four times the noise of a dwell mean the biases of usual sensors wander; `mimu allan` of the \
                                unit at rest, given as --noise, tells whether this one does";

fn effect(out: &mut String, a: &Accepted, shown: &impl Fn(f64) -> String) {
    let candidate = &a.chosen.candidate;
    let about = candidate.about();
    let _ = writeln!(out, "  + {}: {about}", candidate.id());
    let _ = writeln!(
        out,
        "    held out {} without it, {} with it; by chance once in {}",
        shown(a.held_out[0]),
        shown(a.held_out[1]),
        odds(a.chosen.p)
    );
    match &a.second {
        Some(second) if second.shows() => {
            let [x, y] = second.rms.map(shown);
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
    for (i, (name, unit)) in candidate.names().iter().enumerate() {
        // Twice the standard deviation: with dwells by the dozen Student's factor is within a tenth of it.
        let half = 2.0 * a.covariance[(i, i)].sqrt();
        let _ = writeln!(
            out,
            "    {name:<12}{:>12.3e} ± {half:.1e} {unit}",
            a.values[i]
        );
    }
    if let Some(form) = candidate.form() {
        let _ = writeln!(
            out,
            "    {:<12}{:>12}",
            form.name,
            significant(a.chosen.form)
        );
    }
    for c in ConverterTable::of(&candidate.codes) {
        let _ = writeln!(out, "    {}", converter(&c));
    }
    let alternatives = &a.chosen.alternatives;
    for (id, worse) in alternatives.iter().take(SHOWN) {
        let _ = writeln!(out, "    or {id}, {} in score", by(*worse));
    }
    if alternatives.len() > SHOWN {
        let _ = writeln!(out, "    or one of {} more", alternatives.len() - SHOWN);
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

/// How a law on no list does in the place of an effect; `worse` in score.
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

/// 1/p in few digits.
pub(super) fn odds(p: f64) -> String {
    match 1.0 / p.max(1e-300) {
        n if n < 1e6 => format!("{n:.0}"),
        n => format!("{n:.0e}"),
    }
}

fn tried(out: &mut String, d: &Decision) {
    for (id, reason) in &d.rejected {
        wrap(out, &format!("  - {id}: "), reason);
    }
}

/// What the recording could not show, and what would.
fn not_excited(out: &mut String, s: &SensorDiagnosis, next: &Next) {
    let mut by_experiment: Vec<(&str, Vec<&str>)> = Vec::new();
    for (id, _) in &s.decision.not_excited {
        let Some((_, experiment)) = next.not_excited.iter().find(|n| n.0 == *id) else {
            continue;
        };
        match by_experiment.iter_mut().find(|(e, _)| e == experiment) {
            Some((_, ids)) => ids.push(id),
            None => by_experiment.push((experiment, vec![id])),
        }
    }
    for (experiment, ids) in by_experiment {
        wrap(out, "  not excited: ", &ids.join(", "));
        wrap(out, "    needs ", experiment);
    }
}

fn confused(out: &mut String, next: &Next) {
    if !next.confused.is_empty() {
        let _ = writeln!(out);
    }
    for c in &next.confused {
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
