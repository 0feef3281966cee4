//! Curves over temperature as SVG: the change of each parameter from the middle of the range, with its band. Below them are the errors of the dwells:
//! during heating and cooling, over temperature, and over time.

use std::ops::Range;

use maud::{Markup, html};

use super::svg::{AXIS_CLASSES, Chart, Panel, px, range};
use mimu::{AXES, ParameterKind, Sensor, readable};
use mimu_thermal::judge::{Bin, DwellError};
use mimu_thermal::result::{CurveResult, SensorResult, ThermalResult};

/// A panel: three stand side by side.
const PANEL: Panel = Panel {
    size: (400.0, 330.0),
    room: [78.0, 12.0, 34.0, 46.0],
};

/// Largest number of marks of an axis. If there are more dwells, neighbours are averaged.
const MARKS: usize = 200;

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
            let labels = ["over temperature", "over time"].map(label);
            row.extend(labels.into_iter().zip(dwells(result, sensor, found)));
        }
        rows.push(row);
    }
    rows
}

/// All panels as one file.
pub fn svg(result: &ThermalResult) -> String {
    let drawn = |row: Vec<Drawn>| row.into_iter().map(|(_, drawn)| drawn).collect();
    PANEL.file(&rows(result).into_iter().map(drawn).collect::<Vec<_>>())
}

/// The same panels separately, in the colours of the page.
pub fn panels(result: &ThermalResult) -> Markup {
    html! { @for (label, drawn) in rows(result).iter().flatten() { (panel(label, drawn)) } }
}

/// One panel in the colours of the page; `label` describes it for screen readers.
pub(super) fn panel(label: &str, drawn: &Markup) -> Markup {
    PANEL.drawing(label, None, drawn)
}

/// A point of a curve: temperature, °C, change from the middle of the range, and bounds of its 95 % interval, if known.
pub(super) type Point = (f64, f64, Option<[f64; 2]>);

/// Changes of one kind of parameter in a range of temperatures, with name and curve of each axis.
pub(super) fn changes(
    heading: &str,
    unit: &str,
    range_c: [f64; 2],
    curves: &[(String, Vec<Point>)],
) -> Markup {
    let values = curves.iter().flat_map(|(_, points)| points);
    let y = range(values.flat_map(|(_, value, ends)| ends.unwrap_or([*value; 2])));
    let each = || AXIS_CLASSES.into_iter().zip(curves);
    let y_name = format!("change from the middle, {unit}");
    let chart = Chart::new(
        PANEL.frame(range_c[0]..range_c[1], y),
        [heading, "die, °C", &y_name],
    )
    .keyed(each().map(|(class, (axis, _))| (class, axis.as_str())));
    let frame = &chart.frame;
    chart.drawn(&html! {}, &html! { @for (class, (_, points)) in each() {
        @let band: Vec<_> = points.iter().filter_map(|(t, _, ends)| ends.map(|[low, high]| (*t, low, high))).collect();
        @if !band.is_empty() { (frame.band(&format!("{class} band"), &band)) }
        (frame.line(class, points.iter().map(|(t, value, _)| (*t, *value))))
    } })
}

/// Curves of one kind of parameter of a sensor, if it has them.
fn curves(result: &ThermalResult, sensor: Sensor, kind: ParameterKind) -> Option<Markup> {
    // In recordings with one pose the accelerometer's bias includes gravity.
    let with_gravity = ParameterKind::BiasAndGravity;
    let ours = |of: ParameterKind| of == kind || of == with_gravity && kind == ParameterKind::Bias;
    let found = result.curves.iter();
    let found: Vec<&CurveResult> = found
        .filter(|c| c.sensor == sensor && ours(c.of.0))
        .collect();
    let first = found.first()?;
    // Scale factors are shown as relative changes.
    let relative = kind == ParameterKind::Scale;
    let unit = readable::parameter(&first.unit);
    let curve = |curve: &&CurveResult| {
        let middle = curve.value[curve.value.len() / 2];
        let by = if relative { 1e6 / middle } else { unit.factor };
        let change = |values: &[f64], k: usize| (values[k] - middle) * by;
        let ends = |k: usize| [change(&curve.lower, k), change(&curve.upper, k)];
        let points = curve.temp_c.iter().enumerate();
        let points = points.map(|(k, t)| (*t, change(&curve.value, k), Some(ends(k))));
        (curve.of.axis(), points.collect())
    };
    let all: Vec<_> = found.iter().map(curve).collect();
    let heading = format!("{sensor} {}", first.of.0.words());
    let unit = if relative { "ppm" } else { &unit.unit };
    Some(changes(&heading, unit, result.range_c, &all))
}

/// Errors of dwells by temperature, separately for heating and cooling.
fn errors(result: &ThermalResult, sensor: Sensor, found: &SensorResult) -> Markup {
    let unit = readable::error(&found.unit);
    let [from, to] = result.range_c;
    // In the middle of the temperatures that the dies had in a bin.
    let middle = |b: &Bin| 0.5 * (b.from_c.max(from) + b.to_c.min(to));
    let points = |of: fn(&Bin) -> Option<f64>| -> Vec<(f64, f64)> {
        let point = |b: &Bin| Some((middle(b), of(b)? * unit.factor));
        found.bins.iter().filter_map(point).collect()
    };
    let (heating, cooling) = (points(|b| b.heating), points(|b| b.cooling));
    let lines = [
        ("heating", heating),
        ("cooling", cooling),
        ("noise", points(|b| Some(b.noise_floor))),
    ];
    let all = lines.iter().flat_map(|l| l.1.iter().map(|p| p.1));
    let frame = PANEL.frame(from..to, range(all.chain([0.0])));
    let inside =
        html! { @for (class, points) in &lines { (frame.line(class, points.iter().copied())) } };
    let y_name = format!("rms over {}, {}", found.judged_by, unit.unit);
    let key = lines.each_ref().map(|(name, _)| (*name, *name));
    let names = [&format!("{sensor} error"), "die, °C", &y_name];
    Chart::new(frame, names)
        .keyed(key)
        .drawn(&html! {}, &inside)
}

/// Mean of neighbouring dwells: hours since the beginning of the first recording, temperature of the die, and errors in the shown unit.
type Mark = ([f64; 2], [f64; 3]);

/// Errors of the dwells of each axis, over temperature and over time.
fn dwells(result: &ThermalResult, sensor: Sensor, found: &SensorResult) -> [Markup; 2] {
    let unit = readable::error(&found.unit);
    let each = found.dwells.len().div_ceil(MARKS).max(1);
    let (mut marks, mut begins, mut start): (Vec<Mark>, _, _) = (Vec::new(), Vec::new(), 0.0);
    for recording in found.dwells.chunk_by(|a, b| a.recording == b.recording) {
        begins.extend((recording[0].recording > 0).then_some(start));
        for few in recording.chunks(each) {
            let sum = |of: &dyn Fn(&DwellError) -> f64| few.iter().map(of).sum::<f64>();
            let mean = |of: &dyn Fn(&DwellError) -> f64| sum(of) / few.len() as f64;
            let errors = [0, 1, 2].map(|k| unit.factor * mean(&|d| d.error[k]));
            marks.push((
                [start + mean(&|d| d.middle_s) / 3600.0, mean(&|d| d.die_c)],
                errors,
            ));
        }
        start += recording[recording.len() - 1].middle_s / 3600.0;
    }
    let means = if each > 1 {
        format!("means of {each}, ")
    } else {
        String::new()
    };
    let y_name = format!("error, {means}{}", unit.unit);
    let y = range(marks.iter().flat_map(|m| m.1));
    let drawn = |at: usize, x: Range<f64>, heading: String, x_name: &str| {
        let names = [heading.as_str(), x_name, &y_name];
        let chart =
            Chart::new(PANEL.frame(x, y.clone()), names).keyed(AXIS_CLASSES.into_iter().zip(AXES));
        let frame = &chart.frame;
        chart.drawn(&html! {}, &html! {
            @if at == 0 { @for hours in &begins { path class="begin" d={ "M" (px(frame.at_x(*hours))) " " (px(frame.down.start)) "V" (px(frame.down.end)) } {} } }
            @for (axis, class) in AXIS_CLASSES.iter().enumerate() { (frame.dots(&format!("{class} dot"), marks.iter().map(|m| (m.0[at], m.1[axis])))) }
        })
    };
    let [from, to] = result.range_c;
    let hours = range(marks.iter().map(|m| m.0[0]));
    let over_time = format!("{sensor} error over time");
    [
        drawn(1, from..to, format!("{sensor} error"), "die, °C"),
        drawn(0, hours, over_time, "time, h"),
    ]
}
