//! A fit of several sessions.

use maud::{Markup, html};
use mimu::result::sessions::{SensorSessions, SessionParameter, SessionsResult};
use mimu::{JudgementKind, ParameterKind, Sensor, plural, plus_minus, readable};

use super::fit::by_axis;
use super::page::{Level, judged};
use super::table::{by_axes, interval, known, rounded, table, typed, with_unit};
use super::terminal::text;

/// Result of `mimu fit` with several recordings: a summary, or with `verbose` also each session.
pub fn sessions_text(result: &SessionsResult, verbose: bool) -> String {
    text(&document(result, Level::of(verbose)))
}

pub(super) fn document(result: &SessionsResult, level: Level) -> Markup {
    let used = result.sessions.iter().filter(|s| s.origin.used).count();
    let count = result.sessions.len();
    html! {
        @if level.is_page() { h1 { "Calibration of " (result.device) } }
        p { (result.device) ": " (plural(count as u64, "session")) @if used < count { ", " (used) " used" } }
        (judged(&result.judgement, ""))
        @for finding in result.findings.iter().filter(|f| !result.judgement.reason.contains(f.as_str())) { p { "finding: " (finding) } }
        @if let Some(prior) = &result.prior { p { "prior: class \"" (prior.class) "\" (" (prior.source) "); three sessions need none" } }
        h2 { "Errors" }
        (errors(result))
        @for (sensor, triad) in result.sensors.present() {
            h2 class="sensor" { (sensor) }
            (parameters(sensor, "at the next power-on", triad, |p| p.next_power_on))
            @if level.has_all() {
                h2 { (sensor) ": expected values" }
                (parameters(sensor, "of the expected value", triad, |p| p.next_power_on.map(|_| [p.lower, p.upper])))
            }
            @if triad.parameters.iter().any(|p| p.drifts) { section { p { "~ drifts from session to session; the value is extrapolated to the next" } } }
            @if level.has_all() { h2 { (sensor) " by session" } (each_session(sensor, triad)) }
        }
        p.line { "next: " (next(result)) }
    }
}

fn next(result: &SessionsResult) -> &'static str {
    match result.judgement.kind {
        JudgementKind::Suspect => {
            "look at the session that the judgement names (mimu fit SESSION), or record another"
        }
        JudgementKind::Untested => "record another session after the unit was off, and fit all",
        JudgementKind::Unexplained | JudgementKind::Misfit => {
            "find what the model lacks (mimu diagnose SESSION), then judge the calibration on another recording (mimu verify OTHER --calibration FILE)"
        }
        JudgementKind::Good => {
            "use the calibration: mimu export c FILE -o calibration.h; --verbose prints each session"
        }
    }
}

/// Errors of both sensors.
fn errors(result: &SessionsResult) -> Markup {
    let caption = "Root mean square error; held out: of each session by the calibration of the others; noise: what noise alone would cause";
    html! { (table(caption, &html! { th { "rms error" } th.n { "held out" } th.n { "in sample" } th.n { "noise" } th {} }, &html! {
        @for (sensor, triad) in result.sensors.present() {
            @let judged = &triad.judged;
            @let unit = readable::error(&judged.unit);
            tr {
                td { (with_unit(sensor, &unit)) }
                @for rms in [judged.held_out_rms, Some(judged.rms), judged.noise_floor] { (known(rms, unit.factor)) }
                td { "held out: sessions; " (plural(judged.dwells as u64, "dwell")) }
            }
        }
    })) }
}

/// A table of the parameters by axis, of those for which `ends` has an interval.
fn parameters(
    sensor: Sensor,
    of: &str,
    triad: &SensorSessions,
    ends: impl Fn(&SessionParameter) -> Option<[f64; 2]>,
) -> Markup {
    let of_kind = |kind: ParameterKind| triad.parameters.iter().filter(move |p| p.of.0 == kind);
    html! { (by_axes("Parameters with 95 % intervals", &html! { (sensor) ", ± of 95 % " (of) }, &html! {
        @for kind in ParameterKind::PHYSICAL { @if let Some(first) = of_kind(kind).find(|p| ends(p).is_some()) {
            @let unit = readable::parameter(&first.unit);
            tr { td { "  " (by_axis(kind, &unit)) } @for p in of_kind(kind) { @match ends(p).map(|[low, high]| 0.5 * (high - low)) {
                None => td.n { "(frame)" },
                Some(half) if p.drifts => (typed(p.value, &format!("{} ~", plus_minus(p.value * unit.factor, half * unit.factor)))),
                Some(half) => (interval(p.value, half, unit.factor)),
            } } }
        } }
    })) }
}

/// Each session's values, and whether the others predict them.
fn each_session(sensor: Sensor, triad: &SensorSessions) -> Markup {
    let sessions = triad
        .parameters
        .iter()
        .map(|p| p.sessions.len())
        .max()
        .unwrap_or(0);
    html! { (table("Values by session", &html! { th { (sensor) " by session; ! outside the 95 % interval of the others" } @for k in 1..=sessions { th.n { (k) } } }, &html! {
        @for p in triad.parameters.iter().filter(|p| p.next_power_on.is_some()) {
            @let unit = readable::parameter(&p.unit);
            tr { td { "  " (with_unit(&p.name, &unit)) } @for one in &p.sessions { @match one {
                None => td.n { "-" },
                Some(one) => {
                    @let half = 0.5 * (one.upper - one.lower);
                    @let outside = one.predicted.is_some_and(|[value, half]| (one.value - value).abs() > half);
                    @if outside { (typed(one.value, &format!("{} !", plus_minus(one.value * unit.factor, half * unit.factor)))) } @else { (rounded(one.value, half, unit.factor)) }
                }
            } } }
        }
    })) }
}
