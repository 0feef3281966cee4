//! The further triads of a body: how they stand to their reference, and their matrices.

use maud::{Markup, html};
use mimu::{AXES, BodyTriad, Calibration};
use mimu_recording::{RawUnit, TriadKind};

use crate::report::table::{interval, number, table, typed};

/// Table and matrices.
pub fn section(calibration: &Calibration) -> Markup {
    let all = &calibration.body;
    html! {
        (geometry(all))
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
