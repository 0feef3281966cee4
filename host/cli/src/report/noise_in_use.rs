//! Noise in use.

use maud::{Markup, html};
use mimu::in_use::{Estimate, NoiseInUse};
use mimu::quantity::{Sensor, significant};

use super::page::{all_warnings, judged};
use super::table::{between, by_axes, interval, known, number, table};
use super::terminal::text;

/// Result of `mimu noise`.
pub fn noise_in_use_text(result: &NoiseInUse) -> String {
    text(&document(result))
}

pub(super) fn document(result: &NoiseInUse) -> Markup {
    html! {
        h1 { "Noise in use of " (result.device) }
        (judged(&result.judgement, "line"))
        p {
            (result.segments) " segments of " (significant(result.segment_s)) " s, " (significant(result.turn_rad.to_degrees())) " deg of turn"
            @if let Some(rms) = result.vibration_rms_mps2 { ", vibration above 10 Hz " (significant(rms)) " m/s² rms" }
            ", against " @if result.reference == "rests" { "rests before and after" } @else { "a trajectory" }
            @if result.segments_left_out > 0 { "; " (result.segments_left_out) " left out" }
        }
        h2 { "Noise" } (densities(result))
        h2 { "Estimated beside it" } (estimates(result))
        h2 { "Consistency" } (consistency(result))
        h2 { "In words" }
        @for sentence in &result.sentences { p { (sentence) } }
        (all_warnings(&result.warnings))
    }
}

/// Biases, and how the trajectory is mounted and timed.
fn estimates(result: &NoiseInUse) -> Markup {
    let row = |name: &str, own: &[Estimate], factor: f64| html! { tr { td { (name) } @for own in own { (interval(own.value, own.half(), factor)) } } };
    html! { (by_axes("Estimated beside the noise, with halves of the 95 % intervals", &html! { "beyond the calibration" }, &html! {
        (row("gyro bias, deg/s", &result.biases.gyro, 1_f64.to_degrees()))
        (row("accel bias, mm/s²", &result.biases.accel, 1e3))
        @if let Some(mounted) = &result.mounted {
            (row("mounting, deg", &mounted.rotation_rad, 1_f64.to_degrees()))
            (row("lever arm, mm", &mounted.lever_m, 1e3))
            (row("add to the trajectory's times, ms", &[mounted.clock_s], 1e3))
        }
    })) }
}

fn densities(result: &NoiseInUse) -> Markup {
    let name = |sensor, term| match (sensor, term) {
        (Sensor::Gyro, "white") => "gyro N, rad/s/√Hz",
        (Sensor::Gyro, _) => "gyro K, rad/s²/√Hz",
        (Sensor::Accel, "white") => "accel N, m/s²/√Hz",
        (Sensor::Accel, _) => "accel K, m/s³/√Hz",
    };
    html! { (table("Noise that explains the errors in motion, with 95 % intervals", &html! { th { "density" } th.n { "in use" } th.n { "Allan's" } th.n { "factor" } }, &html! {
        @for density in &result.densities { tr {
            td { (name(density.sensor, density.term)) } (between(density.value, density.interval, 1.0)) (known(density.allan, 1.0))
            @match density.factor.zip(density.factor_interval) { Some((factor, ends)) => (between(factor, ends, 1.0)), None => (known(None, 1.0)) }
        } }
    })) }
}

fn consistency(result: &NoiseInUse) -> Markup {
    let all = &result.nees;
    let rows = [
        ("Allan's noise alone", &all.allan),
        ("and the calibration's uncertainty", &all.with_calibration),
        ("the noise in use", &all.in_use),
    ];
    html! { (table("Squared errors of held-out segments over what a filter believes; 1 is right", &html! { th { "filter with" } th.n { "NEES" } th.n { "by chance from" } th.n { "to" } }, &html! {
        @for (name, nees) in rows { tr { td { (name) } @for v in [nees.value, nees.by_chance[0], nees.by_chance[1]] { (number(v, 1.0)) } } }
    })) }
}
