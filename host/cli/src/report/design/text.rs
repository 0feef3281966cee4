//! A design as text.

use std::fmt::Write as _;

use super::{budget, prior, wrapped};
use crate::report::text::{columns, wrap};
use mimu::plan::design::judgement::WEAK;
use mimu::plan::round;
use mimu::quantity::{minutes, plural, significant};
use mimu::readable::{self, Readable};
use mimu::result::design::Design;
use mimu_equipment::step::words;

/// Largest number of dwells listed: that of the longest design.
pub(super) const LISTED: usize = 200;

/// Result of `mimu design`: a summary, or with `verbose` everything.
pub fn design_text(report: &Design, verbose: bool) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{}", report.subject());
    if !verbose {
        summary(&mut out, report);
        return out;
    }
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "  {name:<22}{text}");
    };
    line("design", report.title.clone());
    let n = report.positions.len();
    if let Some(prior) = &report.prior {
        line("prior", prior::population(prior));
        line("without the prior", prior::without(prior));
        line(
            "D-efficiency",
            "none: a prior's optimum depends on the number of dwells and their noise".into(),
        );
    } else {
        efficiency(&mut out, report);
    }
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "  {name:<22}{text}");
    };
    line(
        "condition",
        if report.condition.is_finite() {
            significant(report.condition)
        } else {
            "singular".into()
        },
    );
    line(
        "time",
        format!(
            "{}: {} of {} s, moves {}",
            minutes(report.time_s),
            plural(n as u64, "dwell"),
            significant(report.dwell_s),
            minutes(report.moves_s)
        ),
    );
    line("order", order(report));
    line("sigma of a dwell mean", sigma(report));
    if let Some(part) = report.assumed_noise {
        line(
            "noise",
            format!("that of {part} is assumed: --noise takes yours"),
        );
    }
    let repeated = match report.prior {
        None => format!(", and {} from repetitions", report.dof.repetition),
        Some(_) => String::new(),
    };
    line("spare", spare(report) + &repeated);
    for (name, text) in noticed(report) {
        line(name, text);
    }
    if let Some(filters) = &report.filters {
        let shares = filters
            .each_ref()
            .map(|f| format!("{:.4}", f.d_efficiency))
            .join(", ");
        let gain = filters[0].mean_sigma / report.mean_sigma;
        let text = format!(
            "the filters for x, y and z use four of the nine positions each, fang (26)-(28): their D-efficiency is {shares}, their sigmas are {} times those of all nine",
            significant(gain)
        );
        wrapped(&mut out, "as published", &text);
    }
    if let Some(assumed) = report.assumed {
        wrapped(&mut out, "assumed", assumed);
    }
    if report.turned_over {
        let text = "the unit is mounted upside down compared with the publication (half a turn about x): y and z change sign, and the table reaches all poses";
        wrapped(&mut out, "mounted", text);
    }
    if let Some(budget) = &report.budget {
        budget::spent(&mut out, report.noise.is_some(), budget);
    }
    settings(&mut out, report);
    parameters(&mut out, report, usize::MAX);
    if let Some(prior) = &report.prior {
        prior::by_dwells(&mut out, report, prior);
    }
    out
}

/// Columns and rows of dwells in a summary.
const ACROSS: usize = 3;
const ROWS: usize = 8;

/// Summary of a design: its quality, duration, dwells, and the parameters that they determine.
fn summary(out: &mut String, report: &Design) {
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "  {name:<22}{text}");
    };
    let n = report.positions.len();
    match &report.prior {
        None => line(
            "design",
            format!("{}, D-efficiency {:.4}", report.title, report.d_efficiency),
        ),
        Some(prior) => {
            line("design", report.title.clone());
            line("prior", prior::population(prior));
            line("without the prior", prior::without(prior));
        }
    }
    let time = minutes(report.time_s);
    let dwells = plural(n as u64, "dwell");
    line(
        "time",
        format!("{time}: {dwells} of {} s", significant(report.dwell_s)),
    );
    let sigma = match report.assumed_noise {
        Some(part) => format!(
            "{}, if the noise is that of {part}: --noise takes yours",
            mean_sigma(report)
        ),
        None => sigma(report),
    };
    line("sigma of a dwell mean", sigma);
    line("spare", spare(report));
    if report.turned_over {
        line(
            "mounted",
            "upside down compared with the publication (half a turn about x)".into(),
        );
    }
    let rate = if report.rates_dps.is_some() {
        ", rate in deg/s"
    } else {
        ""
    };
    out.push('\n');
    match report.is_by_hand() {
        true => wrap(
            out,
            "  dwells: ",
            "hold each still; up to 25 degrees off a pose does not matter, because only the size of gravity is used. +x is up where the accelerometer's x reads most; on an edge two axes read alike, on a corner three. The turns between the poses calibrate the gyro: turn by a quarter or more, about each axis both ways",
        ),
        false => {
            let _ = writeln!(out, "  dwell: direction that is up, x y z{rate}");
        }
    }
    let cell = |k: usize| {
        if report.is_by_hand() {
            let up = words(&report.positions[k].into());
            return format!("{:>3}: {up:<26}", k + 1);
        }
        let [x, y, z] = report.positions[k].map(|c| round(c, 1e3));
        let rate = report.rates_dps.as_ref().and_then(|rates| rates.get(k));
        // Three cells with a rate and their gaps fill exactly a hundred columns.
        let rate = rate.map_or(String::new(), |r| format!("{:>7.1}", round(*r, 10.0)));
        format!("{:>3}:{x:>7.3}{y:>7.3}{z:>7.3}{rate}", k + 1)
    };
    let rows = n.div_ceil(ACROSS);
    for row in 0..rows.min(ROWS) {
        let cells = (0..ACROSS).map(|c| c * rows + row).filter(|k| *k < n);
        let cells: Vec<String> = cells.map(cell).collect();
        let _ = writeln!(out, "{}", cells.join("  ").trim_end());
    }
    if rows > ROWS {
        let _ = writeln!(out, "  the other dwells: --verbose, -o, --json");
    }
    parameters(out, report, 6);
    if let Some(prior) = &report.prior {
        prior::few_dwells(out, prior);
    }
    out.push_str(
        "next: -o plan.toml writes it for mimu wizard and mimu record; --verbose prints more\n",
    );
}

/// Equations beyond the unknown parameters, of each sensor.
fn spare(report: &Design) -> String {
    let left = report.dof.lack_of_fit as u64;
    match report.prior {
        None => format!(
            "{} beyond the parameters, which alone reveal a wrong model",
            plural(left, "dwell")
        ),
        Some(_) => {
            format!("{left} values beyond the parameters, which reveal a unit of another kind")
        }
    }
}

/// How near the design is to the best possible.
fn efficiency(out: &mut String, report: &Design) {
    let _ = writeln!(
        out,
        "  {:<22}{:.4}, of the continuous optimum over the reach",
        "D-efficiency", report.d_efficiency
    );
    let _ = writeln!(
        out,
        "  {:<22}{}, optimum {}{}",
        "det(F'F/n)",
        significant(report.determinant),
        significant(report.optimum.determinant),
        match report.regressions {
            1 => "",
            _ => ": product over the three sensors",
        }
    );
}

/// Sigma of a dwell mean with its unit.
fn mean_sigma(report: &Design) -> String {
    let Readable { factor, unit } = readable::parameter(report.dwell_sigma.unit);
    format!("{} {unit}", significant(report.dwell_sigma.value * factor))
}

pub(super) fn sigma(report: &Design) -> String {
    let Readable { factor, unit } = readable::parameter(report.dwell_sigma.unit);
    let shown = |v: f64| significant(v * factor);
    let mean = shown(report.dwell_sigma.value);
    match report.noise {
        None => format!("{mean} {unit}, given"),
        Some(noise) => {
            let walk = match noise.k {
                0.0 => String::new(),
                k => format!(", K = {} {unit}/√s", shown(k)),
            };
            format!(
                "{mean} {unit} (N = {} {unit}/√Hz, B = {} {unit}{walk})",
                shown(noise.n),
                shown(noise.b)
            )
        }
    }
}

/// Order of the dwells, and its cost in time.
fn order(report: &Design) -> String {
    let name = match report.order {
        "shortest" => {
            return "shortest found; neighbouring dwells share drift (see --order)".into();
        }
        "randomised" => "in a randomised order",
        _ => "as published",
    };
    let longer = report.moves_s - report.shortest_moves_s;
    match longer >= 0.05 {
        true => format!("{name}, {} longer than the shortest found", minutes(longer)),
        false => format!("{name}, as short as the shortest found"),
    }
}

/// Effects that the design reveals or cannot reveal, one line each.
fn noticed(report: &Design) -> Vec<(&'static str, String)> {
    let mut lines = Vec::new();
    for notice in &report.notices {
        let (name, unit) = (notice.term, notice.unit);
        let text = match notice.smallest {
            None => ("cannot notice", format!("{name}: aliased with the model")),
            Some(size) => {
                let all = notice.noticed == notice.parameters;
                let part = match all {
                    true => String::new(),
                    false => format!("; {} of {} directions", notice.noticed, notice.parameters),
                };
                let label = if all {
                    "can notice"
                } else {
                    "can notice in part"
                };
                (
                    label,
                    format!(
                        "{name} from {} {unit} on (9 times in 10){part}",
                        significant(size)
                    ),
                )
            }
        };
        lines.push(text);
    }
    lines
}

/// Order of the dwells.
fn settings(out: &mut String, report: &Design) {
    let rate = report.rates_dps.as_ref().map_or("", |_| "  rate, deg/s");
    let _ = writeln!(
        out,
        "\n  {:<7}{:>9}{:>9}{:>9}{rate}",
        "dwell", "up: x", "y", "z"
    );
    let all = &report.positions;
    for (k, up) in all.iter().enumerate().take(LISTED) {
        let [x, y, z] = up.map(|c| round(c, 1e4));
        let _ = write!(out, "  {:<7}{x:>9.4}{y:>9.4}{z:>9.4}", k + 1);
        if let Some(rate) = report.rates_dps.as_ref().and_then(|rates| rates.get(k)) {
            let _ = write!(out, "{:>13.2}", round(*rate, 1e2));
        }
        let _ = writeln!(out);
    }
    if all.len() > LISTED {
        let _ = writeln!(
            out,
            "  ... and {} more: -o and --json have them",
            all.len() - LISTED
        );
    }
}

/// Intervals of the parameters, in at most `most` rows.
fn parameters(out: &mut String, report: &Design, most: usize) {
    let cells: Vec<String> = report
        .sigma_per_parameter
        .iter()
        .map(|p| match p.data_sheet.half_width_95 {
            half if half.is_finite() => {
                let alone = p.data_sheet.population_half_width_95;
                format!(
                    "{} ± {} {}{}",
                    p.name,
                    significant(half),
                    p.data_sheet.unit,
                    alone.map_or_else(String::new, prior::alone)
                )
            }
            _ => format!("{} undetermined", p.name),
        })
        .collect();
    let width = 2 + cells.iter().map(|c| c.chars().count()).max().unwrap_or(0);
    // One column for each sensor if they fit.
    let across = (columns() / width).clamp(1, 3);
    let rows = cells.len().div_ceil(across);
    let beside = match report.prior {
        None => "(FS: full scale, the effect at full input)",
        Some(_) => "[in brackets: by the population alone, without dwells]",
    };
    let _ = writeln!(out, "\n  95 % intervals if the noise is known {beside}");
    for row in 0..rows.min(most) {
        let line: String = (0..across)
            .filter_map(|c| cells.get(c * rows + row))
            .map(|cell| format!("{cell:<width$}"))
            .collect();
        let _ = writeln!(out, "  {}", line.trim_end());
    }
    if rows > most {
        let _ = writeln!(out, "  the other parameters: --verbose, --json");
    }
    let weak = report.sigma_per_parameter.iter();
    // Beside a prior, what the dwells hardly show has the half-width in brackets.
    let weak = weak.filter(|_| report.prior.is_none());
    for p in weak.filter(|p| p.inflation >= WEAK && p.value.is_finite()) {
        let _ = writeln!(
            out,
            "warning: {} is hardly observable: sigma {} times that with the others known",
            p.name,
            significant(p.inflation)
        );
    }
}
