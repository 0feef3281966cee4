//! Misalignment, sensitivity and offset for Fusion of x-io Technologies: a header in C.
//!
//! `calibrated = misalignment (sensitivity ∘ (uncalibrated - offset))`, raw readings to deg/s and g, the units of its AHRS. Therefore misalignment
//! times the diagonal of sensitivity is C, and offset is the bias of the raw readings. The function is `FusionModelInertial`, or
//! `FusionCalibrationInertial` in versions before 1.3, and `imufusion.model_inertial` in Python. Names as in its example.
//!
//! A magnetometer: `calibrated = softIronMatrix (uncalibrated - hardIronOffset)`, in any unit, as its AHRS takes the direction only; softIronMatrix is R C, so
//! the field is in the frame of the gyro. The function is `FusionModelMagnetic`, before 1.3 `FusionCalibrationMagnetic`.
//!
//! Source: xioTechnologies/Fusion, Fusion/FusionModel.h, Examples/C/Advanced/main.c (2026-08).

use std::fmt::Write as _;

use mimu::{Calibration, STANDARD_GRAVITY, Sensor};
use mimu_recording::error::Result;

use crate::convention::{Bias, Convention, Shape};
use crate::layout::{Entry, Numbers};
use crate::remaining::Places;
use crate::{Export, Nothing, Page, Sources, Target, body, driver};

/// A degree.
const DEG: f64 = std::f64::consts::PI / 180.0;
/// How a magnetometer is written.
const MAGNETIC: Convention = Convention::to_input(Shape::Whole, Bias::SubtractedFromReadings);

/// The format.
pub struct Fusion;

impl Target for Fusion {
    type Options = Nothing;
    const NAME: &str = "fusion";
    const ABOUT: &str = "Gyro, accelerometer and magnetometer for Fusion of x-io: a header in C";
    const CONTENTS: &str = "C and o of both triads, in deg/s and g, and of a magnetometer";
    const READERS: &str = "Fusion of x-io Technologies, in C";
    const CONVENTION: Convention =
        Convention::to_input(Shape::MisalignmentSensitivity, Bias::SubtractedFromReadings);
    const FURTHER_TRIADS: bool = true;
    const TAKES_RAW: bool = true;
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Gyro, Numbers::Left, "gyroscopeMisalignment"),
        Entry::of(Sensor::Gyro, Numbers::RightDiagonal, "gyroscopeSensitivity").scaled(0.0, DEG),
        Entry::of(Sensor::Gyro, Numbers::Bias, "gyroscopeOffset"),
        Entry::of(Sensor::Accel, Numbers::Left, "accelerometerMisalignment"),
        Entry::of(
            Sensor::Accel,
            Numbers::RightDiagonal,
            "accelerometerSensitivity",
        )
        .scaled(0.0, STANDARD_GRAVITY),
        Entry::of(Sensor::Accel, Numbers::Bias, "accelerometerOffset"),
    ];
    const NOT_READ: &[&str] = &["softIronMatrix", "hardIronOffset"];
    const PAGES: &[Page] = &[Page::of("Fusion (x-io)", "fusion.h")];

    /// # Errors
    /// The calibration is missing, or an error of [`Convention::of`].
    fn export(from: &Sources, _: &Nothing) -> Result<Export> {
        let (calibration, place) = from.calibration()?;
        let mut export = Export::new::<Self>(from);
        let raw_unit = calibration.recording.raw_unit;
        let mut body = String::new();
        for (sensor, name, unit) in [
            (Sensor::Gyro, "gyroscope", "deg/s"),
            (Sensor::Accel, "accelerometer", "g"),
        ] {
            if calibration.table(sensor).is_none() {
                export.note(format!("The {sensor} is not calibrated."));
                continue;
            }
            let parts = Self::CONVENTION.of(&driver::raw(calibration, place, sensor)?)?;
            export.formula(format!(
                "{name}: calibrated = misalignment * (sensitivity o (raw - offset)), {raw_unit} to {unit}, o by elements; in the frame of the calibration"
            ));
            for entry in Self::LAYOUT.iter().filter(|entry| entry.sensor == sensor) {
                let (kind, unit) = match entry.numbers {
                    Numbers::Left => ("Matrix", "1, by rows".into()),
                    Numbers::Bias => ("Vector", raw_unit.to_string()),
                    _ => ("Vector", format!("{unit} per {raw_unit}")),
                };
                constant(&mut body, kind, entry.key, &entry.values(&parts), &unit);
            }
            body.push('\n');
        }
        magnetometer(calibration, place, &mut body, &mut export)?;
        export.note("FusionModelInertial(raw, misalignment, sensitivity, offset); before version 1.3 FusionCalibrationInertial. 1 g is 9.80665 m/s^2.");
        export.temperature(calibration);
        export.leaves(calibration, Places::Matrix);
        let head = export.head("//", from);
        Ok(export.with(format!(
            "{head}\n#ifndef MIMU_FUSION_CALIBRATION_H\n#define MIMU_FUSION_CALIBRATION_H\n\n#include \"Fusion.h\"\n\n{body}#endif\n"
        )))
    }
}

/// A constant of the header.
fn constant(out: &mut String, kind: &str, name: &str, values: &[f64], unit: &str) {
    let values: Vec<String> = values.iter().map(|v| format!("{:?}f", *v as f32)).collect();
    let values = values.join(", ");
    let _ = writeln!(
        out,
        "static const Fusion{kind} {name} = {{{{{values}}}}}; // {unit}"
    );
}

fn magnetometer(
    calibration: &Calibration,
    place: &str,
    out: &mut String,
    export: &mut Export,
) -> Result<()> {
    let Some(mag) = body::only_mag(calibration, export) else {
        return Ok(());
    };
    let parts = MAGNETIC.of(&body::readings(mag, false, Some(1.0), place)?)?;
    let (raw, unit) = (body::raw_unit(mag), &mag.unit);
    let frame = match mag.rotation_deg {
        Some(_) => "in the frame of the calibration",
        None => "in its own frame",
    };
    export.formula(format!(
        "magnetometer: calibrated = softIronMatrix * (raw - hardIronOffset), {raw} to {unit}, {frame}: FusionModelMagnetic(raw, softIronMatrix, hardIronOffset)"
    ));
    let matrix = parts.left.transpose();
    let per_raw = format!("{unit} per {raw}, by rows");
    constant(out, "Matrix", "softIronMatrix", matrix.as_slice(), &per_raw);
    constant(out, "Vector", "hardIronOffset", parts.bias.as_slice(), &raw);
    out.push('\n');
    Ok(())
}
