//! Biases and scale factors of the accelerometer for INAV, as lines of its CLI.
//!
//! INAV computes `(code - acczero) accgain / 4096` on the axes of the sensor, before it rotates them to those of the craft. All numbers are whole. It
//! has no scale factors of the gyro, and measures the gyro's bias at every start (`init_gyro_cal`). Source: iNavFlight/inav,
//! src/main/sensors/acceleration.c, `applyAccelerationZero`, `accUpdate`; sensors/gyro.c, `gyroUpdateAndCalibrate`; docs/Settings.md (2026-07).

use clap::Args;
use mimu::quantity::AXES;
use mimu_recording::error::Result;

use crate::convention::{Bias, Convention, Shape};
use crate::driver::{self, positive};
use crate::flight_codes::{codes, whole};
use crate::{Export, Sources, Target};

/// INAV's gain of a scale factor of 1.
const UNITY: f64 = 4096.0;

/// Options of the lines.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Codes of the accelerometer for 1 g, acc_1G in INAV's driver of the sensor: 2048 where its range is ±16 g, as of an MPU6000
    #[arg(long = "acc-1g", value_name = "CODES", value_parser = positive)]
    pub acc_1g: f64,
    /// The driver's conversion.
    #[command(flatten)]
    pub driver: driver::Options,
}

/// The format.
pub struct Inav;

impl Target for Inav {
    type Options = Options;
    const NAME: &str = "inav";
    const ABOUT: &str = "Biases and scale factors of the accelerometer for INAV: lines of its CLI";
    const CONTENTS: &str = "biases and scale factors of the accelerometer";
    const READERS: &str = "INAV";
    const CONVENTION: Convention = Convention::to_input(Shape::Axes, Bias::SubtractedFromReadings);

    /// # Errors
    /// No accelerometer is calibrated, C is singular, or a number is outside INAV's range.
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let mut export = Export::new::<Self>(from);
        export.formula(format!(
            "accel: output = (code - acczero) accgain / 4096 on each axis of the sensor, {} codes for 1 g",
            options.acc_1g
        ));
        let accel = codes(
            from,
            options.acc_1g,
            &options.driver,
            Self::CONVENTION,
            &mut export,
        )?;
        export.note("Axes have to be those of the sensor, before INAV's alignment of sensor and board: accSmooth of a log has them only if both alignments are 0.");
        export.note("Record with acczero 0 and accgain 4096. Paste the lines into the CLI.");
        export.remaining.push(accel.rounding());
        let (mut zeros, mut gains) = (String::new(), String::new());
        for (i, axis) in AXES.iter().enumerate() {
            let name = format!("acczero_{axis}");
            let zero = whole(i, &name, accel.zero[i], [-32768, 32767])?;
            zeros += &format!("set {name} = {zero}\n");
            let name = format!("accgain_{axis}");
            let gain = whole(i, &name, UNITY / accel.gain[i], [1, 8192])?;
            gains += &format!("set {name} = {gain}\n");
        }
        let head = export.head("#", from);
        Ok(export.with(head + &zeros + &gains + "save\n"))
    }
}
