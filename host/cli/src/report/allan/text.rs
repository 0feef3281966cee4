//! The table for people.

use std::fmt::Write as _;

use mimu::allan::Point;
use mimu::allan::model::{Term, duration};
use mimu::allan::recording::{Channel, Survey};
use mimu::allan::units::{Usual, number};
use mimu::quantity::Sensor;

/// Why a channel has no coefficients at all.
pub(super) const TOO_SHORT: &str = "fewer than five octaves: record for longer";

/// Result of `mimu allan`: a block for each recording.
pub fn allan_text(surveys: &[Survey]) -> String {
    let blocks: Vec<String> = surveys.iter().map(survey_text).collect();
    blocks.join("\n")
}

fn survey_text(survey: &Survey) -> String {
    let mut out = String::new();
    let [from, to] = survey.span_s;
    let temperature = survey.temp_c.map(|t| format!(", {t:.1} °C"));
    let _ = writeln!(
        out,
        "{} in {}: {} at rest from {:.1} s at {:.2} Hz{}, {} deviation",
        survey.device,
        survey.recording,
        duration(to - from),
        from,
        survey.sample_rate_hz,
        temperature.unwrap_or_default(),
        survey.options.kind.name()
    );
    for sensor in Sensor::BOTH {
        let channels: Vec<&Channel> = survey
            .channels
            .iter()
            .filter(|c| c.sensor == sensor)
            .collect();
        if !channels.is_empty() {
            let _ = writeln!(out);
            sensor_text(&mut out, survey, sensor, &channels);
        }
    }
    if !survey.warnings.is_empty() {
        let _ = writeln!(out);
        for warning in &survey.warnings {
            let _ = writeln!(out, "warning: {warning}");
        }
    }
    out
}

/// Rows of a label and a cell for each channel.
type Rows = Vec<(String, Vec<String>)>;

fn write_rows(out: &mut String, rows: &Rows) {
    let cells = rows.iter().flat_map(|(_, cells)| cells);
    let width = 2 + cells.map(|c| c.chars().count()).max().unwrap_or(0);
    for (label, cells) in rows {
        let _ = write!(out, "  {label:<15}");
        for cell in cells {
            let _ = write!(out, "{cell:>width$}");
        }
        let _ = writeln!(out);
    }
}

fn interval(value: f64, lower: f64, upper: f64, factor: f64) -> String {
    let [v, l, u] = [value, lower, upper].map(|x| number(x * factor));
    format!("{v} ({l}–{u})")
}

fn sensor_text(out: &mut String, survey: &Survey, sensor: Sensor, channels: &[&Channel]) {
    let percent = 100.0 * survey.options.confidence;
    let _ = writeln!(
        out,
        "{sensor}: coefficient ({} % interval)",
        number(percent).trim_end_matches(".0")
    );
    let mut rows: Rows = vec![(String::new(), ["x", "y", "z"].map(String::from).into())];
    for term in Term::ALL {
        let seen = |c: &&Channel| c.model.as_ref().and_then(|m| m.get(term).ok().copied());
        if !channels.iter().any(|c| seen(c).is_some()) {
            continue;
        }
        for usual in channels[0].unit.usual(sensor, term) {
            let cells = channels.iter().map(|c| match seen(c) {
                Some(k) => interval(k.value, k.lower, k.upper, usual.factor),
                None => "-".into(),
            });
            rows.push((
                format!("{}, {}", term.letter(), usual.name),
                cells.collect(),
            ));
        }
    }
    let dwell = |c: &&Channel| match c
        .model
        .as_ref()
        .map(|m| (m.useful_average_s(), m.range_s[1]))
    {
        Some((Some(s), _)) => duration(s),
        Some((None, longest)) => format!("over {}", duration(longest)),
        None => "-".into(),
    };
    rows.push((
        "useful average".into(),
        channels.iter().map(dwell).collect(),
    ));
    write_rows(out, &rows);
    curve_text(out, sensor, channels);
    reasons(out, channels);
}

/// The curve at one time a decade, with the bounds and beside them fang (7), which is one sigma.
fn curve_text(out: &mut String, sensor: Sensor, channels: &[&Channel]) {
    let usual: Usual = channels[0].unit.deviation(sensor);
    let _ = writeln!(
        out,
        "  deviation, {}; bounds, and in brackets one sigma by fang (7), %",
        usual.name
    );
    let mut rows = Rows::new();
    let mut decade = 1e-6;
    while decade < 1e9 {
        let near = |curve: &[Point]| -> Option<Point> {
            let distance = |p: &&Point| (p.tau_s / decade).ln().abs();
            let nearest = curve
                .iter()
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
            (distance(&nearest) < 0.05).then_some(*nearest)
        };
        let cell = |p: Option<Point>| match p {
            Some(p) => {
                let [lower, upper] = [p.lower, p.upper].map(|v| 100.0 * (v / p.deviation - 1.0));
                let places = if upper < 1.0 { 2 } else { 1 };
                format!(
                    "{} {lower:+.places$} {upper:+.places$} ({:.places$})",
                    number(p.deviation * usual.factor),
                    100.0 * p.fang_7 / p.deviation
                )
            }
            None => "-".into(),
        };
        if let Some(first) = channels.iter().find_map(|c| near(&c.curve)) {
            let time = number(first.tau_s);
            let cells = channels.iter().map(|c| cell(near(&c.curve)));
            rows.push((format!("  {time} s"), cells.collect()));
            let beside = channels.iter().map(|c| near(c.hadamard.as_ref()?));
            let beside: Vec<Option<Point>> = beside.collect();
            if beside.iter().any(Option::is_some) {
                let cells = beside.into_iter().map(cell);
                rows.push(("    Hadamard".into(), cells.collect()));
            }
        }
        decade *= 10.0;
    }
    write_rows(out, &rows);
}

/// Why coefficients are missing, and where the model does not hold; the same sentence once.
fn reasons(out: &mut String, channels: &[&Channel]) {
    let mut said: Vec<(String, Vec<&str>)> = Vec::new();
    let mut say = |name, text: String| match said.iter_mut().find(|(t, _)| *t == text) {
        Some((_, names)) => names.push(name),
        None => said.push((text, vec![name])),
    };
    for channel in channels {
        let Some(model) = &channel.model else {
            say(channel.name, format!("no coefficients: {TOO_SHORT}"));
            continue;
        };
        for term in Term::ALL {
            if let Err(why) = model.get(term) {
                say(channel.name, format!("{} {why}", term.letter()));
            }
        }
        if model.range_s[0] > 1.5 * channel.curve.first().map_or(0.0, |p| p.tau_s) {
            let from = duration(model.range_s[0]);
            say(
                channel.name,
                format!("fitted from {from} on: the terms do not describe the curve below"),
            );
        }
        if let Some(excess) = model.excess {
            say(
                channel.name,
                format!(
                    "the terms do not describe the curve: the intervals are {} times wider for it",
                    number(excess.sqrt())
                ),
            );
        }
    }
    for (text, names) in said {
        let _ = writeln!(out, "  {}: {text}", names.join(", "));
    }
}
