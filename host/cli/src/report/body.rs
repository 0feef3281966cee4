//! The further triads of a body.

use std::collections::BTreeMap;

use maud::{Markup, html};
use mimu::judgement::JudgementKind;
use mimu::quantity::{AXES, p_value, plural, significant};
use mimu::triad::Estimate;
use mimu_body::TriadVerification;
use mimu_body::result::{BodyResult, EstimateResult, IronResult, PlaceResult};
use mimu_body::split::{Part, Split};
use serde::Serialize;
use serde_json::{Value, json};

use super::table::{between, by_axes, interval, number, table};
use super::terminal::text;

/// The section as text, after the result of a fit.
pub(crate) fn body_text(body: &BodyResult) -> String {
    format!("\n{}", text(&section(body)))
}

/// The errors of the further triads in a verification as text.
pub(crate) fn body_errors_text(found: &BTreeMap<String, TriadVerification>) -> String {
    let rows = found
        .iter()
        .map(|(triad, of)| (triad, of.unit.as_str(), [of.rms, of.noise_floor]));
    let heads = ["on this recording", "noise"];
    format!(
        "\n{}",
        text(&html! {
            h2 { "Body" }
            (errors("Root mean square error; noise: what white noise alone would cause", heads, rows, |triad| found[triad].judgement.kind))
            @for (triad, of) in found.iter().filter(|(_, of)| !of.judgement.is_good()) { p.line { (triad) " is judged " (of.judgement) } }
        })
    )
}

/// The delay of a unit's accelerometer against its gyro, as text.
pub(crate) fn delay_text(delay_ms: &Estimate) -> String {
    let (later, ms) = match delay_ms.value > 0.0 {
        true => ("later", delay_ms.value),
        false => ("earlier", -delay_ms.value),
    };
    let [ms, interval] = [ms, delay_ms.interval].map(significant);
    format!(
        "\naccelerometer: {ms} ± {interval} ms {later} than the gyro, by the velocity at rest around turns\n"
    )
}

/// How iron moves with the temperature, in words.
fn iron_moves(iron: &IronResult) -> String {
    let axes = iron.per_k.iter().zip(AXES).map(|(of, axis)| {
        let [value, interval] = [of.value, of.upper - of.value].map(significant);
        format!("{axis} {value} ± {interval}")
    });
    let axes: Vec<String> = axes.collect();
    let unit = iron.unit.replace('u', "µ");
    format!(
        "its hard iron moves with the temperature, {} {unit}; the offset is that at {:.1} °C",
        axes.join(", "),
        iron.temp_c
    )
}

/// The magnetometers of a body whose hard iron moves with the temperature, as text.
pub(crate) fn iron_text(places: &[PlaceResult]) -> String {
    let moving = places
        .iter()
        .filter_map(|of| Some((of.triad, of.iron.as_ref()?)));
    let lines = moving.map(|(triad, iron)| format!("\n{triad}: {}\n", iron_moves(iron)));
    lines.collect()
}

/// What turns err by in common to all pairs of a body, and each for itself, as text.
pub(crate) fn split_text(split: &Split) -> String {
    let degrees = |part: &Part, label: &str, judged: &str| {
        html! { tr {
            td { (label) } (between(part.rms, [part.lower, part.upper], 1f64.to_degrees())) (number(part.noise_floor, 1f64.to_degrees()))
            td { (judged) }
        } }
    };
    let judged = |pair: &u8| split.judged.get(pair).map_or("", |of| of.kind.name());
    format!(
        "\n{}",
        text(&html! {
            h2 { "Pairs of the body" }
            (table("Errors of the direction of gravity after each turn, of the fit, with 95 % intervals; noise: of the pair, or what is known to be common; judged: by its own part", &html! {
                th { "error of " (plural(split.turns as u64, "turn")) ", deg" } th.n { "rms" } th.n { "noise" } th { "judged" }
            }, &html! {
                (degrees(&split.common, "common to all pairs", ""))
                @for (pair, own) in &split.own { (degrees(own, &format!("of pair {pair} alone"), judged(pair))) }
            }))
            p.line { (common_cause(split)) }
            @if !split.judged.is_empty() { p.line { "the diagnosis of the first pair is by its own part: the mean error of the others is taken out of its turns" } }
            @for (pair, judgement) in split.judged.iter().filter(|(_, of)| !of.is_good()) { p.line { "pair " (pair) " is judged " (judgement) } }
        })
    )
}

/// Where the part comes from that all pairs share.
fn common_cause(split: &Split) -> String {
    let causes = split.correlations.iter().filter(|c| c.is_significant);
    let causes: Vec<String> = causes
        .map(|c| {
            let (size, p) = (significant(c.coefficient), p_value(c.p));
            format!("{} ({} {size}, {p})", c.term, c.covariate)
        })
        .collect();
    match (split.exceeds_noise, causes.is_empty()) {
        (false, _) => {
            "the pairs share no error beyond noise: what remains is of each sensor".into()
        }
        (true, true) => {
            "all pairs err together: it is the motion, its sampling or the clock, and no sensor"
                .into()
        }
        (true, false) => format!(
            "all pairs err together, and more so with {}: the cause is not in a sensor",
            causes.join(", ")
        ),
    }
}

/// A result as JSON: alone, or with the further triads among its sensors.
#[derive(Serialize)]
#[serde(untagged)]
pub(crate) enum Joined<'a, T> {
    Alone(&'a T),
    Body(Value),
}

impl<'a, T: Serialize> Joined<'a, T> {
    /// Of a result, and what a body adds to it.
    pub fn of(result: &'a T, more: Option<&impl Serialize>) -> Self {
        let Some(more) = more else {
            return Self::Alone(result);
        };
        let [mut all, more] = [json!(result), json!(more)];
        for (key, value) in more.as_object().into_iter().flatten() {
            match (all[key].as_object_mut(), value.as_object()) {
                (Some(own), Some(value)) => own.extend(value.clone()),
                _ => all[key] = value.clone(),
            }
        }
        Self::Body(all)
    }
}

/// The section of a document.
pub(super) fn section(body: &BodyResult) -> Markup {
    let places = &body.body;
    html! {
        h2 { "Body" }
        @if !places.is_empty() {
            (errors(
                "Root mean square error; held out: in pieces of time that the fit has not used; noise: what white noise alone would cause",
                ["held out", "in sample", "noise"],
                body.sensors.iter().map(|(triad, of)| (triad, of.unit, [of.held_out_rms, of.rms, of.noise_floor])),
                |triad| body.sensors[triad].judgement.kind,
            ))
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
        @for place in places.iter().filter(|p| p.dip_deg.as_ref().is_some_and(|dip| dip.value < 0.0)) {
            p.line { (place.triad) ": the field points up, as it does in the south; in the north an axis of it has the wrong sign, or two are exchanged (--latitude)" }
        }
        @for place in places { @if let Some(iron) = &place.iron { p.line { (place.triad) ": " (iron_moves(iron)) } } }
        @for (triad, result) in &body.sensors {
            @if !result.judgement.is_good() { p.line { (triad) " is judged " (result.judgement) } }
            @if !result.left_out_s.is_empty() { p.line { (triad) ": left out, because the rest contradicts them: " (spans(&result.left_out_s)) } }
        }
        @for refused in &body.refused { p.line { (refused.triad) " is not calibrated: " (refused.judgement.reason) } }
    }
}

/// Errors of triads with their units, under `heads`.
fn errors<'a, const N: usize>(
    caption: &str,
    heads: [&str; N],
    rows: impl Iterator<Item = (&'a String, &'a str, [f64; N])>,
    judged: impl Fn(&String) -> JudgementKind,
) -> Markup {
    let scale = |unit: &str| match unit {
        "rad/s" => ("deg/s", 1f64.to_degrees()),
        "m/s^2" => ("mm/s²", 1e3),
        "field" => ("1e-3 of the field", 1e3),
        _ => ("µT", 1.0),
    };
    table(
        caption,
        &html! { th { "rms error" } @for head in heads { th.n { (head) } } th { "judged" } },
        &html! { @for (triad, unit, values) in rows {
            @let (unit, factor) = scale(unit);
            tr { td { (triad) ", " (unit) } @for value in values { (number(value, factor)) } td { (judged(triad)) } }
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
