//! The text of a calibration file.

use std::fmt::Write as _;

use super::{EffectTable, FORMAT};
use crate::fit::{Fit, SensorFit};
use crate::quantity::Sensor;
use crate::triad::Angles;
use mimu_recording::Reference;

/// Text of the calibration file for `fit`, a fit of readings without `effects`, made at `created` (RFC 3339).
pub fn to_toml(fit: &Fit, effects: &[EffectTable], created: &str) -> String {
    let mut out = String::new();
    // Writing to a string does not fail.
    let _ = write_file(&mut out, fit, effects, created);
    out
}

fn write_file(
    out: &mut String,
    fit: &Fit,
    effects: &[EffectTable],
    created: &str,
) -> std::fmt::Result {
    let manifest = &fit.prepared.manifest;
    writeln!(
        out,
        "# Calibration of an inertial unit. To apply it by hand to a raw reading u = (x, y, z):"
    )?;
    writeln!(
        out,
        "#   first axis  = C[0][0]*u_x + C[0][1]*u_y + C[0][2]*u_z + o[0],  and so on by rows."
    )?;
    if !effects.is_empty() {
        writeln!(
            out,
            "# of a reading without the errors e of the effects below, which are added up for each sensor and are SI:\n\
             #   u_x - S_x*e_x in place of u_x, with S_x the root of the sum of squares of P[0], and so on."
        )?;
    }
    writeln!(out, "format = \"{FORMAT}\"")?;
    writeln!(out, "device = {}", quoted(&manifest.device))?;
    writeln!(out, "created = \"{created}\"")?;
    writeln!(out, "tool = \"mimu {}\"", env!("CARGO_PKG_VERSION"))?;
    writeln!(
        out,
        "\n[recording]\nsha256 = \"{}\"  # of its samples file",
        fit.prepared.condensed.sha256
    )?;
    writeln!(
        out,
        "reference = \"{}\"\nraw_unit = \"{}\"\ngravity_mps2 = {:?}",
        manifest.reference, manifest.raw_unit, manifest.gravity_mps2
    )?;
    let temperatures: Vec<f64> = fit
        .prepared
        .dwells
        .list
        .iter()
        .map(|d| d.temp_c)
        .filter(|t| t.is_finite())
        .collect();
    if !temperatures.is_empty() {
        let mean = temperatures.iter().sum::<f64>() / temperatures.len() as f64;
        let remark = match effects.is_empty() {
            true => "; nothing here depends on it",
            false => "",
        };
        writeln!(out, "temp_c = {mean:?}  # mean of the dwells{remark}")?;
    }
    for sensor in &fit.sensors {
        write_sensor(out, fit, sensor)?;
    }
    for effect in effects {
        effect.write(out)?;
    }
    Ok(())
}

fn write_sensor(out: &mut String, fit: &Fit, sensor: &SensorFit) -> std::fmt::Result {
    let name = sensor.sensor.name();
    let raw_unit = fit.prepared.manifest.raw_unit;
    let triad = &sensor.estimated.triad;
    let frame = match (fit.prepared.manifest.reference, sensor.sensor) {
        (Reference::Table, _) => "body: the axes of the ref_ columns",
        (Reference::Gravity, Sensor::Accel) => {
            "body: x along the accelerometer's x, xy plane through its y"
        }
        (Reference::Gravity, Sensor::Gyro) => {
            "body: the accelerometer's (x along its x, xy plane through its y)"
        }
    };
    writeln!(
        out,
        "\n[{name}]\nformula = \"x = C u + o\"\ndirection = \"raw to SI\""
    )?;
    writeln!(
        out,
        "raw_unit = \"{raw_unit}\"\nunit = \"{}\"\nframe = \"{frame}\"",
        sensor.sensor.unit()
    )?;
    let covariance = &triad.inverse_covariance;
    let estimates = triad.inverse_estimates();
    let sigma = |i: usize| estimates[i].sigma;
    let interval = |i: usize| estimates[i].interval;
    writeln!(
        out,
        "C = {}",
        matrix(|i, j| number(triad.inverse.matrix[(i, j)]))
    )?;
    writeln!(out, "o = {}", row(3, |i| number(triad.inverse.offset[i])))?;
    writeln!(
        out,
        "sigma_C = {}",
        matrix(|i, j| format!("{:.3e}", sigma(3 * i + j)))
    )?;
    writeln!(
        out,
        "sigma_o = {}",
        row(3, |i| format!("{:.3e}", sigma(9 + i)))
    )?;
    writeln!(out, "# halves of the 95 % intervals")?;
    writeln!(
        out,
        "interval_C = {}",
        matrix(|i, j| format!("{:.3e}", interval(3 * i + j)))
    )?;
    writeln!(
        out,
        "interval_o = {}",
        row(3, |i| format!("{:.3e}", interval(9 + i)))
    )?;
    let names = crate::quantity::inverse_names();
    writeln!(
        out,
        "parameters = {}",
        row(12, |i| format!("\"{}\"", names[i]))
    )?;
    writeln!(out, "covariance = [")?;
    for i in 0..12 {
        writeln!(out, "  {},", row(12, |j| number(covariance[(i, j)])))?;
    }
    writeln!(out, "]")?;
    writeln!(
        out,
        "\n[{name}.judged]\nestimator = \"{}\"\nfigure = \"{}\"",
        fit.estimator(sensor.sensor),
        sensor.figure.description()
    )?;
    writeln!(
        out,
        "unit = \"{}\"\nrms = {:.6e}",
        sensor.figure.unit(sensor.sensor),
        sensor.rms()
    )?;
    if let Some(rms) = sensor.held_out_rms() {
        writeln!(
            out,
            "held_out_rms = {rms:.6e}  # {} contiguous blocks",
            fit.options.holdout_blocks
        )?;
    }
    writeln!(
        out,
        "noise_floor = {:.6e}\ndwells = {}\ncondition = {:.4}",
        sensor.noise_floor(),
        sensor.dwells,
        sensor.estimated.condition
    )?;
    writeln!(
        out,
        "\n[{name}.forward]\nformula = \"u = P x + b\"\ndirection = \"SI to raw\""
    )?;
    writeln!(
        out,
        "P = {}",
        matrix(|i, j| number(triad.forward.matrix[(i, j)]))
    )?;
    writeln!(out, "b = {}", row(3, |i| number(triad.forward.bias[i])))?;
    let physical = triad.physical(Angles::Exact);
    writeln!(
        out,
        "\n[{name}.physical]\nformula = \"P = K Mo Mp, Mp = Rz Ry Rx by the misalignments, rows of Mo of unit length\""
    )?;
    let triples = [
        ("scale_factor", &physical.scale, 1.0),
        ("bias", &physical.bias, 1.0),
        (
            "misalignment_deg",
            &physical.misalignment,
            1f64.to_degrees(),
        ),
        (
            "non_orthogonality_deg",
            &physical.non_orthogonality,
            1f64.to_degrees(),
        ),
    ];
    for (key, triple, unit) in triples {
        let order = match key {
            "misalignment_deg" => "  # x, y, z",
            "non_orthogonality_deg" => "  # yz, zy, zx",
            _ => "",
        };
        writeln!(
            out,
            "{key} = {}{order}",
            row(3, |i| number(triple[i].value * unit))
        )?;
        writeln!(
            out,
            "sigma_{key} = {}",
            row(3, |i| format!("{:.3e}", triple[i].sigma * unit))
        )?;
    }
    Ok(())
}

/// All digits, so that it is read back exactly; minus zero, which only puzzles, is zero.
pub(super) fn number(value: f64) -> String {
    format!("{:?}", value + 0.0)
}

fn row(n: usize, cell: impl Fn(usize) -> String) -> String {
    format!("[{}]", (0..n).map(cell).collect::<Vec<_>>().join(", "))
}

fn matrix(cell: impl Fn(usize, usize) -> String) -> String {
    let rows: Vec<String> = (0..3)
        .map(|i| format!("  {},\n", row(3, |j| cell(i, j))))
        .collect();
    format!("[\n{}]", rows.concat())
}

pub(super) fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}
