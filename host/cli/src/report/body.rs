//! The further triads of a body.

use maud::{Markup, html};
use mimu_body::result::{BodyResult, EstimateResult, PlaceResult, TriadResult};

use super::table::{by_axes, interval, number, table};
use super::terminal::text;

/// The section as text, after the result of a fit.
pub(crate) fn body_text(body: &BodyResult) -> String {
    format!("\n{}", text(&section(body)))
}

/// The section of a document.
pub(super) fn section(body: &BodyResult) -> Markup {
    let places = &body.body;
    html! {
        h2 { "Body" }
        @if !places.is_empty() {
            (errors(body))
            (standing(places))
            (table("By how much its readings are later than those of its reference; angle of the field below the level", &html! {
                th { "triad" } th { "against" } th.n { "delay, ms" } @if places.iter().any(|p| p.dip_deg.is_some()) { th.n { "dip, deg" } }
            }, &html! { @for place in places { tr {
                td { (place.triad) } td { (place.reference) } (maybe(place.delay_ms.as_ref())) @if let Some(dip) = &place.dip_deg { (maybe(Some(dip))) }
            } } }))
        }
        @for place in places {
            @for (what, why) in place.reasons.iter().filter(|(what, _)| matters(place, what)) {
                p.line { (place.triad) ": no " (name(what)) ": " (why) }
            }
        }
        @for (triad, result) in &body.sensors {
            @if !result.judgement.is_good() { p.line { (triad) " is judged " (result.judgement) } }
            @if !result.left_out_s.is_empty() { p.line { (triad) ": left out, because the rest contradicts them: " (spans(&result.left_out_s)) } }
        }
        @for refused in &body.refused { p.line { (refused.triad) " is not calibrated: " (refused.judgement.reason) } }
    }
}

fn errors(body: &BodyResult) -> Markup {
    let caption = "Root mean square error; held out: in pieces of time that the fit has not used; noise: what white noise alone would cause";
    let factor = |result: &TriadResult| match result.unit {
        "rad/s" => ("deg/s", 1f64.to_degrees()),
        "m/s^2" => ("mm/s²", 1e3),
        "field" => ("1e-3 of the field", 1e3),
        _ => ("µT", 1.0),
    };
    table(
        caption,
        &html! { th { "rms error" } th.n { "held out" } th.n { "in sample" } th.n { "noise" } th { "judged" } },
        &html! { @for (triad, result) in &body.sensors {
            @let (unit, factor) = factor(result);
            tr {
                td { (triad) ", " (unit) } (number(result.held_out_rms, factor)) (number(result.rms, factor)) (number(result.noise_floor, factor))
                td { (result.judgement.kind) }
            }
        } },
    )
}

/// Rotations and arms.
fn standing(places: &[PlaceResult]) -> Markup {
    let caption = "Rotation vector from the frame of each triad to that of its reference, and lever arm from there in its frame";
    by_axes(
        caption,
        &html! { "triad" },
        &html! { @for place in places {
            tr { td { (place.triad) " rotation, deg" } @for angle in &place.rotation_deg { (maybe(Some(angle))) } }
            @if let Some(arm) = &place.lever_arm_mm {
                tr { td { (place.triad) " arm, mm" } @for length in arm { (maybe(Some(length))) } }
            }
        } },
    )
}

fn maybe(of: Option<&EstimateResult>) -> Markup {
    match of {
        Some(of) => interval(of.value, of.upper - of.value, 1.0),
        None => number(f64::NAN, 1.0),
    }
}

/// Whether a person would look for it: an accelerometer has an arm.
fn matters(place: &PlaceResult, what: &str) -> bool {
    what != "lever_arm_mm" || place.triad.kind == mimu_recording::TriadKind::Accel
}

fn name(key: &str) -> &'static str {
    match key {
        "delay_ms" => "delay",
        "lever_arm_mm" => "lever arm",
        _ => "dip",
    }
}

fn spans(of: &[[f64; 2]]) -> String {
    let most = 6;
    let each = of.iter().take(most);
    let each: Vec<String> = each.map(|[a, b]| format!("{a:.1} to {b:.1} s")).collect();
    match of.len() > most {
        true => format!("{} and {} more", each.join(", "), of.len() - most),
        false => each.join(", "),
    }
}
