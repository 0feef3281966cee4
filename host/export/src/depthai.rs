//! The inertial unit of OAK cameras: `imuCalibrationParams` of DepthAI's calibration, as JSON.
//!
//! The camera computes `calibrated = Q uncalibrated + b` from the streams ACCELEROMETER_UNCALIBRATED and GYROSCOPE_UNCALIBRATED, SI to SI, in the
//! frame of the camera (x right, y down, z forward). Therefore Q = C and b = o: DepthAI's b is added, where most programs subtract their bias. Each
//! triad is a list of three rows `[q0, q1, q2, b]`.
//!
//! Source: luxonis/depthai-core 3.6, include/depthai/common/ImuParameters.hpp, `ImuCalibrationParams`; the test of the camera's streams, "runtime
//! calibration applies bias offsets" and `applyCalibration`; device/CalibrationHandler.hpp, `setAccelerometerCalibration` (2026-04).

use mimu::quantity::{AXES, PerSensor, Sensor};
use mimu_recording::error::Result;
use serde_json::{Map, Value, json};

use crate::driver::Readings;
use crate::remaining::{self, Places};
use crate::worst_axis::{self, WalkOptions};
use crate::{Export, Sources, driver, heading};

/// Options of the file.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Type of the inertial unit, as DepthAI names it, such as BMI270
    #[cfg_attr(feature = "clap", arg(long, value_name = "NAME", default_value = ""))]
    pub imu: String,
    /// Random walks.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub walks: WalkOptions,
    /// The driver's conversion.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub driver: driver::Options,
}

/// Text of the file.
///
/// # Errors
/// The calibration or a triad of it is missing, C is singular, or an error of [`WalkOptions::axes`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let readings = PerSensor {
        gyro: options.driver.readings(calibration, place, Sensor::Gyro)?,
        accel: options.driver.readings(calibration, place, Sensor::Accel)?,
    };
    let mut export = Export::new("depthai", from);
    export.notes.extend(from.other_device());
    export.formulas.push(
        "calibrated = Q uncalibrated + b, SI to SI, b is added; three rows [q0, q1, q2, b] for each triad".into(),
    );
    export
        .notes
        .extend([readings.accel.line(), readings.gyro.line()]);
    export.notes.push("Record the streams ACCELEROMETER_UNCALIBRATED and GYROSCOPE_UNCALIBRATED: they have the camera's axes, and no calibration.".into());
    export.notes.push("Merge the file into the camera's calibration: update eepromToJson()[\"imuCalibrationParams\"] with it, then fromJson() and device.setCalibration() or flashCalibration().".into());
    export.notes.extend(heading::temperature(calibration));
    let places = Places {
        cross_terms: true,
        temperature: false,
        effects: false,
    };
    export.remaining = remaining::of(calibration, places)?;
    let mut triads = Map::new();
    for (name, readings) in [
        ("accelerometer", &readings.accel),
        ("gyroscope", &readings.gyro),
    ] {
        triads.insert(name.into(), rows(readings));
    }
    match from.noise {
        Some(_) => {
            triads.insert("noise".into(), noise(from, options, &mut export)?);
        }
        None => export
            .notes
            .push("The file has no noise: the camera keeps its own. Add --noise for one.".into()),
    }
    let value = json!({
        "about": heading::of_calibration(calibration, &export),
        "imuCalibrationParams": triads,
    });
    export.content = (format!("{value:#}") + "\n").into_bytes();
    Ok(export)
}

fn rows(readings: &Readings) -> Value {
    let inverse = &readings.inverse;
    let row = |i: usize| {
        let q = inverse.matrix.row(i);
        json!([q[0], q[1], q[2], inverse.offset[i]])
    };
    json!([row(0), row(1), row(2)])
}

/// Noise of each axis of the calibrated readings.
fn noise(from: &Sources, options: &Options, export: &mut Export) -> Result<Value> {
    let noise = from.noise()?;
    let axes = options.walks.axes(noise, &PerSensor::both([1.0; 3]))?;
    export.formulas.push("noiseDensity = N and randomWalk = K, continuous time, biasStability = B, of the calibrated readings in SI; 0 is not known".into());
    let triad = |sensor: Sensor| {
        let mut out = Map::new();
        for (axis, densities) in AXES.iter().zip(&axes[sensor]) {
            let instability = worst_axis::instability(noise, sensor, axis);
            if instability.is_none() {
                let note = format!(
                    "{sensor}, {axis}: the record shows no bias instability, so biasStability is 0."
                );
                export.notes.push(note);
            }
            let value = json!({
                "noiseDensity": densities.white.value,
                "randomWalk": densities.walk.value,
                "biasStability": instability.unwrap_or(0.0),
            });
            out.insert((*axis).into(), value);
        }
        Value::from(out)
    };
    let [accel, gyro] = [Sensor::Accel, Sensor::Gyro].map(triad);
    Ok(json!({"name": options.imu, "accelerometer": accel, "gyroscope": gyro}))
}
