//! An accepted effect: its influence on the error, its coefficients, and its alternatives.

use std::fmt::Write as _;

use super::{by, shown};
use crate::report::table::{Cell, Table};
use crate::report::text::{columns, wrap};
use mimu::diagnose::decision::Accepted;
use mimu::effects::fitted::WrittenCoefficient;
use mimu::quantity::{p_value, plus_minus, significant};
use mimu::readable::{self, Readable};
use mimu::result::diagnosis::{DiagnosisResult, SensorDiagnosisResult};

/// Largest number of alternatives listed.
const SHOWN: usize = 3;
/// Largest number of coefficients with one unit on a line, whatever their names: one for each axis.
const AXES: usize = 3;

/// `all`: each coefficient on a separate line.
pub(super) fn effect(
    out: &mut String,
    d: &DiagnosisResult,
    s: &SensorDiagnosisResult,
    a: &Accepted,
    all: bool,
) {
    wrap(
        out,
        &format!("  + {}: ", a.effect.id()),
        a.effect.candidate.about(),
    );
    let coefficients = a.effect.coefficients();
    wrap(out, "    held out ", &errors(s, a));
    match all {
        true => *out += &table(a).text("    "),
        false => compact(out, &coefficients),
    }
    if let Some(form) = a.effect.nonlinear_parameter().filter(|_| !all) {
        let (value, interval) = (significant(form.value), form.interval());
        let _ = writeln!(out, "    {} {value} (95 %: {interval})", form.name);
    }
    alternatives(out, a);
    for u in d.undecided.iter().filter(|u| u.id == a.effect.id()) {
        let score = by(u.difference);
        wrap(out, "    or, undecided: ", &format!("{} ({score})", u.law));
    }
}

/// `0.549 deg without it, 0.136 deg with it; p < 1e-6`, and the same for rest and for the second recording.
fn errors(s: &SensorDiagnosisResult, a: &Accepted) -> String {
    let both = |[without, with]: [String; 2]| format!("{without} without it, {with} with it");
    let mut text = both([a.held_out_rms_before, a.held_out_rms_after].map(|v| shown(s, v)));
    if let (Some(before), Some(after)) = (a.held_out_at_rest_before, a.held_out_at_rest_after) {
        // For a gyro without a table. Its other figures are angles after a turn.
        let rate = readable::error("rad/s");
        text += &format!("; at rest {}", both([before, after].map(|v| rate.write(v))));
    }
    match &a.second {
        Some(second) if second.shows => {
            let figures = both([second.rms_before, second.rms_after].map(|v| shown(s, v)));
            text += &format!("; second recording {figures} (affine parameters refitted)");
        }
        Some(_) => text += "; the second recording does not excite it",
        None => {}
    }
    format!("{text}; {}", p_value(a.chosen.p))
}

/// The coefficients of an effect, and its nonlinear parameter.
pub(in crate::report::diagnosis) fn table(a: &Accepted) -> Table {
    let mut table = Table::new("Coefficients with 95 % intervals", "coefficient")
        .numbers(["value"])
        .words("unit")
        .numbers(["in data sheets"])
        .on_page("SI");
    for c in a.effect.coefficients() {
        let Readable { factor, unit } = readable::coefficient(&c.unit);
        table.row([
            Cell::from(c.name.clone()),
            Cell::Interval {
                si: c.value,
                half: 2.0 * c.sigma.unwrap_or_default(),
                factor,
            },
            Cell::from(unit.into_owned()),
            Cell::known(c.typical, factor),
            Cell::from(format!("{:.3e} {}", c.value, c.unit.replace("^2", "²"))),
        ]);
    }
    if let Some(form) = a.effect.nonlinear_parameter() {
        let [from, to] = [form.from, form.to].map(significant);
        table.row([
            Cell::from(form.name.clone()),
            Cell::from(format!(
                "{} (95 %: {})",
                significant(form.value),
                form.interval()
            )),
            Cell::Empty,
            Cell::from(format!("{from} to {to} sought")),
        ]);
    }
    table
}

/// Value with its 95 % interval, and unit.
fn coefficient(c: &WrittenCoefficient) -> (String, String) {
    let Readable { factor, unit } = readable::coefficient(&c.unit);
    // Twice the standard deviation: with dozens of dwells, Student's factor is within a tenth of it.
    let value = plus_minus(c.value * factor, 2.0 * c.sigma.unwrap_or_default() * factor);
    (value, unit.into_owned())
}

/// Coefficients in rows: up to three with one unit on a line, a matrix by rows, others as many as fit on a line.
fn compact(out: &mut String, coefficients: &[WrittenCoefficient]) {
    for of_unit in coefficients.chunk_by(|a, b| a.unit == b.unit) {
        let first = |c: &WrittenCoefficient| c.name.chars().next();
        let matrix = of_unit.len() > AXES && of_unit.iter().all(|c| c.name.chars().count() == 2);
        let rows: Vec<&[WrittenCoefficient]> = match matrix {
            true => of_unit.chunk_by(|a, b| first(a) == first(b)).collect(),
            false => vec![of_unit],
        };
        let cells = |row: &[WrittenCoefficient]| -> Vec<String> {
            let each = row.iter().map(|c| (c.name.as_str(), coefficient(c).0));
            each.map(|(name, value)| match value.starts_with('-') {
                true => format!("{name} {value}"),
                false => format!("{name}  {value}"),
            })
            .collect()
        };
        let rows: Vec<Vec<String>> = rows.into_iter().map(cells).collect();
        let width = rows.iter().flatten().map(|c| c.chars().count()).max();
        let width = width.unwrap_or(0) + 3;
        let (_, unit) = coefficient(&of_unit[0]);
        let fit = (columns().saturating_sub(4 + unit.chars().count()) / width).max(1);
        for line in rows.iter().flat_map(|row| row.chunks(fit)) {
            let line: String = line.iter().map(|c| format!("{c:<width$}")).collect();
            let _ = writeln!(out, "    {} {unit}", line.trim_end());
        }
    }
}

/// Candidates that fit almost as well, on one line.
fn alternatives(out: &mut String, a: &Accepted) {
    let listed = a.chosen.alternatives.iter().take(SHOWN);
    let mut words: Vec<String> = listed
        .map(|other| format!("{} ({})", other.id, by(other.score_worse_by)))
        .collect();
    if a.chosen.alternatives.len() > SHOWN {
        words.push(format!(
            "one of {} more",
            a.chosen.alternatives.len() - SHOWN
        ));
    }
    if !words.is_empty() {
        wrap(out, "    or, by score: ", &words.join(", "));
    }
}
