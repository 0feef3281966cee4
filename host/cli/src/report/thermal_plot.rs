//! Curves over temperature as SVG: the change of each parameter from the middle of the range, with its band. Below them are the errors of the dwells:
//! during heating and cooling, over temperature, and over time.

use std::ops::Range;

use maud::{Markup, html};

use super::svg::{Frame, px, range};
use mimu::parameter::ParameterKind;
use mimu::quantity::{AXES, Sensor};
use mimu::readable;
use mimu_thermal::judge::{Bin, DwellError};
use mimu_thermal::result::{CurveResult, SensorResult, ThermalResult};

/// Width and height of one panel, pixels.
const PANEL: (f64, f64) = (400.0, 330.0);

/// Colours that colour-blind people can distinguish (Okabe and Ito), the same as for Allan curves.
const STYLE: &str = ".curves text{font:13px sans-serif;fill:#000;font-weight:400}.curves .tick{font-size:12px}\
.curves .name{font-size:13px}.curves .heading{font-size:15px}.curves path{fill:none;stroke-width:2}\
.curves .grid{stroke:#e1e1e1;stroke-width:1}.curves .zero{stroke:#888;stroke-width:1}\
.curves .a{stroke:#e69f00}.curves .b{stroke:#0072b2}.curves .c{stroke:#009e73}\
.curves .noise{stroke:#888;stroke-dasharray:2 3}.curves .band{stroke:none;opacity:.2}\
.curves .a.band{fill:#e69f00}.curves .b.band{fill:#0072b2}.curves .c.band{fill:#009e73}\
.curves .heating{stroke:#d55e00}.curves .cooling{stroke:#56b4e9}\
.curves .dot{stroke-width:4;stroke-linecap:round;opacity:.6}.curves .begin{stroke:#888;stroke-width:1;stroke-dasharray:4 3}";

/// Largest number of marks of an axis. If there are more dwells, neighbours are averaged.
const MARKS: usize = 200;

/// Classes of the three parameters of a kind.
const CLASSES: [&str; 3] = ["a", "b", "c"];

/// A panel: its description for screen readers, and the drawing.
type Drawn = (String, Markup);

/// For each sensor a row of curves and a row of errors; a single row if there are only biases.
fn rows(result: &ThermalResult) -> Vec<Vec<Drawn>> {
    let mut rows = Vec::new();
    for (sensor, found) in result.sensors.present() {
        let curves = ParameterKind::PHYSICAL.into_iter().filter_map(|kind| {
            let label = format!("{sensor}: {} over temperature", kind.words());
            Some((label, curves(result, sensor, kind)?))
        });
        let mut row: Vec<Drawn> = curves.collect();
        if !found.dwells.is_empty() {
            let label = |over: &str| format!("{sensor}: errors {over}");
            if row.len() > 1 {
                rows.push(std::mem::take(&mut row));
                row.push((
                    label("while heating and cooling"),
                    errors(result, sensor, found),
                ));
            }
            row.extend(dwells(result, sensor, found, label));
        }
        rows.push(row);
    }
    rows
}

/// All panels as one file.
pub fn svg(result: &ThermalResult) -> String {
    let rows = rows(result);
    let (width, height) = (
        PANEL.0 * ParameterKind::PHYSICAL.len() as f64,
        PANEL.1 * rows.len() as f64,
    );
    let drawn = html! {
        svg class="curves" xmlns="http://www.w3.org/2000/svg" width=(width) height=(height) viewBox={ "0 0 " (width) " " (height) } {
            style { (STYLE) }
            rect width=(width) height=(height) fill="#fff" {}
            @for (k, row) in rows.iter().enumerate() { @for (column, (_, drawn)) in row.iter().enumerate() {
                g transform={ "translate(" (PANEL.0 * column as f64) " " (PANEL.1 * k as f64) ")" } { (drawn) }
            } }
        }
    };
    drawn.into_string() + "\n"
}

/// The same panels separately, in the colours of the page.
pub fn panels(result: &ThermalResult) -> Markup {
    html! { @for (label, drawn) in rows(result).iter().flatten() { (panel(label, drawn)) } }
}

/// One panel in the colours of the page; `label` describes it for screen readers.
pub(super) fn panel(label: &str, drawn: &Markup) -> Markup {
    html! { svg class="curves" role="img" aria-label=(label) viewBox={ "0 0 " (PANEL.0) " " (PANEL.1) } xmlns="http://www.w3.org/2000/svg" { (drawn) } }
}

/// Axes with their names and a legend, around what is `inside`.
fn framed(
    heading: &str,
    [x_name, y_name]: [&str; 2],
    x: Range<f64>,
    y: Range<f64>,
    key: &[(&str, &str)],
    inside: impl Fn(&Frame) -> Markup,
) -> Markup {
    let frame = Frame {
        across: 78.0..PANEL.0 - 12.0,
        down: 34.0..PANEL.1 - 46.0,
        x,
        y,
    };
    html! { (frame.axes(heading, true)) (inside(&frame)) (frame.x_name(x_name, &frame)) (frame.y_name(y_name)) (frame.legend(key)) }
}

/// A point of a curve: the change from the middle of the range.
pub(super) struct Point {
    /// Temperature, °C.
    pub temp_c: f64,
    /// Change.
    pub value: f64,
    /// Bounds of its 95 % interval, if known.
    pub interval: Option<[f64; 2]>,
}

/// Changes of one kind of parameter over the range of temperatures: its heading, its unit, and name and curve of each axis, with their bands.
pub(super) fn changes(
    heading: &str,
    unit: &str,
    [from, to]: [f64; 2],
    curves: &[(String, Vec<Point>)],
) -> Markup {
    let ends = |p: &Point| p.interval.unwrap_or([p.value; 2]);
    let y = range(curves.iter().flat_map(|(_, points)| points).flat_map(ends));
    let each = || CLASSES.into_iter().zip(curves);
    let key: Vec<(&str, &str)> = each()
        .map(|(class, (axis, _))| (class, axis.as_str()))
        .collect();
    let names = ["die, °C", &format!("change from the middle, {unit}")];
    framed(heading, names, from..to, y, &key, |frame| {
        html! { @for (class, (_, points)) in each() {
            @let band: Vec<_> = points.iter().filter_map(|p| p.interval.map(|[low, high]| (p.temp_c, low, high))).collect();
            @if !band.is_empty() { (frame.band(&format!("{class} band"), &band)) }
            (frame.line(class, points.iter().map(|p| (p.temp_c, p.value))))
        } }
    })
}

/// Curves of one kind of parameter of a sensor, if it has them.
fn curves(result: &ThermalResult, sensor: Sensor, kind: ParameterKind) -> Option<Markup> {
    // In recordings with one pose the accelerometer's bias includes gravity.
    let ours = |of: ParameterKind| {
        of == kind || (of == ParameterKind::BiasAndGravity && kind == ParameterKind::Bias)
    };
    let found = result
        .curves
        .iter()
        .filter(|c| c.sensor == sensor && ours(c.of.0));
    let found: Vec<&CurveResult> = found.collect();
    let first = found.first()?;
    // Scale factors are shown as relative changes.
    let relative = kind == ParameterKind::Scale;
    let unit = readable::parameter(&first.unit);
    let curve = |curve: &&CurveResult| {
        let middle = curve.value[curve.value.len() / 2];
        let by = if relative { 1e6 / middle } else { unit.factor };
        let points = (0..curve.temp_c.len()).map(|k| {
            let [value, low, high] =
                [curve.value[k], curve.lower[k], curve.upper[k]].map(|v| (v - middle) * by);
            Point {
                temp_c: curve.temp_c[k],
                value,
                interval: Some([low, high]),
            }
        });
        (curve.of.axis(), points.collect())
    };
    let all: Vec<_> = found.iter().map(curve).collect();
    let unit = if relative { "ppm" } else { &unit.unit };
    Some(changes(
        &format!("{sensor} {}", first.of.0.words()),
        unit,
        result.range_c,
        &all,
    ))
}

/// Errors of dwells by temperature, separately for heating and cooling.
fn errors(result: &ThermalResult, sensor: Sensor, found: &SensorResult) -> Markup {
    let unit = readable::error(&found.unit);
    let [from, to] = result.range_c;
    let points = |of: fn(&Bin) -> Option<f64>| -> Vec<(f64, f64)> {
        // In the middle of the temperatures that the dies had in a bin.
        let point = |b: &Bin| {
            Some((
                0.5 * (b.from_c.max(from) + b.to_c.min(to)),
                of(b)? * unit.factor,
            ))
        };
        found.bins.iter().filter_map(point).collect()
    };
    let lines = [
        ("heating", points(|b| b.heating)),
        ("cooling", points(|b| b.cooling)),
        ("noise", points(|b| Some(b.noise_floor))),
    ];
    let y = range(
        lines
            .iter()
            .flat_map(|l| l.1.iter().map(|p| p.1))
            .chain([0.0]),
    );
    let key = ["heating", "cooling", "noise"].map(|name| (name, name));
    let names = [
        "die, °C",
        &format!("rms over {}, {}", found.judged_by, unit.unit),
    ];
    framed(
        &format!("{sensor} error"),
        names,
        from..to,
        y,
        &key,
        |frame| {
            html! { @for (class, points) in &lines { (frame.line(class, points.iter().copied())) } }
        },
    )
}

/// Mean of neighbouring dwells in the shown unit: hours since the beginning of the first recording, temperature of the die, errors.
struct Mark {
    hours: f64,
    die_c: f64,
    error: [f64; 3],
}

/// Errors of the dwells of each axis, over temperature and over time.
fn dwells(
    result: &ThermalResult,
    sensor: Sensor,
    found: &SensorResult,
    label: impl Fn(&str) -> String,
) -> [Drawn; 2] {
    let unit = readable::error(&found.unit);
    let each = found.dwells.len().div_ceil(MARKS).max(1);
    let (mut marks, mut begins, mut start) = (Vec::new(), Vec::new(), 0.0);
    for recording in found.dwells.chunk_by(|a, b| a.recording == b.recording) {
        if recording[0].recording > 0 {
            begins.push(start);
        }
        for dwells in recording.chunks(each) {
            let mean = |of: &dyn Fn(&DwellError) -> f64| {
                dwells.iter().map(of).sum::<f64>() / dwells.len() as f64
            };
            marks.push(Mark {
                hours: start + mean(&|d| d.middle_s) / 3600.0,
                die_c: mean(&|d| d.die_c),
                error: [0, 1, 2].map(|k| unit.factor * mean(&|d| d.error[k])),
            });
        }
        start += recording[recording.len() - 1].middle_s / 3600.0;
    }
    let y_name = match each {
        1 => format!("error, {}", unit.unit),
        n => format!("error, means of {n}, {}", unit.unit),
    };
    let key: Vec<(&str, &str)> = CLASSES.into_iter().zip(AXES).collect();
    let y = range(marks.iter().flat_map(|m| m.error));
    let drawn = |heading: String,
                 x_name: &str,
                 x: Range<f64>,
                 begins: &[f64],
                 at: fn(&Mark) -> f64| {
        framed(&heading, [x_name, &y_name], x, y.clone(), &key, |frame| {
            html! {
                @for hours in begins { path class="begin" d={ "M" (px(frame.at_x(*hours))) " " (px(frame.down.start)) "V" (px(frame.down.end)) } {} }
                @for (axis, class) in CLASSES.iter().enumerate() { (frame.dots(&format!("{class} dot"), marks.iter().map(|m| (at(m), m.error[axis])))) }
            }
        })
    };
    let [from, to] = result.range_c;
    let hours = range(marks.iter().map(|m| m.hours));
    [
        (
            label("over temperature"),
            drawn(format!("{sensor} error"), "die, °C", from..to, &[], |m| {
                m.die_c
            }),
        ),
        (
            label("over time"),
            drawn(
                format!("{sensor} error over time"),
                "time, h",
                hours,
                &begins,
                |m| m.hours,
            ),
        ),
    ]
}
