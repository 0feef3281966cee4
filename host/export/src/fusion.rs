//! Misalignment, sensitivity and offset for Fusion of x-io Technologies: a header in C.
//!
//! `calibrated = misalignment (sensitivity ∘ (uncalibrated - offset))`, raw readings to deg/s and g, the units of its AHRS. Therefore misalignment
//! times the diagonal of sensitivity is C, and offset is the bias of the raw readings. The function is `FusionModelInertial`, or
//! `FusionCalibrationInertial` in versions before 1.3, and `imufusion.model_inertial` in Python. Names as in its example. Source:
//! xioTechnologies/Fusion, Fusion/FusionModel.h, Examples/C/Advanced/main.c (2026-08).

use std::fmt::Write as _;

use mimu::quantity::Sensor;
use mimu::readable::STANDARD_GRAVITY;
use mimu::triad::Forward;
use mimu_recording::error::{Error, Result};

use crate::misalignment::Misalignment;
use crate::remaining::{self, Places};
use crate::{Export, Sources, heading};

/// Text of the header.
///
/// # Errors
/// The calibration is missing, or an error of [`Misalignment::of`].
pub fn export(from: &Sources) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let mut export = Export::new("fusion", from);
    let raw_unit = calibration.recording.raw_unit;
    let mut body = String::new();
    for sensor in [Sensor::Gyro, Sensor::Accel] {
        let (name, unit, per_si) = match sensor {
            Sensor::Gyro => ("gyroscope", "deg/s", 1.0_f64.to_degrees()),
            Sensor::Accel => ("accelerometer", "g", 1.0 / STANDARD_GRAVITY),
        };
        let Some(model) = calibration.inverse(sensor) else {
            export
                .notes
                .push(format!("The {sensor} is not calibrated."));
            continue;
        };
        let raw = Forward::of(&model).ok_or_else(|| {
            let problem = format!("C of the {sensor} is singular");
            Error::new(place, problem, "fit the recording again")
        })?;
        let factors = Misalignment::of(&model.matrix, sensor)?;
        export.formulas.push(format!(
            "{name}: calibrated = misalignment * (sensitivity o (raw - offset)), {raw_unit} to {unit}, o by elements; in the frame of the calibration"
        ));
        let numbers = [
            (
                "Matrix",
                "Misalignment",
                factors.matrix.transpose().as_slice().to_vec(),
                "1, by rows".into(),
            ),
            (
                "Vector",
                "Sensitivity",
                (per_si * factors.sensitivity).as_slice().to_vec(),
                format!("{unit} per {raw_unit}"),
            ),
            (
                "Vector",
                "Offset",
                raw.bias.as_slice().to_vec(),
                raw_unit.to_string(),
            ),
        ];
        for (kind, what, values, unit) in numbers {
            let values: Vec<String> = values.iter().map(|v| format!("{:?}f", *v as f32)).collect();
            let values = values.join(", ");
            let _ = writeln!(
                body,
                "static const Fusion{kind} {name}{what} = {{{{{values}}}}}; // {unit}"
            );
        }
        body.push('\n');
    }
    let note = "FusionModelInertial(raw, misalignment, sensitivity, offset); before version 1.3 FusionCalibrationInertial. 1 g is 9.80665 m/s^2.";
    export.notes.push(note.into());
    export.notes.extend(heading::temperature(calibration));
    let places = Places {
        cross_terms: true,
        temperature: false,
        effects: false,
    };
    export.remaining = remaining::of(calibration, places)?;
    let mut out = heading::comments("//", &heading::of_calibration(calibration, &export));
    out.push_str("\n#ifndef MIMU_FUSION_CALIBRATION_H\n#define MIMU_FUSION_CALIBRATION_H\n\n#include \"Fusion.h\"\n\n");
    out.push_str(&body);
    out.push_str("#endif\n");
    export.content = out.into_bytes();
    Ok(export)
}
