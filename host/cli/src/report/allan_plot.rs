//! Allan curves as SVG: gyros and accelerometers side by side, with bounds as bands, fitted models and coefficients.

use std::ops::Range;

use maud::{Markup, html};

use super::svg::{AXIS_CLASSES, Chart, Frame, Panel, px};
use mimu::result::allan::{AllanResult, ChannelResult, ModelResult};
use mimu::{Sensor, readable, significant};
use mimu_allan::model::{FLOOR, Term};

/// The panel of a sensor.
const PANEL: Panel = Panel {
    size: (640.0, 520.0),
    room: [92.0, 14.0, 44.0, 60.0],
};

/// The curves of a single recording as SVG.
pub fn svg(result: &AllanResult) -> String {
    let of = |sensor: Sensor| {
        let ours = result.channels.iter().filter(|c| c.sensor == sensor);
        let ours: Vec<&ChannelResult> = ours.filter(|c| !c.tau_s.is_empty()).collect();
        (!ours.is_empty()).then(|| panel(result, sensor, &ours))
    };
    PANEL.file(&[Sensor::BOTH.into_iter().filter_map(of).collect()])
}

fn panel(result: &AllanResult, sensor: Sensor, channels: &[&ChannelResult]) -> Markup {
    let usual = &readable::noise(channels[0].unit)[0];
    let by = usual.factor;
    let x = ends(channels.iter().flat_map(|c| c.tau_s.iter().copied()), 1.1);
    // At the longest times the curve has to be visible, but not all of the band.
    let y = ends(
        channels.iter().flat_map(|c| c.adev.iter().map(|d| d * by)),
        1.6,
    );
    let frame = PANEL.logarithmic(x, y);
    let inside = |deviation: f64| (deviation * by).clamp(frame.y.start, frame.y.end);
    let curve = |tau_s: &[f64], deviation: &[f64]| -> Vec<(f64, f64)> {
        let each = tau_s.iter().zip(deviation);
        each.map(|(t, d)| (*t, inside(*d))).collect()
    };
    // Line style, name and curve of an entry of the legend.
    type Entry = (String, String, Vec<(f64, f64)>);
    let mut entries: Vec<Entry> = Vec::new();
    for (class, channel) in AXIS_CLASSES.iter().zip(channels) {
        let (name, tau_s) = (channel.name, &channel.tau_s);
        entries.push((
            (*class).into(),
            with_values(channel),
            curve(tau_s, &channel.adev),
        ));
        let hadamard = channel.hadamard.iter();
        entries.extend(hadamard.map(|h| {
            (
                format!("{class} hadamard"),
                format!("{name}, Hadamard"),
                curve(&h.tau_s, &h.hdev),
            )
        }));
    }
    let sensors = sensor.pick("Gyros", "Accelerometers");
    let title = format!(
        "{sensors} of {}",
        result.device.as_deref().unwrap_or_default()
    );
    let y_name = format!(
        "{} deviation, {}",
        result.kind.unwrap_or_default(),
        usual.unit
    );
    let drawn = html! {
        path class="ink" d={ "M" (px(frame.across.start)) " " (px(frame.down.start)) "V" (px(frame.down.end)) "H" (px(frame.across.end)) } {}
        @for (class, channel) in AXIS_CLASSES.iter().zip(channels) {
            @let [high, low] = [&channel.upper, &channel.lower].map(|ends| curve(&channel.tau_s, ends).into_iter());
            (frame.line(&format!("{class} band"), high.chain(low.rev())))
        }
        @for (class, _, points) in &entries { (frame.line(class, points.iter().copied())) }
        @for (_, channel, model) in models(channels) {
            @let [from, to] = model.range_s;
            (frame.line("model", curve(&channel.tau_s, &model.adev).into_iter().filter(|(t, _)| (from..=to).contains(t))))
        }
        @for term in MARKED { (marks(&frame, channels, term, by)) }
        (line_marks(&frame, channels, by))
        (legend(&frame, channels, &entries.iter().map(|(class, name, _)| (class.as_str(), name.as_str())).collect::<Vec<_>>()))
    };
    let names = [title.as_str(), "averaging time, s", &y_name];
    Chart::new(frame, names).drawn(&html! {}, &drawn)
}

/// Terms that the picture marks.
const MARKED: [Term; 3] = [Term::N, Term::B, Term::K];

/// Name of a channel with its coefficients, whose units are in the legend.
fn with_values(channel: &ChannelResult) -> String {
    let each = MARKED.into_iter().filter_map(|term| {
        let own = channel.get(term).ok()?;
        let value = significant(own.value * readable::noise(&own.unit)[0].factor);
        Some(format!("{} {value}", term.letter()))
    });
    let each: Vec<String> = each.collect();
    match each.is_empty() {
        true => channel.name.into(),
        false => format!("{}: {}", channel.name, each.join(", ")),
    }
}

/// A wedge whose tip is at a place, pixels.
fn wedge(x: f64, y: f64) -> Markup {
    html! { path class="ink" d={ "M" (px(x - 4.0)) " " (px(y - 7.0)) "L" (px(x)) " " (px(y)) "L" (px(x + 4.0)) " " (px(y - 7.0)) } {} }
}

/// Averaging time at which a sinusoid of frequency 1 increases an Allan deviation most: the maximum of `sin²(π τ)/(π τ)`.
const BENT_AT: f64 = 0.371;
/// Space for the label of a frequency: width and height, pixels.
const LABEL: (f64, f64) = (54.0, 14.0);
/// Distance of a letter's centre from the edge of the frame, pixels.
const EDGE: f64 = 10.0;

/// Marks where spectral lines affect the curves: a wedge at the highest curve, with the frequency above it. Lines that several channels share are
/// marked once.
fn line_marks(frame: &Frame, channels: &[&ChannelResult], by: f64) -> Markup {
    let mut marks: Vec<(f64, f64)> = Vec::new();
    for (channel, line) in channels
        .iter()
        .flat_map(|c| c.lines.iter().map(move |l| (c, l)))
    {
        let frequency = line.frequency_hz;
        let distance = |t: &f64| (t * frequency / BENT_AT).ln().abs();
        let each = channel.tau_s.iter().zip(&channel.adev);
        let nearest = each.min_by(|a, b| distance(a.0).total_cmp(&distance(b.0)));
        let high = nearest.map_or(0.0, |(_, deviation)| deviation * by);
        match marks
            .iter_mut()
            .find(|(f, _)| (*f / frequency).ln().abs() < 0.05)
        {
            Some((_, highest)) => *highest = highest.max(high),
            None => marks.push((frequency, high)),
        }
    }
    // From left to right along the falling curve: the highest frequency comes first.
    marks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let places = marks.iter().map(|(f, high)| (*f, BENT_AT / f, *high));
    let inside = places.filter(|(_, x, y)| frame.x.contains(x) && frame.y.contains(y));
    let mut labels: Vec<(f64, f64)> = Vec::new();
    let mut place = |(f, x, y): (f64, f64, f64)| {
        let (x, y) = (frame.at_x(x), frame.at_y(y) - 5.0);
        // Next to the wedge, but inside the frame, and below labels that are there.
        let left = (x + 6.0).min(frame.across.end - LABEL.0);
        let mut bottom = (y - 4.0).max(frame.down.start + LABEL.1);
        for (other, above) in &labels {
            if (left - other).abs() < LABEL.0 && (bottom - above).abs() < LABEL.1 {
                bottom = above + LABEL.1;
            }
        }
        labels.push((left, bottom));
        html! { (wedge(x, y)) text class="tick" x=(px(left)) y=(px(bottom)) { (significant(f)) " Hz" } }
    };
    html! { @for at in inside { (place(at)) } }
}

/// Marks a coefficient: a circle for each channel, and one letter above the highest circle; their values are in the legend.
fn marks(frame: &Frame, channels: &[&ChannelResult], term: Term, by: f64) -> Markup {
    let places = models(channels).filter_map(|(k, channel, model)| {
        let (t, deviation) = read_at(channel, model, term)?;
        Some((k, t, deviation * by))
    });
    let inside = places.filter(|(_, x, y)| frame.x.contains(x) && frame.y.contains(y));
    let marks: Vec<(usize, f64, f64)> = inside
        .map(|(k, x, y)| (k, frame.at_x(x), frame.at_y(y)))
        .collect();
    html! {
        @for (k, x, y) in &marks { circle class=(AXIS_CLASSES[*k]) cx=(px(*x)) cy=(px(*y)) r="4" {} }
        @if let Some((_, x, y)) = marks.iter().min_by(|a, b| a.2.total_cmp(&b.2)) {
            @let x = x.clamp(frame.across.start + EDGE, frame.across.end - EDGE);
            text x=(px(x)) y=(px((y - 9.0).max(frame.down.start + LABEL.1))) text-anchor="middle" { (term.letter()) }
        }
    }
}

/// The legend is at the upper right, where falling curves leave space: the curves, and what the marks mean.
fn legend(frame: &Frame, channels: &[&ChannelResult], curves: &[(&str, &str)]) -> Markup {
    let known = |term| channels.iter().find_map(|c| c.get(term).ok());
    let unit = |term: Term| {
        Some((
            term.letter(),
            readable::noise(&known(term)?.unit).remove(0).unit,
        ))
    };
    let units = MARKED
        .into_iter()
        .filter_map(unit)
        .map(|(letter, unit)| format!("{letter} in {unit}"));
    let units = units.collect::<Vec<_>>().join(", ");
    let mut key = curves.to_vec();
    if models(channels).next().is_some() {
        key.extend([
            ("model", "models"),
            ("mark", "N at 1 s, K at 3 s, B at its floor"),
            ("", &units),
        ]);
    }
    if channels.iter().any(|c| !c.lines.is_empty()) {
        key.push(("wedge", "lines of the spectrum"));
    }
    let letters = key.iter().map(|(_, name)| name.chars().count()).max();
    let width = 46.0 + 7.6 * letters.unwrap_or(0) as f64;
    let height = 10.0 + 18.0 * key.len() as f64;
    let (left, top) = (frame.across.end - 6.0 - width, frame.down.start + 6.0);
    html! {
        rect class="legend" x=(px(left)) y=(px(top)) width=(px(width)) height=(px(height)) {}
        @for (row, (class, name)) in key.iter().enumerate() {
            @let y = top + 14.0 + 18.0 * row as f64;
            @match *class {
                "mark" => circle class="ink" cx=(px(left + 20.0)) cy=(px(y)) r="4" {},
                "wedge" => (wedge(left + 20.0, y + 4.0)),
                "" => {},
                class => path class=(class) d={ "M" (px(left + 8.0)) " " (px(y)) "h24" } {},
            }
            text x=(px(left + 38.0)) y=(px(y + 5.0)) { (name) }
        }
    }
}

/// Range of positive values, extended by the factor `room`.
fn ends(values: impl Iterator<Item = f64>, room: f64) -> Range<f64> {
    let positive: Vec<f64> = values.filter(|v| v.is_finite() && *v > 0.0).collect();
    let low = positive.iter().copied().fold(f64::INFINITY, f64::min);
    let high = positive.iter().copied().fold(0.0, f64::max);
    if low < high {
        low / room..high * room
    } else {
        0.5..2.0
    }
}

/// Channels with a model, and their indices.
fn models<'a>(
    of: &'a [&ChannelResult],
) -> impl Iterator<Item = (usize, &'a ChannelResult, &'a ModelResult)> {
    let each = of.iter().enumerate();
    each.filter_map(|(k, c)| Some((k, *c, c.model.as_ref()?)))
}

/// Averaging time and deviation at which the plot marks a coefficient: N at 1 s, K at 3 s, and B where the model reaches its floor.
fn read_at(channel: &ChannelResult, model: &ModelResult, term: Term) -> Option<(f64, f64)> {
    let value = channel.get(term).ok()?.value;
    match term {
        Term::N => Some((1.0, value)),
        Term::K => Some((3.0, value)),
        Term::B => Some((
            channel.useful_average_s.unwrap_or(model.range_s[1]),
            value * FLOOR.sqrt(),
        )),
        Term::Q | Term::R => None,
    }
}
