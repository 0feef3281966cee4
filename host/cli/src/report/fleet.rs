//! A fleet.

mod figures;
mod tables;

use maud::{Markup, html};
use mimu::quantity::{p_value, plural, plus_minus, significant};
use mimu_fleet::Fleet;
use mimu_fleet::result::{ChangedLevel, ChangedUnit, ChartOfParameter, DifferentLevel, Stranger};

use super::page::{Level, Made, contents, judged, page, spoken};
use super::terminal::text;
use tables::{parameter, signed};

/// Lists of a summary that have two lines each; of more lists each has one.
const FEW_LISTS: usize = 2;
/// Files that a summary names, and rows of a table: the first of thousands. The JSON has all.
const FILES: usize = 2;
const SHOWN: usize = 200;

/// The result as text: a summary, or everything.
pub fn fleet_text(fleet: &Fleet, verbose: bool) -> String {
    text(&document(fleet, Level::of(verbose), None))
}

/// The page of a fleet.
pub fn fleet_page(fleet: &Fleet, made: &Made) -> String {
    page(
        &format!("Fleet of {}", plural(fleet.units as u64, "unit")),
        &document(fleet, Level::Page, Some(made)),
    )
}

fn document(fleet: &Fleet, level: Level, made: Option<&Made>) -> Markup {
    html! {
        h1 { "Fleet of " (plural(fleet.units as u64, "unit")) }
        p {
            "fleet: " (plural(fleet.units as u64, "unit")) ", " (plural(fleet.measurements as u64, "calibration"))
            @if let Some([from, to]) = &fleet.days { ", " (from) " to " (to) }
            ", readings in " (fleet.raw_unit) " with reference \"" (fleet.reference) "\""
        }
        (judged(&fleet.judgement, ""))
        @if let Some(made) = made {
            dl {
                dt { "Folders" } dd { code { (made.recording) } }
                @if !fleet.labels.is_empty() { dt { "Labels" } dd { @for (k, (label, levels)) in fleet.labels.iter().enumerate() { @if k > 0 { ", " } (label) " (" (levels) ")" } } }
                dt { "Reported" } dd { (made.created) }
            }
            (contents(&[
                ("strangers", "Units that do not belong", true),
                ("labels", "Labels", !fleet.labels.is_empty()),
                ("drift", "Drift of production", true),
                ("population", "Population", true),
                ("capability", "Capability", fleet.part.is_some()),
            ]))
        }
        (files(fleet, level))
        @if level.has_all() {
            h2 id="strangers" { "Units that do not belong" }
            (strangers(fleet, level))
            @if !fleet.labels.is_empty() { h2 id="labels" { "Labels" } (levels(fleet, level)) }
            h2 id="drift" { "Drift of production" }
            (charts(fleet, level))
            h2 id="population" { "Population" }
            p { "Mean and standard deviation between units, with the uncertainty of the fits removed." @if level.is_page() { " Histograms have the normal distribution of units and fits." } }
            @for (sensor, triad) in fleet.sensors.present() {
                @if level.is_page() { h3 class="sensor" { (spoken(sensor)) } } @else { hr; }
                (tables::population(sensor, triad))
                @if !triad.jointly { p class="dim" { "Too few units for covariances between parameters: each parameter is judged alone." } }
                @if level.is_page() { figure { div class="figures small" { @for p in &triad.parameters { (figures::histogram(sensor, p)) } } } }
            }
        } @else {
            h2 { "Population" }
            (tables::spreads(fleet))
            (lists(fleet))
        }
        @if let Some(part) = &fleet.part { (capability(fleet, part, level)) }
        @if let Some(made) = made { (made.line(&fleet.tool)) }
    }
}

/// Files that were left out.
fn files(fleet: &Fleet, level: Level) -> Markup {
    let shown = match level {
        Level::Summary => FILES,
        Level::Verbose => usize::MAX,
        Level::Page => SHOWN,
    };
    let rest = fleet.left_out.len().saturating_sub(shown) as u64;
    html! {
        @if level.is_page() && !fleet.left_out.is_empty() { h2 id="files" { "Files that were left out" } }
        ul class="lines" data-head="left out: " {
            // The reason of a file that cannot be read names it.
            @for one in fleet.left_out.iter().take(shown) { li { @if !one.reason.contains(&one.file) { (one.file) ": " } (one.reason) } }
            @if rest > 0 { li { (plural(rest, "more file")) " (--verbose)" } }
        }
        @if fleet.unlabelled > 0 { ul class="lines" data-head="warning: " { li { (plural(fleet.unlabelled as u64, "calibration")) " without a row in the table of labels" } } }
    }
}

/// What is found, by kind, the most significant first. The JSON has all triads of a label, the list the one that shows it most.
fn lists(fleet: &Fleet) -> Markup {
    let mut labels: Vec<(&str, &str)> = Vec::new();
    let different = fleet.different.iter().filter(|d| {
        let new = !labels.contains(&(&d.label, &d.level));
        labels.push((&d.label, &d.level));
        new
    });
    let different: Vec<Markup> = different.map(level).collect();
    html! {
        @let of_files = |one: &Stranger| html! { (one.files.join(", ")) " of " (unit(one)) };
        @let all: [(&str, Vec<Markup>); 6] = [
            ("units that do not belong", fleet.strangers.iter().map(unit).collect()),
            ("calibrations that contradict others of their unit", fleet.contradicting.iter().map(of_files).collect()),
            ("units measured on many days that change", fleet.changed_units.iter().map(changed_unit).collect()),
            ("labels that differ", different),
            ("labels that changed", fleet.changed.iter().map(changed).collect()),
            ("parameters that drift", fleet.drift.iter().flat_map(|d| &d.charts).filter(|c| c.signal.is_some()).map(since).collect()),
        ];
        @let found = || all.iter().filter(|(_, items)| !items.is_empty());
        @let shown = if found().count() > FEW_LISTS { 1 } else { 2 };
        @for (what, items) in found() {
            p { (what) ": " (items.len()) @if items.len() > shown { " (--verbose)" } }
            section { @for item in items.iter().take(shown) { p { (item) } } }
        }
    }
}

fn unit(one: &Stranger) -> Markup {
    html! {
        (one.unit) ": " (parameter(one.sensor, &one.parameter)) " " (signed(one.parameter_unit, one.change))
        " (" (significant(one.sigmas.abs())) " sigmas, " (p_value(one.p)) ")"
    }
}

fn level(one: &DifferentLevel) -> Markup {
    html! {
        (one.label) " " (one.level) ": " (parameter(one.sensor, &one.parameter)) " " (signed(one.parameter_unit, one.change))
        " (" (significant(one.sigmas.abs())) " sigmas of the population, " (plural(one.count as u64, "unit")) ", " (p_value(one.p)) ")"
    }
}

fn since(chart: &ChartOfParameter) -> Markup {
    html! {
        (parameter(chart.sensor, &chart.parameter)) " " (signed(chart.unit, chart.change.unwrap_or(f64::NAN))) " since " (chart.since.as_deref().unwrap_or("the first day"))
        @if let Some(day) = &chart.signal { ", beyond the limits on " (day) }
    }
}

fn changed(one: &ChangedLevel) -> Markup {
    html! { (one.label) " " (one.level) ": " (since(&one.chart)) }
}

fn changed_unit(one: &ChangedUnit) -> Markup {
    html! { (one.unit) ", measured " (plural(one.measurements as u64, "time")) ": " (since(&one.chart)) }
}

fn capability(fleet: &Fleet, part: &str, level: Level) -> Markup {
    let all = fleet.capability.iter();
    let worst = all.min_by(|a, b| a.cpk.total_cmp(&b.cpk));
    html! {
        @if level.has_all() { h2 id="capability" { "Capability" } }
        @match worst {
            None => p { "limits of " (part) ": none could be compared; sensitivities need readings in a range of the part" },
            Some(worst) => p {
                "limits of " (part) ": least Cpk " (plus_minus(worst.cpk, worst.cpk_half_width)) " (" (worst.sensor) " " (worst.property.name(worst.sensor)) " " (worst.axis)
                ", " (plural(worst.beyond as u64, "unit")) " beyond " (significant(worst.at_most)) " " (worst.unit) ")"
            },
        }
        @if level.has_all() && worst.is_some() { (tables::capability(&fleet.capability)) }
    }
}

/// Charts of some parameters, with the beginnings of their names; only pages have them.
fn drawn<'a>(level: Level, charts: impl Iterator<Item = (&'a ChartOfParameter, String)>) -> Markup {
    html! { @if level.is_page() { figure { div.figures { @for (chart, prefix) in charts {
        (figures::chart(chart, &format!("{prefix}{}", parameter(chart.sensor, &chart.parameter))))
    } } } } }
}

fn strangers(fleet: &Fleet, level: Level) -> Markup {
    let shown = if level.is_page() { SHOWN } else { usize::MAX };
    let several = |count: usize, what: &str| match count > shown {
        true => format!("The first {SHOWN} of {count} {what}; the JSON has all"),
        false => format!("{count} {what}"),
    };
    html! {
        @if fleet.strangers.is_empty() { p { "All units are of one population: none is farther from the others than 1 % of such fleets have one." } }
        @else {
            p { (several(fleet.strangers.len(), "units")) " do not belong, by their Mahalanobis distance. The probability is that of any unit so far away in a fleet of this size without such a unit." }
            (tables::strangers(&fleet.strangers, shown))
        }
        @if !fleet.changed_units.is_empty() {
            h3 { "Units measured on many days that change" }
            p { "Each against its own mean before: a golden unit ages, or the station does. Only the first measurement of such a unit is used for the population." }
            ul { @for one in &fleet.changed_units { li { (changed_unit(one)) } } }
            (drawn(level, fleet.changed_units.iter().map(|one| (&one.chart, format!("{}: ", one.unit)))))
        }
        @if !fleet.contradicting.is_empty() {
            h3 { (several(fleet.contradicting.len(), "calibrations")) " contradict others of their unit" }
            (tables::strangers(&fleet.contradicting, shown))
        }
    }
}

fn levels(fleet: &Fleet, level: Level) -> Markup {
    html! {
        @if fleet.different.is_empty() { p { "No level of a label differs from the others." } }
        @else { p { "A level differs by its medians, which single units hardly move." } (tables::different(&fleet.different)) }
        @if !fleet.changed.is_empty() {
            h3 { "Changed since a day" }
            p { "Against the other levels of the same days." }
            ul { @for one in &fleet.changed { li { (changed(one)) } } }
            (drawn(level, fleet.changed.iter().map(|one| (&one.chart, format!("{} {}: ", one.label, one.level)))))
        }
    }
}

fn charts(fleet: &Fleet, level: Level) -> Markup {
    let Some(found) = &fleet.drift else {
        return html! { p { "Fewer than eight days: no control chart." } };
    };
    let signals = || found.charts.iter().filter(|c| c.signal.is_some());
    let quiet = found.charts.iter().filter(|c| c.signal.is_none());
    html! {
        @if level.is_page() {
            p { "Days (dots), their exponentially weighted moving average with λ = " (found.lambda) " (line), and its limits (dashed): production without a drift exceeds any of them in 1 % of fleets. Units that do not belong, and labels that differ, are left out. From where the drift began the chart is shaded." }
        }
        @if found.undated > 0 { p class="dim" { (plural(found.undated as u64, "calibration")) " without a date." } }
        @if signals().next().is_none() { p { "No parameter drifts." } }
        ul { @for one in signals() { li { (since(one)) } } }
        (drawn(level, signals().chain(quiet).map(|one| (one, String::new()))))
    }
}
