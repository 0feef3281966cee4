//! A fleet as text, and the tables that its page has too.

mod figures;
mod page;
mod tables;

use std::fmt::Write as _;

use mimu::quantity::{p_value, plural, significant};
use mimu_fleet::Fleet;
use mimu_fleet::result::{ChangedLevel, ChartOfParameter, DifferentLevel, Stranger};

pub use page::fleet_page;

use super::text::wrap;
use tables::{parameter, readable};

/// Lines of each list in a summary.
const SHOWN: usize = 3;

/// The result as text: a summary, or everything.
pub fn fleet_text(fleet: &Fleet, verbose: bool) -> String {
    let mut out = String::new();
    wrap(&mut out, "", &head(fleet));
    let shown = if verbose { usize::MAX } else { SHOWN };
    wrap(&mut out, "judgement: ", &fleet.judgement.to_string());
    files(&mut out, fleet, verbose);
    out.push('\n');
    match verbose {
        true => {
            for (sensor, triad) in fleet.sensors.present() {
                out += &tables::population(sensor, triad).text("");
                out.push('\n');
            }
        }
        false => out += &tables::spreads(fleet).text(""),
    }
    list(&mut out, fleet.strangers.iter().map(unit), shown, "units that do not belong");
    list(&mut out, fleet.contradicting.iter().map(calibration), shown, "calibrations that contradict others of their unit");
    list(&mut out, fleet.different.iter().map(level), shown, "labels that differ");
    list(&mut out, fleet.changed.iter().map(changed), shown, "labels that changed");
    let signals = fleet.drift.iter().flat_map(|d| &d.charts).filter(|c| c.signal.is_some());
    list(&mut out, signals.map(drift), shown, "parameters that drift");
    if let Some(gage) = &fleet.gage {
        let _ = writeln!(out, "\n{}", gage_line(gage));
        if verbose {
            out += &tables::gage(gage).text("");
        } else if let Some(worst) = worst(gage) {
            let _ = writeln!(out, "{worst}");
        }
    }
    capability(&mut out, fleet, verbose);
    out
}

fn head(fleet: &Fleet) -> String {
    let days = fleet.days.as_ref().map_or_else(String::new, |[from, to]| format!(", {from} to {to}"));
    format!(
        "fleet: {}, {}{days}, readings in {} with reference \"{}\"",
        plural(fleet.units as u64, "unit"),
        plural(fleet.measurements as u64, "calibration"),
        fleet.raw_unit,
        fleet.reference
    )
}

/// Files that were left out.
fn files(out: &mut String, fleet: &Fleet, verbose: bool) {
    let shown = if verbose { usize::MAX } else { 2 };
    for one in fleet.left_out.iter().take(shown) {
        // The reason of a file that cannot be read names it.
        let named = match one.reason.contains(&one.file) {
            true => one.reason.clone(),
            false => format!("{}: {}", one.file, one.reason),
        };
        let _ = writeln!(out, "left out: {named}");
    }
    let rest = fleet.left_out.len().saturating_sub(shown) as u64;
    if rest > 0 {
        let _ = writeln!(out, "left out: {} (--verbose)", plural(rest, "more file"));
    }
    if fleet.unlabelled > 0 {
        let _ = writeln!(out, "warning: {} without a row in the table of labels", plural(fleet.unlabelled as u64, "calibration"));
    }
}

fn list(out: &mut String, all: impl Iterator<Item = String>, shown: usize, what: &str) {
    let all: Vec<String> = all.collect();
    if all.is_empty() {
        return;
    }
    let _ = writeln!(out, "\n{what}: {}", all.len());
    for line in all.iter().take(shown) {
        wrap(out, "  ", line);
    }
    if all.len() > shown {
        let _ = writeln!(out, "  and {} more (--verbose)", all.len() - shown);
    }
}

/// A change with its sign: `+1.2 mg`.
pub(super) fn signed(unit: &str, change: f64) -> String {
    let sign = if change < 0.0 { "-" } else { "+" };
    format!("{sign}{}", readable(unit).write(change.abs()))
}

fn labels(one: &Stranger) -> String {
    let each = one.labels.iter().map(|(name, value)| format!("{name} {value}"));
    let all: Vec<String> = each.collect();
    if all.is_empty() { String::new() } else { format!("; {}", all.join(", ")) }
}

fn unit(one: &Stranger) -> String {
    format!(
        "{} ({}): {} {} by {} sigmas{}",
        one.unit,
        p_value(one.p),
        parameter(one.sensor, &one.parameter),
        signed(one.parameter_unit, one.change),
        significant(one.sigmas.abs()),
        labels(one)
    )
}

fn calibration(one: &Stranger) -> String {
    format!("{} of {}", one.files.join(", "), unit(one))
}

fn level(one: &DifferentLevel) -> String {
    format!(
        "{} {} ({} of {}): {} {} ({} sigmas of the population)",
        one.label,
        one.level,
        p_value(one.p),
        plural(one.count as u64, "calibration"),
        parameter(one.sensor, &one.parameter),
        signed(one.parameter_unit, one.change),
        significant(one.sigmas.abs())
    )
}

fn since(chart: &ChartOfParameter) -> String {
    let change = chart.change.unwrap_or(f64::NAN);
    format!(
        "{} {} since {} (beyond the limits on {})",
        parameter(chart.sensor, &chart.parameter),
        signed(chart.unit, change),
        chart.since.as_deref().unwrap_or("the first day"),
        chart.signal.as_deref().unwrap_or("no day"),
    )
}

fn changed(one: &ChangedLevel) -> String {
    format!("{} {}: {}", one.label, one.level, since(&one.chart))
}

fn drift(chart: &ChartOfParameter) -> String {
    since(chart)
}

fn gage_line(gage: &mimu_fleet::result::GageStudy) -> String {
    let factors = match gage.factors.is_empty() {
        true => "no operator, fixture or day changes within a unit, so that reproducibility is unknown".to_string(),
        false => format!("reproducibility by {}", gage.factors.join(", ")),
    };
    format!(
        "repeatability and reproducibility: {} of {} with repeated calibrations; {factors}",
        gage.units[1],
        plural(gage.units[0] as u64, "unit")
    )
}

/// The parameter whose measurement has the largest share of the tolerance, or else of the variation.
fn worst(gage: &mimu_fleet::result::GageStudy) -> Option<String> {
    let with = |p: &&mimu_fleet::result::GageOfParameter| p.share_of_tolerance.is_some();
    let by_tolerance = gage.parameters.iter().filter(with).max_by(|a, b| a.share_of_tolerance.unwrap_or(0.0).total_cmp(&b.share_of_tolerance.unwrap_or(0.0)));
    let worst = by_tolerance.or_else(|| gage.parameters.iter().max_by(|a, b| a.share_of_variation.total_cmp(&b.share_of_variation)))?;
    let (share, of) = match worst.share_of_tolerance {
        Some(share) => (share, "tolerance"),
        None => (worst.share_of_variation, "variation"),
    };
    Some(format!(
        "  the measurement takes at most {} % of the {of}: {}, 1 sigma {}",
        significant(100.0 * share),
        parameter(worst.sensor, &worst.name),
        readable(&worst.unit).write(worst.measurement.value)
    ))
}

fn capability(out: &mut String, fleet: &Fleet, verbose: bool) {
    let Some(part) = &fleet.part else { return };
    let _ = writeln!(out, "\nagainst the limits of {part}");
    if fleet.capability.is_empty() {
        let _ = writeln!(out, "  no limit could be compared: sensitivities need readings of a range of the part");
        return;
    }
    if verbose {
        *out += &tables::capability(&fleet.capability).text("");
        return;
    }
    if let Some(worst) = fleet.capability.iter().min_by(|a, b| a.cpk.total_cmp(&b.cpk)) {
        let _ = writeln!(
            out,
            "  least Cpk {}: {} {} {}, {} beyond {} {}",
            mimu::quantity::plus_minus(worst.cpk, worst.cpk_half_width),
            worst.sensor,
            worst.property.name(worst.sensor),
            worst.axis,
            plural(worst.beyond as u64, "unit"),
            significant(worst.at_most),
            worst.unit
        );
    }
}
