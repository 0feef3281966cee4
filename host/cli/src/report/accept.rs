//! Result of `mimu accept`.

use maud::{Markup, html};
use mimu::quantity::{plural, plus_minus, significant};
use mimu_recording::error::Refused;
use mimu_station::document::{Document, Measurement, Verdict};

use super::table::{number, table};
use super::terminal::text;

/// Standard uncertainties of the interval beside a value.
const SIGMAS: f64 = 2.0;
/// A smaller interval, as a share of its value, is not written: nine more digits tell nobody anything.
const LEAST_SHARE: f64 = 1e-7;
/// Names in a line of one unit.
const NAMED: usize = 3;

/// The result of one of several units, in one line.
pub fn accept_line(document: &Document) -> String {
    let said = match (document.verdict, &document.problem) {
        (Verdict::NotMeasured, Some(problem)) => problem_words(problem),
        (Verdict::Failed, _) => failures(document),
        _ => summary(document),
    };
    format!(
        "{:<16} {:<13} {said}\n",
        document.unit,
        document.verdict.name()
    )
}

/// The result of one unit; with `all` also what has no limits, and where the limits are from.
pub fn accept_text(document: &Document, all: bool) -> String {
    // A count that passes, such as of stuck bits, is not in a summary.
    let plain = |m: &Measurement| m.measured.sigma == 0.0 && m.passed == Some(true);
    let shown = |m: &&Measurement| all || m.passed.is_some() && !plain(m);
    let rows: Vec<&Measurement> = document.measurements.iter().filter(shown).collect();
    let hidden = (document.measurements.len() - rows.len()) as u64;
    text(&html! {
        p { "verdict: " (document.verdict.name()) " (" (document.unit) ")" }
        section {
            @if let Some(problem) = &document.problem { ul class="lines" data-head="" { li { (problem_words(problem)) } } } @else {
                p { (summary(document)) }
                @if document.verdict == Verdict::Failed { p data-head="beyond its limits: " { (failures(document)) } }
                p { (document.decision.words()) }
                hr;
                (against_limits(&rows))
                @if hidden > 0 { p { "and " (plural(hidden, "value")) " without limits, or counts within them (--verbose)" } }
                @if all { (sources(&document.measurements)) }
            }
        }
        @if let Some(found) = document.as_found.as_ref().filter(|_| document.problem.is_none()) {
            // A count is the same by every calibration.
            @let same = |m: &Measurement| document.measurements.iter().any(|own| own.measured == m.measured && own.passed == m.passed);
            hr;
            p { "as found, by " (found.calibration) ": " (found.verdict.name()) }
            section { (against_limits(&found.measurements.iter().filter(|m| m.passed.is_some() && !same(m)).collect::<Vec<_>>())) }
        }
        @if document.problem.is_none() { section { @for missing in &document.not_measured { p data-head="not measured: " { (missing) } } } }
    })
}

fn problem_words(problem: &Refused) -> String {
    format!("{}: {}; {}", problem.place, problem.problem, problem.remedy)
}

/// What a good unit's line says.
fn summary(document: &Document) -> String {
    let all = &document.measurements;
    let kept = all.iter().filter(|m| m.passed.is_some()).count() as u64;
    let gravity = all.iter().find(|m| m.measured.name == "gravity_error");
    let gravity = gravity.map(|m| {
        format!(
            "gravity {} mg",
            plus_minus(m.measured.value, SIGMAS * m.measured.sigma)
        )
    });
    let parts = [
        (document.verdict != Verdict::Failed).then(|| format!("{} kept", plural(kept, "limit"))),
        gravity,
        document.up.as_ref().map(|up| format!("{up} up")),
        document.duration_s.map(|s| format!("{s:.1} s")),
        document.scale.clone(),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// The quantities beyond their limits.
fn failures(document: &Document) -> String {
    let all: Vec<String> = document.failed().map(failure).collect();
    let more = (all.len() > NAMED).then(|| format!(", and {} more", all.len() - NAMED));
    all[..NAMED.min(all.len())].join(", ") + &more.unwrap_or_default()
}

fn failure(m: &Measurement) -> String {
    let limits = match (m.lower.map(significant), m.upper.map(significant)) {
        (Some(lower), Some(upper)) => format!("{lower} to {upper}"),
        (Some(lower), None) => format!("at least {lower}"),
        (None, Some(upper)) => format!("at most {upper}"),
        (None, None) => String::new(),
    };
    format!(
        "{} {} {} ({limits})",
        m.measured.name,
        value(m),
        m.measured.unit
    )
}

fn value(m: &Measurement) -> String {
    let (value, half) = (m.measured.value, SIGMAS * m.measured.sigma);
    match half {
        0.0 if value.fract() == 0.0 => format!("{value:.0}"),
        half if half > LEAST_SHARE * value.abs() => plus_minus(value, half),
        _ => significant(value),
    }
}

/// Where the limits are from, each source once.
fn sources(measurements: &[Measurement]) -> Markup {
    let mut known: Vec<(&str, Vec<&str>)> = Vec::new();
    for (source, name) in measurements
        .iter()
        .filter_map(|m| Some((m.limits_of.as_deref()?, m.measured.name.as_str())))
    {
        match known.iter_mut().find(|(other, _)| *other == source) {
            Some((_, names)) => names.push(name),
            None => known.push((source, vec![name])),
        }
    }
    html! { @for (source, names) in known { p data-head="limits of " { (names.join(", ")) ": " (source) } } }
}

fn against_limits(measurements: &[&Measurement]) -> Markup {
    html! { (table("Measurements against their limits", &html! {
        th { "quantity" } th.n { "measured, ± 2 σ" } th.n { "lower" } th.n { "upper" } th { "unit" } th {}
    }, &html! { @for m in measurements { tr {
        td { (m.measured.name) } td.n { (value(m)) }
        @for limit in [m.lower, m.upper] { @if let Some(limit) = limit { (number(limit, 1.0)) } @else { td {} } }
        td { (m.measured.unit) } td { @match m.passed { Some(true) => "passed", Some(false) => "FAILED", None => {} } }
    } } })) }
}
