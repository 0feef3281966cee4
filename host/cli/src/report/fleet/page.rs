//! A fleet as a page.

use maud::{Markup, html};
use mimu::quantity::plural;
use mimu_fleet::Fleet;

use super::{changed, changed_unit, drift, figures, gage_line, head, tables};
use crate::report::page::{Made, judged, page, spoken};

/// Units in a table: the first of thousands. The JSON has all.
const SHOWN: usize = 200;

/// The page of a fleet.
pub fn fleet_page(fleet: &Fleet, made: &Made) -> String {
    let title = format!("Fleet of {}", plural(fleet.units as u64, "unit"));
    let main = html! {
        h1 { (title) }
        (judged(&fleet.judgement))
        (identity(fleet, made))
        (contents(fleet))
        h2 id="strangers" { "Units that do not belong" }
        (strangers(fleet))
        @if !fleet.labels.is_empty() {
            h2 id="labels" { "Labels" }
            (labels(fleet))
        }
        h2 id="drift" { "Drift of production" }
        (charts(fleet))
        h2 id="population" { "Population" }
        p { "Mean and standard deviation between units, with the uncertainty of the fits removed. Histograms have the normal distribution of units and fits." }
        @for (sensor, triad) in fleet.sensors.present() {
            h3 class="sensor" { (spoken(sensor)) }
            (tables::population(sensor, triad).html())
            @if !triad.jointly { p class="dim" { "Too few units for covariances between parameters: each parameter is judged alone." } }
            figure { div class="figures small" { @for p in &triad.parameters { (figures::histogram(sensor, p)) } } }
        }
        @if let Some(gage) = &fleet.gage {
            h2 id="gage" { "Repeatability and reproducibility" }
            p { (gage_line(gage)) "." }
            (tables::gage(gage).html())
        }
        @if let Some(part) = &fleet.part {
            h2 id="capability" { "Capability" }
            p { "Against the limits of " (part) "." }
            @if fleet.capability.is_empty() { p { "No limit could be compared." } }
            @else { (tables::capability(&fleet.capability).html()) }
        }
        @if !fleet.left_out.is_empty() {
            h2 id="files" { "Files that were left out" }
            ul { @for one in fleet.left_out.iter().take(SHOWN) { li { code { (one.file) } ": " (one.reason) } } }
            @if fleet.left_out.len() > SHOWN { p { "And " (fleet.left_out.len() - SHOWN) " more; the JSON has all." } }
        }
        p class="dim" { (fleet.tool) ", " (made.created) ": " code { (made.command) } }
    };
    page(&title, &main)
}

fn identity(fleet: &Fleet, made: &Made) -> Markup {
    let words = head(fleet);
    html! {
        dl {
            dt { "Folders" } dd { code { (made.recording) } }
            dt { "Calibrations" } dd { (words.strip_prefix("fleet: ").unwrap_or(&words)) }
            @if !fleet.labels.is_empty() {
                dt { "Labels" } dd { @for (k, (label, levels)) in fleet.labels.iter().enumerate() { @if k > 0 { ", " } (label) " (" (levels) ")" } }
            }
            @if !fleet.left_out.is_empty() { dt { "Left out" } dd { (plural(fleet.left_out.len() as u64, "file")) } }
            dt { "Reported" } dd { (made.created) }
        }
    }
}

fn contents(fleet: &Fleet) -> Markup {
    let entry = |id: &str, name: &str| html! { li { a href={ "#" (id) } { (name) } } };
    html! {
        nav aria-label="Contents" { ul class="contents" {
            (entry("strangers", "Units that do not belong"))
            @if !fleet.labels.is_empty() { (entry("labels", "Labels")) }
            (entry("drift", "Drift of production"))
            (entry("population", "Population"))
            @if fleet.gage.is_some() { (entry("gage", "Repeatability and reproducibility")) }
            @if fleet.part.is_some() { (entry("capability", "Capability")) }
            @if !fleet.left_out.is_empty() { (entry("files", "Files that were left out")) }
        } }
    }
}

fn strangers(fleet: &Fleet) -> Markup {
    let several = |count: usize, what: &str| match count > SHOWN {
        true => format!("The first {SHOWN} of {count} {what}; the JSON has all"),
        false => format!("{count} {what}"),
    };
    html! {
        @if fleet.strangers.is_empty() { p { "All units are of one population: none is farther from the others than 1 % of such fleets have one." } }
        @else {
            p { "By their Mahalanobis distance. The probability is that of any unit so far away in a fleet of this size without such a unit." }
            (tables::strangers(&fleet.strangers, several(fleet.strangers.len(), "units"), SHOWN).html())
        }
        @if !fleet.changed_units.is_empty() {
            h3 { "Units measured on many days that change" }
            p { "Each against its own mean before: a golden unit ages, or the station does. Only the first measurement of such a unit is used for the population." }
            ul { @for one in &fleet.changed_units { li { (changed_unit(one)) "." } } }
            figure { div class="figures" {
                @for one in &fleet.changed_units { (figures::chart(&one.chart, &format!("{}: {}", one.unit, tables::parameter(one.chart.sensor, &one.chart.parameter)))) }
            } }
        }
        @if !fleet.contradicting.is_empty() {
            h3 { "Calibrations that contradict others of their unit" }
            (tables::strangers(&fleet.contradicting, several(fleet.contradicting.len(), "calibrations"), SHOWN).html())
        }
    }
}

fn labels(fleet: &Fleet) -> Markup {
    html! {
        @if fleet.different.is_empty() { p { "No level of a label differs from the others." } }
        @else {
            p { "A level differs by its medians, which single units hardly move." }
            (tables::different(&fleet.different).html())
        }
        @if !fleet.changed.is_empty() {
            h3 { "Changed since a day" }
            p { "Against the other levels of the same days." }
            ul { @for one in &fleet.changed { li { (changed(one)) "." } } }
            figure { div class="figures" {
                @for one in &fleet.changed { (figures::chart(&one.chart, &format!("{} {}: {}", one.label, one.level, tables::parameter(one.chart.sensor, &one.chart.parameter)))) }
            } }
        }
    }
}

fn charts(fleet: &Fleet) -> Markup {
    let Some(found) = &fleet.drift else {
        return html! { p { "Fewer than eight days: no control chart." } };
    };
    let signals: Vec<_> = found.charts.iter().filter(|c| c.signal.is_some()).collect();
    html! {
        p { "Days (dots), their exponentially weighted moving average with λ = " (found.lambda) " (line), and its limits (dashed): production without a drift exceeds any of them in 1 % of fleets. Units that do not belong, and labels that differ, are left out. From where the drift began the chart is shaded." }
        @if found.undated > 0 { p class="dim" { (plural(found.undated as u64, "calibration")) " without a date." } }
        @if signals.is_empty() { p { "No parameter drifts." } }
        @else { ul { @for one in &signals { li { (drift(one)) "." } } } }
        figure { div class="figures" {
            @for one in &signals { (figures::chart(one, &tables::parameter(one.sensor, &one.parameter))) }
            @for one in found.charts.iter().filter(|c| c.signal.is_none()) { (figures::chart(one, &tables::parameter(one.sensor, &one.parameter))) }
        } }
    }
}
