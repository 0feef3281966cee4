//! A unit against the data sheet of its part: the same table as text and on the page.

use std::fmt::Write as _;

use maud::{Markup, html};
use mimu::data_sheet::{DataSheet, Kept};
use serde::Serialize;

use crate::report::table::{Cell, Table};
use crate::report::text::wrap;

/// A result of a command with the unit against a data sheet beside it, as JSON has them.
#[derive(Serialize)]
pub(crate) struct WithDataSheet<'a, T: Serialize> {
    /// The result.
    #[serde(flatten)]
    pub result: &'a T,
    /// The unit against the data sheet; absent without `--part`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data_sheet: Option<&'a DataSheet>,
}

/// The section as text.
pub(crate) fn data_sheet_text(sheet: &DataSheet) -> String {
    let mut out = format!(
        "\nagainst the data sheet: {} ({})\n",
        sheet.part, sheet.source
    );
    if !sheet.rows.is_empty() {
        out += &table(sheet).text("");
    }
    wrap(&mut out, "", &counts(sheet));
    for missing in &sheet.not_measured {
        let _ = writeln!(out, "not compared: {missing}");
    }
    out
}

/// The section of a page.
pub(super) fn section(sheet: &DataSheet) -> Markup {
    html! {
        p { (sheet.part) ": " (sheet.source) ". " (counts(sheet)) }
        @if !sheet.rows.is_empty() { (table(sheet).html()) }
        @for missing in &sheet.not_measured { p class="dim" { "Not compared: " (missing) "." } }
    }
}

fn counts(sheet: &DataSheet) -> String {
    let [passed, failed, undecided] =
        [Kept::Passed, Kept::Failed, Kept::Undecided].map(|kept| sheet.count(kept));
    let typical = match sheet.rows.iter().any(|r| r.typical) {
        true => "; a limit marked typ is typical of the part and not guaranteed",
        false => "",
    };
    format!(
        "{passed} passed, {failed} failed (the whole 95 % interval is beyond the limit), {undecided} undecided{typical}"
    )
}

fn table(sheet: &DataSheet) -> Table {
    let mut table = Table::new("The unit against the data sheet of its part", "property")
        .numbers(["measured", "limit"])
        .words("unit")
        .words("result")
        .on_page("where the data sheet has it");
    for row in &sheet.rows {
        let name = format!(
            "{} {}, {}",
            row.sensor,
            row.axis,
            row.property.name(row.sensor)
        );
        let measured = match row.half_width {
            Some(half) => Cell::Interval {
                si: row.value,
                half,
                factor: 1.0,
            },
            None => Cell::number(row.value, 1.0),
        };
        let typical = if row.typical { " (typ)" } else { "" };
        table.row([
            Cell::from(name),
            measured,
            Cell::number(row.at_most, 1.0),
            Cell::from(row.unit),
            Cell::from(format!("{}{typical}", row.kept.name())),
            Cell::from(row.source.clone()),
        ]);
    }
    table
}
