//! An accepted effect: its influence on the error, its coefficients, and its alternatives.

use maud::{Markup, html};
use mimu::diagnose::picture::{Against, Panel, Picture};
use mimu::effects::fitted::WrittenCoefficient;
use mimu::readable::{self, Readable};
use mimu::result::diagnosis::{DiagnosisResult, SensorDiagnosisResult};
use mimu::{Accepted, plus_minus, significant};

use super::{by, chance, figure_of, figures};
use crate::report::page::{Level, quantity};
use crate::report::table::{interval, known, table, typed};

/// Largest number of alternatives in a summary.
const SHOWN: usize = 3;

pub(super) fn section(
    d: &DiagnosisResult,
    s: &SensorDiagnosisResult,
    a: &Accepted,
    drawn: Option<(&Picture, &Vec<Panel>)>,
    level: Level,
) -> Markup {
    let alternatives = &a.chosen.alternatives;
    let most = if level.has_all() { usize::MAX } else { SHOWN };
    let shown = alternatives.len().min(most);
    html! {
        @if level.is_page() { h3 { code { (a.effect.id()) } } }
        p { @if !level.is_page() { "+ " (a.effect.id()) ": " } (a.effect.candidate.about()) }
        section {
            p { "held out " (errors(s, a)) @if !a.of_unit { "; it is not stored in a calibration" } }
            @if level.has_all() { (coefficients(a)) } @else { (compact(a)) }
            @if let (Some((picture, panels)), true) = (drawn, level.is_page()) { (figure(a, picture, panels)) }
            @if shown > 0 { p {
                "or, by score: " @for (k, other) in alternatives[..shown].iter().enumerate() { @if k > 0 { ", " } (other.id) " (" (by(other.score_worse_by)) ")" }
                @if alternatives.len() > shown { ", one of " (alternatives.len() - shown) " more" }
            } }
            @for u in d.undecided.iter().filter(|u| u.id == a.effect.id()) { p { "or, undecided: " (u.law) " (" (by(u.difference)) ")" } }
        }
    }
}

/// `0.549 deg without it, 0.136 deg with it; p < 1e-6`, and the same for rest and for the second recording.
fn errors(s: &SensorDiagnosisResult, a: &Accepted) -> Markup {
    let both = |[without, with]: [Markup; 2]| html! { (without) " without it, " (with) " with it" };
    // For a gyro without a table. Its other figures are angles after a turn.
    let rate = readable::error("rad/s");
    html! {
        (both([a.held_out_rms_before, a.held_out_rms_after].map(|v| figure_of(s, v))))
        @if let (Some(before), Some(after)) = (a.held_out_at_rest_before, a.held_out_at_rest_after) {
            "; at rest " (both([before, after].map(|v| quantity(v, &rate))))
        }
        @match &a.second {
            Some(second) if second.shows => {
                "; second recording " (both([second.rms_before, second.rms_after].map(|v| figure_of(s, v)))) " (affine parameters refitted)"
            }
            Some(_) => "; the second recording does not excite it",
            None => {}
        }
        "; " (chance(a.chosen.p))
    }
}

/// Half-width of a 95 % interval. Twice the standard deviation: with dozens of dwells, Student's factor is within a tenth of it.
fn half(c: &WrittenCoefficient) -> f64 {
    2.0 * c.sigma.unwrap_or_default()
}

/// The coefficients of an effect, and its nonlinear parameter.
fn coefficients(a: &Accepted) -> Markup {
    html! { (table("Coefficients with 95 % intervals", &html! { th { "coefficient" } th.n { "value" } th { "unit" } th.n { "in data sheets" } th.page { "SI" } }, &html! {
        @for c in a.effect.coefficients() {
            @let Readable { factor, unit } = readable::coefficient(&c.unit);
            tr {
                td { (c.name) } (interval(c.value, half(&c), factor)) td { (unit) } (known(c.typical, factor))
                td.page { (format!("{:.3e} {}", c.value, c.unit.replace("^2", "²"))) }
            }
        }
        @if let Some(form) = a.effect.nonlinear_parameter() {
            tr { td { (form.name) } (typed(form.value, &format!("{} (95 %: {})", significant(form.value), form.interval()))) td {} td.n { (significant(form.from)) " to " (significant(form.to)) " sought" } }
        }
    })) }
}

/// Coefficients in as few lines as possible, by unit.
fn compact(a: &Accepted) -> Markup {
    let all = a.effect.coefficients();
    html! {
        @for of_unit in all.chunk_by(|a, b| a.unit == b.unit) {
            @let Readable { factor, unit } = readable::coefficient(&of_unit[0].unit);
            @let values: Vec<String> = of_unit.iter().map(|c| plus_minus(c.value * factor, half(c) * factor)).collect();
            @if of_unit.len() == 9 { pre { (matrix(of_unit, &values)) " " (unit) } } @else {
                @let each: Vec<String> = of_unit.iter().zip(&values).map(|(c, value)| format!("{}\u{a0}{value}", c.name)).collect();
                p { (each.join(", ")) " " (unit) }
            }
        }
        @if let Some(form) = a.effect.nonlinear_parameter() { p { (form.name) " " (significant(form.value)) " (95 %: " (form.interval()) ")" } }
    }
}

/// Nine coefficients, three in a line.
fn matrix(all: &[WrittenCoefficient], values: &[String]) -> String {
    let width = values.iter().map(|value| value.chars().count()).max();
    let cell = |(c, value): (&WrittenCoefficient, &String)| {
        format!("{} {value:>width$}", c.name, width = width.unwrap_or(0))
    };
    let cells: Vec<String> = all.iter().zip(values).map(cell).collect();
    let lines: Vec<String> = cells.chunks(3).map(|line| line.join("   ")).collect();
    lines.join("\n")
}

fn figure(a: &Accepted, picture: &Picture, panels: &[Panel]) -> Markup {
    html! { figure {
        div class="figures" { @for panel in panels { (figures::against(picture.sensor, panel)) } }
        figcaption {
            "Left: residuals plus the named part of the effect (its other parts and the other effects removed), against the "
            "variable that it depends on, minus the part that the affine calibration absorbs. " (figures::key("fit", "M0 6H24")) "fitted effect with its 95 % band"
            @if let Some(form) = a.effect.nonlinear_parameter() { " (for the " code { (form.name) } " found)" }
            ". Right: the residuals, on the same scale. " (figures::keys()) "."
            @if panels.iter().any(|p| p.against == Against::Fitted) {
                " If a residual depends on several quantities, as that of a whole turn does, the abscissa is the change that the fitted effect "
                "predicts beside the affine calibration: points on the diagonal are explained."
            }
        }
    } }
}
