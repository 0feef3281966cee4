//! Tables of a fleet.

use maud::{Markup, html};
use mimu::quantity::{Sensor, p_value};
use mimu::readable::{self, Readable};
use mimu_fleet::Fleet;
use mimu_fleet::capability::Capability;
use mimu_fleet::result::{DifferentLevel, Stranger, TriadOfFleet};

use crate::report::page::written;
use crate::report::table::{interval, known, number, table};

/// Unit that people read. Scale factors are relative, in per cent; units of data sheets stay.
pub(super) fn readable(unit: &str) -> Readable {
    match unit {
        "1" => Readable {
            factor: 100.0,
            unit: "%".into(),
        },
        other => readable::parameter(other),
    }
}

/// Kinds by the beginnings of their names in files.
const KINDS: [(&str, &str); 4] = [
    ("scale", "scale factor"),
    ("bias", "bias"),
    ("misalignment", "misalignment"),
    ("non_orthogonality", "non-orthogonality"),
];

/// Kind and axis of a parameter's name in files.
fn split(name: &str) -> Option<(&'static str, &str)> {
    KINDS.iter().find_map(|(key, words)| {
        let axis = name.strip_prefix(key)?.strip_prefix('_')?;
        Some((*words, axis))
    })
}

/// Words for a parameter's name in files: `gyro scale factor x`.
pub(super) fn parameter(sensor: Sensor, name: &str) -> String {
    match split(name) {
        Some((kind, axis)) => format!("{sensor} {kind} {axis}"),
        None => format!("{sensor} {name}"),
    }
}

/// A change with its sign: `+1.2 mg`.
pub(super) fn signed(unit: &str, change: f64) -> String {
    let sign = if change < 0.0 { "-" } else { "+" };
    format!("{sign}{}", readable(unit).write(change.abs()))
}

/// Standard deviations between units, a row for each kind.
pub(super) fn spreads(fleet: &Fleet) -> Markup {
    html! { (table("Standard deviation between units", &html! { th { "between units, 1 sigma" } th.n { "x, yz" } th.n { "y, zy" } th.n { "z, zx" } }, &html! {
        @for (sensor, triad) in fleet.sensors.present() { @for (_, words) in KINDS {
            @let of: Vec<_> = triad.parameters.iter().filter(|p| split(&p.name).is_some_and(|s| s.0 == words)).collect();
            @if let Some(first) = of.first() {
                @let Readable { factor, unit } = readable(first.unit);
                tr { td { (sensor) " " (words) ", " (unit) } @for p in &of { (number(p.sigma, factor)) } }
            }
        } }
    })) }
}

/// All parameters of a triad.
pub(super) fn population(sensor: Sensor, triad: &TriadOfFleet) -> Markup {
    let caption = format!(
        "{sensor}: {} units; mean and scatter are of the {} that lie nearest together; scale factors relative to the median",
        triad.units, triad.used
    );
    let within = triad.parameters.iter().any(|p| p.within_sigma.is_some());
    html! { (table(&caption, &html! {
        th { (sensor) } th.n { "mean" } th.n { "between units, 1 σ" } th.n { "of a fit, 1 σ" } @if within { th.n { "between measurements, 1 σ" } }
    }, &html! { @for p in &triad.parameters {
        @let Readable { factor, unit } = readable(p.unit);
        @let (words, axis) = split(&p.name).unwrap_or((&p.name, ""));
        tr {
            td { (words) " " (axis) ", " (unit) } (interval(p.mean, p.half_width, factor)) (number(p.sigma, factor)) (number(p.fit_sigma, factor))
            @if within { (known(p.within_sigma, factor)) }
        }
    } })) }
}

/// Units that do not belong, or calibrations that contradict others.
pub(super) fn strangers(all: &[Stranger], shown: usize) -> Markup {
    html! { (table("The most improbable first", &html! {
        th { "unit" } th { "probability" } th { "shown by" } th.n { "change" } th.n { "in sigmas" } th.n { "distance" } th.page { "labels" } th.page { "files" }
    }, &html! { @for one in all.iter().take(shown) { tr {
        td { code { (one.unit) } } td { (p_value(one.p)) } td { (parameter(one.sensor, &one.parameter)) } td.n { (written(&signed(one.parameter_unit, one.change))) }
        (number(one.sigmas.abs(), 1.0)) (number(one.distance, 1.0))
        td.page { @for (k, (label, level)) in one.labels.iter().enumerate() { @if k > 0 { ", " } (label) " " (level) } } td.page { (one.files.join(", ")) }
    } } })) }
}

/// Labels that differ.
pub(super) fn different(all: &[DifferentLevel]) -> Markup {
    let caption = "Labels whose units differ from the others: how many of these units do not belong to the population, and the difference in its standard deviations";
    html! { (table(caption, &html! {
        th { "label" } th { "probability" } th.n { "units" } th.n { "strangers" } th { "shown by" } th.n { "change" } th.n { "sigmas" }
    }, &html! { @for one in all { tr {
        td { (one.label) " " (one.level) } td { (p_value(one.p)) } td.n { (one.count) } td.n { (one.strangers) } td { (parameter(one.sensor, &one.parameter)) }
        td.n { (written(&signed(one.parameter_unit, one.change))) } (number(one.sigmas.abs(), 1.0))
    } } })) }
}

/// Indices of capability.
pub(super) fn capability(all: &[Capability]) -> Markup {
    html! { (table("Capability against the limits; an index of 1.33 or more is usually called capable", &html! {
        th { "property" } @for head in ["limit", "mean", "1 σ", "Cp", "Cpk", "Cpk without the fits' uncertainty", "units beyond"] { th.n { (head) } }
    }, &html! { @for one in all { tr {
        td { (one.sensor) " " (one.property.name(one.sensor)) " " (one.axis) ", " (one.unit) @if one.typical { " (typ)" } }
        @for v in [Some(one.at_most), Some(one.mean), Some(one.sigma), one.cp] { (known(v, 1.0)) }
        (interval(one.cpk, one.cpk_half_width, 1.0)) (known(one.cpk_of_process, 1.0)) td.n { (one.beyond) }
    } } })) }
}
