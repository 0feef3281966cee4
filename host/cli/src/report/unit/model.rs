//! Tables of a calibration: scale factors, biases, alignment, and the inverse model.

use maud::{Markup, html};
use mimu::calibration::{Calibration, TriadTable};
use mimu::readable::{self, Readable};
use mimu::{AXES, ParameterKind, Sensor};
use mimu_recording::RawUnit;

use crate::report::fit::by_axis;
use crate::report::page::spoken;
use crate::report::table::{by_axes, interval, number, table, typed};

/// Tables of both sensors.
pub fn section(calibration: &Calibration) -> Markup {
    html! {
        @for sensor in Sensor::BOTH {
            @if let Some(table) = calibration.table(sensor) {
                h3 class="sensor" { (spoken(sensor)) }
                (physical(table))
                (matrix(sensor, table, &calibration.effects_of(sensor)))
            }
        }
    }
}

fn physical(triad: &TriadTable) -> Markup {
    let p = &triad.physical;
    let (raw, gain) = match triad.raw_unit {
        RawUnit::Si => (triad.unit.clone(), readable::parameter("")),
        raw => (
            raw.to_string(),
            readable::parameter(&format!("{raw}/({})", triad.unit)),
        ),
    };
    // The page is for those who use the calibration tomorrow.
    let next = triad.next_power_on.as_ref();
    let caption = format!(
        "Physical parameters with 95 % intervals{}",
        if next.is_some() {
            " at the next power-on, from several sessions"
        } else {
            ""
        }
    );
    let row = |kind: ParameterKind, values: [f64; 3], sigmas: Option<[f64; 3]>, unit: Readable| {
        html! { tr {
            td { (by_axis(kind, &unit)) }
            @let half = next.and_then(|n| n.intervals(kind)).or_else(|| sigmas.map(|s| s.map(|s| triad.interval_sigmas() * s)));
            @for i in 0..3 { @match half { Some(half) => (interval(values[i], half[i], unit.factor)), None => (number(values[i], unit.factor)) } }
        } }
    };
    let degrees = || Readable {
        factor: 1.0,
        unit: "deg".into(),
    };
    html! { (by_axes(&caption, &html! { "parameter" }, &html! {
        (row(ParameterKind::Scale, p.scale_factor, p.sigma_scale_factor, gain.clone()))
        (row(ParameterKind::Bias, p.bias, p.sigma_bias, readable::parameter(&raw)))
        (row(ParameterKind::Misalignment, p.misalignment_deg, p.sigma_misalignment_deg, degrees()))
        (row(ParameterKind::NonOrthogonality, p.non_orthogonality_deg, p.sigma_non_orthogonality_deg, degrees()))
    })) }
}

pub(in crate::report) fn matrix(sensor: Sensor, of: &TriadTable, effects: &[String]) -> Markup {
    let input = if sensor == Sensor::Gyro {
        "rate"
    } else {
        "specific force"
    };
    let formula = if effects.is_empty() {
        "C u + o"
    } else {
        "C (u - S e) + o"
    };
    let mut caption = format!(
        "To apply it: {input} = {formula}, with u the reading in {}; {}, in {}",
        of.raw_unit, of.direction, of.unit
    );
    if !effects.is_empty() {
        caption += &format!(
            ". e is the error by {}, in {}; S is diagonal, and converts it to readings by the scale factors. C and o are right only with these effects",
            effects.join(", "),
            of.unit
        );
    }
    // The digits of single precision, as on a device.
    let digits = |value: f64| {
        typed(
            value,
            &if value == 0.0 {
                "0".into()
            } else {
                format!("{value:.7e}")
            },
        )
    };
    html! { (table(&caption, &html! { th { "axis" } th.n { "C, x" } th.n { "C, y" } th.n { "C, z" } th.n { "o" } }, &html! {
        @for (i, axis) in AXES.iter().enumerate() { tr { td { (axis) } @for j in 0..3 { (digits(of.C[i][j])) } (digits(of.o[i])) } }
    })) }
}
