//! Allan curves as SVG: gyros and accelerometers side by side, with bounds as bands, fitted models and coefficients.

use std::ops::Range;

use maud::{Markup, html};

use super::svg::{Frame, decades, px};
use mimu::quantity::{Sensor, significant};
use mimu::readable;
use mimu::result::allan::{AllanResult, ChannelResult, ModelResult};
use mimu_allan::model::{FLOOR, Term};

/// Width and height of one panel, pixels.
const PANEL: (f64, f64) = (640.0, 520.0);

/// Colours that colour-blind people can distinguish (Okabe and Ito).
const STYLE: &str = "text{font:14px sans-serif;fill:#000}.tick{font-size:13px}.name{font-size:15px}.heading{font-size:18px}\
path{fill:none;stroke-width:2}.grid{stroke:#e1e1e1;stroke-width:1}.axis{stroke:#000;stroke-width:1}\
.x{stroke:#e69f00}.y{stroke:#0072b2}.z{stroke:#009e73}\
.band{stroke:none;opacity:.2}.x.band{fill:#e69f00}.y.band{fill:#0072b2}.z.band{fill:#009e73}\
.hadamard{stroke-dasharray:7 4}.quiet{stroke-width:1.5;stroke-dasharray:3 3}.line{stroke:#000;stroke-width:1}.model{stroke:#000;stroke-width:1;stroke-dasharray:2 3}\
circle{fill:#fff;stroke-width:2}.key{fill:#fff;opacity:.85;stroke:#c8c8c8}";

/// Classes of the channels in [`STYLE`].
const CLASSES: [&str; 3] = ["x", "y", "z"];

/// The curves of a single recording as SVG.
pub fn svg(result: &AllanResult) -> String {
    let drawn = |c: &&ChannelResult| !c.tau_s.is_empty();
    let of = |sensor: Sensor| {
        let ours = result.channels.iter().filter(drawn);
        ours.filter(move |c| c.sensor == sensor)
    };
    let panels: Vec<(Sensor, Vec<&ChannelResult>)> = Sensor::BOTH
        .into_iter()
        .map(|sensor| (sensor, of(sensor).collect()))
        .filter(|(_, channels): &(_, Vec<_>)| !channels.is_empty())
        .collect();
    let (width, height) = (PANEL.0 * panels.len() as f64, PANEL.1);
    let drawn = html! {
        svg xmlns="http://www.w3.org/2000/svg" width=(width) height=(height) viewBox={ "0 0 " (width) " " (height) } {
            style { (STYLE) }
            rect width=(width) height=(height) fill="#fff" {}
            @for (k, (sensor, channels)) in panels.iter().enumerate() {
                g transform={ "translate(" (PANEL.0 * k as f64) ")" } { (panel(result, *sensor, channels)) }
            }
        }
    };
    drawn.into_string() + "\n"
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
    let frame = Frame {
        across: 92.0..PANEL.0 - 14.0,
        down: 44.0..PANEL.1 - 60.0,
        x: x.start.log10()..x.end.log10(),
        y: y.start.log10()..y.end.log10(),
    };
    let title = match sensor {
        Sensor::Gyro => "Gyros",
        Sensor::Accel => "Accelerometers",
    };
    let title = format!(
        "{title} of {}",
        result.device.as_deref().unwrap_or_default()
    );
    let kind = result.kind.unwrap_or_default();
    let point = |t: f64, deviation: f64| {
        let inside = (deviation * by).clamp(y.start, y.end);
        (t.log10(), inside.log10())
    };
    let curve = |tau_s: &[f64], deviation: &[f64]| -> Vec<(f64, f64)> {
        let each = tau_s.iter().zip(deviation);
        each.map(|(t, d)| point(*t, *d)).collect()
    };
    let line = |class: &str, points: Vec<(f64, f64)>| frame.line(class, points.into_iter());
    // Line style and name of each legend entry.
    let mut key: Vec<(String, String)> = Vec::new();
    let mut curves: Vec<Markup> = Vec::new();
    for (class, channel) in CLASSES.iter().zip(channels) {
        curves.push(line(class, curve(&channel.tau_s, &channel.adev)));
        key.push(((*class).into(), with_values(channel)));
        if let Some(quiet) = &channel.adev_without_lines {
            let class = format!("{class} quiet");
            curves.push(line(&class, curve(&channel.tau_s, quiet)));
            key.push((class, format!("{}, lines removed", channel.name)));
        }
        if let Some(hadamard) = &channel.hadamard {
            let class = format!("{class} hadamard");
            curves.push(line(&class, curve(&hadamard.tau_s, &hadamard.hdev)));
            key.push((class, format!("{}, Hadamard", channel.name)));
        }
    }
    for (_, channel, model) in models(channels) {
        let [from, to] = model.range_s.map(f64::log10);
        let mut points = curve(&channel.tau_s, &model.adev);
        points.retain(|(t, _)| (from..=to).contains(t));
        curves.push(line("model", points));
    }
    if models(channels).next().is_some() {
        key.push(("model".into(), "models".into()));
        key.push((MARK.into(), "N at 1 s, K at 3 s, B at its floor".into()));
        key.push((UNITS.into(), units(channels)));
    }
    if channels.iter().any(|c| !c.lines.is_empty()) {
        key.push((WEDGE.into(), "lines of the spectrum".into()));
    }
    html! {
        (frame.grid(&title, &decades(&x), &decades(&y), true))
        path class="axis" d={ "M" (px(frame.across.start)) " " (px(frame.down.start)) "V" (px(frame.down.end)) "H" (px(frame.across.end)) } {}
        (frame.x_name("averaging time, s", &frame))
        (frame.y_name(&format!("{kind} deviation, {}", usual.unit)))
        @for (class, channel) in CLASSES.iter().zip(channels) {
            @let high = curve(&channel.tau_s, &channel.upper);
            @let low = curve(&channel.tau_s, &channel.lower);
            (line(&format!("{class} band"), high.into_iter().chain(low.into_iter().rev()).collect()))
        }
        @for curve in &curves { (curve) }
        @for term in [Term::N, Term::B, Term::K] { (marks(&frame, channels, term, by)) }
        (line_marks(&frame, channels, by))
        (legend(&frame, &key))
    }
}

/// Entries of the legend that are no lines.
const MARK: &str = "mark";
const WEDGE: &str = "wedge";
const UNITS: &str = "units";

/// Terms that the picture marks.
const MARKED: [Term; 3] = [Term::N, Term::B, Term::K];

/// Name of a channel with its coefficients in [`units`].
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

/// Units of the coefficients of `channels`.
fn units(channels: &[&ChannelResult]) -> String {
    let each = MARKED.into_iter().filter_map(|term| {
        let own = channels.iter().find_map(|c| c.get(term).ok())?;
        Some(format!(
            "{} in {}",
            term.letter(),
            readable::noise(&own.unit)[0].unit
        ))
    });
    each.collect::<Vec<_>>().join(", ")
}

/// A wedge whose tip is at a place, pixels.
fn wedge(x: f64, y: f64) -> Markup {
    html! { path class="line" d={ "M" (px(x - 4.0)) " " (px(y - 7.0)) "L" (px(x)) " " (px(y)) "L" (px(x + 4.0)) " " (px(y - 7.0)) } {} }
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
    for channel in channels {
        for line in &channel.lines {
            let t = BENT_AT / line.frequency_hz;
            let near = |(a, b): (&f64, &f64)| ((a / t).ln().abs(), b * by);
            let each = channel.tau_s.iter().zip(&channel.adev).map(near);
            let Some((_, deviation)) = each.min_by(|a, b| a.0.total_cmp(&b.0)) else {
                continue;
            };
            match marks
                .iter_mut()
                .find(|(f, _)| (f / line.frequency_hz).ln().abs() < 0.05)
            {
                Some((_, high)) => *high = high.max(deviation),
                None => marks.push((line.frequency_hz, deviation)),
            }
        }
    }
    // From left to right along the falling curve: the highest frequency comes first.
    marks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut labels: Vec<(f64, f64)> = Vec::new();
    let mut place = |(f, deviation): &(f64, f64)| {
        let (x, y) = ((BENT_AT / f).log10(), deviation.log10());
        let inside = frame.x.contains(&x) && frame.y.contains(&y);
        inside.then(|| {
            let (x, y) = (frame.at_x(x), frame.at_y(y) - 5.0);
            // Next to the wedge, but inside the frame.
            let left = (x + 6.0).min(frame.across.end - LABEL.0);
            let mut bottom = (y - 4.0).max(frame.down.start + LABEL.1);
            for (other, above) in &labels {
                if (left - other).abs() < LABEL.0 && (bottom - above).abs() < LABEL.1 {
                    bottom = above + LABEL.1;
                }
            }
            labels.push((left, bottom));
            (*f, [x, y], [left, bottom])
        })
    };
    let places: Vec<_> = marks.iter().filter_map(&mut place).collect();
    html! {
        @for (f, [x, y], [left, bottom]) in places {
            (wedge(x, y))
            text class="tick" x=(px(left)) y=(px(bottom)) { (significant(f)) " Hz" }
        }
    }
}

/// Marks a coefficient: a circle for each channel, and one letter above the highest circle; their values are in the legend.
fn marks(frame: &Frame, channels: &[&ChannelResult], term: Term, by: f64) -> Markup {
    let marks: Vec<(usize, f64, f64)> = models(channels)
        .filter_map(|(k, channel, model)| Some((k, read_at(channel, model, term)?)))
        .map(|(k, (t, deviation))| (k, t.log10(), (deviation * by).log10()))
        .filter(|(_, x, y)| frame.x.contains(x) && frame.y.contains(y))
        .map(|(k, x, y)| (k, frame.at_x(x), frame.at_y(y)))
        .collect();
    html! {
        @for (k, x, y) in &marks { circle class=(CLASSES[*k]) cx=(px(*x)) cy=(px(*y)) r="4" {} }
        @if let Some((_, x, y)) = marks.iter().min_by(|a, b| a.2.total_cmp(&b.2)) {
            @let x = x.clamp(frame.across.start + EDGE, frame.across.end - EDGE);
            text x=(px(x)) y=(px((y - 9.0).max(frame.down.start + LABEL.1))) text-anchor="middle" { (term.letter()) }
        }
    }
}

/// The legend is at the upper right, where falling curves leave space.
fn legend(frame: &Frame, key: &[(String, String)]) -> Markup {
    let letters = key.iter().map(|(_, name)| name.chars().count()).max();
    let (width, height) = (
        46.0 + 7.6 * letters.unwrap_or(0) as f64,
        10.0 + 18.0 * key.len() as f64,
    );
    let (left, top) = (frame.across.end - 6.0 - width, frame.down.start + 6.0);
    html! {
        rect class="key" x=(px(left)) y=(px(top)) width=(px(width)) height=(px(height)) {}
        @for (row, (class, name)) in key.iter().enumerate() {
            @let y = top + 14.0 + 18.0 * row as f64;
            @match class.as_str() {
                MARK => circle class="line" cx=(px(left + 20.0)) cy=(px(y)) r="4" {},
                WEDGE => (wedge(left + 20.0, y + 4.0)),
                UNITS => {},
                _ => path class=(class) d={ "M" (px(left + 8.0)) " " (px(y)) "h24" } {},
            }
            text x=(px(left + 38.0)) y=(px(y + 5.0)) { (name) }
        }
    }
}

/// Range of positive values, extended by the factor `room`.
fn ends(values: impl Iterator<Item = f64>, room: f64) -> Range<f64> {
    let (low, high) = values
        .filter(|v| v.is_finite() && *v > 0.0)
        .fold((f64::INFINITY, 0.0f64), |(low, high), v| {
            (low.min(v), high.max(v))
        });
    match low < high {
        true => low / room..high * room,
        false => 0.5..2.0,
    }
}

/// Channels with a model, and their indices.
fn models<'a>(
    channels: &'a [&'a ChannelResult],
) -> impl Iterator<Item = (usize, &'a ChannelResult, &'a ModelResult)> {
    let with_model = |(k, c): (usize, &&'a ChannelResult)| Some((k, *c, c.model.as_ref()?));
    channels.iter().enumerate().filter_map(with_model)
}

/// Averaging time and deviation at which the plot marks a coefficient: N at 1 s, K at 3 s, and B where the model reaches its floor.
fn read_at(channel: &ChannelResult, model: &ModelResult, term: Term) -> Option<(f64, f64)> {
    let value = channel.get(term).ok()?.value;
    match term {
        Term::N => Some((1.0, value)),
        Term::K => Some((3.0, value)),
        Term::B => {
            let floor_s = channel.useful_average_s.unwrap_or(model.range_s[1]);
            Some((floor_s, value * FLOOR.sqrt()))
        }
        Term::Q | Term::R => None,
    }
}
