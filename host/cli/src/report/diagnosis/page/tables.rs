//! The tables: errors before and after, coefficients, what was tried.

use maud::{Markup, PreEscaped, html};

use super::figures::unit;
use super::svg::raised;
use super::{sentence, spoken};
use crate::report::diagnosis::text::{by_score, converter, odds};
use mimu::calibration::ConverterTable;
use mimu::diagnose::candidate::{Candidate, Kind};
use mimu::diagnose::decision::{Accepted, Decision, Leftover, Split};
use mimu::diagnose::picture::{Kind as Rows, Picture};
use mimu::diagnose::{Diagnosis, SensorDiagnosis};
use mimu::quantity::Figure;
use mimu::quantity::Sensor;
use mimu::quantity::significant;
use mimu::readable;
use mimu::verify::Verification;

/// A line break that is HTML and XML.
const BR: PreEscaped<&str> = PreEscaped("<br/>");

/// A number for people, which holds that of the JSON.
pub fn number(si: f64, factor: f64, unit: &str) -> Markup {
    html! {
        @if si.is_finite() {
            data value=(si) { (written(&significant(si * factor))) @if !unit.is_empty() { " " (unit) } }
        } @else { "–" }
    }
}

/// An error figure: none where there are as many parameters as residuals, and only rounding is left.
pub fn figure_of(decision: &Decision, si: f64, factor: f64, unit: &str) -> Markup {
    let [rows, parameters] = decision.rows;
    match rows > parameters {
        true => number(si, factor, unit),
        false => html! { "–" },
    }
}

/// With a minus sign in place of a hyphen, and powers of ten as people write them.
fn written(text: &str) -> String {
    let text = match text.split_once('e') {
        Some((digits, power)) => format!("{digits}·10{}", raised(power)),
        None => text.into(),
    };
    text.replace('-', "−")
}

/// What the error figures of a sensor are about.
pub fn figure(d: &Diagnosis, sensor: Sensor) -> Figure {
    d.before.sensor(sensor).map_or(Figure::Input, |f| f.figure)
}

/// Probability of chance in words.
pub fn chance(p: f64) -> Markup {
    // Where a distribution function has underflowed.
    let less = if p < 1e-300 { "less than " } else { "" };
    html! { "by chance " (less) "once in " data value=(p) { (written(&odds(p))) } }
}

/// Errors before and after, of all sensors, in sample and held out.
pub fn errors(d: &Diagnosis, pictures: &[Picture]) -> Markup {
    html! {
        div class="scroll" { table {
            caption { "Root mean square error. Noise floor: what would be left if the model were complete." }
            thead { tr {
                th { "sensor" } th { "model" } th class="n" { "in sample" } th class="n" { "held out" } th class="n" { "noise floor" }
            } }
            tbody {
                @for (s, picture) in d.sensors.iter().zip(pictures) {
                    @let (factor, unit) = figure(d, s.sensor).readable(s.sensor);
                    @let last = picture.steps.len() - 1;
                    @for (n, step) in picture.steps.iter().enumerate() {
                        @let ends = [(0, 0), (last, 1)].into_iter().find(|e| e.0 == n && (n == 0 || last > 0));
                        tr class=[(n == last && last > 0).then_some("total")] {
                            td { @if n == 0 { (spoken(s.sensor)) (BR) span class="dim" { (figure(d, s.sensor).description()) } } }
                            td { @if n == 0 { (step.adds) } @else { "+ " code { (step.adds) } } }
                            // The first and the last are those of the decision.
                            @let (rms, held) = match ends {
                                Some((_, k)) => (s.decision.rms[k], s.decision.held_out_rms[k]),
                                None => (step.rms, step.held_out_rms),
                            };
                            td class="n" { (figure_of(&s.decision, rms, factor, unit)) }
                            td class="n" { (figure_of(&s.decision, held, factor, unit)) }
                            td class="n" { (number(s.decision.noise_floor, factor, unit)) }
                        }
                    }
                }
            }
        } }
        @for s in d.sensors.iter().filter(|s| s.decision.split == Split::Interleaved) {
            p class="dim" { (spoken(s.sensor)) ": every fourth dwell is held out in turn, as one block of time alone shows what the model needs." }
        }
    }
}

/// Sizes in data sheets of the active coefficients.
fn typical(candidate: &Candidate) -> Vec<Option<f64>> {
    let of = |k: &usize| match candidate.kind {
        Kind::Effect(e) => e.typical.get(*k).copied(),
        _ => None,
    };
    candidate.active.iter().map(of).collect()
}

/// Coefficients of an effect.
pub fn coefficients(one: &Accepted) -> Markup {
    let candidate = &one.chosen.candidate;
    html! {
        div class="scroll" { table {
            thead { tr {
                th { "coefficient" } th class="n" { "value" } th class="n" { "± 95 %" } th { "unit" }
                th class="n" { "in data sheets" } th class="n" { "SI" } th { "SI unit" }
            } }
            tbody {
                @for (i, ((name, si), typical)) in candidate.names().iter().zip(typical(candidate)).enumerate() {
                    @let sigma = one.covariance[(i, i)].sqrt();
                    @let readable = readable::coefficient(si);
                    @let factor = readable.factor;
                    tr {
                        td { (name) }
                        td class="n" { (number(one.values[i], factor, "")) }
                        td class="n" { data value=(sigma) { (written(&significant(2.0 * sigma * factor))) } }
                        td { (readable.unit) }
                        td class="n" { @match typical { Some(t) => (number(t, factor, "")), None => "–" } }
                        td class="n dim" { (written(&format!("{:.3e}", one.values[i]))) }
                        td class="dim" { (si.replace("^2", "²")) }
                    }
                }
                @if let Some(form) = candidate.form() {
                    tr {
                        td { (form.name) }
                        td class="n" { (number(one.chosen.form, 1.0, "")) }
                        td class="n" { "–" } td { }
                        td class="n" { (number(form.from, 1.0, "")) " to " (number(form.to, 1.0, "")) " sought" }
                        td { } td { }
                    }
                }
                @for c in ConverterTable::of(&candidate.codes) {
                    tr { td colspan="7" { (converter(&c)) } }
                }
            }
        } }
    }
}

/// Candidates, and laws on no list, that would do nearly as well in the place of an effect.
pub fn alternatives(s: &SensorDiagnosis, one: &Accepted) -> Markup {
    let id = one.chosen.candidate.id();
    let undecided = || s.decision.undecided.iter().filter(|u| u.id == id);
    html! {
        @for u in undecided() {
            p { strong { "Undecided. " } (sentence(u.law)) " explains it " (by_score(u.worse)) ". Told apart by: " (u.settled_by) "." }
        }
        @if one.chosen.alternatives.is_empty() {
            @if undecided().next().is_none() && s.decision.notes.is_empty() {
                p { "Nothing else that was tried would do nearly as well." }
            }
        } @else {
            p { "In this recording it can be confused with:" }
            div class="scroll" { table {
                thead { tr { th { "instead" } th class="n" { "worse by, in score" } th class="n" { "odds" } } }
                tbody { @for (id, worse) in &one.chosen.alternatives {
                    tr {
                        td { code { (id) } }
                        td class="n" { (number(*worse, 1.0, "")) }
                        td class="n" { "1 : " (significant((0.5 * worse.max(0.0)).exp())) }
                    }
                } }
            } }
        }
    }
}

/// Unit of what is left over in a stratum.
fn leftover_unit(sensor: Sensor, left: &Leftover) -> (f64, &'static str) {
    unit(
        if left.stratum == "turns" {
            Rows::Angle
        } else {
            Rows::Input
        },
        sensor,
    )
}

/// What is left, of all sensors.
pub fn leftover(d: &Diagnosis) -> Markup {
    html! {
        div class="scroll" { table {
            thead { tr { th { "residual" } th class="n" { "rms beyond the noise" } th { "goes with" } } }
            tbody { @for s in &d.sensors { @for left in &s.decision.leftover {
                @let (factor, unit) = leftover_unit(s.sensor, left);
                tr {
                    td { (spoken(s.sensor)) " " (left.stratum) }
                    td class="n" { (number(left.strength, factor, unit)) }
                    td { (left.against) @if left.usual { " *" } }
                }
            } } }
        } }
    }
}

/// What is left of a sensor, in words: where, and the largest; what it goes with stands in the table.
pub fn leftover_words(s: &SensorDiagnosis) -> Markup {
    let all: Vec<&Leftover> = s.decision.unexplained().collect();
    // Turns are in another unit than the rest.
    let of_unit = |turns: bool| -> Vec<&Leftover> {
        all.iter()
            .copied()
            .filter(|l| (l.stratum == "turns") == turns)
            .collect()
    };
    let parts: Vec<Vec<&Leftover>> = [true, false]
        .into_iter()
        .map(of_unit)
        .filter(|part| !part.is_empty())
        .collect();
    html! {
        @for (n, part) in parts.iter().enumerate() {
            @if n > 0 { ", " }
            @let names: Vec<&str> = part.iter().map(|l| l.stratum.as_str()).collect();
            @let largest = part.iter().fold(part[0], |a, b| if b.strength > a.strength { b } else { a });
            @let (factor, unit) = leftover_unit(s.sensor, largest);
            (spoken(s.sensor)) " " (names.join(", ")) @if part.len() > 1 { " by up to " } @else { " by " }
            (number(largest.strength, factor, unit)) " rms"
        }
    }
}

/// Before and after on a recording that nothing was fitted to.
pub fn second(both: &[Verification; 2]) -> Markup {
    let [before, after] = both;
    html! {
        div class="scroll" { table {
            caption { "Root mean square error with the calibration of the first recording." }
            thead { tr {
                th { "sensor" } th class="n" { "before" } th class="n" { "after" } th class="n" { "noise floor" } th class="n" { "dwells or turns" }
            } }
            tbody { @for (b, a) in before.sensors.iter().zip(&after.sensors) {
                @let (factor, unit) = b.figure.readable(b.sensor);
                tr {
                    td { (spoken(b.sensor)) (BR) span class="dim" { (b.figure.description()) } }
                    td class="n" { (number(b.rms, factor, unit)) }
                    td class="n" { (number(a.rms, factor, unit)) }
                    td class="n" { (number(a.noise_floor, factor, unit)) }
                    td class="n" { (a.count) }
                }
            } }
        } }
    }
}

/// What was tried and not accepted.
pub fn rejected(sensors: &[SensorDiagnosis]) -> Markup {
    html! {
        @if sensors.iter().all(|s| s.decision.rejected.is_empty()) {
            p { "Nothing came near." }
        } @else {
            div class="scroll" { table class="long" {
                caption { "Errors in the SI unit of the residual." }
                thead { tr { th { "effect" } th { "why not" } } }
                tbody { @for s in sensors { @for (id, reason) in &s.decision.rejected {
                    tr { td { code { (id) } } td { (reason) } }
                } } }
            } }
        }
    }
}

/// What the experiment could not show, by the experiment that would.
pub fn not_excited(sensors: &[SensorDiagnosis]) -> Markup {
    let mut by_experiment: Vec<(&str, Vec<&str>)> = Vec::new();
    for (id, experiment) in sensors.iter().flat_map(|s| not_excited_in(&s.decision)) {
        match by_experiment.iter_mut().find(|(e, _)| *e == experiment) {
            Some((_, ids)) => ids.push(id),
            None => by_experiment.push((experiment, vec![id])),
        }
    }
    html! {
        @if by_experiment.is_empty() {
            p { "Every effect of the library was tested." }
        } @else {
            div class="scroll" { table {
                thead { tr { th { "effect" } th { "what the experiment lacks" } } }
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

fn not_excited_in(d: &Decision) -> impl Iterator<Item = (&str, &str)> {
    d.not_excited
        .iter()
        .map(|(id, e)| (id.as_str(), e.as_str()))
}
