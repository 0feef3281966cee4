//! The figures: residuals over time, effects against the quantities that they depend on, and remaining residuals against noise.

use std::ops::Range;

use maud::{Markup, html};

use crate::report::svg::{self, Frame, power_of_ten, range, times_ten};
use mimu::diagnose::picture::{Against, Panel, Picture, Quantile, ResidualKind, Track};
use mimu::observable::Observable;
use mimu::quantity::Figure;
use mimu::quantity::Sensor;

const FIGURE: svg::Panel = svg::Panel {
    room: [62.0, 8.0, 26.0, 40.0],
    ..svg::Panel::ONE
};
/// Space between two drawings with a common ordinate.
const GAP: f64 = 18.0;
const MINUTE_S: f64 = 60.0;

/// Factor and unit in which residuals are shown.
pub fn unit(kind: ResidualKind, sensor: Sensor) -> (f64, &'static str) {
    match kind {
        ResidualKind::Angle => Figure::Direction.readable(sensor),
        ResidualKind::Input => Figure::Input.readable(sensor),
    }
}

fn frames<const N: usize>(x: &Range<f64>, y: &Range<f64>) -> [Frame; N] {
    let all = FIGURE.frame(x.clone(), y.clone());
    let width = (all.across.end - all.across.start - GAP * (N - 1) as f64) / N as f64;
    std::array::from_fn(|i| {
        let left = all.across.start + i as f64 * (width + GAP);
        Frame {
            across: left..left + width,
            ..all.clone()
        }
    })
}

/// From this number of rows on, marks are smaller.
const MANY: usize = 60;

/// `rows` is the number of marks.
fn drawing(label: &str, rows: usize, inside: &Markup) -> Markup {
    FIGURE.drawing(label, (rows > MANY).then_some("many"), inside)
}

/// Ordinate of a drawing in the shown unit, with a power of ten.
struct Ordinate {
    by: f64,
    name: String,
    ends: Range<f64>,
}

impl Ordinate {
    /// Ordinate for `values` in SI, including zero.
    fn new(
        kind: ResidualKind,
        sensor: Sensor,
        what: &str,
        values: impl Iterator<Item = f64>,
    ) -> Self {
        let (factor, unit) = unit(kind, sensor);
        let ends = range(values.map(|v| v * factor).chain([0.0]));
        let power = power_of_ten(&ends);
        let scale = 10f64.powi(-power);
        Self {
            by: factor * scale,
            name: format!("{what}, {}{unit}", times_ten(power)),
            ends: ends.start * scale..ends.end * scale,
        }
    }
}

/// Residuals of a track over time, before and after; `after` if there are effects.
pub fn in_time(sensor: Sensor, track: &Track, blocks_s: &[f64], after: bool) -> Markup {
    let samples = &track.samples;
    let shown = if after { 2 } else { 1 };
    let values = samples.iter().flat_map(|s| {
        let both = (0..shown).flat_map(|k| [s.residual[k], s.held_out[k]]);
        both.chain([s.residual[0] + s.sigma, s.residual[0] - s.sigma])
    });
    let y = Ordinate::new(track.kind, sensor, "residual", values);
    let x = range(samples.iter().map(|s| s.t_s / MINUTE_S));
    let ends: Vec<f64> = blocks_s.iter().map(|e| e / MINUTE_S).collect();
    let one = |frame: &Frame, k: usize, heading: &str| {
        html! {
            (frame.stretches("block", &ends))
            (frame.axes(heading, k == 0))
            (frame.bars("sigma", samples.iter().map(|s| (s.t_s / MINUTE_S, s.residual[k] * y.by, s.sigma * y.by))))
            (frame.diamonds("held", samples.iter().map(|s| (s.t_s / MINUTE_S, s.held_out[k] * y.by))))
            (frame.dots("dot", samples.iter().map(|s| (s.t_s / MINUTE_S, s.residual[k] * y.by))))
        }
    };
    let name = title(sensor, track);
    let inside = match after {
        true => {
            let [left, right] = frames::<2>(&x, &y.ends);
            html! {
                (left.y_name(&y.name))
                (left.x_name("time, min", &right))
                (one(&left, 0, &name))
                (one(&right, 1, "after"))
            }
        }
        false => {
            let [only] = frames::<1>(&x, &y.ends);
            html! { (only.y_name(&y.name)) (only.x_name("time, min", &only)) (one(&only, 0, &name)) }
        }
    };
    drawing(
        &format!("residual of {name} in time"),
        samples.len(),
        &inside,
    )
}

/// Title of a track, with the sensor for an axis: `gyro x`, `gyro x at rest`, `turns, first direction`.
fn title(sensor: Sensor, track: &Track) -> String {
    match track.group {
        Observable::Axis(_) | Observable::AtRest(_) => format!("{sensor} {}", track.name),
        _ => track.name.clone(),
    }
}

/// An effect against the quantity that it depends on, before and after its removal.
pub fn against(sensor: Sensor, panel: &Panel) -> Markup {
    let (points, curve) = (&panel.points, &panel.curve);
    let values = points
        .iter()
        .flat_map(|p| {
            [
                p.partial,
                p.predicted,
                p.after,
                p.held_out,
                p.partial + p.sigma,
                p.partial - p.sigma,
            ]
        })
        .chain(
            curve
                .iter()
                .flat_map(|c| [c.value - c.half, c.value + c.half]),
        );
    let y = Ordinate::new(panel.kind, sensor, "residual", values);
    let (by, offset, name) = match &panel.against {
        Against::Variable(a) => (a.factor, a.offset, format!("{}, {}", a.name, a.unit)),
        Against::Fitted => {
            let unit = unit(panel.kind, sensor);
            (unit.0, 0.0, format!("the effect by the fit, {}", unit.1))
        }
    };
    let ends = range(points.iter().map(|p| p.x * by + offset));
    let power = power_of_ten(&ends);
    let scale = 10f64.powi(-power);
    let ends = ends.start * scale..ends.end * scale;
    let name = match power {
        0 => name,
        // The unit follows the last comma.
        power => match name.rsplit_once(", ") {
            Some((name, unit)) => format!("{name}, {}{unit}", times_ten(power)),
            None => name,
        },
    };
    let x = |v: f64| (v * by + offset) * scale;
    let [left, right] = frames::<2>(&ends, &y.ends);
    let band: Vec<(f64, f64, f64)> = curve
        .iter()
        .map(|c| (x(c.x), (c.value - c.half) * y.by, (c.value + c.half) * y.by))
        .collect();
    let inside = html! {
        (left.y_name(&y.name))
        (left.x_name(&name, &right))
        (left.axes(&panel.title, true))
        @match panel.against {
            Against::Variable(_) => (left.band("band", &band)),
            Against::Fitted => (left.bars("bandbar", curve.iter().map(|c| (x(c.x), c.value * y.by, c.half * y.by)))),
        }
        (left.bars("sigma", points.iter().map(|p| (x(p.x), p.partial * y.by, p.sigma * y.by))))
        (left.diamonds("held", points.iter().map(|p| (x(p.x), p.predicted * y.by))))
        (left.dots("dot", points.iter().map(|p| (x(p.x), p.partial * y.by))))
        (left.line("fit", curve.iter().map(|c| (x(c.x), c.value * y.by))))
        (right.axes("effect taken out", false))
        (right.bars("sigma", points.iter().map(|p| (x(p.x), p.after * y.by, p.sigma * y.by))))
        (right.diamonds("held", points.iter().map(|p| (x(p.x), p.held_out * y.by))))
        (right.dots("dot", points.iter().map(|p| (x(p.x), p.after * y.by))))
    };
    drawing(
        &format!("{} against {name}", panel.title),
        points.len(),
        &inside,
    )
}

/// Quantiles of the residuals, in sigmas of the known noise, against those of noise alone.
pub fn quantiles(picture: &Picture, after: bool) -> Markup {
    const X: &str = "normal quantile, σ";
    const Y: &str = "residual, σ";
    let all = &picture.quantiles;
    let shown = if after { 2 } else { 1 };
    let x = range(all.iter().map(|q| q.normal));
    let last = shown - 1;
    // Before an effect is removed, a row may be hundreds of sigmas off. Afterwards the line of noise has to be visible.
    let y = |k: usize| range(all.iter().flat_map(|q| [q.found[k], q.band[0], q.band[1]]));
    let one = |frame: &Frame, k: usize, heading: &str| {
        let of = |q: &Quantile| (q.normal, q.found[k]);
        let band: Vec<(f64, f64, f64)> = all
            .iter()
            .map(|q| (q.normal, q.band[0], q.band[1]))
            .collect();
        html! {
            (frame.axes(heading, true))
            (frame.band("band", &band))
            (frame.line("fit", all.iter().map(|q| (q.normal, q.normal))))
            (frame.dots("dot small", all.iter().map(of)))
        }
    };
    let inside = match after {
        true => {
            let [mut left, mut right] = frames::<2>(&x, &y(0));
            left.across.end -= 18.0;
            right.across.start += 18.0;
            right.y = y(last);
            html! {
                (left.y_name(Y))
                (left.x_name(X, &right))
                (one(&left, 0, &format!("{}: before", picture.sensor)))
                (one(&right, 1, "after (its own scale)"))
            }
        }
        false => {
            let [only] = frames::<1>(&x, &y(0));
            html! {
                (only.y_name(Y))
                (only.x_name(X, &only))
                (one(&only, 0, picture.sensor.name()))
            }
        }
    };
    drawing(
        "residuals against the normal distribution",
        all.len(),
        &inside,
    )
}
