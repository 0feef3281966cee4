//! A unit against the data sheet of its part.

use maud::{Markup, html};
use mimu::data_sheet::{DataSheet, Kept};
use serde::Serialize;

use super::table::{interval, number, table};
use super::terminal::text;

/// A result of a command with the unit against a data sheet beside it, as JSON has them.
#[derive(Serialize)]
pub(crate) struct WithDataSheet<'a, T: Serialize> {
    /// The result.
    #[serde(flatten)]
    pub result: T,
    /// The unit against the data sheet; absent without `--part`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data_sheet: Option<&'a DataSheet>,
}

/// The section as text, after other text.
pub(crate) fn data_sheet_text(sheet: &DataSheet) -> String {
    format!("\n{}", text(&section(sheet)))
}

/// The section of a document.
pub(super) fn section(sheet: &DataSheet) -> Markup {
    let [passed, failed, undecided] =
        [Kept::Passed, Kept::Failed, Kept::Undecided].map(|kept| sheet.count(kept));
    html! {
        p { "against the data sheet: " (sheet.part) " (" (sheet.source) ")" }
        @if !sheet.rows.is_empty() { (properties(sheet)) }
        p {
            (passed) " passed, " (failed) " failed (the whole 95 % interval is beyond the limit), " (undecided) " undecided"
            @if sheet.rows.iter().any(|r| r.typical) { "; a limit marked typ is typical of the part and not guaranteed" }
        }
        ul class="lines" data-head="" { @for missing in &sheet.not_measured { li { "not compared: " (missing) } } }
    }
}

fn properties(sheet: &DataSheet) -> Markup {
    html! { (table("The unit against the data sheet of its part", &html! {
        th { "property" } th.n { "measured" } th.n { "limit" } th { "unit" } th { "result" } th.page { "where the data sheet has it" }
    }, &html! { @for row in &sheet.rows { tr {
        td { (row.sensor) " " (row.axis) ", " (row.property.name(row.sensor)) }
        @match row.half_width { Some(half) => (interval(row.value, half, 1.0)), None => (number(row.value, 1.0)) }
        (number(row.at_most, 1.0)) td { (row.unit) } td { (row.kept.name()) @if row.typical { " (typ)" } } td.page { (row.source) }
    } } })) }
}
