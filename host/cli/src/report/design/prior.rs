//! What a prior adds to a design, as text.

use std::fmt::Write as _;

use mimu::quantity::{plural, significant};
use mimu::readable::{self, Readable};
use mimu::result::design::Design;
use mimu::result::design::beside_population::{BesidePopulation, ByDwells, HalfWidths};

use crate::report::text::wrap;

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

/// How many dwells the prior spares.
pub(super) fn worth(prior: &BesidePopulation, dwells: usize) -> String {
    let as_good = match prior.dwells_without {
        Some(n) if n > dwells => format!("{n} dwells without the prior have this mean sigma"),
        Some(n) => format!("none: {n} dwells without it have this mean sigma"),
        None => "no feasible number of dwells without the prior has this mean sigma".into(),
    };
    let targets = prior.targets.map(|t| match t.dwells_without {
        Some(n) => format!("{n} meet the targets"),
        None => "no feasible number meets the targets".into(),
    });
    targets.map_or(as_good.clone(), |t| format!("{as_good}, and {t}"))
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

/// Largest half-widths for a few numbers of dwells, and what is not designed.
pub(super) fn few_dwells(out: &mut String, report: &Design, prior: &BesidePopulation) {
    let shown: Vec<&ByDwells> = prior
        .by_dwells
        .iter()
        .filter(|b| SHOWN.contains(&b.dwells))
        .collect();
    let _ = write!(
        out,
        "  {:<22}",
        format!("dwells of {} s", significant(report.dwell_s))
    );
    for by in &shown {
        let _ = write!(out, "{:>10}", by.dwells);
    }
    let _ = writeln!(out, "   largest half-width; 0: population");
    for (k, name) in NAMES.iter().enumerate() {
        let _ = write!(out, "  {name:<22}");
        for by in &shown {
            let _ = write!(out, "{:>10}", cells(&by.with)[k]);
        }
        let _ = writeln!(out);
    }
    out.push_str(
        "  the gyro's prior is for mimu fit --prior; this plan does not design the turns\n",
    );
}

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
    wrap(
        out,
        &format!("  {:<22}", "gyro"),
        "by hand its known inputs are the turns between the poses, which this plan does not design; mimu fit --prior uses its prior in the same recording",
    );
}
