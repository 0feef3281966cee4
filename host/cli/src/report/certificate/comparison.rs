//! As found and as left.

use maud::{Markup, html};
use mimu::certificate::AsFound;
use mimu::readable;

use crate::report::page::{spoken, written};
use crate::report::table::{interval, number, rounded, table};

/// The calibration that the unit had beside the new one.
pub(super) fn section(as_found: Option<&AsFound>) -> Markup {
    let Some(found) = as_found else {
        return html! { p { "No earlier calibration was given: the results above are those as left." } };
    };
    let beyond = found
        .rows
        .iter()
        .filter(|r| r.is_within() == Some(false))
        .count();
    html! {
        p {
            "As found is the calibration " code { (found.file) }
            @if let Some(created) = &found.created { " of " (created) }
            "; as left is the one above. En is the change over the root of the sum of the squares of both expanded uncertainties (ISO 13528:2022, 9.7): if it is beyond 1 "
            "in size, the uncertainties do not explain the change. Errors of a reference that both calibrations used make En smaller than it would be by chance alone."
        }
        p { strong { (beyond) " of " (found.rows.len()) } " parameters changed by more than the uncertainties explain." }
        (parameters(found))
        @if !found.errors.is_empty() { (errors(found)) }
        @if let Some(why) = &found.not_applied { p { "The calibration as found was not applied to the recording: " (why) "." } }
        @for note in &found.notes { p { (note) "." } }
    }
}

fn parameters(found: &AsFound) -> Markup {
    html! { (table("Parameters as found and as left, with U", &html! {
        th { "parameter" } th.n { "as found" } th.n { "as left" } th.n { "change" } th.n { "En" } th { "unit" } th { "within U" }
    }, &html! { @for row in &found.rows {
        @let unit = readable::parameter(&row.unit);
        @let factor = unit.factor;
        tr {
            td { (row.sensor) " " (row.name) }
            // The change has as many decimals as its uncertainty.
            @match row.expanded {
                Some([a, b]) => { (interval(row.found, a, factor)) (interval(row.left, b, factor)) (rounded(row.change(), a.hypot(b), factor)) }
                None => { @for value in [row.found, row.left, row.change()] { (number(value, factor)) } }
            }
            td.n { @if let Some(e) = row.normalised_error() { (written(&format!("{e:.2}"))) } @else { "–" } }
            td { (unit.unit) } td { @match row.is_within() { Some(true) => "yes", Some(false) => "no", None => "not known" } }
        }
    } })) }
}

fn errors(found: &AsFound) -> Markup {
    html! { (table("Root mean square errors in the recording of this certificate", &html! { th { "error" } th.n { "as found" } th.n { "as left" } th { "unit" } }, &html! {
        @for error in &found.errors {
            @let unit = readable::error(error.unit);
            tr { td { (spoken(error.sensor)) ": " (error.figure) } (number(error.found, unit.factor)) (number(error.left, unit.factor)) td { (unit.unit) } }
        }
    })) }
}
