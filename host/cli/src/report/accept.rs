//! Result of `mimu accept` as text.

use std::fmt::Write as _;

use mimu::quantity::{plural, plus_minus, significant};
use mimu_station::document::{Document, Measurement, Problem, Verdict};

use super::table::{Cell, Table};
use super::text::wrap;

/// Standard uncertainties of the interval beside a value.
const SIGMAS: f64 = 2.0;
/// A smaller interval, as a share of its value, is not written: nine more digits tell nobody anything.
const LEAST_SHARE: f64 = 1e-7;
/// Names in a line of one unit.
const NAMED: usize = 3;

/// The result of one of several units, in one line.
pub fn accept_line(document: &Document) -> String {
    let head = format!("{:<16} {:<13}", document.unit, document.verdict.name());
    let said = match (document.verdict, &document.problem) {
        (Verdict::NotMeasured, Some(problem)) => problem_words(problem),
        (Verdict::Failed, _) => failures(document),
        _ => summary(document),
    };
    format!("{head} {said}\n")
}

/// The result of one unit; with `all` also what has no limits, and where the limits are from.
pub fn accept_text(document: &Document, all: bool) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "verdict: {} ({})",
        document.verdict.name(),
        document.unit
    );
    if let Some(problem) = &document.problem {
        let _ = writeln!(out, "  {}", problem_words(problem));
        return out;
    }
    let _ = writeln!(out, "  {}", summary(document));
    if document.verdict == Verdict::Failed {
        wrap(&mut out, "  beyond its limits: ", &failures(document));
    }
    wrap(&mut out, "  ", &document.decision.words());
    out.push('\n');
    let shown = |m: &&Measurement| all || m.passed.is_some() && !is_plain_count(m);
    let rows: Vec<&Measurement> = document.measurements.iter().filter(shown).collect();
    out += &table(&rows).text("  ");
    let hidden = document.measurements.len() - rows.len();
    if hidden > 0 {
        let hidden = plural(hidden as u64, "value");
        let _ = writeln!(
            out,
            "  and {hidden} without limits, or counts within them (--verbose)"
        );
    }
    if all {
        sources(&mut out, &document.measurements);
    }
    if let Some(found) = &document.as_found {
        let verdict = found.verdict.name();
        let _ = writeln!(out, "\nas found, by {}: {verdict}", found.calibration);
        // A count is the same by every calibration.
        let other = |m: &&Measurement| {
            let same = |own: &Measurement| own.measured == m.measured && own.passed == m.passed;
            m.passed.is_some() && !document.measurements.iter().any(same)
        };
        let rows: Vec<&Measurement> = found.measurements.iter().filter(other).collect();
        out += &table(&rows).text("  ");
    }
    for missing in &document.not_measured {
        wrap(&mut out, "  not measured: ", missing);
    }
    out
}

fn problem_words(problem: &Problem) -> String {
    format!("{}: {}; {}", problem.place, problem.problem, problem.remedy)
}

/// What a good unit's line says.
fn summary(document: &Document) -> String {
    let limited = document.measurements.iter().filter(|m| m.passed.is_some());
    let mut out = format!("{} kept", plural(limited.count() as u64, "limit"));
    if document.verdict == Verdict::Failed {
        out = String::new();
    }
    let mut say = |words: String| {
        if !out.is_empty() {
            out += ", ";
        }
        out += &words;
    };
    let gravity = document
        .measurements
        .iter()
        .find(|m| m.measured.name == "gravity_error");
    if let Some(m) = gravity {
        let [value, sigma] = [m.measured.value, m.measured.sigma];
        say(format!("gravity {} mg", plus_minus(value, SIGMAS * sigma)));
    }
    if let Some(up) = &document.up {
        say(format!("{up} up"));
    }
    if let Some(s) = document.duration_s {
        say(format!("{s:.1} s"));
    }
    if let Some(scale) = &document.scale {
        say(scale.clone());
    }
    out
}

/// The quantities beyond their limits.
fn failures(document: &Document) -> String {
    let all: Vec<String> = document.failed().map(failure).collect();
    let mut out = all
        .iter()
        .take(NAMED)
        .cloned()
        .collect::<Vec<_>>()
        .join(", ");
    if all.len() > NAMED {
        let _ = write!(out, ", and {} more", all.len() - NAMED);
    }
    out
}

fn failure(m: &Measurement) -> String {
    let value = value(m);
    let limits = match (m.lower, m.upper) {
        (Some(lower), Some(upper)) => format!("{} to {}", significant(lower), significant(upper)),
        (Some(lower), None) => format!("at least {}", significant(lower)),
        (None, Some(upper)) => format!("at most {}", significant(upper)),
        (None, None) => String::new(),
    };
    format!("{} {value} {} ({limits})", m.measured.name, m.measured.unit)
}

fn value(m: &Measurement) -> String {
    let (value, half) = (m.measured.value, SIGMAS * m.measured.sigma);
    if half == 0.0 && value.fract() == 0.0 {
        return format!("{value:.0}");
    }
    match half > LEAST_SHARE * value.abs() {
        true => plus_minus(value, half),
        false => significant(value),
    }
}

/// Where the limits are from, each source once.
fn sources(out: &mut String, measurements: &[Measurement]) {
    let mut known: Vec<&str> = Vec::new();
    for source in measurements.iter().filter_map(|m| m.limits_of.as_deref()) {
        if known.contains(&source) {
            continue;
        }
        known.push(source);
        let own = measurements
            .iter()
            .filter(|m| m.limits_of.as_deref() == Some(source));
        let names: Vec<&str> = own.map(|m| m.measured.name.as_str()).collect();
        wrap(
            out,
            "  limits of ",
            &format!("{}: {source}", names.join(", ")),
        );
    }
}

/// Whether it is a count that passes, such as of stuck bits: a summary leaves these out.
fn is_plain_count(m: &Measurement) -> bool {
    m.measured.sigma == 0.0 && m.passed == Some(true)
}

fn table(measurements: &[&Measurement]) -> Table {
    let heads = ["measured, ± 2 σ", "lower", "upper"];
    let mut table = Table::new("Measurements against their limits", "quantity")
        .numbers(heads)
        .words("unit")
        .words("");
    for m in measurements {
        let limit = |limit: Option<f64>| limit.map_or(Cell::Empty, |v| Cell::number(v, 1.0));
        let cells = [
            Cell::from(m.measured.name.clone()),
            Cell::from(value(m)),
            limit(m.lower),
            limit(m.upper),
            Cell::from(m.measured.unit.clone()),
            Cell::from(match m.passed {
                Some(true) => "passed",
                Some(false) => "FAILED",
                None => "",
            }),
        ];
        table.row(cells);
    }
    table
}
