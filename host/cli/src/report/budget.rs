//! What the uncertainty of each parameter consists of, if errors of the reference are stated.

use mimu::result::budget::BudgetRow;
use mimu::result::fit::FitResult;

use crate::report::table::{Cell, Table};

/// The tables of both triads as text; empty if no error of the reference is stated.
pub(crate) fn budget_text(fit: &FitResult) -> String {
    let sensors = fit.sensors.present();
    let tables = sensors.filter_map(|(name, sensor)| table(name, &sensor.budget));
    tables
        .map(|table| format!("\n{}", table.text("")))
        .collect()
}

/// The table of one triad.
pub(super) fn table(sensor: impl std::fmt::Display, rows: &[BudgetRow]) -> Option<Table> {
    let first = rows.first()?;
    let causes = first.shares.iter().map(|(cause, _)| cause.name());
    let mut table = Table::new(
        "What the variance of each parameter consists of",
        format!("{sensor}, share of variance in %"),
    )
    .numbers(["noise"].into_iter().chain(causes));
    for row in rows {
        let percent = |share: f64| Cell::Words(format!("{:.0}", 100.0 * share));
        let shares = row.shares.iter().map(|(_, share)| percent(*share));
        let name = format!("{} {}", row.of.0.words(), row.of.axis());
        table.row(
            [Cell::Words(name), percent(row.noise)]
                .into_iter()
                .chain(shares),
        );
    }
    Some(table)
}
