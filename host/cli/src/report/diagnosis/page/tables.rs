//! The tables: errors before and after, coefficients, rejected effects.

use maud::{Markup, PreEscaped, html};

use super::{Shown, sentence};
use crate::hint;
use crate::report::diagnosis::remarks;
use crate::report::diagnosis::text::{by_experiment, by_score, coefficient_table};
use crate::report::page::{number, spoken, written};
use mimu::diagnose::decision::{Accepted, Leftover};
use mimu::quantity::{Figure, Sensor, p_value, significant};
use mimu::readable;
use mimu::result::diagnosis::{DiagnosisResult, SensorDiagnosisResult};

/// A line break that is HTML and XML.
const BR: PreEscaped<&str> = PreEscaped("<br/>");

/// An error figure; none if there are as many parameters as residuals, because then only rounding remains.
pub fn figure_of(s: &SensorDiagnosisResult, si: f64) -> Markup {
    let figure = readable::error(s.unit);
    match s.says_anything() {
        true => number(si, figure.factor, &figure.unit),
        false => html! { "–" },
    }
}

/// A p value.
pub fn chance(p: f64) -> Markup {
    html! { data value=(p) { (written(&p_value(p))) } }
}

/// Errors before and after, for all sensors, in sample and held out.
pub(super) fn errors(sensors: &[Shown]) -> Markup {
    html! {
        div class="scroll" { table {
            caption { "Root mean square error. Noise floor: the error that would remain if the model were complete." }
            thead { tr {
                th { "sensor" } th { "model" } th class="n" { "in sample" } th class="n" { "held out" } th class="n" { "noise floor" }
            } }
            tbody {
                @for s in sensors {
                    @let last = s.picture.steps.len() - 1;
                    @for (n, step) in s.picture.steps.iter().enumerate() {
                        tr class=[(n == last && last > 0).then_some("total")] {
                            td { @if n == 0 { (spoken(s.name)) (BR) span class="dim" { (s.figures.figure.description()) } } }
                            td { @if n == 0 { (step.adds) } @else { "+ " code { (step.adds) } } }
                            td class="n" { (figure_of(s.figures, step.rms)) }
                            td class="n" { (figure_of(s.figures, step.held_out_rms)) }
                            td class="n" { (figure_of(s.figures, s.figures.noise_floor)) }
                        }
                    }
                }
            }
        } }
        @for s in sensors {
            @for remark in remarks(s.figures, true) { p class="dim" { (spoken(s.name)) ": " (remark) "." } }
        }
    }
}

/// Coefficients of an effect.
pub fn coefficients(one: &Accepted) -> Markup {
    html! {
        (coefficient_table(one).html())
    }
}

/// Candidates and unlisted alternative models that fit almost as well as an effect.
pub(super) fn alternatives(d: &DiagnosisResult, s: &Shown, one: &Accepted) -> Markup {
    let undecided = || d.undecided.iter().filter(|u| u.id == one.effect.id());
    html! {
        @for u in undecided() {
            p { strong { "Undecided. " } (sentence(u.law)) " explains it " (by_score(u.difference)) ". Distinguished by: " (u.experiment) "." }
        }
        @if one.chosen.alternatives.is_empty() {
            @if undecided().next().is_none() && s.figures.notes.is_empty() {
                p { "Nothing else that was tried fits nearly as well." }
            }
        } @else {
            p { "In this recording it can be confused with:" }
            div class="scroll" { table {
                thead { tr { th { "instead" } th class="n" { "worse by, in score" } th class="n" { "odds" } } }
                tbody { @for other in &one.chosen.alternatives {
                    tr {
                        td { code { (other.id) } }
                        td class="n" { (number(other.score_worse_by, 1.0, "")) }
                        td class="n" { "1 : " (significant((0.5 * other.score_worse_by.max(0.0)).exp())) }
                    }
                } }
            } }
        }
    }
}

fn strength(left: &Leftover) -> Markup {
    let figure = readable::error(left.unit());
    number(left.strength, figure.factor, &figure.unit)
}

/// Remaining residuals of all sensors.
pub fn leftover(d: &DiagnosisResult) -> Markup {
    html! {
        div class="scroll" { table {
            thead { tr { th { "residual" } th class="n" { "rms beyond the noise" } th { "correlates with" } } }
            tbody { @for left in &d.leftover {
                tr {
                    td { (spoken(left.sensor)) " " (left.stratum) }
                    td class="n" { (strength(left)) }
                    td { (left.against) @if left.usual { " *" } }
                }
            } }
        } }
    }
}

/// Remaining residuals of a sensor in words: where they are, and the largest. The table shows what they correlate with.
pub fn leftover_words(d: &DiagnosisResult, sensor: Sensor) -> Markup {
    let all: Vec<&Leftover> = d.unexplained().filter(|l| l.sensor == sensor).collect();
    // Turns have another unit than the other residuals.
    let of_unit = |turns: bool| -> Vec<&Leftover> {
        let ours = all.iter().copied();
        ours.filter(|l| (l.figure() == Figure::Direction) == turns)
            .collect()
    };
    let parts = [true, false].map(of_unit);
    let parts: Vec<&Vec<&Leftover>> = parts.iter().filter(|p| !p.is_empty()).collect();
    html! {
        @for (n, part) in parts.iter().enumerate() {
            @if n > 0 { ", " }
            @let names: Vec<String> = part.iter().map(|l| l.stratum.to_string()).collect();
            @let largest = part.iter().fold(part[0], |a, b| if b.strength > a.strength { b } else { a });
            (spoken(sensor)) " " (names.join(", ")) @if part.len() > 1 { " by up to " } @else { " by " }
            (strength(largest)) " rms"
        }
    }
}

/// Rejected effects.
pub fn rejected(d: &DiagnosisResult) -> Markup {
    html! {
        @if d.rejected.is_empty() {
            p { "No other effect came near." }
        } @else {
            div class="scroll" { table class="long told" {
                thead { tr { th { "effect" } th { "why not" } } }
                tbody { @for r in &d.rejected {
                    tr { td { code { (r.id) } } td { (hint::of_rejected(r)) } }
                } }
            } }
        }
    }
}

/// Effects that the recording could not show, by the experiment that would show them.
pub fn not_excited(d: &DiagnosisResult) -> Markup {
    let by_experiment = by_experiment(d);
    html! {
        @if by_experiment.is_empty() {
            p { "This recording would show every effect of the library at the size of data sheets." }
        } @else {
            div class="scroll" { table class="told" {
                thead { tr { th { "effect" } th { "what would show it" } } }
                tbody { @for (experiment, ids) in by_experiment {
                    tr {
                        td { @for id in ids { code { (id) } (BR) } }
                        td { (experiment) }
                    }
                } }
            } }
        }
    }
}
