//! Biases of the accelerometer for Betaflight, as lines of its CLI.
//!
//! Betaflight rotates the codes of the accelerometer to the axes of the craft (x forward, y left, z up) and subtracts three whole codes:
//! `acc_calibration = x,y,z,1`; the last number says that there is a calibration. It has no scale factors, and measures the gyro's bias at every start.
//! Source: betaflight/betaflight, src/main/sensors/acceleration.c, `accUpdate`, `applyAccelerationTrims`; acceleration_init.c,
//! `performAccelerometerCalibration`; sensors/boardalignment.c; cli/settings.c, `acc_calibration` (2026-08).

use mimu::quantity::{AXES, Sensor};
use mimu_recording::error::Result;

use crate::flight_codes::{codes, whole};
use crate::remaining::{self, Remaining};
use crate::{Export, Sources, driver, heading};

/// Options of the lines.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Codes of the accelerometer for 1 g: 2048 with nearly every sensor, 4096 with a BMI160, 1024 with one of 32 g
    #[cfg_attr(feature = "clap", arg(long = "acc-1g", value_name = "CODES", default_value_t = 2048.0, value_parser = crate::options::positive))]
    pub acc_1g: f64,
    /// The driver's conversion.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub driver: driver::Options,
}

/// Text of the lines.
///
/// # Errors
/// No accelerometer is calibrated, C is singular, or a bias is no number of 16 bits.
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let mut export = Export::new("betaflight", from);
    export.formulas.push(format!(
        "accel: output = code - acc_calibration on each axis of the craft (x forward, y left, z up), {} codes for 1 g",
        options.acc_1g
    ));
    let accel = codes(
        calibration,
        place,
        options.acc_1g,
        &options.driver,
        &mut export,
    )?;
    export.notes.push("Axes have to be those of the craft, after the alignment of sensor and board, as in accSmooth of a log. Record with acc_calibration = 0,0,0,1.".into());
    export.notes.push("Paste the lines into the CLI. The trims for level flight (acc_trim_roll, acc_trim_pitch) are left as they are.".into());
    export
        .remaining
        .push(remaining::scale_factors(Sensor::Accel, &accel.gain));
    export
        .remaining
        .push(Remaining::of_rounding(Sensor::Accel, accel.step));
    let mut zero = [0; 3];
    for (i, axis) in AXES.iter().enumerate() {
        zero[i] = whole(axis, "acc_calibration", accel.zero[i], [-32768, 32767])?;
    }
    let [x, y, z] = zero;
    let mut out = heading::comments("#", &heading::of_calibration(calibration, &export));
    out.push_str(&format!("set acc_calibration = {x},{y},{z},1\nsave\n"));
    export.content = out.into_bytes();
    Ok(export)
}
