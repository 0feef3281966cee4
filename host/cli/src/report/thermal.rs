//! A fit over temperature, and the comparison of two.

use maud::{Markup, html};
use mimu::{ParameterKind, Sensor, plural, readable};
use mimu_thermal::fit::FitVerdict;
use mimu_thermal::result::{CurveResult, SensorResult, ThermalResult};

use super::page::{Level, Made, judged, page, spoken, warnings};
use super::table::{between, interval, known, number, table, with_unit};
use super::terminal::text;
use super::thermal_plot;
use crate::hint;

/// Number of temperatures at which curves are shown, and in a summary.
const SHOWN: [usize; 2] = [5, 3];

/// Result of `mimu thermal fit`: a summary, or with `verbose` everything.
pub fn thermal_text(result: &ThermalResult, verbose: bool) -> String {
    text(&document(result, Level::of(verbose), None))
}

/// The page of a fit.
pub fn thermal_page(result: &ThermalResult, made: &Made) -> String {
    let title = format!(
        "{} over temperature: {}",
        result.device,
        result.verdict.name()
    );
    page(&title, &document(result, Level::Page, Some(made)))
}

pub(super) fn document(result: &ThermalResult, level: Level, made: Option<&Made>) -> Markup {
    let [from, to] = result.range_c;
    let class = if result.verdict == FitVerdict::Fitted {
        "verdict explained"
    } else {
        "verdict unexplained"
    };
    let meaning = match result.verdict {
        FitVerdict::Fitted => {
            "heating and cooling, or plateaus, distinguish the lag of the dies from the slopes of the curves"
        }
        FitVerdict::OneWay => {
            "the temperature goes one way only: lag and slope cannot be distinguished, and the intervals allow for any lag. A whole cycle of heating and cooling distinguishes them."
        }
        FitVerdict::Misfit => {
            "the remaining errors far exceed the noise: something that these curves and the lag do not contain changes the readings, and the intervals do not include it."
        }
    };
    let said: Vec<String> = result.warnings.iter().map(hint::of_thermal).collect();
    html! {
        @if level.is_page() { h1 { (result.device) " over temperature" } }
        p {
            (result.device) ": " (plural(result.recordings.len() as u64, "recording")) (format!(", dies at {from:.1} to {to:.1} °C"))
        }
        // The judgement of a fit says it with the figures.
        @if level.has_all() || result.verdict != FitVerdict::Fitted {
            ul class="lines" data-head="verdict: " { li class=(class) { strong { (result.verdict.name()) } ": " (meaning) } }
        }
        (judged(&result.judgement, "line"))
        @if let Some(made) = made { dl {
            @for recording in &result.recordings { dt { "Recording" } dd { code { (recording.samples) } ", SHA-256 " code { (recording.sha256) } } }
            dt { "Fitted" } dd { (made.created) }
        } }
        h2 { "Errors and lag" }
        (errors(result))
        @for why in without_lag(result) { p { "lag: " (why) } }
        @for (name, sensor) in result.sensors.present() {
            @if let (Some(used), true) = (&sensor.used, level.has_all()) { p { (name) " uses " (used.words()) } }
            @if let Some(what) = sensor.inseparable { p { (name) ", inseparable: " (what) } }
        }
        @if level.is_page() {
            h2 { "Curves" }
            figure {
                div class="figures" { (thermal_plot::panels(result)) }
                figcaption {
                    "Change of each parameter from the middle of the range, with its 95 % interval. Below: errors of the dwells, rms while the temperature rises and falls, of each axis over temperature and over time; at a dashed line the next recording begins."
                }
            }
        }
        @for (name, sensor) in result.sensors.present() {
            h2 class="sensor" { (spoken(name)) }
            @if level.has_all() && !sensor.bins.is_empty() { (bins(sensor)) }
            @if level.has_all() && sensor.hysteresis.is_some() { (hysteresis(sensor)) }
            (curves(name, result, level))
        }
        (warnings(&said, level, 1))
        @if level == Level::Summary { p.line { "next: --page shows all curves, --verify judges them on another recording; --verbose prints more" } }
        @if let Some(made) = made { (made.line(result.tool)) }
    }
}

/// Errors and lags of both sensors.
fn errors(result: &ThermalResult) -> Markup {
    // Held out of a verification recording, because the biases change with every power-on.
    let verified = result
        .sensors
        .present()
        .any(|(_, s)| s.held_out_rms_without_session_bias.is_some());
    let caption = "Root mean square error of the dwells (of segments of 30 s if only biases are estimated), and the lag of the dies behind the thermometer with its 95 % interval";
    html! { (table(caption, &html! {
        th { "rms error" } th.n { "held out" } @if verified { th.n { "minus its bias" } } th.n { "in sample" } th.n { "noise" } th.n { "lag of the dies, s" }
    }, &html! { @for (name, s) in result.sensors.present() {
        @let unit = readable::error(&s.unit);
        tr {
            td { (with_unit(name, &unit)) } (known(s.held_out_rms, unit.factor)) @if verified { (known(s.held_out_rms_without_session_bias, unit.factor)) }
            (known(s.rms, unit.factor)) (known(s.noise_floor, unit.factor))
            @match &s.lag_s { Some(lag) => (between(lag.value, [lag.lower, lag.upper], 1.0)), None => (known(None, 1.0)) }
        }
    } })) }
}

/// Why lags are not known, each reason once.
fn without_lag(result: &ThermalResult) -> Vec<&str> {
    let mut reasons: Vec<&str> = Vec::new();
    for (_, s) in result.sensors.present() {
        let why = s.lag_reason.as_deref().filter(|_| s.lag_s.is_none());
        reasons.extend(why.filter(|why| !reasons.contains(why)));
    }
    reasons
}

/// Difference between heating and cooling by axis.
fn hysteresis(sensor: &SensorResult) -> Markup {
    let unit = readable::error(&sensor.unit);
    html! { (table("Hysteresis: difference between heating and cooling that remains after the lag; it is reported, not fitted", &html! {
        th { (with_unit("hysteresis", &unit)) } th.n { "rms" } th.n { "as K" } th.n { "largest" } th.n { "at, °C" } th.n { "heating - cooling" }
    }, &html! { @for h in sensor.hysteresis.iter().flatten() { tr {
        td { (h.axis) } (number(h.rms, unit.factor)) (known(h.kelvin, 1.0)) (interval(h.largest, h.largest_half_width, unit.factor))
        td.n { (format!("{:.0}", h.largest_at_c)) } (interval(h.value, h.half_width, unit.factor))
    } } })) }
}

/// Errors by temperature of the die.
fn bins(sensor: &SensorResult) -> Markup {
    let unit = readable::error(&sensor.unit);
    html! { (table("Error by temperature of the die, rms; noise: what noise alone would cause", &html! {
        th { (with_unit("error", &unit)) } th.n { "heating" } th.n { "cooling" } th.n { "noise" } th.n { (sensor.judged_by) }
    }, &html! { @for b in &sensor.bins { tr {
        td { (format!("{:.0} to {:.0} °C", b.from_c, b.to_c)) } @for rms in [b.heating, b.cooling, Some(b.noise_floor)] { (known(rms, unit.factor)) } td.n { (b.dwells) }
    } } })) }
}

/// Physical parameters of a sensor with their intervals at some temperatures. A summary has only scale factors and biases, at three. JSON contains more
/// temperatures and the inverse model.
fn curves(name: Sensor, result: &ThermalResult, level: Level) -> Markup {
    let count = SHOWN[usize::from(!level.has_all())];
    let main = [
        ParameterKind::Scale,
        ParameterKind::Bias,
        ParameterKind::BiasAndGravity,
    ];
    let shown = |c: &&CurveResult| {
        c.sensor == name
            && c.of.0 != ParameterKind::Inverse
            && (level.has_all() || main.contains(&c.of.0))
    };
    let curves: Vec<&CurveResult> = result.curves.iter().filter(shown).collect();
    let Some(first) = curves.first() else {
        return html! {};
    };
    let at = |k: usize| k * (first.temp_c.len() - 1) / (count - 1);
    html! { (table("Parameters with 95 % intervals, by temperature of the die", &html! {
        th { (name) ", ± of 95 %" } @for k in (0..count).map(at) { th.n { (format!("{:.1} °C", first.temp_c[k])) } }
    }, &html! { @for curve in curves {
        @let unit = readable::parameter(&curve.unit);
        tr { td { "  " (with_unit(curve.of, &unit)) } @for k in (0..count).map(at) { (interval(curve.value[k], 0.5 * (curve.upper[k] - curve.lower[k]), unit.factor)) } }
    } })) }
}
