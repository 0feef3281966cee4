//! Results of a certificate with expanded uncertainties, and what these consist of.

use maud::{Markup, html};
use mimu::certificate::{Certificate, SensorResults};
use mimu::quantity::{Sensor, plus_minus};
use mimu::readable;

use crate::report::budget;
use crate::report::page::spoken;
use crate::report::table::{number, table, typed};
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
            @let shown = readable::error(of.unit);
            h3 class="sensor" { (spoken(sensor)) }
            (parameters(sensor, of))
            p {
                "Root mean square of the " (of.figure) ": " (shown.write(of.rms)) " in the dwells of the fit"
                @if let Some(rms) = of.held_out_rms { ", " (shown.write(rms)) " in dwells that the fit had not used" }
                "."
            }
            (model::matrix(sensor, &of.table, &[]))
        }
    }
}

fn parameters(sensor: Sensor, of: &SensorResults) -> Markup {
    let caption = format!("Parameters of the {}; {}", spoken(sensor), of.table.frame);
    html! { (table(&caption, &html! { th { "parameter" } th.n { "value" } th.n { "U" } th { "unit" } th.n { "k" } th.n { "ν" } }, &html! { @for row in &of.parameters {
        @let unit = readable::parameter(&row.unit);
        @let both = plus_minus(row.value * unit.factor, row.expanded * unit.factor);
        tr {
            td { (row.of.0.words()) " " (row.of.axis()) }
            @if let (Some(k), Some((value, uncertainty))) = (row.coverage_factor(), both.split_once(" ± ")) {
                (typed(row.value, value)) (typed(row.expanded, uncertainty)) td { (unit.unit) }
                td.n { (format!("{k:.2}")) } td.n { @if row.dof < MANY { (format!("{:.0}", row.dof.floor())) } @else { "∞" } }
            } @else { (number(row.value, unit.factor)) td.n.dim { "defines the frame" } td { (unit.unit) } td {} td {} }
        }
    } })) }
}

/// What the variances consist of.
pub(super) fn budget(certificate: &Certificate) -> Markup {
    let tables = certificate
        .sensors
        .present()
        .filter_map(|(sensor, of)| budget::shares(sensor, &of.budget));
    let tables: Vec<Markup> = tables.collect();
    html! {
        @if tables.is_empty() { p { "Noise and scatter make up the whole variance of each parameter." } } @else {
            p { "Shares of the influences in the variance of each parameter. noise includes scatter between dwells beyond noise, where there is any." }
            @for table in &tables { (table) }
        }
    }
}
