//! A verification.

use maud::{Markup, html};
use mimu::calibration::verify::{SensorVerification, Verification, WholeTurnsOfAxis};
use mimu::{AXES, Figure, JudgementKind, Warning, plural, plus_minus, readable, significant};

use super::page::{Level, judged, kinds, warnings};
use super::table::{interval, known, number, table, with_unit};
use super::terminal::text;

/// Result of `mimu verify`: a summary, or with `verbose` all warnings.
pub fn verify_text(verification: &Verification, verbose: bool) -> String {
    let one = [(String::new(), verification.clone())];
    text(&document(&one, Level::of(verbose)))
}

/// A verification with the name of its recording.
pub(super) fn document(one: &[(String, Verification); 1], level: Level) -> Markup {
    let verification = &one[0].1;
    let decisive = |w: &&Warning| w.to_string() == verification.judgement.reason;
    let all = verification.warnings.iter();
    let others = all.filter(|w| level.has_all() || !decisive(w));
    let said = kinds(
        others,
        Warning::is_like,
        ToString::to_string,
        level.has_all(),
    );
    html! {
        (judged(&verification.judgement, "line"))
        @for (name, s) in verification.sensors.present() { p data-head={ (name) ": " } { @if level.is_page() { (name) ": " } (verdict(s)) } }
        h2 { "Errors" }
        (errors(one))
        @for turned in &verification.whole_turns { p { "gyro: " (whole_turns(turned)) } }
        @for (name, s) in verification.sensors.present() { p { (name) ": " (s.figure.description()) ", rms" } }
        p { "one for all: the error with one scale factor and one bias for all three axes, the means of the calibration's" }
        @for (name, s) in verification.sensors.present() {
            @if let Some(causes) = s.causes.as_ref().filter(|_| level.has_all() || beyond_noise(s)) {
                @let unit = readable::parameter(name.unit());
                @let change = |k: usize| plus_minus(causes.bias_change[k] * unit.factor, causes.bias_change_interval[k] * unit.factor);
                @let changes: Vec<String> = (0..3).map(|k| format!("{} {}", AXES[k], change(k))).collect();
                p { (name) ": the bias has changed by " (changes.join(", ")) " " (unit.unit) "; of the error " (causes.words()) }
            }
        }
        (warnings(&said, level, 0))
        p.line { "next: " (next(verification)) }
    }
}

/// `360 deg about x read as 360.4 ± 0.1 deg (356.1 uncalibrated): 40 turns, put back 4 times`.
pub(super) fn whole_turns(turned: &WholeTurnsOfAxis) -> Markup {
    let read = |error: f64, half: f64| plus_minus(360.0 + error, half);
    html! {
        "360 deg about " (turned.axis) " read as " (read(turned.error_deg_per_turn, turned.half_width_deg_per_turn)) " deg"
        @if let Some(before) = turned.before_deg_per_turn() {
            " (" (format!("{:.2}", 360.0 + before)) @if turned.uncalibrated_deg_per_turn.is_some() { " uncalibrated)" } @else { " with one scale factor for all axes)" }
        }
        ": " (turned.turns) " turns, put back " (plural(turned.times as u64, "time"))
        @if let Some([[ahead, of_ahead], [back, of_back]]) = turned.asymmetric() { "; forwards " (read(ahead, of_ahead)) ", backwards " (read(back, of_back)) " deg" }
    }
}

/// What the gyro reads for whole turns, by recording and axis; `used`: whether the calibration was made from the recording.
pub(super) fn whole_turns_table(all: &[(String, bool, Vec<WholeTurnsOfAxis>)]) -> Markup {
    let mut each = all.iter().flat_map(|(_, _, turned)| turned);
    let as_came = each.any(|turned| turned.uncalibrated_deg_per_turn.is_some());
    let caption = "Degrees that the gyro reads for one turn of 360 degrees, by whole turns after which the unit was put back; 95 % intervals by how well it was put back";
    html! { (table(caption, &html! {
        th { "axis" } th.n { @if as_came { "uncalibrated" } @else { "one scale factor for all axes" } } th.n { "calibrated" } th.n { "turns" } th.n { "put back" } th { "used by the fit" } th { "recording" }
    }, &html! { @for (name, used, turned) in all { @for of in turned { tr {
        td { (of.axis) } (known(of.before_deg_per_turn().map(|error| 360.0 + error), 1.0)) (interval(360.0 + of.error_deg_per_turn, of.half_width_deg_per_turn, 1.0))
        td.n { (of.turns) } td.n { (of.times) } td { @if *used { "yes" } @else { "no" } } td { code { (name) } }
    } } } })) }
}

/// Errors on recordings that the calibration was not made from, by recording and sensor.
pub(super) fn errors(all: &[(String, Verification)]) -> Markup {
    let each = || all.iter().flat_map(|(_, v)| v.sensors.present());
    let has = |of: fn(&SensorVerification) -> bool| each().any(|(_, s)| of(s));
    let came = has(|s| s.rms_uncalibrated.is_some());
    let effects = has(|s| s.rms_affine.is_some());
    let at_rest = has(|s| s.static_rms.is_some());
    let rest = readable::error("rad/s");
    html! { (table("Error of the calibration on other recordings, rms; noise: what noise alone would cause", &html! {
        th { "rms error" } th.n { "calibrated" } th.n { "noise" } th.n { "largest" } th.n { "one for all" }
        @if came { th.n { "uncalibrated" } } @if effects { th.n { "effects left in" } } @if at_rest { th.n { (with_unit("at rest", &rest)) } } th { "over" } th.page { "recording" }
    }, &html! { @for (recording, v) in all { @for (name, s) in v.sensors.present() {
        @let unit = readable::error(s.unit);
        tr {
            td { (with_unit(name, &unit)) } @for rms in [s.rms, s.noise_floor, s.max, s.rms_raw] { (number(rms, unit.factor)) }
            @if came { (known(s.rms_uncalibrated, unit.factor)) } @if effects { (known(s.rms_affine, unit.factor)) } @if at_rest { (known(s.static_rms, rest.factor)) }
            td { (plural(s.count as u64, if s.figure == Figure::Direction { "turn" } else { "dwell" })) } td.page { code { (recording) } }
        }
    } } })) }
}

fn beyond_noise(s: &SensorVerification) -> bool {
    s.test.is_none_or(|test| test.fails())
}

/// Next step after the verification.
fn next(verification: &Verification) -> Markup {
    let contradicted = |w: &Warning| {
        matches!(
            w,
            Warning::OtherGravity {
                contradicted: true,
                ..
            }
        )
    };
    let worst = verification.worst().and_then(|(_, s)| s.causes.as_ref());
    html! { @match (verification.judgement.kind, worst) {
        _ if verification.warnings.iter().any(contradicted) => "give the recording the gravity of its place (mimu import --gravity), and verify again",
        (JudgementKind::Good, _) => "use the calibration: mimu export c FILE -o calibration.h, or kalibr, px4 ...",
        (JudgementKind::Untested, _) => "record more dwells or turns on another day, and verify with that recording",
        (JudgementKind::Suspect, _) => "correct what the judgement names (mimu import), and verify again",
        (_, Some(c)) if c.bias.value >= c.matrix.value.max(c.rest.value) => "estimate the biases again and keep the matrices (mimu diagnose REC --calibration FILE -o NEW)",
        (_, Some(c)) if c.rest.value >= c.matrix.value => "find what the model lacks (mimu diagnose REC)",
        _ => "fit this recording (mimu fit), and compare both calibrations (mimu compare)",
    } }
}

/// Effect of the calibration on a sensor's error.
fn verdict(s: &SensorVerification) -> Markup {
    let figure = readable::error(s.unit);
    let (other, what) = match s.rms_uncalibrated {
        Some(came) => (came, "uncalibrated"),
        None => (s.rms_raw, "with one scale factor and bias for all axes"),
    };
    html! {
        (figure.write(s.rms)) " rms" @if s.rms < other { " instead of " } @else { ", not better than " } (figure.write(other)) " " (what) "; "
        @match &s.test { Some(test) => { (significant(test.ratio)) " times what noise predicts" }, None => "the noise is unknown" }
        @match (s.next_power_on, s.parameter_uncertainty) {
            (Some(next), _) => { "; a power-on changes it by up to " (figure.write(next)) ", as the sessions showed" }
            // Beside the noise a smaller one hardly counts.
            (None, Some(own)) if own > s.noise_floor => { "; the intervals of the calibration explain up to " (figure.write(own)) }
            _ => {}
        }
    }
}
