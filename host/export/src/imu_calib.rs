//! The accelerometer for the ROS package imu_calib: imu_calib.yaml.
//!
//! `corrected = SM raw - bias`, readings of a driver, SI to SI. Therefore SM = C and bias = -o; SM is one list by rows. The node `apply_calib` has no
//! calibration of the gyro: it subtracts the mean of the first messages, and leaves scale factors and cross terms. Source: dpkoch/imu_calib,
//! src/accel_calib/accel_calib.cpp, `loadCalib` and `applyCalib`; src/apply_calib.cpp (2016-06).

use mimu::quantity::Sensor;
use mimu_recording::error::Result;

use crate::remaining::{self, Places, Remaining};
use crate::{Export, Sources, driver, heading, yaml};

/// Options of the file.
pub type Options = driver::Options;

/// Text of `imu_calib.yaml`.
///
/// # Errors
/// No accelerometer is calibrated, or C is singular.
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let readings = options.readings(calibration, place, Sensor::Accel)?;
    let mut export = Export::new("imu-calib", from);
    export.formulas.push(
        "accel: output = SM reading - bias, m/s^2 to m/s^2; SM by rows, output in the frame of the calibration"
            .into(),
    );
    export.notes.push(readings.line());
    export.notes.extend(heading::temperature(calibration));
    let places = Places {
        cross_terms: true,
        temperature: false,
        effects: false,
    };
    export.remaining = remaining::of(calibration, places)?;
    export.remaining.retain(|r| r.sensor == Sensor::Accel);
    if calibration.gyro.is_some() {
        let gyro = options.readings(calibration, place, Sensor::Gyro)?;
        export.notes.push("gyro: imu_calib only subtracts the mean of the first messages. Keep the unit still during them.".into());
        export.notes.push(gyro.line());
        export
            .remaining
            .push(Remaining::of_readings(Sensor::Gyro, &gyro.forward.matrix));
    }
    let comments = heading::of_calibration(calibration, &export);
    let mut out = heading::comments("#", &comments);
    let matrix = readings.inverse.matrix.transpose();
    yaml::list(&mut out, "", "SM", matrix.iter().copied());
    let bias = -readings.inverse.offset;
    yaml::list(&mut out, "", "bias", bias.iter().copied());
    export.content = out.into_bytes();
    Ok(export)
}
