//! What a prior adds to a design.

use maud::{Markup, html};
use mimu::plan::design::fewest::{MOST, Widths};
use mimu::result::design::Design;
use mimu::result::design::beside_population::BesidePopulation;
use mimu::{plural, readable, significant};

use crate::report::page::Level;
use crate::report::table::{number, table};

/// Numbers of dwells in a summary.
const SHOWN: [usize; 5] = [0, 3, 6, 9, 12];

/// Where the prior comes from.
pub(super) fn population(prior: &BesidePopulation) -> String {
    let biases = if prior.biases {
        ""
    } else {
        "; it says nothing of the biases"
    };
    format!(
        "of {} whose readings are in {}{biases}",
        plural(prior.units as u64, "unit"),
        prior.raw_unit
    )
}

/// How many dwells the design would need without the prior.
pub(super) fn without(prior: &BesidePopulation) -> String {
    let as_good = match prior.dwells_without {
        Some(n) => format!("{n} dwells have the same mean sigma"),
        None => format!("{MOST} dwells do not have the same mean sigma"),
    };
    let targets = prior.targets.map(|t| match t.dwells_without {
        Some(n) => format!(", and {n} meet the targets"),
        None => format!(", and {MOST} do not meet the targets"),
    });
    as_good + &targets.unwrap_or_default()
}

/// The half-width by the population alone, in brackets.
pub(super) fn alone(half: f64) -> String {
    match half.is_finite() {
        true => format!(" [{}]", significant(half)),
        false => " [open]".into(),
    }
}

const NAMES: [&str; 3] = ["bias, mg", "scale, ppm", "angle, µrad"];

/// Half-widths in the units of data sheets, as in [`NAMES`].
fn cells(widths: &Widths) -> [Markup; 3] {
    let bias = readable::parameter("m/s^2").factor;
    [
        (widths.bias, bias),
        (widths.scale, 1e6),
        (widths.angle, 1e6),
    ]
    .map(|(si, factor)| match si.is_finite() {
        true => number(si, factor),
        false => html! { td.n { "open" } },
    })
}

/// Largest half-widths by the number of dwells, in a summary for a few; what is assumed, and what is not designed.
pub(super) fn by_dwells(report: &Design, prior: &BesidePopulation, level: Level) -> Markup {
    let caption = "Largest half-widths of the best designs";
    let few = || {
        prior
            .by_dwells
            .iter()
            .filter(|by| SHOWN.contains(&by.dwells))
    };
    html! {
        @if level.has_all() {
            hr;
            p { "largest half-widths of the best designs of dwells of " (significant(report.dwell_s)) " s (0: the population alone), with the prior and without" }
            (table(caption, &html! { th { "dwells" } @for name in NAMES { th.n { (name) } } @for name in NAMES { th.n { "without: " (name) } } }, &html! { @for by in &prior.by_dwells { tr {
                td { (by.dwells) } @for cell in cells(&by.with) { (cell) }
                @match &by.without { Some(widths) => { @for cell in cells(widths) { (cell) } }, None => { @for _ in NAMES { td.n { "-" } } } }
            } } }))
        } @else {
            (table(caption, &html! { th { "dwells (0: population alone)" } @for by in few() { th.n { (by.dwells) } } }, &html! {
                @for (k, name) in NAMES.iter().enumerate() { tr { td { "  largest " (name) } @for by in few() { (cells(&by.with)[k]) } } }
            }))
        }
        dl.aligned {
            dt { "poses" } dd { "assumed to be taken to within " (significant(prior.aim_deg)) "° about each level axis, 1 sigma (--aim)" }
            dt { "gyro" } dd { "not designed: its inputs are the turns; mimu fit --prior uses its prior too" }
        }
    }
}
