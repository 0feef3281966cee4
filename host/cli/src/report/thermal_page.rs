//! A fit over temperature as a page.

use maud::{Markup, html};
use mimu_thermal::fit::FitVerdict;
use mimu_thermal::result::ThermalResult;

use crate::hint;

use super::page::{Made, page, spoken, written};
use super::thermal::{
    SHOWN, VERDICT_MISFIT, VERDICT_ONE_WAY, bins, curves, errors, hysteresis, without_lag,
};
use super::thermal_plot;

/// The page of a fit.
pub fn thermal_page(result: &ThermalResult, made: &Made) -> String {
    let (device, verdict) = (&result.device, result.verdict.name());
    let title = format!("{device} over temperature: {verdict}");
    page(&title, &body(result, made))
}

/// Contents of the page.
pub(super) fn body(result: &ThermalResult, made: &Made) -> Markup {
    html! {
        (head(result, made))
        h2 { "Errors and lag" }
        (errors(result).html())
        @for why in without_lag(result) { p { "Lag: " (why) "." } }
        @for (name, sensor) in result.sensors.present() {
            @if let Some(used) = &sensor.used { p { (spoken(name)) " uses " (used.words()) "." } }
            @if let Some(what) = sensor.inseparable { p { (spoken(name)) ", inseparable: " (what) "." } }
        }
        h2 { "Curves" }
        figure {
            div class="figures" { (thermal_plot::panels(result)) }
            figcaption {
                "Change of each parameter from the middle of the range, with its 95 % interval. Below: errors of the dwells, rms while the temperature rises and falls, of each axis over temperature and over time; at a dashed line the next recording begins."
            }
        }
        @for (name, sensor) in result.sensors.present() {
            h2 class="sensor" { (spoken(name)) }
            @if !sensor.bins.is_empty() { (bins(sensor).html()) }
            @if sensor.hysteresis.is_some() { (hysteresis(sensor).html()) }
            @if let Some(table) = curves(name, result, (0..SHOWN, SHOWN), true) { (table.html()) }
        }
        @if !result.warnings.is_empty() {
            h2 { "To know" }
            ul { @for warning in &result.warnings { li { (hint::of_thermal(warning)) } } }
        }
        p class="dim" { (result.tool) ", " (made.created) ": " code { (made.command) } }
    }
}

fn head(result: &ThermalResult, made: &Made) -> Markup {
    let [from, to] = result.range_c;
    html! {
        h1 { (result.device) " over temperature" }
        p class={ "verdict " @if result.verdict == FitVerdict::Fitted { "explained" } @else { "unexplained" } } {
            strong { (result.verdict.name()) } ": dies at " (written(&format!("{from:.1}"))) " to " (written(&format!("{to:.1}"))) " °C. "
            @match result.verdict {
                FitVerdict::Fitted => { "Heating and cooling, or plateaus, distinguish the lag of the dies from the slopes of the curves." }
                FitVerdict::Misfit => { (VERDICT_MISFIT) }
                FitVerdict::OneWay => { (VERDICT_ONE_WAY) }
            }
        }
        dl {
            @for recording in &result.recordings {
                dt { "Recording" } dd { code { (recording.samples) } ", SHA-256 " code { (recording.sha256) } }
            }
            dt { "Estimator" } dd { (result.estimator) }
            dt { "Judgement" } dd { (result.judgement) }
            dt { "Fitted" } dd { (made.created) }
        }
    }
}
