//! Misalignment, sensitivity and offset for Fusion of x-io Technologies: a header in C.
//!
//! `calibrated = misalignment (sensitivity ∘ (uncalibrated - offset))`, raw readings to deg/s and g, the units of its AHRS. Therefore misalignment
//! times the diagonal of sensitivity is C, and offset is the bias of the raw readings. The function is `FusionModelInertial`, or
//! `FusionCalibrationInertial` in versions before 1.3, and `imufusion.model_inertial` in Python. Names as in its example. Source:
//! xioTechnologies/Fusion, Fusion/FusionModel.h, Examples/C/Advanced/main.c (2026-08).

use std::fmt::Write as _;

use mimu::quantity::Sensor;
use mimu::readable::STANDARD_GRAVITY;
use mimu_recording::error::Result;

use crate::convention::{Bias, Convention, Shape};
use crate::remaining::Places;
use crate::{Export, Nothing, Page, Sources, Target, driver};

/// The format.
pub struct Fusion;

impl Target for Fusion {
    type Options = Nothing;
    const NAME: &str = "fusion";
    const ABOUT: &str = "Both triads for Fusion of x-io: a header in C";
    const CONTENTS: &str = "C and o of both triads, in deg/s and g";
    const READERS: &str = "Fusion of x-io Technologies, in C";
    const CONVENTION: Convention =
        Convention::to_input(Shape::MisalignmentSensitivity, Bias::SubtractedFromReadings);
    const PAGES: &[Page] = &[Page::of("Fusion (x-io)", "fusion.h")];

    /// # Errors
    /// The calibration is missing, or an error of [`Convention::of`].
    fn export(from: &Sources, _: &Nothing) -> Result<Export> {
        let (calibration, place) = from.calibration()?;
        let mut export = Export::new::<Self>(from);
        let raw_unit = calibration.recording.raw_unit;
        let mut body = String::new();
        for (sensor, name, unit, per_si) in [
            (Sensor::Gyro, "gyroscope", "deg/s", 1.0_f64.to_degrees()),
            (Sensor::Accel, "accelerometer", "g", 1.0 / STANDARD_GRAVITY),
        ] {
            if calibration.table(sensor).is_none() {
                export.note(format!("The {sensor} is not calibrated."));
                continue;
            }
            let parts = Self::CONVENTION.of(&driver::raw(calibration, place, sensor)?)?;
            export.formula(format!(
                "{name}: calibrated = misalignment * (sensitivity o (raw - offset)), {raw_unit} to {unit}, o by elements; in the frame of the calibration"
            ));
            let misalignment = parts.left.transpose();
            let sensitivity = per_si * parts.right.diagonal();
            for (kind, what, values, unit) in [
                (
                    "Matrix",
                    "Misalignment",
                    misalignment.as_slice(),
                    "1, by rows".into(),
                ),
                (
                    "Vector",
                    "Sensitivity",
                    sensitivity.as_slice(),
                    format!("{unit} per {raw_unit}"),
                ),
                (
                    "Vector",
                    "Offset",
                    parts.bias.as_slice(),
                    raw_unit.to_string(),
                ),
            ] {
                let values: Vec<String> =
                    values.iter().map(|v| format!("{:?}f", *v as f32)).collect();
                let values = values.join(", ");
                let _ = writeln!(
                    body,
                    "static const Fusion{kind} {name}{what} = {{{{{values}}}}}; // {unit}"
                );
            }
            body.push('\n');
        }
        export.note("FusionModelInertial(raw, misalignment, sensitivity, offset); before version 1.3 FusionCalibrationInertial. 1 g is 9.80665 m/s^2.");
        export.temperature(calibration);
        export.leaves(calibration, Places::Matrix);
        let head = export.head("//", from);
        Ok(export.with(format!(
            "{head}\n#ifndef MIMU_FUSION_CALIBRATION_H\n#define MIMU_FUSION_CALIBRATION_H\n\n#include \"Fusion.h\"\n\n{body}#endif\n"
        )))
    }
}
