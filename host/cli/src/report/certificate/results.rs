//! Results of a certificate with expanded uncertainties, and what these consist of.

use maud::{Markup, html};
use mimu::certificate::{Certificate, ResultRow, SensorResults};
use mimu::quantity::{Sensor, plus_minus, significant};
use mimu::readable;

use crate::report::budget;
use crate::report::page::{spoken, written};
use crate::report::unit::model;

/// From so many degrees of freedom on, they are written as infinite: the coverage factor is 1.96 to its last digit.
const MANY: f64 = 1000.0;

/// Parameters and matrix of both triads.
pub(super) fn section(certificate: &Certificate) -> Markup {
    html! {
        p {
            "U is the expanded uncertainty: the standard uncertainty times the coverage factor k, for a coverage probability of 95 %. k is that of Student's distribution "
            "with the effective degrees of freedom ν of the parameter; with ν = ∞, the normal distribution, it is 1.96."
        }
        @for (sensor, of) in certificate.sensors.present() {
            h3 class="sensor" { (spoken(sensor)) }
            (parameters(sensor, of))
            (errors(of))
            (model::matrix(sensor, &of.table, &[]))
        }
    }
}

fn parameters(sensor: Sensor, of: &SensorResults) -> Markup {
    html! {
        div class="scroll" { table {
            caption { "Parameters of the " (spoken(sensor)) "; " (of.table.frame) }
            thead { tr { th { "parameter" } th class="n" { "value" } th class="n" { "U" } th { "unit" } th class="n" { "k" } th class="n" { "ν" } } }
            tbody { @for row in &of.parameters { (parameter(row)) } }
        } }
    }
}

fn parameter(row: &ResultRow) -> Markup {
    let shown = readable::parameter(&row.unit);
    let both = plus_minus(row.value * shown.factor, row.expanded * shown.factor);
    let (value, half) = both.split_once(" ± ").unwrap_or((&both, ""));
    html! {
        tr {
            td { (row.of.0.words()) " " (row.of.axis()) }
            @match row.coverage_factor() {
                Some(k) => {
                    td class="n" { data value=(row.value) { (written(value)) } }
                    td class="n" { data value=(row.expanded) { (half) } }
                    td { (shown.unit) }
                    td class="n" { (format!("{k:.2}")) }
                    td class="n" { @if row.dof < MANY { (format!("{:.0}", row.dof.floor())) } @else { "∞" } }
                }
                None => {
                    td class="n" { data value=(row.value) { (written(&significant(row.value * shown.factor))) } }
                    td class="n dim" { "defines the frame" }
                    td { (shown.unit) } td {} td {}
                }
            }
        }
    }
}

fn errors(of: &SensorResults) -> Markup {
    let shown = readable::error(of.unit);
    html! {
        p {
            "Root mean square of the " (of.figure) ": " (shown.write(of.rms)) " in the dwells of the fit"
            @if let Some(rms) = of.held_out_rms { ", " (shown.write(rms)) " in dwells that the fit had not used" }
            "."
        }
    }
}

/// What the variances consist of.
pub(super) fn budget(certificate: &Certificate) -> Markup {
    let stated = certificate
        .sensors
        .present()
        .any(|(_, of)| !of.budget.is_empty());
    html! {
        @if stated {
            p { "Shares of the influences in the variance of each parameter. noise includes scatter between dwells beyond noise, where there is any." }
            @for (sensor, of) in certificate.sensors.present() {
                @if let Some(table) = budget::table(sensor, &of.budget) { (table.html()) }
            }
        } @else {
            p { "Noise and scatter make up the whole variance of each parameter." }
        }
    }
}
