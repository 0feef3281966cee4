//! Biases and scale factors of the accelerometer for INAV, as lines of its CLI.
//!
//! INAV computes `(code - acczero) accgain / 4096` on the axes of the sensor, before it rotates them to those of the craft. All numbers are whole. It
//! has no scale factors of the gyro, and measures the gyro's bias at every start (`init_gyro_cal`). Source: iNavFlight/inav,
//! src/main/sensors/acceleration.c, `applyAccelerationZero`, `accUpdate`; sensors/gyro.c, `gyroUpdateAndCalibrate`; docs/Settings.md (2026-07).

use mimu::quantity::{AXES, Sensor};
use mimu_recording::error::Result;

use crate::flight_codes::{codes, whole};
use crate::remaining::Remaining;
use crate::{Export, Sources, driver, heading};

/// INAV's gain of a scale factor of 1.
const UNITY: f64 = 4096.0;

/// Options of the lines.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Codes of the accelerometer for 1 g, acc_1G in INAV's driver of the sensor: 2048 where its range is ±16 g, as of an MPU6000
    #[cfg_attr(feature = "clap", arg(long = "acc-1g", value_name = "CODES", value_parser = crate::options::positive))]
    pub acc_1g: f64,
    /// The driver's conversion.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub driver: driver::Options,
}

/// Text of the lines.
///
/// # Errors
/// No accelerometer is calibrated, C is singular, or a number is outside INAV's range.
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let mut export = Export::new("inav", from);
    export.formulas.push(format!(
        "accel: output = (code - acczero) accgain / 4096 on each axis of the sensor, {} codes for 1 g",
        options.acc_1g
    ));
    let accel = codes(
        calibration,
        place,
        options.acc_1g,
        &options.driver,
        &mut export,
    )?;
    export.notes.push("Axes have to be those of the sensor, before INAV's alignment of sensor and board: accSmooth of a log has them only if both alignments are 0.".into());
    export
        .notes
        .push("Record with acczero 0 and accgain 4096. Paste the lines into the CLI.".into());
    export
        .remaining
        .push(Remaining::of_rounding(Sensor::Accel, accel.step));
    let (mut zeros, mut gains) = (String::new(), String::new());
    for (i, axis) in AXES.iter().enumerate() {
        let zero = whole(
            axis,
            &format!("acczero_{axis}"),
            accel.zero[i],
            [-32768, 32767],
        )?;
        let gain = whole(
            axis,
            &format!("accgain_{axis}"),
            UNITY / accel.gain[i],
            [1, 8192],
        )?;
        zeros.push_str(&format!("set acczero_{axis} = {zero}\n"));
        gains.push_str(&format!("set accgain_{axis} = {gain}\n"));
    }
    let out = heading::comments("#", &heading::of_calibration(calibration, &export));
    export.content = (out + &zeros + &gains + "save\n").into_bytes();
    Ok(export)
}
