//! The further triads of a body: how they stand to their reference, in a table and drawn, and their matrices.

use maud::{Markup, html};
use mimu::calibration::Calibration;
use mimu::calibration::body::BodyTriad;
use mimu::quantity::AXES;
use mimu_recording::{RawUnit, TriadKind};
use nalgebra::{Matrix3, Vector3};

use crate::report::svg::{AXIS_CLASSES, Panel, px};
use crate::report::table::{interval, number, table, typed};

/// Triads in a row of the drawing, and the size of each, pixels.
const ROW: usize = 5;
const CELL: [f64; 2] = [112.0, 126.0];
/// Length of a body's axis, and of a triad's, pixels.
const LENGTHS: [f64; 2] = [40.0, 30.0];
/// Smallest extent of the drawing of the places, mm: a board's.
const LEAST_MM: f64 = 10.0;

/// Table, drawing and matrices.
pub fn section(calibration: &Calibration) -> Markup {
    let all = &calibration.body;
    html! {
        (geometry(all))
        div.figures {
            @if all.iter().any(|triad| triad.rotation_deg.is_some()) {
                figure.whole { (rotations(all)) figcaption { "The axes of each triad (x orange, y blue, z green) and those of its reference (grey)." } }
            }
            @if all.iter().any(|triad| triad.lever_arm_mm.is_some()) {
                figure.whole { (places(all)) figcaption { "Where the triads are, in the frame of the reference." } }
            }
        }
        @for triad in all { (matrix(triad)) }
    }
}

/// Rotation, delay and lever arm.
fn geometry(all: &[BodyTriad]) -> Markup {
    let caption = "Rotation vector from the frame of the triad to that of its reference, by how much its readings are later, and its place from the reference in the frame of the reference; with 95 % intervals";
    let heads = html! {
        th { "triad" } th { "against" }
        @for axis in AXES { th.n { "rotation " (axis) ", deg" } }
        th.n { "delay, ms" }
        @for axis in AXES { th.n { "place " (axis) ", mm" } }
    };
    let radian = 1f64.to_degrees();
    let rows = html! { @for triad in all { tr {
        td { (triad.triad) } td { (triad.reference) }
        @for i in 0..3 { (cell(triad.rotation_deg.map(|v| v[i]), triad.interval_rotation_deg.map(|v| v[i]), radian)) }
        (cell(triad.delay_ms, triad.interval_delay_ms, 1e3))
        @for i in 0..3 { (cell(triad.lever_arm_mm.map(|v| v[i]), triad.interval_lever_arm_mm.map(|v| v[i]), 1e3)) }
    } } };
    table(caption, &heads, &rows)
}

/// A number in the unit of its column, which is a `factor`th of SI.
fn cell(value: Option<f64>, half: Option<f64>, factor: f64) -> Markup {
    let value = value.unwrap_or(f64::NAN) / factor;
    match half {
        Some(half) => interval(value, half / factor, factor),
        None => number(value, factor),
    }
}

fn matrix(triad: &BodyTriad) -> Markup {
    let raw = match (triad.triad.kind, triad.raw_unit) {
        (TriadKind::Mag, RawUnit::Si) => "µT".into(),
        (_, unit) => unit.to_string(),
    };
    let caption = format!(
        "{}: x = C u + o, with u the reading in {raw}; {}, in {}, in its own frame",
        triad.triad, triad.direction, triad.unit
    );
    let digits = |value: f64| typed(value, &format!("{value:.7e}"));
    table(
        &caption,
        &html! { th { "axis" } th.n { "C, x" } th.n { "C, y" } th.n { "C, z" } th.n { "o" } },
        &html! { @for (i, axis) in AXES.iter().enumerate() { tr { td { (axis) } @for j in 0..3 { (digits(triad.C[i][j])) } (digits(triad.o[i])) } } },
    )
}

/// A point of the body, seen from where x, y and z are all positive, in pixels to the right and down.
fn seen(v: &Vector3<f64>) -> (f64, f64) {
    let (sin, cos) = 30f64.to_radians().sin_cos();
    ((v.y - v.x) * cos, (v.x + v.y) * sin - v.z)
}

/// The axes of every triad with a rotation, side by side.
fn rotations(all: &[BodyTriad]) -> Markup {
    let known: Vec<(&BodyTriad, Matrix3<f64>)> = all
        .iter()
        .filter_map(|triad| Some((triad, triad.rotation()?)))
        .collect();
    let rows = known.len().div_ceil(ROW);
    let panel = Panel {
        size: (ROW as f64 * CELL[0], rows as f64 * CELL[1] + 8.0),
        ..Panel::ONE
    };
    let one = Matrix3::identity();
    let drawn = html! { @for (k, (triad, rotation)) in known.iter().enumerate() {
        @let middle = (CELL[0] * ((k % ROW) as f64 + 0.5), CELL[1] * (k / ROW) as f64 + 76.0);
        @for axis in 0..3 { (arrow("grid", middle, &one.column(axis).into_owned(), LENGTHS[0])) }
        @for (axis, class) in AXIS_CLASSES.iter().enumerate() { (arrow(class, middle, &rotation.column(axis).into_owned(), LENGTHS[1])) }
        text class="heading" x=(px(middle.0)) y=(px(middle.1 - 60.0)) text-anchor="middle" { (triad.triad) }
        @if k == 0 { @for (axis, name) in AXES.iter().enumerate() {
            @let end = seen(&(one.column(axis) * (LENGTHS[0] + 9.0)));
            text class="tick" x=(px(middle.0 + end.0)) y=(px(middle.1 + end.1 + 4.0)) text-anchor="middle" { (name) }
        } }
    } };
    let label = format!("Axes of {} triads against those of the body", known.len());
    panel.drawing(&label, None, &drawn)
}

/// A line along `direction`, with a dot at its end.
fn arrow(class: &str, from: (f64, f64), direction: &Vector3<f64>, length: f64) -> Markup {
    let (x, y) = seen(&(direction * length));
    html! {
        path class=(class) d={ "M" (px(from.0)) " " (px(from.1)) "l" (px(x)) " " (px(y)) } {}
        @if class != "grid" { path class={ "dot small " (class) } d={ "M" (px(from.0 + x)) " " (px(from.1 + y)) "h0" } {} }
    }
}

/// The places of the triads with a lever arm: from above, y over x, and from the side, z over x, in one scale.
fn places(all: &[BodyTriad]) -> Markup {
    let known: Vec<(String, [f64; 3])> = all
        .iter()
        .filter_map(|triad| Some((triad.triad.to_string(), triad.lever_arm_mm?)))
        .collect();
    let origin = all.iter().find(|triad| triad.lever_arm_mm.is_some());
    let origin = origin.map_or_else(String::new, |triad| triad.reference.to_string());
    let all: Vec<(String, [f64; 3])> = [(origin, [0.0; 3])].into_iter().chain(known).collect();
    let panel = Panel::ONE;
    let (width, height) = (panel.size.0 / 2.0, panel.size.1);
    let room = 38.0;
    let ends = |axis: usize| {
        let low = all.iter().map(|p| p.1[axis]).fold(f64::INFINITY, f64::min);
        let high = all
            .iter()
            .map(|p| p.1[axis])
            .fold(f64::NEG_INFINITY, f64::max);
        (0.5 * (low + high), (high - low).max(LEAST_MM))
    };
    let (x, y, z) = (ends(0), ends(1), ends(2));
    let scale = ((width - 2.0 * room) / x.1)
        .min((height - 2.0 * room) / y.1)
        .min((height - 2.0 * room) / z.1);
    let at = |view: usize, p: &[f64; 3]| {
        let (up, middle) = if view == 0 { (p[1], y.0) } else { (p[2], z.0) };
        (
            width * (view as f64 + 0.5) + scale * (p[0] - x.0),
            0.5 * height - scale * (up - middle),
        )
    };
    let bar_mm = round(60.0 / scale);
    let drawn = html! {
        @for (view, name) in ["from above: y over x", "from the side: z over x"].iter().enumerate() {
            text class="heading" x=(px(width * view as f64 + 8.0)) y="16" { (name) }
            @let from = at(view, &[0.0; 3]);
            @for (name, p) in &all {
                @let to = at(view, p);
                path class="grid" d={ "M" (px(from.0)) " " (px(from.1)) "L" (px(to.0)) " " (px(to.1)) } {}
                path class="dot" d={ "M" (px(to.0)) " " (px(to.1)) "h0" } {}
                text class="tick" x=(px(to.0)) y=(px(to.1 - 8.0)) text-anchor="middle" { (name) }
            }
        }
        path class="ink" d={ "M" (px(8.0)) " " (px(height - 14.0)) "h" (px(bar_mm * scale)) } {}
        text class="tick" x=(px(14.0 + bar_mm * scale)) y=(px(height - 10.0)) { (bar_mm) " mm" }
    };
    let label = format!("Places of {} triads on the body", all.len());
    panel.drawing(&label, None, &drawn)
}

/// The largest of 1, 2 and 5 times a power of ten that is not above `value`.
fn round(value: f64) -> f64 {
    let decade = 10f64.powf(value.log10().floor());
    let steps = [5.0, 2.0, 1.0].map(|m| m * decade);
    let found = steps.into_iter().find(|step| *step <= value);
    found.unwrap_or(decade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axes_are_seen_right_handed_with_z_up() {
        let [x, y, z] = [0, 1, 2].map(|axis| seen(&Vector3::ith(axis, 1.0)));
        assert!(x.0 < 0.0 && x.1 > 0.0 && y.0 > 0.0 && y.1 > 0.0);
        assert_eq!(z, (0.0, -1.0));
        assert_eq!([round(7.4), round(23.0), round(1.0)], [5.0, 20.0, 1.0]);
    }
}
