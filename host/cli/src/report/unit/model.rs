//! Tables of a calibration: scale factors, biases, alignment, and the inverse model.

use maud::{Markup, html};
use mimu::calibration::{Calibration, TriadTable};
use mimu::parameter::ParameterKind;
use mimu::quantity::{AXES, Sensor, plus_minus};
use mimu::readable;
use mimu_recording::RawUnit;

use crate::report::page::{number, spoken, written};

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

fn value(si: f64, half: Option<f64>, factor: f64) -> Markup {
    html! {
        data value=(si) {
            @match half {
                // Parameters that define the frame are known exactly.
                Some(0.0) => { (number(si, factor, "")) " (fixed)" }
                Some(half) => (written(&plus_minus(si * factor, half * factor))),
                None => (written(&mimu::quantity::significant(si * factor))),
            }
        }
    }
}

fn physical(table: &TriadTable) -> Markup {
    let p = &table.physical;
    let raw = table.raw_unit.to_string();
    let raw = if table.raw_unit == RawUnit::Si {
        table.unit.clone()
    } else {
        raw
    };
    let gain = match table.raw_unit {
        RawUnit::Si => readable::parameter(""),
        _ => readable::parameter(&format!("{raw}/({})", table.unit)),
    };
    let bias = readable::parameter(&raw);
    let k = table.interval_sigmas();
    // The page is for those who use the calibration tomorrow.
    let next = table.next_power_on.as_ref();
    let half = |sigmas: Option<[f64; 3]>, kind: ParameterKind, i: usize| {
        let next = next.and_then(|n| n.intervals(kind)).map(|all| all[i]);
        next.or_else(|| sigmas.map(|s| k * s[i]))
    };
    let angles = ["yz", "zy", "zx"];
    html! {
        div class="scroll" { table {
            caption {
                "Physical parameters with 95 % intervals"
                @if next.is_some() { " at the next power-on, from several sessions" }
            }
            thead { tr { th { "parameter" } @for axis in AXES { th class="n" { (axis) } } } }
            tbody {
                tr {
                    td { "scale factor" @if !gain.unit.is_empty() { ", " (gain.unit) } }
                    @for i in 0..3 { td class="n" { (value(p.scale_factor[i], half(p.sigma_scale_factor, ParameterKind::Scale, i), gain.factor)) } }
                }
                tr {
                    td { "bias, " (bias.unit) }
                    @for i in 0..3 { td class="n" { (value(p.bias[i], half(p.sigma_bias, ParameterKind::Bias, i), bias.factor)) } }
                }
                tr {
                    td { "misalignment, deg" }
                    @for i in 0..3 { td class="n" { (value(p.misalignment_deg[i], half(p.sigma_misalignment_deg, ParameterKind::Misalignment, i), 1.0)) } }
                }
                tr {
                    td { "non-orthogonality " (angles.join(", ")) ", deg" }
                    @for i in 0..3 { td class="n" { (value(p.non_orthogonality_deg[i], half(p.sigma_non_orthogonality_deg, ParameterKind::NonOrthogonality, i), 1.0)) } }
                }
            }
        } }
    }
}

/// The digits of single precision, as on a device.
fn digits(value: f64) -> String {
    match value == 0.0 {
        true => "0".into(),
        false => written(&format!("{value:.7e}")),
    }
}

pub(in crate::report) fn matrix(sensor: Sensor, table: &TriadTable, effects: &[String]) -> Markup {
    let input = match sensor {
        Sensor::Gyro => "rate",
        Sensor::Accel => "specific force",
    };
    let formula = match effects.is_empty() {
        true => "C u + o",
        false => "C (u - S e) + o",
    };
    html! {
        div class="scroll" { table {
            caption {
                "To apply it: " (input) " = " (formula) ", with u the reading in " (table.raw_unit.to_string()) "; " (table.direction) ", in " (table.unit)
                @if !effects.is_empty() {
                    ". e is the error by " (effects.join(", ")) ", in " (table.unit)
                    "; S is diagonal, and converts it to readings by the scale factors. C and o are right only with these effects"
                }
            }
            thead { tr { th { "axis" } th class="n" { "C, x" } th class="n" { "C, y" } th class="n" { "C, z" } th class="n" { "o" } } }
            tbody {
                @for (i, axis) in AXES.iter().enumerate() {
                    tr {
                        td { (axis) }
                        @for j in 0..3 { td class="n" { data value=(table.C[i][j]) { (digits(table.C[i][j])) } } }
                        td class="n" { data value=(table.o[i]) { (digits(table.o[i])) } }
                    }
                }
            }
        } }
    }
}
