//! Machine-readable results: `mimu-fit/1`, `mimu-verify/1`, `mimu-import/1`.

use serde::Serialize;
use serde_json::{Value, json};

use mimu::dwell::Dwells;
use mimu::fit::{Fit, SensorFit};
use mimu::quantity::AXES;
use mimu::quantity::Sensor;
use mimu::quantity::{inverse_names, raw_unit, scale_unit};
use mimu::triad::{Angles, Estimate};
use mimu::verify::Verification;
use mimu_recording::{ImportSummary, RawUnit};

/// A parameter with its uncertainty.
#[derive(Serialize)]
struct Parameter {
    name: String,
    value: f64,
    sigma: f64,
    /// Ends of the 95 % interval.
    lower: f64,
    upper: f64,
    unit: String,
}

/// Result of `mimu fit`.
pub fn fit_json(fit: &Fit) -> Value {
    let mut sensors = serde_json::Map::new();
    for sensor in &fit.sensors {
        sensors.insert(sensor.sensor.name().into(), sensor_json(fit, sensor));
    }
    json!({
        "format": "mimu-fit/1",
        "tool": concat!("mimu ", env!("CARGO_PKG_VERSION")),
        "device": fit.prepared.manifest.device,
        "sha256": fit.prepared.condensed.sha256,
        "rows": fit.prepared.condensed.rows,
        "period_s": fit.prepared.condensed.period_s,
        "gaps": { "count": fit.prepared.condensed.gaps.0, "missing_s": fit.prepared.condensed.gaps.1 },
        "duplicates": fit.prepared.condensed.duplicates,
        "holdout_blocks": fit.options.holdout_blocks,
        "sensors": sensors,
        "detection": detection(&fit.prepared.dwells),
        "dwells": dwells(&fit.prepared.dwells),
        "warnings": warnings(fit),
    })
}

fn warnings(fit: &Fit) -> Vec<&String> {
    fit.warnings
        .iter()
        .chain(fit.sensors.iter().flat_map(|s| &s.warnings))
        .collect()
}

fn detection(dwells: &Dwells) -> Value {
    dwells.detection.map_or(Value::Null, |d| {
        json!({
            "window_s": d.window_s,
            "guard_s": d.guard_s,
            "shortest_s": d.shortest_s,
            "still_factor": d.still_factor,
            "gyro_still_factor": d.gyro_still_factor,
            "floor_raw": d.floor,
        })
    })
}

fn dwells(dwells: &Dwells) -> Vec<Value> {
    let list = dwells.list.iter().map(|d| {
        let fault = |s: Sensor| d.fault(s).map(|f| f.to_string());
        json!({
            "step": d.step,
            "first_row": d.first_row,
            "rows": d.rows,
            "start_s": d.start_s,
            "duration_s": d.duration_s,
            "temp_c": d.temp_c, // not a number is null
            "raw_mean": d.raw.map(|m| m.mean),
            "clipped": d.raw.map(|m| m.clipped),
            "gyro_not_used": fault(Sensor::Gyro),
            "accel_not_used": fault(Sensor::Accel),
        })
    });
    list.collect()
}

fn sensor_json(fit: &Fit, sensor: &SensorFit) -> Value {
    let scatter: serde_json::Map<_, _> = sensor
        .estimated
        .scatter
        .iter()
        .map(|(name, s)| {
            (
                name.clone(),
                json!({ "chi2": s.chi2, "dof": s.dof, "excess_sigma": s.excess.sqrt() }),
            )
        })
        .collect();
    let residuals: Vec<Value> = sensor
        .residuals
        .iter()
        .map(|r| {
            json!({
                "step": fit.prepared.dwells.list[r.dwell].step,
                "value": <[f64; 3]>::from(r.value),
                "held_out": r.held_out.map(<[f64; 3]>::from),
                "floor": r.floor,
            })
        })
        .collect();
    let mut value = json!({
        "estimator": fit.estimator(sensor.sensor),
        "parameters": parameters(fit.prepared.manifest.raw_unit, sensor),
        "rms": sensor.rms(),
        "held_out_rms": sensor.held_out_rms(),
        "noise_floor": sensor.noise_floor(),
        "unit": sensor.figure.unit(sensor.sensor),
        "figure": sensor.figure.description(),
        "dwells": sensor.dwells,
        "condition": sensor.estimated.condition,
        "small_angle": small_angle(sensor),
        "scatter": scatter,
        "not_held_out": sensor.not_held_out,
        "residuals": residuals,
    });
    if let Some((rms, held_out)) = sensor.static_rms {
        value["static_rms"] = json!(rms);
        value["static_held_out_rms"] = json!(held_out);
    }
    value
}

/// Physical quantities to first order in the angles, fang (14): for comparison with what others publish.
fn small_angle(sensor: &SensorFit) -> Value {
    let physical = sensor.estimated.triad.physical(Angles::Small);
    let both =
        |t: &[Estimate; 3]| json!({ "value": t.map(|e| e.value), "sigma": t.map(|e| e.sigma) });
    json!({
        "scale": both(&physical.scale),
        "bias": both(&physical.bias),
        "misalignment_rad": both(&physical.misalignment),
        "non_orthogonality_yz_zy_zx_rad": both(&physical.non_orthogonality),
    })
}

fn parameters(raw: RawUnit, sensor: &SensorFit) -> Vec<Parameter> {
    let triad = &sensor.estimated.triad;
    let si = sensor.sensor.unit();
    let parameter = |name: String, e: Estimate, unit: String| Parameter {
        name,
        value: e.value,
        sigma: e.sigma,
        lower: e.value - e.interval,
        upper: e.value + e.interval,
        unit,
    };
    let inverse_unit = match raw {
        RawUnit::Si => "1".to_string(),
        other => format!("({si})/{other}"),
    };
    let estimates = triad.inverse_estimates();
    let mut all = Vec::new();
    for (i, name) in inverse_names().into_iter().enumerate() {
        let unit = if i < 9 {
            inverse_unit.clone()
        } else {
            si.to_string()
        };
        all.push(parameter(name, estimates[i], unit));
    }
    let physical = triad.physical(Angles::Exact);
    for (i, axis) in AXES.iter().enumerate() {
        all.push(parameter(
            format!("scale_{axis}"),
            physical.scale[i],
            scale_unit(raw, si),
        ));
    }
    for (i, axis) in AXES.iter().enumerate() {
        all.push(parameter(
            format!("bias_{axis}"),
            physical.bias[i],
            raw_unit(raw, si),
        ));
    }
    for (i, axis) in AXES.iter().enumerate() {
        all.push(parameter(
            format!("misalignment_{axis}"),
            physical.misalignment[i],
            "rad".into(),
        ));
    }
    for (i, pair) in ["yz", "zy", "zx"].iter().enumerate() {
        all.push(parameter(
            format!("non_orthogonality_{pair}"),
            physical.non_orthogonality[i],
            "rad".into(),
        ));
    }
    all
}

/// Result of `mimu verify`.
pub fn verify_json(verification: &Verification) -> Value {
    let mut sensors = serde_json::Map::new();
    for s in &verification.sensors {
        let mut value = json!({
            "rms_raw": s.rms_raw,
            "rms": s.rms,
            "max": s.max,
            "noise_floor": s.noise_floor,
            "unit": s.figure.unit(s.sensor),
            "figure": s.figure.description(),
            "count": s.count,
        });
        if let Some(rms) = s.rms_affine {
            value["rms_affine"] = json!(rms);
        }
        if let Some(rms) = s.static_rms {
            value["static_rms"] = json!(rms);
        }
        sensors.insert(s.sensor.name().into(), value);
    }
    json!({ "format": "mimu-verify/1", "sensors": sensors, "warnings": verification.warnings })
}

/// Result of `mimu import`.
pub fn import_json(summary: &ImportSummary) -> Value {
    json!({
        "format": "mimu-import/1",
        "rows": summary.rows,
        "sample_rate_hz": summary.sample_rate_hz,
        "skipped_lines": {
            "header": summary.skipped.header,
            "comment": summary.skipped.comment,
            "blank": summary.skipped.blank,
        },
        "dropped_outside": summary.dropped_outside,
        "dropped_in_gaps": summary.dropped_in_gaps,
        "interpolated": summary.interpolated,
        "empty_cells": summary.empty_cells,
        "warnings": summary.warnings,
    })
}
