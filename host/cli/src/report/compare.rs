//! Result of `mimu compare`.

use maud::{Markup, html};
use mimu::calibration::comparison::{ComparedParameter, Comparison};
use mimu::quantity::p_value;
use mimu::readable;

use super::table::{interval, number, rounded, table, with_unit};
use super::terminal::text;

/// Two files side by side with their difference, or the range of several.
pub fn compare_text(result: &Comparison, all: bool) -> String {
    let count =
        |of: fn(&ComparedParameter) -> bool| result.parameters.iter().filter(|p| of(p)).count();
    let (changed, judged) = (count(|p| p.changed), count(|p| p.p.is_some()));
    let shown = |p: &&ComparedParameter| all || judged == 0 || p.changed;
    let shown: Vec<&ComparedParameter> = result.parameters.iter().filter(shown).collect();
    let two = result.files.len() == 2;
    text(&html! {
        p {
            (result.files.len()) " calibrations"
            @match (judged, changed) {
                (0, _) => " without uncertainties: no change can be judged",
                (_, 0) => { ": none of " (judged) " parameters changed by more than their intervals explain" }
                _ => { ": " (changed) " of " (judged) " parameters changed by more than their intervals explain (*)" }
            }
        }
        @if !shown.is_empty() {
            h2 { "Parameters" }
            (parameters(&shown, two))
            @if !two { hr; p { "repeatability: the spread beyond the uncertainty of the fits, 1 σ" } }
        }
        @for (file, judgement) in result.files.iter().zip(&result.judgements) {
            @if let Some(judgement) = judgement.as_ref().filter(|j| !j.is_good()) { p.line { (file) ": " (judgement) } }
        }
        ul class="lines" data-head="note: " { @for note in &result.notes { li { (note) } } }
    })
}

fn parameters(shown: &[&ComparedParameter], two: bool) -> Markup {
    let heads = if two {
        ["first", "second", "difference"]
    } else {
        ["mean", "spread, 1 σ", "repeatability"]
    };
    html! { (table("Parameters that changed", &html! { th {} @for head in heads { th.n { (head) } } th { "chance" } }, &html! { @for p in shown {
        // An effect's id begins with its sensor.
        @let is_effect = p.name.contains('_');
        @let unit = if is_effect { readable::coefficient(&p.unit) } else { readable::parameter(&p.unit) };
        @let factor = unit.factor;
        tr {
            td { @if p.changed { "* " } @else { "  " } @if !is_effect { (p.sensor) " " } (with_unit(&p.name, &unit)) }
            @match p.difference() {
                Some((difference, Some(half))) => { @for value in &p.values { (rounded(*value, half, factor)) } (interval(difference, half, factor)) }
                Some((difference, None)) => { @for value in &p.values { (number(*value, factor)) } (number(difference, factor)) }
                None => { (rounded(p.mean, p.spread, factor)) (number(p.spread, factor)) @if let Some(r) = p.repeatability { (number(r, factor)) } @else { td {} } }
            }
            td { (p.p.map_or_else(String::new, p_value)) }
        }
    } })) }
}
