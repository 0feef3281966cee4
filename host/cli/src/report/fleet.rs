//! A fleet as text, and the tables that its page has too.

mod figures;
mod page;
mod tables;

use std::fmt::Write as _;

use mimu::quantity::{p_value, plural, plus_minus, significant};
use mimu_fleet::Fleet;
use mimu_fleet::result::{
    ChangedLevel, ChangedUnit, ChartOfParameter, DifferentLevel, GageOfParameter, GageStudy,
    Stranger,
};

pub use page::fleet_page;

use super::text::wrap;
use tables::{parameter, readable};

/// Lists of a summary that have two lines each; of more lists each has one.
const FEW_LISTS: usize = 2;

/// The result as text: a summary, or everything.
pub fn fleet_text(fleet: &Fleet, verbose: bool) -> String {
    let mut out = String::new();
    wrap(&mut out, "", &head(fleet));
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
    let lists: Vec<(&str, Vec<String>)> = lists(fleet)
        .into_iter()
        .filter(|l| !l.1.is_empty())
        .collect();
    let shown = match (verbose, lists.len()) {
        (true, _) => usize::MAX,
        (_, count) if count > FEW_LISTS => 1,
        _ => 2,
    };
    for (what, all) in lists {
        let more = if all.len() > shown {
            " (--verbose)"
        } else {
            ""
        };
        let _ = writeln!(out, "{what}: {}{more}", all.len());
        all.iter()
            .take(shown)
            .for_each(|line| wrap(&mut out, "  ", line));
    }
    if let Some(gage) = &fleet.gage {
        let worst = worst(gage).filter(|_| !verbose);
        let worst = worst.map_or_else(String::new, |worst| format!("; {worst}"));
        wrap(&mut out, "", &format!("{}{worst}", gage_line(gage)));
        if verbose {
            out += &tables::gage(gage).text("");
        }
    }
    capability(&mut out, fleet, verbose);
    out
}

/// What is found, by kind, the most significant first. The JSON has all triads of a label, the list the one that shows it most.
fn lists(fleet: &Fleet) -> [(&'static str, Vec<String>); 6] {
    let mut labels: Vec<(&str, &str)> = Vec::new();
    let different = fleet.different.iter().filter(|d| {
        let new = !labels.contains(&(&d.label, &d.level));
        labels.push((&d.label, &d.level));
        new
    });
    let different = different.map(level).collect();
    let signals = fleet
        .drift
        .iter()
        .flat_map(|d| &d.charts)
        .filter(|c| c.signal.is_some());
    [
        (
            "units that do not belong",
            fleet.strangers.iter().map(unit).collect(),
        ),
        (
            "calibrations that contradict others of their unit",
            fleet.contradicting.iter().map(calibration).collect(),
        ),
        (
            "units measured on many days that change",
            fleet.changed_units.iter().map(changed_unit).collect(),
        ),
        ("labels that differ", different),
        (
            "labels that changed",
            fleet.changed.iter().map(changed).collect(),
        ),
        ("parameters that drift", signals.map(drift).collect()),
    ]
}

fn head(fleet: &Fleet) -> String {
    let days = fleet
        .days
        .as_ref()
        .map_or_else(String::new, |[from, to]| format!(", {from} to {to}"));
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
        let _ = writeln!(
            out,
            "warning: {} without a row in the table of labels",
            plural(fleet.unlabelled as u64, "calibration")
        );
    }
}

/// A change with its sign: `+1.2 mg`.
pub(super) fn signed(unit: &str, change: f64) -> String {
    let sign = if change < 0.0 { "-" } else { "+" };
    format!("{sign}{}", readable(unit).write(change.abs()))
}

fn unit(one: &Stranger) -> String {
    format!(
        "{}: {} {} ({} sigmas, {})",
        one.unit,
        parameter(one.sensor, &one.parameter),
        signed(one.parameter_unit, one.change),
        significant(one.sigmas.abs()),
        p_value(one.p),
    )
}

fn calibration(one: &Stranger) -> String {
    format!("{} of {}", one.files.join(", "), unit(one))
}

fn level(one: &DifferentLevel) -> String {
    format!(
        "{} {}: {} {} ({} sigmas of the population, {}, {})",
        one.label,
        one.level,
        parameter(one.sensor, &one.parameter),
        signed(one.parameter_unit, one.change),
        significant(one.sigmas.abs()),
        plural(one.count as u64, "unit"),
        p_value(one.p),
    )
}

fn since(chart: &ChartOfParameter) -> String {
    let change = chart.change.unwrap_or(f64::NAN);
    let signal = chart
        .signal
        .as_ref()
        .map_or_else(String::new, |day| format!(", beyond the limits on {day}"));
    format!(
        "{} {} since {}{signal}",
        parameter(chart.sensor, &chart.parameter),
        signed(chart.unit, change),
        chart.since.as_deref().unwrap_or("the first day"),
    )
}

fn changed(one: &ChangedLevel) -> String {
    format!("{} {}: {}", one.label, one.level, since(&one.chart))
}

fn changed_unit(one: &ChangedUnit) -> String {
    format!(
        "{}, measured {}: {}",
        one.unit,
        plural(one.measurements as u64, "time"),
        since(&one.chart)
    )
}

fn drift(chart: &ChartOfParameter) -> String {
    since(chart)
}

fn gage_line(gage: &GageStudy) -> String {
    let factors = match gage.factors.is_empty() {
        true => "no operator, fixture or day changes within a unit".to_string(),
        false => format!("by {}", gage.factors.join(", ")),
    };
    let units = match gage.units {
        [all, used] if all == used => plural(all as u64, "unit"),
        [all, used] => format!("{used} of {}", plural(all as u64, "unit")),
    };
    format!(
        "repeatability and reproducibility: {units} with {}, {factors}",
        plural(gage.measurements as u64, "calibration")
    )
}

/// The parameter whose measurement has the largest share of the tolerance, or else of the variation.
fn worst(gage: &GageStudy) -> Option<String> {
    let by_tolerance = gage
        .parameters
        .iter()
        .filter_map(|p| Some((p, p.share_of_tolerance?, "tolerance")));
    let by_variation = gage
        .parameters
        .iter()
        .map(|p| (p, p.share_of_variation, "variation"));
    let largest =
        |a: &(&GageOfParameter, f64, &str), b: &(&GageOfParameter, f64, &str)| a.1.total_cmp(&b.1);
    let (worst, share, of) = by_tolerance
        .max_by(largest)
        .or_else(|| by_variation.max_by(largest))?;
    Some(format!(
        "at most {} % of the {of} ({})",
        significant(100.0 * share),
        parameter(worst.sensor, &worst.name)
    ))
}

fn capability(out: &mut String, fleet: &Fleet, verbose: bool) {
    let Some(part) = &fleet.part else { return };
    let worst = fleet
        .capability
        .iter()
        .min_by(|a, b| a.cpk.total_cmp(&b.cpk));
    let Some(worst) = worst else {
        wrap(
            out,
            "",
            &format!(
                "limits of {part}: none could be compared; sensitivities need readings in a range of the part"
            ),
        );
        return;
    };
    let line = format!(
        "limits of {part}: least Cpk {} ({} {} {}, {} beyond {} {})",
        plus_minus(worst.cpk, worst.cpk_half_width),
        worst.sensor,
        worst.property.name(worst.sensor),
        worst.axis,
        plural(worst.beyond as u64, "unit"),
        significant(worst.at_most),
        worst.unit
    );
    wrap(out, "", &line);
    if verbose {
        *out += &tables::capability(&fleet.capability).text("");
    }
}
