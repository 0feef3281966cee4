//! What the uncertainty of each parameter consists of, if errors of the reference are stated.

use maud::{Markup, html};
use mimu::result::budget::BudgetRow;
use mimu::{FitResult, Sensor};

use super::table::table;
use super::terminal::text;

/// The tables of both triads as text; empty if no error of the reference is stated.
pub(crate) fn budget_text(fit: &FitResult) -> String {
    let sensors = fit.sensors.present();
    let tables = sensors.filter_map(|(name, sensor)| shares(name, &sensor.budget));
    tables.map(|table| format!("\n{}", text(&table))).collect()
}

/// The table of one triad.
pub(super) fn shares(sensor: Sensor, rows: &[BudgetRow]) -> Option<Markup> {
    let causes = &rows.first()?.shares;
    Some(
        html! { (table("What the variance of each parameter consists of", &html! {
            th { (sensor) ", share of variance in %" } th.n { "noise" } @for (cause, _) in causes { th.n { (cause.name()) } }
        }, &html! { @for row in rows { tr {
            td { (row.of.0.words()) " " (row.of.axis()) } td.n { (format!("{:.0}", 100.0 * row.noise)) } @for (_, share) in &row.shares { td.n { (format!("{:.0}", 100.0 * share)) } }
        } } })) },
    )
}
