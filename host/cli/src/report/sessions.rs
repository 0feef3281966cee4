//! A fit of several sessions as text.

use std::fmt::Write as _;

use mimu::judgement::JudgementKind;
use mimu::parameter::ParameterKind;
use mimu::quantity::{plural, plus_minus};
use mimu::readable;
use mimu::result::sessions::{SensorSessions, SessionParameter, SessionsResult};

use crate::report::table::{Cell, Table};
use crate::report::text::wrap;

/// Result of `mimu fit` with several recordings: a summary, or with `verbose` also each session.
pub fn sessions_text(result: &SessionsResult, verbose: bool) -> String {
    let used = result.sessions.iter().filter(|s| s.origin.used).count();
    let count = result.sessions.len();
    let mut out = format!("{}: {}", result.device, plural(count as u64, "session"));
    match used == count {
        true => out += "\n",
        false => out += &format!(", {used} used\n"),
    }
    wrap(&mut out, "judgement: ", &result.judgement.to_string());
    for finding in &result.findings {
        if !result.judgement.reason.contains(finding.as_str()) {
            wrap(&mut out, "finding: ", finding);
        }
    }
    if let Some(prior) = &result.prior {
        let text = format!(
            "class \"{}\" ({}); three sessions need none",
            prior.class, prior.source
        );
        wrap(&mut out, "prior: ", &text);
    }
    out.push('\n');
    out += &errors(result).text("");
    for (sensor, triad) in result.sensors.present() {
        let head = format!("{sensor}, ± of 95 % at the next power-on");
        parameters(&mut out, &head, triad, |p| {
            let [low, high] = p.next_power_on?;
            Some((p.value, 0.5 * (high - low)))
        });
        let head = format!("{sensor}, ± of 95 % of the expected value");
        if verbose {
            parameters(&mut out, &head, triad, |p| {
                p.next_power_on?;
                Some((p.value, 0.5 * (p.upper - p.lower)))
            });
            each_session(&mut out, result, triad);
        }
    }
    let _ = writeln!(out, "next: {}", next(result));
    out
}

fn next(result: &SessionsResult) -> &'static str {
    match result.judgement.kind {
        JudgementKind::Suspect => {
            "look at the session that the judgement names (mimu fit SESSION), or record another"
        }
        JudgementKind::Untested => "record another session after the unit was off, and fit all",
        JudgementKind::Unexplained | JudgementKind::Misfit => {
            "find what the model lacks (mimu diagnose SESSION), then judge the calibration on another recording (mimu verify OTHER --calibration FILE)"
        }
        JudgementKind::Good => {
            "use the calibration: mimu export c FILE -o calibration.h; --verbose prints each session"
        }
    }
}

/// Errors of both sensors.
fn errors(result: &SessionsResult) -> Table {
    let mut table = Table::new(
        "Root mean square error; held out: of each session by the calibration of the others; noise: what noise alone would cause",
        "rms error",
    )
    .numbers(["held out", "in sample", "noise"])
    .words("");
    for (sensor, triad) in result.sensors.present() {
        let judged = &triad.judged;
        let unit = readable::error(&judged.unit);
        let known = |value: Option<f64>| Cell::known(value, unit.factor);
        table.row([
            format!("{sensor}, {}", unit.unit).into(),
            known(judged.held_out_rms),
            known(Some(judged.rms)),
            known(judged.noise_floor),
            format!(
                "held out: sessions; {}",
                plural(judged.dwells as u64, "dwell")
            )
            .into(),
        ]);
    }
    table
}

/// A table of the parameters by axis, of those for which `of` has a value and half an interval.
fn parameters(
    out: &mut String,
    head: &str,
    triad: &SensorSessions,
    of: impl Fn(&SessionParameter) -> Option<(f64, f64)>,
) {
    let _ = writeln!(out, "\n{head:<36}{:>22}{:>22}{:>22}", "x", "y", "z");
    for kind in ParameterKind::PHYSICAL {
        let all = triad.parameters.iter().filter(|p| p.of.0 == kind);
        let cells: Vec<_> = all.clone().map(|p| (of(p), p)).collect();
        if cells.iter().all(|(value, _)| value.is_none()) {
            continue;
        }
        let shown = readable::parameter(&cells[0].1.unit);
        let label = match kind {
            ParameterKind::NonOrthogonality => "non-orthogonality yz, zy, zx",
            other => other.words(),
        };
        let label = match shown.unit.is_empty() {
            true => label.to_owned(),
            false => format!("{label}, {}", shown.unit),
        };
        let _ = write!(out, "  {label:<34}");
        for (value, p) in cells {
            let cell = match value {
                Some((value, half)) => plus_minus(value * shown.factor, half * shown.factor),
                None => "(frame)".into(),
            };
            let mark = if p.drifts { " ~" } else { "" };
            let _ = write!(out, "{:>22}", format!("{cell}{mark}"));
        }
        out.push('\n');
    }
    if triad.parameters.iter().any(|p| p.drifts) {
        *out += "  ~ drifts from session to session; the value is extrapolated to the next\n";
    }
}

/// Each session's values, and whether the others predict them.
fn each_session(out: &mut String, result: &SessionsResult, triad: &SensorSessions) {
    let _ = writeln!(
        out,
        "\n  by session; ! outside the 95 % interval that the others predict"
    );
    for p in triad
        .parameters
        .iter()
        .filter(|p| p.next_power_on.is_some())
    {
        let shown = readable::parameter(&p.unit);
        let _ = write!(out, "  {:<24}", p.name);
        for (one, _) in p.sessions.iter().zip(&result.sessions) {
            let cell = one.as_ref().map_or("-".into(), |one| {
                let half = 0.5 * (one.upper - one.lower);
                let outside = one
                    .predicted
                    .is_some_and(|[value, half]| (one.value - value).abs() > half);
                let value = plus_minus(one.value * shown.factor, half * shown.factor);
                let value = value.split(' ').next().unwrap_or("").to_owned();
                format!("{value}{}", if outside { "!" } else { " " })
            });
            let _ = write!(out, "{cell:>12}");
        }
        let _ = writeln!(out, "  {}", shown.unit);
    }
}
