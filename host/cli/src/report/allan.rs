//! The noise of a unit at rest: coefficients, curve, and missing coefficients.

use maud::{Markup, html};
use mimu::quantity::{Sensor, duration, plural, significant};
use mimu::readable::{self, Readable};
use mimu::result::allan::{AllanResult, ChannelResult, RecordingResult};
use mimu::survey::unit::Unit;
use mimu_allan::model::Term;
use mimu_recording::RawUnit;

use super::page::{Level, judged, warnings};
use super::table::{table, with_unit};
use super::terminal::text;

/// Result of `mimu allan`: the coefficients of the first recording, or with `verbose` everything for each.
pub fn allan_text(result: &AllanResult, verbose: bool) -> String {
    text(&document(result, Level::of(verbose)))
}

pub(super) fn document(result: &AllanResult, level: Level) -> Markup {
    let shown = if level.has_all() {
        result.recordings.len()
    } else {
        1
    };
    let others = result.recordings.len().saturating_sub(shown);
    html! {
        @if level.is_page() { h1 { "Noise of " (result.device.as_deref().unwrap_or("a unit")) } }
        @if let Some(judgement) = &result.judgement { (judged(judgement, "line")) }
        @for recording in result.recordings.iter().take(shown) { (of_recording(result, recording, level)) }
        @if others > 0 { p { "and " (plural(others as u64, "more recording")) ": --verbose" } }
    }
}

fn of_recording(result: &AllanResult, recording: &RecordingResult, level: Level) -> Markup {
    let [from, to] = recording.span_s;
    let said: Vec<String> = recording.warnings.iter().map(ToString::to_string).collect();
    let percent = significant(100.0 * result.confidence.unwrap_or(f64::NAN));
    html! {
        p {
            (result.device.as_deref().unwrap_or_default()) " in " (recording.recording) ": " (duration(to - from))
            (format!(" at rest from {from:.1} s at {:.2} Hz", recording.sample_rate_hz))
            @if let Some(t) = recording.temp_c { (format!(", {t:.1} °C")) } ", " (result.kind.unwrap_or_default()) " deviation"
        }
        @for sensor in Sensor::BOTH {
            @let channels = result.channels(&recording.recording, sensor);
            @if !channels.is_empty() {
                h2 class="sensor" { (sensor) }
                p { (sensor) ": coefficient (" (percent.trim_end_matches(".0")) " % interval)" }
                section {
                    (coefficients(&channels, level))
                    @if level.has_all() { (everything(&channels)) } @else { (unseen(&channels)) }
                }
            }
        }
        (warnings(&said, level, 2))
    }
}

fn heads(channels: &[&ChannelResult]) -> Markup {
    html! { th {} @for c in channels { th.n { (c.name.rsplit('_').next().unwrap_or_default()) } } }
}

fn interval([value, lower, upper]: [f64; 3], unit: &Readable) -> String {
    let [v, l, u] = [value, lower, upper].map(|x| significant(x * unit.factor));
    format!("{v} ({l}–{u})")
}

fn coefficients(channels: &[&ChannelResult], level: Level) -> Markup {
    let known = |term| channels.iter().find_map(|c| c.get(term).ok());
    let shown = if level.has_all() { usize::MAX } else { 1 };
    html! { (table("Coefficients of the noise with their intervals", &heads(channels), &html! {
        @for term in Term::ALL { @for unit in known(term).into_iter().flat_map(|c| readable::noise(&c.unit)).take(shown) { tr {
            td { (with_unit(term.letter(), &unit)) }
            @for c in channels { td.n { @match c.get(term) {
                Ok(k) if level.has_all() => (interval([k.value, k.lower, k.upper], &unit)),
                // Three of them fit in 100 columns.
                Ok(k) => { (significant(k.value * unit.factor)) @for end in [k.lower, k.upper] { (format!(" {:+.1}", 100.0 * (end / k.value - 1.0))) } " %" }
                Err(_) => "-",
            } } }
        } } }
        tr { td { "useful dwell up to" } @for c in channels { td.n { @match (c.useful_average_s, &c.model) {
            (Some(s), _) => (duration(s)),
            (None, Some(model)) => { (duration(model.range_s[1])) " or more" }
            (None, None) => "-",
        } } } }
    })) }
}

/// What the recording was too short or too noisy to show of the three coefficients that a filter needs, and how long to record.
fn unseen(channels: &[&ChannelResult]) -> Markup {
    let lost = channels.iter().find(|c| c.model.is_none());
    let lost = lost.and_then(|c| c.get(Term::N).err());
    let largest = |values: &mut dyn Iterator<Item = f64>| values.reduce(f64::max);
    html! {
        @if let Some(why) = lost { p { "no coefficients: " (why) } }
        @else { @for term in [Term::N, Term::B, Term::K] {
            @let missing: Vec<_> = channels.iter().filter(|c| c.get(term).is_err()).collect();
            @let key = term.letter().to_lowercase();
            @if let Some(any) = missing.first() { p {
                (term.letter()) ", " (term.name()) ", is not seen in " (missing.iter().map(|c| c.name).collect::<Vec<_>>().join(", "))
                @if let Some(bound) = largest(&mut missing.iter().filter_map(|c| *c.at_most.get(&key)?)) {
                    @let unit = Unit { name: any.unit, ..Unit::raw(RawUnit::Si) };
                    ": at most " (readable::noise(&unit.coefficient(term))[0].write(bound))
                }
                @if let Some(longer) = largest(&mut missing.iter().filter_map(|c| c.longer_s.get(&key).copied())) {
                    "; to see half of that, record " (duration(longer)) " longer"
                }
            } }
        } }
    }
}

/// The curve, the lines of the spectrum, the origin of N, and why coefficients are missing.
fn everything(channels: &[&ChannelResult]) -> Markup {
    let unit = &readable::noise(channels[0].unit)[0];
    let scaled = channels.iter().filter(|c| c.raw_unit == Some("SI"));
    let factors = scaled.filter_map(|c| c.scale_factor).map(significant);
    let factors: Vec<String> = factors.collect();
    html! {
        @if !factors.is_empty() { p { "calibrated: noise of the readings divided by the scale factors " (factors.join(", ")) } }
        p { "deviation, " (unit.unit) "; 95 % bounds in %; in brackets the textbook one-sigma value" }
        (curve(channels, unit))
        ul class="lines" data-head="" {
            @for channel in channels {
                @for line in &channel.lines { li {
                    (channel.name) ": line of the spectrum: " (frequency(line.frequency_hz, line.resolution_hz)) " Hz, "
                    @match line.width_hz { Some(width) => { (significant(width)) " Hz wide" }, None => { "narrower than " (significant(line.resolution_hz)) " Hz" } }
                    ", rms " (interval([line.rms, line.rms_interval[0], line.rms_interval[1]], &readable::noise(channel.unit)[0])) " " (readable::noise(channel.unit)[0].unit)
                    (format!(", {:.0} dB above the floor", 10.0 * line.above_floor.log10()))
                } }
                @if let Some([from, to]) = channel.n_band_hz {
                    li { (channel.name) ": N from the spectrum, which is white from " (significant(from)) " to " (significant(to)) " Hz" }
                }
            }
            @for (text, names) in reasons(channels) { li { (names.join(", ")) ": " (text) } }
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
fn curve(channels: &[&ChannelResult], unit: &Readable) -> Markup {
    let cell = |[_, deviation, lower, upper, sigma]: Point| {
        let [lower, upper] = [lower, upper].map(|v| 100.0 * (v / deviation - 1.0));
        let places = if upper < 1.0 { 2 } else { 1 };
        let (value, sigma) = (
            significant(deviation * unit.factor),
            100.0 * sigma / deviation,
        );
        format!("{value} {lower:+.places$} {upper:+.places$} ({sigma:.places$})")
    };
    let row = |label: &str, cells: &[Option<String>]| {
        html! {
            @if cells.iter().any(Option::is_some) { tr { td { (label) } @for cell in cells { td.n { (cell.as_deref().unwrap_or("-")) } } } }
        }
    };
    html! { (table("Deviation by averaging time", &heads(channels), &html! { @for decade in (-6..9).map(|power| 10f64.powi(power)) {
        @let points: Vec<Option<Point>> = channels.iter().map(|c| near(decade, [&c.tau_s, &c.adev, &c.lower, &c.upper, &c.sigma_independent].map(Vec::as_slice))).collect();
        @if let Some(time_s) = points.iter().flatten().next().map(|p| p[0]) {
            (row(&format!("  {} s", significant(time_s)), &points.iter().map(|p| p.map(cell)).collect::<Vec<_>>()))
            (row("    Hadamard", &channels.iter().map(|c| {
                let h = c.hadamard.as_ref()?;
                near(decade, [&h.tau_s, &h.hdev, &h.lower, &h.upper, &h.sigma_independent].map(Vec::as_slice)).map(cell)
            }).collect::<Vec<_>>()))
        }
    } })) }
}

/// Why coefficients are missing, and where the model is invalid; each sentence once, with the channels.
fn reasons<'a>(channels: &[&'a ChannelResult]) -> Vec<(String, Vec<&'a str>)> {
    let mut given: Vec<(String, Vec<&str>)> = Vec::new();
    for channel in channels {
        let missing = Term::ALL.map(|t| channel.get(t).err().map(|why| (t, why)));
        let mut said: Vec<String> = Vec::new();
        match &channel.model {
            None => said.extend(missing[0].map(|(_, why)| format!("no coefficients: {why}"))),
            Some(model) => {
                let letter = |(term, why): (Term, &str)| format!("{} {why}", term.letter());
                said.extend(missing.into_iter().flatten().map(letter));
                let from = model.range_s[0];
                let late = from > 1.5 * channel.tau_s.first().copied().unwrap_or(0.0);
                said.extend(late.then(|| {
                    format!(
                        "fitted from {} on: at shorter times the terms do not describe the curve",
                        duration(from)
                    )
                }));
                let widened = model.excess.map(|excess| significant(excess.sqrt()));
                said.extend(widened.map(|by| format!("the terms do not describe the curve, so the intervals are widened by a factor of {by}")));
            }
        }
        for text in said {
            match given.iter_mut().find(|(t, _)| *t == text) {
                Some((_, names)) => names.push(channel.name),
                None => given.push((text, vec![channel.name])),
            }
        }
    }
    given
}
