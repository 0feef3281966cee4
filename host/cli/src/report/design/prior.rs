//! What a prior adds to a design, as text.

use std::fmt::Write as _;

use super::wrapped;
use mimu::plan::design::fewest::MOST;
use mimu::quantity::{plural, significant};
use mimu::readable::{self, Readable};
use mimu::result::design::Design;
use mimu::result::design::beside_population::{BesidePopulation, ByDwells, HalfWidths};

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

/// Half-widths in the units of data sheets: biases, scale factors, angles.
fn cells(widths: &HalfWidths) -> [String; 3] {
    let Readable { factor, .. } = readable::parameter("m/s^2");
    let values = [
        widths.bias_mps2 * factor,
        widths.scale * 1e6,
        widths.angle_rad * 1e6,
    ];
    values.map(|v| match v.is_finite() {
        true => significant(v),
        false => "open".into(),
    })
}

const NAMES: [&str; 3] = ["bias, mg", "scale, ppm", "angle, µrad"];

/// Largest half-widths for a few numbers of dwells, and what is assumed and not designed.
pub(super) fn few_dwells(out: &mut String, prior: &BesidePopulation) {
    let shown: Vec<&ByDwells> = prior
        .by_dwells
        .iter()
        .filter(|b| SHOWN.contains(&b.dwells))
        .collect();
    let mut row = |name: &str, cell: &dyn Fn(&ByDwells) -> String| {
        let _ = write!(out, "  {name:<30}");
        for by in &shown {
            let _ = write!(out, "{:>10}", cell(by));
        }
        out.push('\n');
    };
    row("dwells (0: population alone)", &|by| by.dwells.to_string());
    for (k, name) in NAMES.iter().enumerate() {
        row(&format!("  largest {name}"), &|by| {
            cells(&by.with)[k].clone()
        });
    }
    wrapped(out, "poses", &taken(prior));
    wrapped(out, "gyro", GYRO);
}

/// How well poses are assumed to be taken.
fn taken(prior: &BesidePopulation) -> String {
    format!(
        "assumed to be taken to within {}° about each level axis, 1 sigma (--aim)",
        significant(prior.aim_deg)
    )
}

const GYRO: &str = "not designed: its inputs are the turns; mimu fit --prior uses its prior too";

/// Largest half-widths for all listed numbers of dwells, with the prior and without, and what is not designed.
pub(super) fn by_dwells(out: &mut String, report: &Design, prior: &BesidePopulation) {
    let _ = writeln!(
        out,
        "\n  largest half-widths of the best designs of dwells of {} s (0: the population alone)",
        significant(report.dwell_s)
    );
    let _ = writeln!(
        out,
        "  {:<8}{:>39}{:>39}",
        "", "with the prior", "without it"
    );
    let _ = write!(out, "  {:<8}", "dwells");
    for name in NAMES.iter().chain(&NAMES) {
        let _ = write!(out, "{name:>13}");
    }
    out.push('\n');
    for by in &prior.by_dwells {
        let _ = write!(out, "  {:<8}", by.dwells);
        let without = by
            .without
            .as_ref()
            .map_or_else(|| ["-"; 3].map(String::from), cells);
        for cell in cells(&by.with).iter().chain(&without) {
            let _ = write!(out, "{cell:>13}");
        }
        out.push('\n');
    }
    out.push('\n');
    wrapped(out, "poses", &taken(prior));
    wrapped(out, "gyro", GYRO);
}
