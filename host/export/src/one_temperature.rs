//! An offset and a factor for each axis, for autopilots, from a calibration at one temperature.
//!
//! Both autopilots compute `x_i = (v_i - offset_i) scale_i` from the driver's value of a raw reading, `v_i = si_per_raw_i (u_i - zero_i)`. With `u =
//! P x + b`, and without the cross terms of P, `offset_i = si_per_raw_i (b_i - zero_i)` and `scale_i = 1 / (si_per_raw_i P_ii)`.

use mimu::calibration::Calibration;
use mimu::calibration::bias_cubic::Conversion;
use mimu::quantity::{AXES, Sensor};
use mimu::triad::Forward;
use mimu_recording::RawUnit;
use mimu_recording::error::{Argument, Error, Result};
use nalgebra::Vector3;

use crate::remaining::{self, Places};
use crate::{Export, parameters};

/// Names of the axes in parameter names.
pub(crate) const LETTERS: [&str; 3] = ["X", "Y", "Z"];

/// Offsets and factors of a triad.
pub(crate) struct Offsets {
    pub sensor: Sensor,
    /// Offset, SI.
    pub offset: Vector3<f64>,
    /// Factor, SI of the input per SI of the reading.
    pub scale: Vector3<f64>,
}

/// Offsets of each calibrated triad. The autopilot has no scale factors for a gyro; the remaining errors are added to `export`.
///
/// # Errors
/// An error of [`Conversion::of`], or this build cannot evaluate an effect.
pub(crate) fn offsets(
    calibration: &Calibration,
    options: &parameters::Options,
    export: &mut Export,
) -> Result<Vec<Offsets>> {
    let known = options.driver.conversions();
    export.formulas.push(
        "x = (v - offset) scale on each axis, raw to SI; v is the driver's output for a raw reading; a gyro has no scale.".into(),
    );
    export.notes.push(
        "Axes are those of the recording; they have to be those of the sensor in the autopilot."
            .into(),
    );
    let places = Places {
        cross_terms: false,
        temperature: false,
        effects: false,
    };
    export.remaining = remaining::of(calibration, places)?;
    let mut all = Vec::new();
    for sensor in Sensor::BOTH {
        let Some(forward) = calibration.inverse(sensor).as_ref().and_then(Forward::of) else {
            let note = format!("The calibration has no {sensor}, so nothing is written for it.");
            export.notes.push(note);
            continue;
        };
        let conversion = Conversion::of(calibration, sensor, &known[sensor], &forward)?;
        let list = |values: [f64; 3]| values.map(|v| format!("{v:.6}")).join(", ");
        export.formulas.push(format!(
            "{sensor}: v = [{}] (raw - [{}]) {}, raw to SI",
            list(conversion.si_per_raw),
            list(conversion.zero_raw),
            sensor.unit(),
        ));
        let assumed =
            known[sensor].si_per_raw.is_none() && calibration.recording.raw_unit != RawUnit::Si;
        if assumed {
            export.notes.push(format!(
                "{sensor}: the driver is assumed to convert with the scale factors of the calibration. Give its factors with --{sensor}-si-per-raw."
            ));
        }
        let gain = conversion.gain(&forward);
        if sensor == Sensor::Gyro {
            export
                .remaining
                .push(remaining::scale_factors(sensor, &gain));
        }
        all.push(Offsets {
            sensor,
            offset: conversion.bias(&forward),
            scale: gain.map(|gain| 1.0 / gain),
        });
    }
    Ok(all)
}

/// Refuses a value outside the parameter's range.
///
/// # Errors
/// It is outside `range`.
pub(crate) fn within(
    sensor: Sensor,
    axis: usize,
    (name, value, unit): (&str, f64, &str),
    [least, most]: [f64; 2],
    (remedy, argument): (&str, Argument),
) -> Result<()> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(Error::new(
        format!("{sensor}, axis {}", AXES[axis]),
        format!("{name} would be {value:.3}{unit}, but its range is {least} to {most}"),
        remedy,
    )
    .about(argument))
}
