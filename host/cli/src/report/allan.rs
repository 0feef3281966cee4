//! The noise of a unit at rest as text: coefficients, curve, and missing coefficients.

use std::fmt::Write as _;

use mimu::quantity::{Sensor, duration, plural, significant};
use mimu::readable::{self, Readable};
use mimu::result::allan::{AllanResult, ChannelResult, RecordingResult};
use mimu::survey::unit::Unit;
use mimu_allan::model::Term;
use mimu_recording::RawUnit;

use crate::report::table::{Cell, Table};
use crate::report::text::{warn, warn_within, wrap};

/// Result of `mimu allan`: the coefficients of the first recording, or with `verbose` a block with everything for each.
pub fn allan_text(result: &AllanResult, verbose: bool) -> String {
    let judged = match &result.judgement {
        Some(judgement) => format!("judgement: {judgement}\n"),
        None => String::new(),
    };
    if verbose {
        let block = |recording| recording_text(result, recording, true);
        let blocks: Vec<String> = result.recordings.iter().map(block).collect();
        return judged + &blocks.join("\n");
    }
    let Some(first) = result.recordings.first() else {
        return String::new();
    };
    let mut out = judged + &recording_text(result, first, false);
    let others = result.recordings.len() - 1;
    if others > 0 {
        let others = plural(others as u64, "more recording");
        let _ = writeln!(out, "and {others}: --verbose");
    }
    out
}

fn recording_text(result: &AllanResult, recording: &RecordingResult, verbose: bool) -> String {
    let mut out = String::new();
    let [from, to] = recording.span_s;
    let temperature = recording.temp_c.map(|t| format!(", {t:.1} °C"));
    let _ = writeln!(
        out,
        "{} in {}: {} at rest from {:.1} s at {:.2} Hz{}, {} deviation",
        result.device.as_deref().unwrap_or_default(),
        recording.recording,
        duration(to - from),
        from,
        recording.sample_rate_hz,
        temperature.unwrap_or_default(),
        result.kind.unwrap_or_default()
    );
    for sensor in Sensor::BOTH {
        let channels = result.channels(&recording.recording, sensor);
        if !channels.is_empty() {
            let _ = writeln!(out);
            sensor_text(&mut out, result.confidence, sensor, &channels, verbose);
        }
    }
    if verbose && !recording.warnings.is_empty() {
        let _ = writeln!(out);
        warn(&mut out, recording.warnings.iter());
    } else if !verbose {
        warn_within(
            &mut out,
            recording.warnings.iter().map(ToString::to_string),
            2,
        );
    }
    out
}

/// A table of channels: a row for each label.
fn by_channel(channels: &[&ChannelResult]) -> Table {
    let axis = |c: &&ChannelResult| c.name.rsplit('_').next().unwrap_or_default().to_owned();
    Table::new("", "").numbers(channels.iter().map(axis))
}

/// A row of `table`.
fn add_row(table: &mut Table, label: impl Into<Cell>, cells: impl IntoIterator<Item = String>) {
    table.row(std::iter::once(label.into()).chain(cells.into_iter().map(Cell::Words)));
}

fn interval(value: f64, lower: f64, upper: f64, unit: &Readable) -> String {
    let [v, l, u] = [value, lower, upper].map(|x| significant(x * unit.factor));
    format!("{v} ({l}–{u})")
}

fn sensor_text(
    out: &mut String,
    confidence: Option<f64>,
    sensor: Sensor,
    channels: &[&ChannelResult],
    verbose: bool,
) {
    let percent = 100.0 * confidence.unwrap_or(f64::NAN);
    let _ = writeln!(
        out,
        "{sensor}: coefficient ({} % interval)",
        significant(percent).trim_end_matches(".0")
    );
    let mut rows = by_channel(channels);
    for term in Term::ALL {
        let Some(any) = channels.iter().find_map(|c| c.get(term).ok()) else {
            continue;
        };
        let units = readable::noise(&any.unit);
        let shown = if verbose { units.len() } else { 1 };
        for unit in units.into_iter().take(shown) {
            let cells = channels.iter().map(|c| match c.get(term) {
                Ok(k) if verbose => interval(k.value, k.lower, k.upper, &unit),
                // Three of them fit in 100 columns.
                Ok(k) => {
                    let [low, high] = [k.lower, k.upper].map(|end| 100.0 * (end / k.value - 1.0));
                    format!(
                        "{} {low:+.1} {high:+.1} %",
                        significant(k.value * unit.factor)
                    )
                }
                Err(_) => "-".into(),
            });
            add_row(
                &mut rows,
                format!("{}, {}", term.letter(), unit.unit),
                cells,
            );
        }
    }
    let scaled = channels.iter().filter(|c| c.raw_unit == Some("SI"));
    let factors: Vec<String> = scaled
        .filter_map(|c| c.scale_factor)
        .map(significant)
        .collect();
    let dwell = |c: &&ChannelResult| match (c.useful_average_s, &c.model) {
        (Some(s), _) => duration(s),
        (None, Some(model)) => format!("{} or more", duration(model.range_s[1])),
        (None, None) => "-".into(),
    };
    add_row(&mut rows, "useful dwell up to", channels.iter().map(dwell));
    *out += &rows.text("  ");
    if !verbose {
        unseen(out, channels);
        return;
    }
    if !factors.is_empty() {
        let _ = writeln!(
            out,
            "  calibrated: noise of the readings divided by the scale factors {}",
            factors.join(", ")
        );
    }
    curve_text(out, channels);
    lines_text(out, channels);
    reasons(out, channels);
}

/// What the recording was too short or too noisy to show of the three coefficients that a filter needs, and how long to record.
fn unseen(out: &mut String, channels: &[&ChannelResult]) {
    if let Some(why) = channels
        .iter()
        .find(|c| c.model.is_none())
        .and_then(|c| c.get(Term::N).err())
    {
        let _ = writeln!(out, "  no coefficients: {why}");
        return;
    }
    for term in [Term::N, Term::B, Term::K] {
        let missing = channels.iter().filter(|c| c.get(term).is_err());
        let missing: Vec<&&ChannelResult> = missing.collect();
        let Some(any) = missing.first() else { continue };
        let key = term.letter().to_lowercase();
        let names: Vec<&str> = missing.iter().map(|c| c.name).collect();
        let largest = |values: Vec<f64>| values.into_iter().reduce(f64::max);
        let bound = largest(
            missing
                .iter()
                .filter_map(|c| *c.at_most.get(&key)?)
                .collect(),
        );
        let longer = largest(
            missing
                .iter()
                .filter_map(|c| c.longer_s.get(&key).copied())
                .collect(),
        );
        let mut text = format!(
            "{}, {}, is not seen in {}",
            term.letter(),
            term.name(),
            names.join(", ")
        );
        if let Some(bound) = bound {
            let unit = Unit {
                name: any.unit,
                ..Unit::raw(RawUnit::Si)
            };
            text += &format!(
                ": at most {}",
                readable::noise(&unit.coefficient(term))[0].write(bound)
            );
        }
        if let Some(longer) = longer {
            text += &format!("; to see half of that, record {} longer", duration(longer));
        }
        wrap(out, "  ", &text);
    }
}

/// Lines of the spectrum that were set aside, and the origin of N.
fn lines_text(out: &mut String, channels: &[&ChannelResult]) {
    for channel in channels {
        let unit = &readable::noise(channel.unit)[0];
        for line in &channel.lines {
            let [lower, upper] = line.rms_interval;
            let width = match line.width_hz {
                Some(width) => format!("{} Hz wide", significant(width)),
                None => "steady".into(),
            };
            let _ = writeln!(
                out,
                "  {}: line removed: {} Hz, {width}, rms {} {}, {:.0} dB above the floor",
                channel.name,
                frequency(line.frequency_hz, line.resolution_hz),
                interval(line.rms, lower, upper, unit),
                unit.unit,
                10.0 * line.above_floor.log10()
            );
        }
        if let Some([from, to]) = channel.n_band_hz {
            let _ = writeln!(
                out,
                "  {}: N from the spectrum, which is white from {} to {} Hz",
                channel.name,
                significant(from),
                significant(to)
            );
        }
    }
}

/// A frequency, to a tenth of the resolution.
fn frequency(hz: f64, resolution_hz: f64) -> String {
    let places = (1.0 - resolution_hz.log10().floor()).clamp(0.0, 6.0);
    format!("{hz:.*}", places as usize)
}

/// A point of a curve: averaging time, deviation, bounds of its interval, textbook sigma.
type Point = [f64; 5];

/// Largest distance of a time from the nearest end of a curve, as a logarithm.
const OUTSIDE: f64 = 0.05;

/// The point of a curve nearest to a time, if the curve extends so far. Averaging times are whole samples: at 180 Hz none is within 10 % of 0.1 s,
/// and the nearest one is shown.
fn near(time_s: f64, [tau, deviation, lower, upper, sigma]: [&[f64]; 5]) -> Option<Point> {
    let distance = |t: &f64| (t / time_s).ln();
    if distance(tau.first()?) > OUTSIDE || distance(tau.last()?) < -OUTSIDE {
        return None;
    }
    let each = tau.iter().enumerate();
    let (i, t) = each.min_by(|a, b| distance(a.1).abs().total_cmp(&distance(b.1).abs()))?;
    Some([*t, deviation[i], lower[i], upper[i], sigma[i]])
}

/// The curve at one time per decade, with its bounds and fang's one-sigma value (7) beside them.
fn curve_text(out: &mut String, channels: &[&ChannelResult]) {
    let unit = &readable::noise(channels[0].unit)[0];
    let _ = writeln!(
        out,
        "  deviation, {}; 95 % bounds in %; in brackets the textbook one-sigma value",
        unit.unit
    );
    let mut rows = by_channel(channels);
    let mut decade = 1e-6;
    while decade < 1e9 {
        let cell = |p: Option<Point>| match p {
            Some([_, deviation, lower, upper, sigma]) => {
                let [lower, upper] = [lower, upper].map(|v| 100.0 * (v / deviation - 1.0));
                let places = if upper < 1.0 { 2 } else { 1 };
                format!(
                    "{} {lower:+.places$} {upper:+.places$} ({:.places$})",
                    significant(deviation * unit.factor),
                    100.0 * sigma / deviation
                )
            }
            None => "-".into(),
        };
        let points = channels.iter().map(|c| {
            let columns = [&c.tau_s, &c.adev, &c.lower, &c.upper, &c.sigma_independent];
            near(decade, columns.map(Vec::as_slice))
        });
        let points: Vec<Option<Point>> = points.collect();
        if let Some(time_s) = points.iter().flatten().next().map(|p| p[0]) {
            let label = format!("  {} s", significant(time_s));
            add_row(&mut rows, label, points.into_iter().map(cell));
            // Shown only if it differs.
            let without = channels.iter().map(|c| {
                let quiet = c.adev_without_lines.as_ref()?;
                let (i, _) = c.tau_s.iter().enumerate().find(|(_, t)| **t == time_s)?;
                let [quiet, all] = [quiet[i], c.adev[i]].map(|d| significant(d * unit.factor));
                (quiet != all).then_some(quiet)
            });
            let without: Vec<Option<String>> = without.collect();
            if without.iter().any(Option::is_some) {
                let cells = without.into_iter().map(|c| c.unwrap_or_else(|| "-".into()));
                add_row(&mut rows, "    without lines", cells);
            }
            let beside = channels.iter().map(|c| {
                let h = c.hadamard.as_ref()?;
                let columns = [&h.tau_s, &h.hdev, &h.lower, &h.upper, &h.sigma_independent];
                near(decade, columns.map(Vec::as_slice))
            });
            let beside: Vec<Option<Point>> = beside.collect();
            if beside.iter().any(Option::is_some) {
                add_row(&mut rows, "    Hadamard", beside.into_iter().map(cell));
            }
        }
        decade *= 10.0;
    }
    *out += &rows.text("  ");
}

/// Why coefficients are missing, and where the model is invalid; each sentence once.
fn reasons(out: &mut String, channels: &[&ChannelResult]) {
    let mut given: Vec<(String, Vec<&str>)> = Vec::new();
    let mut give = |name, text: String| match given.iter_mut().find(|(t, _)| *t == text) {
        Some((_, names)) => names.push(name),
        None => given.push((text, vec![name])),
    };
    for channel in channels {
        let missing = Term::ALL.map(|t| channel.get(t).err().map(|why| (t, why)));
        let Some(model) = &channel.model else {
            if let Some((_, why)) = missing[0] {
                give(channel.name, format!("no coefficients: {why}"));
            }
            continue;
        };
        for (term, why) in missing.into_iter().flatten() {
            give(channel.name, format!("{} {why}", term.letter()));
        }
        if model.range_s[0] > 1.5 * channel.tau_s.first().copied().unwrap_or(0.0) {
            let from = duration(model.range_s[0]);
            give(
                channel.name,
                format!(
                    "fitted from {from} on: at shorter times the terms do not describe the curve"
                ),
            );
        }
        if let Some(excess) = model.excess {
            give(
                channel.name,
                format!(
                    "the terms do not describe the curve, so the intervals are widened by a factor of {}",
                    significant(excess.sqrt())
                ),
            );
        }
    }
    for (text, names) in given {
        let _ = writeln!(out, "  {}: {text}", names.join(", "));
    }
}
