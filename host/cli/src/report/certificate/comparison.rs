//! As found and as left.

use maud::{Markup, html};
use mimu::certificate::{AsFound, AsFoundRow};
use mimu::quantity::{plus_minus, significant};
use mimu::readable;

use crate::report::page::{spoken, written};
use crate::report::table::{Cell, Table};

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
        (parameters(found).html())
        @if !found.errors.is_empty() { (errors(found).html()) }
        @if let Some(why) = &found.not_applied { p { "The calibration as found was not applied to the recording: " (why) "." } }
        @for note in &found.notes { p { (note) "." } }
    }
}

fn parameters(found: &AsFound) -> Table {
    let mut table = Table::new("Parameters as found and as left, with U", "parameter")
        .numbers(["as found", "as left", "change", "En"])
        .words("unit")
        .words("within U");
    for row in &found.rows {
        let shown = readable::parameter(&row.unit);
        let of = |k: usize, si: f64| match row.expanded {
            Some(both) => Cell::Words(written(&plus_minus(
                si * shown.factor,
                both[k] * shown.factor,
            ))),
            None => Cell::number(si, shown.factor),
        };
        table.row([
            format!("{} {}", row.sensor, row.name).into(),
            of(0, row.found),
            of(1, row.left),
            Cell::Words(written(&change(row, shown.factor))),
            Cell::Words(
                row.normalised_error()
                    .map_or("–".into(), |e| written(&format!("{e:.2}"))),
            ),
            shown.unit.to_string().into(),
            Cell::from(match row.is_within() {
                Some(true) => "yes",
                Some(false) => "no",
                None => "not known",
            }),
        ]);
    }
    table
}

/// The change with as many decimals as its uncertainty has.
fn change(row: &AsFoundRow, factor: f64) -> String {
    let Some([found, left]) = row.expanded else {
        return significant(row.change() * factor);
    };
    let both = plus_minus(row.change() * factor, found.hypot(left) * factor);
    both.split(" ± ").next().unwrap_or_default().to_owned()
}

fn errors(found: &AsFound) -> Table {
    let mut table = Table::new(
        "Root mean square errors in the recording of this certificate",
        "error",
    )
    .numbers(["as found", "as left"])
    .words("unit");
    for error in &found.errors {
        let shown = readable::error(error.unit);
        table.row([
            format!("{}: {}", spoken(error.sensor), error.figure).into(),
            Cell::number(error.found, shown.factor),
            Cell::number(error.left, shown.factor),
            shown.unit.to_string().into(),
        ]);
    }
    table
}
