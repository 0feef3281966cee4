//! Result of `mimu diagnose`.

mod effect;
mod figures;

use maud::{Markup, html};
use mimu::diagnose::decision::{Accepted, FALSE_LEFTOVER, LEVERAGE, Leftover};
use mimu::diagnose::picture::Picture;
use mimu::diagnose::search::{FALSE_FOUND, FALSE_LISTED};
use mimu::plan::next_experiment::{NotExcited, NotShown};
use mimu::quantity::{Figure, Sensor, p_value, plural, significant};
use mimu::result::diagnosis::{DiagnosisResult, SecondResult, SensorDiagnosisResult};
use mimu::{Split, Verdict, Warning, readable};
use mimu_recording::Reference;

use super::page::{Level, Made, judged, kinds, page, problems, quantity, shown, spoken, written};
use super::table::{number, table, with_unit};
use super::terminal::text;
use crate::hint;

/// If the reference's errors exceed this many noise floors, they limit the judgement of a clean unit instead of the noise.
const OPEN: f64 = 3.0;
/// Where the figures come from.
const FIGURES: &str = "The figures before are those of `mimu fit` for the same recording. Held out, the figures after are those of effects and calibration found without the part that is judged.";
/// Remark on residuals that can come from the biases of usual sensors.
const USUAL: &str = "usual biases wander by up to four times the noise of a dwell; --noise (from `mimu allan` of the unit at rest) shows whether this one does";
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
    let level = Level::of(detail.all);
    text(&html! {
        (first(d, level))
        h2 { "Error before and after" }
        (errors(d, level))
        (sensors(d, level))
        (tried(d, level, detail.next))
        ul data-head="warning: " { @for warning in said(d, level) { li { (warning) } } }
    })
}

/// The page of a diagnosis.
pub fn diagnosis_page(d: &DiagnosisResult, made: &Made) -> String {
    let title = format!("Diagnosis of {}: {}", d.device, d.verdict.name());
    page(&title, &body(d, made))
}

/// Contents of the page.
pub(super) fn body(d: &DiagnosisResult, made: &Made) -> Markup {
    html! {
        h1 { "Diagnosis of " (d.device) }
        (first(d, Level::Page))
        (identity(d, made))
        h2 { "Error before and after" }
        (errors(d, Level::Page))
        (sensors(d, Level::Page))
        (tried(d, Level::Page, true))
        (recorded(d))
        (method())
        (made.line(d.tool))
    }
}

/// Meaning of the verdict, as a sentence fragment.
fn meaning(d: &DiagnosisResult) -> Markup {
    let open = |s: &SensorDiagnosisResult| s.reference_rms > OPEN * s.noise_floor;
    // Reported below, not judged.
    let usual = d.leftover.iter().any(|l| l.usual);
    html! { @match d.verdict {
        Verdict::Clean if d.sensors.present().any(|(_, s)| open(s)) => "noise, and the accelerometer's uncertainty in these poses, explain the residual of the affine calibration",
        Verdict::Clean if usual => "noise, and biases that wander as much as usual, explain the residual of the affine calibration",
        Verdict::Clean => "noise explains the residual of the affine calibration",
        Verdict::Explained if usual => "with the effects below, noise and biases that wander as much as usual explain what remains",
        Verdict::Explained => "with the effects below, noise explains what remains",
        Verdict::Untestable => "no effect was found, and the recording has too little data to judge",
        Verdict::Unexplained if d.unexplained().next().is_some() => "an error of unknown origin remains",
        Verdict::Unexplained => "an unlisted alternative model fits as well as an effect that was found",
    } }
}

/// Faults of the recording, the verdict and the judgement.
pub(super) fn first(d: &DiagnosisResult, level: Level) -> Markup {
    html! {
        (problems(&d.recording_problems, d.has_several(), level))
        p class={ "verdict " (d.verdict.name()) } { (d.device) ": " strong { (d.verdict.name()) } ": " (meaning(d)) }
        (judged(&d.judgement, ""))
        section { @for u in &d.untestable { p data-head={ (u.sensor) ": " } { @if level.is_page() { (u.sensor) ": " } (u.reason) } } }
    }
}

fn identity(d: &DiagnosisResult, made: &Made) -> Markup {
    html! { dl {
        dt { "Recording" } dd { code { (made.recording) } }
        @for source in &d.recordings {
            dt { "Samples" } dd {
                @if d.recordings.len() > 1 { code { (source.place) } ": " }
                (source.rows) " in " (shown(source.rows as f64 * source.period_s, 1.0 / 60.0, "min"))
                " at " (shown(1.0 / source.period_s, 1.0, "Hz")) ", SHA-256 " code { (source.sha256) }
            }
        }
        dt { "Input" } dd {
            @match d.reference {
                Reference::Table => "known from the table",
                Reference::Gravity => "only gravity is known",
                Reference::TurntableRate => "only the magnitude of the rate is known",
            }
            "; gravity " data value=(d.gravity_mps2) { (format!("{:.5}", d.gravity_mps2)) " m/s²" }
        }
        dt { "Judged by" } dd { @for (k, (name, s)) in d.sensors.present().enumerate() {
            @if k > 0 { ", " } (s.judged) @if s.figure == Figure::Direction { " turns" } @else { " dwells" } " for the " (spoken(name))
        } }
        dt { "Diagnosed" } dd { (made.created) }
    } }
}

/// An error figure; a dash if there are as many parameters as residuals, because then only rounding remains.
fn figure_of(s: &SensorDiagnosisResult, si: f64) -> Markup {
    let known = if s.says_anything() { si } else { f64::NAN };
    quantity(known, &readable::error(s.unit))
}

/// Errors before and after, on the recording and on a second one.
pub(super) fn errors(d: &DiagnosisResult, level: Level) -> Markup {
    let beside = d.second.as_ref().filter(|_| level == Level::Summary);
    html! {
        (table("Root mean square error. Noise floor: the error that would remain if the model were complete.", &html! {
            th { "rms error" } th.n { "in sample" } th.n { "held out" } th.n { "noise floor" } @if beside.is_some() { th.n { "second recording" } th {} } th.page { "error of" }
        }, &html! { @for (name, s) in d.sensors.present() { @for (label, [rms, held_out], after) in steps(d, name, s) { tr {
            @let unit = readable::error(s.unit);
            td { (with_unit(label, &unit)) }
            @for rms in [rms, held_out] { (number(if s.says_anything() { rms } else { f64::NAN }, unit.factor)) }
            // The noise floor is known even if the residuals are not informative.
            (number(s.noise_floor, unit.factor))
            @if let Some(of) = beside.and_then(|second| if after { &second.after } else { &second.before }.sensors[name].as_ref()) {
                @let other = readable::error(of.unit);
                (number(of.rms, other.factor)) td { @if of.unit != s.unit { (other.unit) } }
            }
            td.page { (s.figure.description()) }
        } } } }))
        @if level.has_all() { p.dim { (FIGURES) } }
        @if let Some(second) = &d.second {
            @if second.fitted_to { p { "The second recording " code { (second.recording) } " is the fitted one, so it proves nothing." } }
            @if level.has_all() {
                h2 { "A second recording" }
                @if !second.fitted_to { p { code { (second.recording) } " was not used to find or fit the effects." } }
                (second_errors(second))
            }
        }
    }
}

/// Without effects and with them: label, errors in sample and held out, and whether effects are taken out.
fn steps(
    d: &DiagnosisResult,
    name: Sensor,
    s: &SensorDiagnosisResult,
) -> Vec<(String, [f64; 2], bool)> {
    let before = [s.rms_before, s.held_out_rms_before];
    let mut all = vec![(name.to_string(), before, false)];
    if accepted(d, name).next().is_some() {
        let after = [s.rms_after, s.held_out_rms_after];
        all.push(("  with effects".into(), after, true));
    }
    all
}

/// Errors before and after, on a recording that was not fitted.
fn second_errors(both: &SecondResult) -> Markup {
    html! { (table("Root mean square error with the calibration of the first recording", &html! {
        th { "rms error" } th.n { "before" } th.n { "after" } th.n { "noise" } th.n { "dwells or turns" } th.page { "error of" }
    }, &html! { @for ((name, before), (_, after)) in both.before.sensors.present().zip(both.after.sensors.present()) {
        @let unit = readable::error(before.unit);
        tr {
            td { (with_unit(name, &unit)) } @for rms in [before.rms, after.rms, after.noise_floor] { (number(rms, unit.factor)) }
            td.n { (after.count) } td.page { (before.figure.description()) }
        }
    } })) }
}

fn accepted(d: &DiagnosisResult, sensor: Sensor) -> impl Iterator<Item = &Accepted> {
    d.effects
        .iter()
        .filter(move |a| a.effect.sensor() == sensor)
}

/// Effects and residuals of each sensor.
pub(super) fn sensors(d: &DiagnosisResult, level: Level) -> Markup {
    html! {
        @for (name, s) in d.sensors.present() { (sensor(d, name, s, level)) }
        @if level.has_all() && d.leftover.iter().any(|l| l.usual) { p { "* " (USUAL) } }
    }
}

fn sensor(d: &DiagnosisResult, name: Sensor, s: &SensorDiagnosisResult, level: Level) -> Markup {
    let found = accepted(d, name).next().is_some();
    html! {
        @if level.is_page() { h2 class="sensor" { (spoken(name)) } } @else if d.sensors.present().next().is_some_and(|(first, _)| first == name) { hr; }
        p { (name) " (" (s.figure.description()) ")" @if !found { ": no effect found" } }
        section {
            (remarks(s, level))
            @for (k, of) in accepted(d, name).enumerate() { (effect::section(d, s, of, s.picture.effects.get(k).map(|panels| (&s.picture, panels)), level)) }
            @for note in &s.notes {
                p { "note: " (note) }
            }
            (residuals(d, name, level))
            @if level.is_page() { (drawn(&s.picture, found)) }
        }
    }
}

/// Remarks on the error figures of a sensor.
fn remarks(s: &SensorDiagnosisResult, level: Level) -> Markup {
    html! {
        @if !s.held_out_rms_after.is_finite() { p { "no part of the recording can be held out: the rest would determine too little" } }
        @else if s.held_out == Split::Interleaved { p { "held out: every fourth dwell, because a single block of time contains the evidence" } }
        @if s.reference_rms > s.noise_floor {
            p { "the directions of gravity come from the accelerometer, and its errors add at most " (quantity(s.reference_rms, &readable::error(s.unit))) " rms to the noise floor" }
        }
        @if let (Some(share), true) = (s.explained, level.has_all()) {
            p { "the effects explain " (significant(100.0 * share)) " % of the held-out mean square beyond noise and errors of the reference" }
        }
    }
}

/// Residuals beyond the noise. In a summary those that correlate with the same quantity are grouped, and only the first few are listed.
fn residuals(d: &DiagnosisResult, name: Sensor, level: Level) -> Markup {
    let mut groups: Vec<Vec<&Leftover>> = Vec::new();
    for l in d.leftover.iter().filter(|l| l.sensor == name) {
        let same = |g: &&mut Vec<&Leftover>| g[0].against == l.against && g[0].unit() == l.unit();
        match groups.iter_mut().find(same) {
            Some(group) if !level.has_all() => group.push(l),
            _ => groups.push(vec![l]),
        }
    }
    let most = if level.has_all() { usize::MAX } else { LISTED };
    let listed = groups.len().min(most);
    html! {
        @for group in &groups[..listed] {
            @let rows: Vec<String> = group.iter().map(|l| l.stratum.to_string()).collect();
            @let largest = group.iter().map(|l| l.strength).fold(0.0, f64::max);
            p {
                "residual, " (rows.join(", ")) ": " @if group.len() > 1 { "up to " } (quantity(largest, &readable::error(group[0].unit())))
                " rms beyond the noise; correlates with " (group[0].against) @if level.has_all() && group[0].usual { " *" }
            }
        }
        @if groups.len() > listed { p { "and " (groups[listed..].iter().map(Vec::len).sum::<usize>()) " more residuals (--verbose)" } }
    }
}

/// Residuals in time; `after` if there are effects.
fn drawn(picture: &Picture, after: bool) -> Markup {
    html! {
        h3 { "Residuals in time" }
        figure {
            div class="figures" { @for track in &picture.tracks { (figures::in_time(picture.sensor, track, &picture.blocks_s, after)) } }
            figcaption {
                (figures::keys()) "."
                @if !picture.blocks_s.is_empty() { " The shading changes at the borders of the held-out blocks." }
                @if after { " Before and after have the same scale." }
            }
        }
    }
}

/// A p value.
fn chance(p: f64) -> Markup {
    html! { data value=(p) { (written(&p_value(p))) } }
}

/// Difference in score: worse or, compared with later effects, better.
fn by(worse: f64) -> String {
    match worse >= 0.0 {
        true => format!("worse by {worse:.1}"),
        false => format!("better by {:.1}", -worse),
    }
}

/// Effects that were not accepted, and experiments for those that this recording could not show or distinguish. A summary only counts them.
pub(super) fn tried(d: &DiagnosisResult, level: Level, next: bool) -> Markup {
    let (unseen, pairs) = (
        d.not_excited.len() as u64,
        (d.confused.len() + d.undecided.len()) as u64,
    );
    html! {
        h2 { "Tried and rejected" }
        @if level.has_all() { ul { @for r in &d.rejected { li { code { (r.id) } ": " (hint::of_rejected(r)) } } } }
        @else if !d.rejected.is_empty() { p { "tried and rejected: " (plural(d.rejected.len() as u64, "effect")) "; --verbose prints the reasons" } }
        @if level.has_all() || next {
            @if level.is_page() && !d.not_excited.is_empty() { h2 { "Too small to be seen here" } p { "These effects were tried too, but their absence proves nothing." } }
            @for (shown_by, ids) in by_recipe(d) {
                p { "too small to be seen here at the sizes of data sheets: " @for (k, id) in ids.iter().enumerate() { @if k > 0 { ", " } code { (id) } } }
                section { p { (shown_by.experiment) } }
            }
            @if level.is_page() && pairs > 0 { h2 { "Experiments that distinguish the confused effects" } }
            @for c in &d.confused {
                p { code { (c.ids[0]) } " or " code { (c.ids[1]) } " (" (by(c.difference)) " in score)" }
                section { p { "distinguished by: " (c.experiment) } }
            }
            @for u in &d.undecided { p { code { (u.id) } " or " (u.law) } section { p { "distinguished by: " (u.experiment) } } }
        } @else if unseen + pairs > 0 { p {
            @if unseen > 0 { "too small to be seen here: " (plural(unseen, "effect")) "; " }
            @if pairs > 0 { "not distinguished: " (plural(pairs, "pair")) "; " }
            "--next prints the experiments"
        } }
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

/// Warnings beside the faults of the recording.
fn said(d: &DiagnosisResult, level: Level) -> Vec<String> {
    let others = d.warnings.iter().filter(|w| !w.is_of_recording());
    kinds(others, Warning::is_like, hint::of_warning, level.has_all())
}

/// What was masked, gaps, warnings.
pub(super) fn recorded(d: &DiagnosisResult) -> Markup {
    let out = &d.left_out;
    html! {
        h2 { "The recording: masked, gaps, warnings" }
        dl {
            dt { "Dwells" } dd {
                @for (n, (name, s)) in d.sensors.present().enumerate() {
                    @if n > 0 { "; " }
                    (name) ": " (s.dwells_used) " used of " (s.dwells) (s.not_used)
                }
            }
            dt { "Gaps" } dd { (out.gaps) ", " (shown(out.missing_s, 1.0, "s")) " missing" }
            dt { "Repeated rows" } dd { (out.repeated_rows) }
            dt { "Empty samples" } dd { (out.empty_samples) " masked" }
            dt { "Samples at a rail" } dd { (out.clipped_samples) " left out of the dwell means" }
        }
        @if d.warnings.is_empty() { p { "No warnings." } }
        ul { @for w in &d.warnings { li { (hint::of_warning(w)) } } }
    }
}

/// Description of the method.
pub(super) fn method() -> Markup {
    let percent = |p: f64| format!("{} %", significant(100.0 * p));
    html! {
        h2 { "How it is decided" }
        p {
            "Every effect of the library, and every product of recorded quantities up to third order, is fitted together with the "
            "affine calibration and judged by the likelihood ratio. The noise of the residuals is estimated anew for each. Over the "
            "whole search the probability of a false alarm is " (percent(FALSE_LISTED)) " for a named effect and "
            (percent(FALSE_FOUND)) " for a product, for each sensor. "
            "An effect is accepted only if it lowers the error of held-out dwells, and if no single dwell "
            "contains more than " (percent(LEVERAGE)) " of the information about it. "
            "Scatter beyond the known noise, of a size that chance causes in " (percent(FALSE_LEFTOVER))
            " of clean units, is reported as a residual, and the verdict is then unexplained, even if effects were found."
        }
    }
}

/// Effects that the plan of the next experiment does not show, by the reason.
pub fn not_in_plan_text(d: &DiagnosisResult) -> String {
    let mut reasons: Vec<NotShown> = d.not_in_plan.iter().map(|n| n.reason).collect();
    reasons.sort_unstable();
    reasons.dedup();
    text(&html! { @for reason in reasons {
        @let ids: Vec<&str> = d.not_in_plan.iter().filter(|n| n.reason == reason).map(|n| n.id.as_str()).collect();
        p data-head={ "not in this plan, as " (reason) ": " } { (ids.join(", ")) }
    } })
}
