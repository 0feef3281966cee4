//! The figures: residuals over time, and effects against the quantities that they depend on.

use std::ops::Range;

use maud::{Markup, html};
use mimu::diagnose::picture::{Against, At, Panel, ResidualKind, Track};
use mimu::observable::Observable;
use mimu::quantity::{Figure, Sensor};

use crate::report::svg::{self, Frame, power_of_ten, range, times_ten};

const FIGURE: svg::Panel = svg::Panel {
    room: [62.0, 8.0, 26.0, 40.0],
    ..svg::Panel::ONE
};
/// Space between two drawings with a common ordinate.
const GAP: f64 = 18.0;
const MINUTE_S: f64 = 60.0;
/// From this number of rows on, marks are smaller.
const MANY: usize = 60;

/// A mark of the figures, for the legend.
pub(super) fn key(class: &str, d: &str) -> Markup {
    html! { svg class="key" viewBox="0 0 24 12" xmlns="http://www.w3.org/2000/svg" { path class=(class) d=(d) {} } }
}

pub(super) fn keys() -> Markup {
    html! {
        (key("dot", "M12 6h0")) "in sample, "
        (key("sigma", "M12 0V12")) "± one standard deviation of its known noise; "
        (key("held", "M12 2l4 4l-4 4l-4 -4z")) "held out, predicted by a model that was fitted without this dwell"
    }
}

/// Factor and unit in which residuals are shown.
fn unit(kind: ResidualKind, sensor: Sensor) -> (f64, &'static str) {
    match kind {
        ResidualKind::Angle => Figure::Direction.readable(sensor),
        ResidualKind::Input => Figure::Input.readable(sensor),
    }
}

/// Frames side by side, for each of the ordinates, with `gap` between them.
fn frames(x: &Range<f64>, y: &[Range<f64>], gap: f64) -> Vec<Frame> {
    let all = FIGURE.frame(x.clone(), y[0].clone());
    let width = (all.across.end - all.across.start + gap) / y.len() as f64;
    let place = |(k, y): (usize, &Range<f64>)| {
        let left = all.across.start + k as f64 * width;
        Frame {
            across: left..left + width - gap,
            y: y.clone(),
            ..all.clone()
        }
    };
    y.iter().enumerate().map(place).collect()
}

/// A drawing of `rows` marks with its label and the names of its axes.
fn drawing([label, x, y]: [&str; 3], rows: usize, frames: &[Frame], inside: &Markup) -> Markup {
    let (first, last) = (&frames[0], &frames[frames.len() - 1]);
    let all = html! { (first.y_name(y)) (first.x_name(x, last)) (inside) };
    FIGURE.drawing(label, (rows > MANY).then_some("many"), &all)
}

/// Factor to the unit of an axis with a power of ten, the name of the axis, and its ends.
struct Axis {
    by: f64,
    name: String,
    ends: Range<f64>,
}

impl Axis {
    /// An axis for values with an offset, of a quantity that is shown in a unit, to which the factor converts.
    fn new(
        what: &str,
        (factor, unit): (f64, &str),
        offset: f64,
        values: impl Iterator<Item = f64>,
    ) -> Self {
        let ends = range(values.map(|v| v * factor + offset));
        let power = power_of_ten(&ends);
        let by = 10f64.powi(-power);
        let name = format!("{what}, {}{unit}", times_ten(power));
        Self {
            by,
            name,
            ends: ends.start * by..ends.end * by,
        }
    }

    /// The ordinate of residuals in SI, including zero.
    fn of_residuals(kind: ResidualKind, sensor: Sensor, values: impl Iterator<Item = f64>) -> Self {
        let unit = unit(kind, sensor);
        let axis = Self::new("residual", unit, 0.0, values.chain([0.0]));
        Self {
            by: unit.0 * axis.by,
            ..axis
        }
    }
}

/// Residuals of a track over time, before and after; `after` if there are effects.
pub(super) fn in_time(sensor: Sensor, track: &Track, blocks_s: &[f64], after: bool) -> Markup {
    let samples = &track.samples;
    let shown = if after { 2 } else { 1 };
    let values = samples.iter().flat_map(|s| {
        let both = (0..shown).flat_map(|k| [s.residual[k], s.held_out[k]]);
        both.chain([s.residual[0] + s.sigma, s.residual[0] - s.sigma])
    });
    let y = Axis::of_residuals(track.kind, sensor, values);
    let ends: Vec<f64> = blocks_s.iter().map(|e| e / MINUTE_S).collect();
    // With the sensor for an axis: `gyro x`, `gyro x at rest`, `turns, first direction`.
    let name = match track.group {
        Observable::Axis(_) | Observable::AtRest(_) => format!("{sensor} {}", track.name),
        _ => track.name.clone(),
    };
    let minutes = range(samples.iter().map(|s| s.t_s / MINUTE_S));
    let frames = frames(&minutes, &vec![y.ends.clone(); shown], GAP);
    let inside = html! { @for (k, frame) in frames.iter().enumerate() {
        (frame.stretches("block", &ends))
        (frame.axes(if k == 0 { &name } else { "after" }, k == 0))
        (frame.bars("sigma", samples.iter().map(|s| (s.t_s / MINUTE_S, s.residual[k] * y.by, s.sigma * y.by))))
        (frame.diamonds("held", samples.iter().map(|s| (s.t_s / MINUTE_S, s.held_out[k] * y.by))))
        (frame.dots("dot", samples.iter().map(|s| (s.t_s / MINUTE_S, s.residual[k] * y.by))))
    } };
    let names = [&format!("residual of {name} in time"), "time, min", &y.name];
    drawing(names, samples.len(), &frames, &inside)
}

/// An effect against the quantity that it depends on, before and after its removal.
pub(super) fn against(sensor: Sensor, panel: &Panel) -> Markup {
    let (points, curve) = (&panel.points, &panel.curve);
    let marks = points.iter().flat_map(|p| {
        [
            p.predicted,
            p.after,
            p.held_out,
            p.partial - p.sigma,
            p.partial + p.sigma,
        ]
    });
    let values = marks.chain(
        curve
            .iter()
            .flat_map(|c| [c.value - c.half, c.value + c.half]),
    );
    let y = Axis::of_residuals(panel.kind, sensor, values);
    let (what, of, offset) = match &panel.against {
        Against::Variable(a) => (a.name.as_str(), (a.factor, a.unit.as_str()), a.offset),
        Against::Fitted => ("the effect by the fit", unit(panel.kind, sensor), 0.0),
    };
    let axis = Axis::new(what, of, offset, points.iter().map(|p| p.x));
    let x = |v: f64| (v * of.0 + offset) * axis.by;
    let frames = frames(&axis.ends, &[y.ends.clone(), y.ends.clone()], GAP);
    let (left, right) = (&frames[0], &frames[1]);
    // Residuals with their bars, and predicted ones.
    let residuals = |frame: &Frame, of: fn(&At) -> [f64; 2]| {
        html! {
            (frame.bars("sigma", points.iter().map(|p| (x(p.x), of(p)[0] * y.by, p.sigma * y.by))))
            (frame.diamonds("held", points.iter().map(|p| (x(p.x), of(p)[1] * y.by))))
            (frame.dots("dot", points.iter().map(|p| (x(p.x), of(p)[0] * y.by))))
        }
    };
    let inside = html! {
        (left.axes(&panel.title, true))
        @match panel.against {
            Against::Variable(_) => (left.band("band", &curve.iter().map(|c| (x(c.x), (c.value - c.half) * y.by, (c.value + c.half) * y.by)).collect::<Vec<_>>())),
            Against::Fitted => (left.bars("bandbar", curve.iter().map(|c| (x(c.x), c.value * y.by, c.half * y.by)))),
        }
        (residuals(left, |p| [p.partial, p.predicted]))
        (left.line("fit", curve.iter().map(|c| (x(c.x), c.value * y.by))))
        (right.axes("effect taken out", false))
        (residuals(right, |p| [p.after, p.held_out]))
    };
    let label = format!("{} against {}", panel.title, axis.name);
    drawing(
        [&label, &axis.name, &y.name],
        points.len(),
        &frames,
        &inside,
    )
}
