//! Curves over temperature as SVG: the change of each parameter from the middle of the range, with its band. Below them are the errors of the dwells:
//! during heating and cooling, over temperature, and over time.

use std::ops::Range;

use maud::{Markup, html};

use super::svg::{Frame, px, range};
use mimu::parameter::ParameterKind;
use mimu::quantity::{AXES, Sensor};
use mimu::readable;
use mimu_thermal::judge::DwellError;
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
struct Drawn(String, Markup);

/// For each sensor a row of curves and a row of errors; a single row if there are only biases.
fn rows(result: &ThermalResult) -> Vec<Vec<Drawn>> {
    let mut rows = Vec::new();
    for (sensor, found) in result.sensors.present() {
        let kinds = ParameterKind::PHYSICAL.into_iter();
        let of_curves = kinds.filter_map(|kind| {
            let label = format!("{sensor}: {} over temperature", kind.words());
            Some(Drawn(label, curves(result, sensor, kind)?))
        });
        let mut row: Vec<Drawn> = of_curves.collect();
        if !found.dwells.is_empty() {
            let label = |over: &str| format!("{sensor}: errors {over}");
            if row.len() > 1 {
                rows.push(std::mem::take(&mut row));
                let drawn = errors(result, sensor, found);
                row.push(Drawn(label("while heating and cooling"), drawn));
            }
            let drawn = by_temperature(result, sensor, found);
            row.push(Drawn(label("over temperature"), drawn));
            row.push(Drawn(label("over time"), by_time(sensor, found)));
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
    let mut placed: Vec<(f64, f64, &Markup)> = Vec::new();
    for (k, row) in rows.iter().enumerate() {
        for (column, Drawn(_, drawn)) in row.iter().enumerate() {
            placed.push((PANEL.0 * column as f64, PANEL.1 * k as f64, drawn));
        }
    }
    let drawn = html! {
        svg class="curves" xmlns="http://www.w3.org/2000/svg" width=(width) height=(height) viewBox={ "0 0 " (width) " " (height) } {
            style { (STYLE) }
            rect width=(width) height=(height) fill="#fff" {}
            @for (x, y, drawn) in &placed {
                g transform={ "translate(" (x) " " (y) ")" } { (drawn) }
            }
        }
    };
    drawn.into_string() + "\n"
}

/// The same panels separately, in the colours of the page.
pub fn panels(result: &ThermalResult) -> Markup {
    html! {
        @for Drawn(label, drawn) in rows(result).iter().flatten() { (panel(label, drawn)) }
    }
}

/// One panel in the colours of the page; `label` describes it for screen readers.
pub(super) fn panel(label: &str, drawn: &Markup) -> Markup {
    html! {
        svg class="curves" role="img" aria-label=(label) viewBox={ "0 0 " (PANEL.0) " " (PANEL.1) }
            xmlns="http://www.w3.org/2000/svg" { (drawn) }
    }
}

fn frame([from, to]: [f64; 2], y: Range<f64>) -> Frame {
    Frame {
        across: 78.0..PANEL.0 - 12.0,
        down: 34.0..PANEL.1 - 46.0,
        x: from..to,
        y,
    }
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

/// Curves of one kind of parameter of a sensor, for each axis, with their bands.
pub(super) struct Changes {
    /// Names of sensor and kind.
    pub heading: String,
    /// Unit of the changes.
    pub unit: String,
    /// Range of the abscissa, °C.
    pub range_c: [f64; 2],
    /// Name and curve of each axis.
    pub curves: Vec<(String, Vec<Point>)>,
}

impl Changes {
    pub(super) fn draw(&self) -> Markup {
        let ends = |p: &Point| p.interval.unwrap_or([p.value; 2]);
        let all = self.curves.iter().flat_map(|(_, points)| points);
        let frame = frame(self.range_c, range(all.flat_map(ends)));
        let key: Vec<(&str, &str)> = CLASSES
            .iter()
            .zip(&self.curves)
            .map(|(class, (axis, _))| (*class, axis.as_str()))
            .collect();
        html! {
            (frame.axes(&self.heading, true))
            @for (class, (_, points)) in CLASSES.iter().zip(&self.curves) {
                @let band: Vec<_> = points.iter().filter_map(|p| p.interval.map(|[low, high]| (p.temp_c, low, high))).collect();
                @if !band.is_empty() { (frame.band(&format!("{class} band"), &band)) }
                (frame.line(class, points.iter().map(|p| (p.temp_c, p.value))))
            }
            (frame.x_name("die, °C", &frame))
            (frame.y_name(&format!("change from the middle, {}", self.unit)))
            (frame.legend(&key))
        }
    }
}

/// Curves of one kind of parameter of a sensor, if it has them.
fn curves(result: &ThermalResult, sensor: Sensor, kind: ParameterKind) -> Option<Markup> {
    // In recordings with one pose the accelerometer's bias includes gravity.
    let ours = |of: ParameterKind| {
        of == kind || (of == ParameterKind::BiasAndGravity && kind == ParameterKind::Bias)
    };
    let found = result.curves.iter().filter(|c| c.sensor == sensor);
    let found: Vec<&CurveResult> = found.filter(|c| ours(c.of.0)).collect();
    let first = found.first()?;
    // Scale factors are shown as relative changes.
    let relative = kind == ParameterKind::Scale;
    let unit = readable::parameter(&first.unit);
    let curves = found
        .iter()
        .map(|curve| {
            let middle = curve.value[curve.value.len() / 2];
            let by = match relative {
                true => 1e6 / middle,
                false => unit.factor,
            };
            let change = |v: f64| (v - middle) * by;
            let points = (0..curve.temp_c.len()).map(|k| Point {
                temp_c: curve.temp_c[k],
                value: change(curve.value[k]),
                interval: Some([curve.lower[k], curve.upper[k]].map(change)),
            });
            (curve.of.axis(), points.collect())
        })
        .collect();
    let changes = Changes {
        heading: format!("{sensor} {}", first.of.0.words()),
        unit: match relative {
            true => "ppm".into(),
            false => unit.unit.to_string(),
        },
        range_c: result.range_c,
        curves,
    };
    Some(changes.draw())
}

/// Errors of dwells by temperature, separately for heating and cooling.
fn errors(result: &ThermalResult, sensor: Sensor, found: &SensorResult) -> Markup {
    let unit = readable::error(&found.unit);
    let points = |of: fn(&mimu_thermal::judge::Bin) -> Option<f64>| -> Vec<(f64, f64)> {
        let each = found.bins.iter();
        let [from, to] = result.range_c;
        each.filter_map(|b| {
            // The middle of the temperatures that the dies had in this bin.
            let middle = 0.5 * (b.from_c.max(from) + b.to_c.min(to));
            Some((middle, of(b)? * unit.factor))
        })
        .collect()
    };
    let lines = [
        ("heating", points(|b| b.heating)),
        ("cooling", points(|b| b.cooling)),
        ("noise", points(|b| Some(b.noise_floor))),
    ];
    let highest = lines.iter().flat_map(|l| l.1.iter().map(|p| p.1));
    let frame = frame(result.range_c, range(highest.chain([0.0])));
    let key = ["heating", "cooling", "noise"].map(|name| (name, name));
    html! {
        (frame.axes(&format!("{} error", sensor.name()), true))
        @for (class, points) in &lines { (frame.line(class, points.iter().copied())) }
        (frame.x_name("die, °C", &frame))
        (frame.y_name(&format!("rms over {}, {}", found.judged_by, unit.unit)))
        (frame.legend(&key))
    }
}

/// Mean of neighbouring dwells in the shown unit: hours since the beginning of the first recording, temperature of the die, errors.
struct Mark {
    hours: f64,
    die_c: f64,
    error: [f64; 3],
}

/// All marks of a sensor.
struct Marks {
    all: Vec<Mark>,
    /// Number of dwells averaged in each mark.
    each: usize,
    /// Beginnings of the second and further recordings, hours.
    begins: Vec<f64>,
}

impl Marks {
    fn of(found: &SensorResult) -> Self {
        let factor = readable::error(&found.unit).factor;
        let each = found.dwells.len().div_ceil(MARKS).max(1);
        let (mut all, mut begins, mut start) = (Vec::new(), Vec::new(), 0.0);
        for recording in found.dwells.chunk_by(|a, b| a.recording == b.recording) {
            if recording[0].recording > 0 {
                begins.push(start);
            }
            for dwells in recording.chunks(each) {
                let n = dwells.len() as f64;
                let mean = |of: &dyn Fn(&DwellError) -> f64| dwells.iter().map(of).sum::<f64>() / n;
                all.push(Mark {
                    hours: start + mean(&|d| d.middle_s) / 3600.0,
                    die_c: mean(&|d| d.die_c),
                    error: [0, 1, 2].map(|k| factor * mean(&|d| d.error[k])),
                });
            }
            start += recording[recording.len() - 1].middle_s / 3600.0;
        }
        Self { all, each, begins }
    }

    fn errors(&self) -> Range<f64> {
        range(self.all.iter().flat_map(|m| m.error))
    }

    /// Name of the ordinate.
    fn ordinate(&self, found: &SensorResult) -> String {
        let unit = readable::error(&found.unit).unit;
        match self.each {
            1 => format!("error, {unit}"),
            n => format!("error, means of {n}, {unit}"),
        }
    }

    /// Draws the three axes in `frame`.
    fn draw(&self, frame: &Frame, at: fn(&Mark) -> f64) -> Markup {
        let key: Vec<(&str, &str)> = CLASSES.into_iter().zip(AXES).collect();
        html! {
            @for (axis, class) in CLASSES.iter().enumerate() {
                (frame.dots(&format!("{class} dot"), self.all.iter().map(|m| (at(m), m.error[axis]))))
            }
            (frame.legend(&key))
        }
    }
}

fn by_temperature(result: &ThermalResult, sensor: Sensor, found: &SensorResult) -> Markup {
    let marks = Marks::of(found);
    let frame = frame(result.range_c, marks.errors());
    html! {
        (frame.axes(&format!("{} error", sensor.name()), true))
        (marks.draw(&frame, |m| m.die_c))
        (frame.x_name("die, °C", &frame))
        (frame.y_name(&marks.ordinate(found)))
    }
}

fn by_time(sensor: Sensor, found: &SensorResult) -> Markup {
    let marks = Marks::of(found);
    let frame = Frame {
        across: 78.0..PANEL.0 - 12.0,
        down: 34.0..PANEL.1 - 46.0,
        x: range(marks.all.iter().map(|m| m.hours)),
        y: marks.errors(),
    };
    html! {
        (frame.axes(&format!("{} error over time", sensor.name()), true))
        @for hours in &marks.begins {
            path class="begin" d={ "M" (px(frame.at_x(*hours))) " " (px(frame.down.start)) "V" (px(frame.down.end)) } {}
        }
        (marks.draw(&frame, |m| m.hours))
        (frame.x_name("time, h", &frame))
        (frame.y_name(&marks.ordinate(found)))
    }
}
