//! Biases and scale factors of the accelerometer and of the compass for INAV, as lines of its CLI.
//!
//! INAV computes `(code - acczero) accgain / 4096` on the axes of the sensor, before it rotates them to those of the craft. All numbers are whole. It
//! has no scale factors of the gyro, and measures the gyro's bias at every start (`init_gyro_cal`). Source: iNavFlight/inav,
//! src/main/sensors/acceleration.c, `applyAccelerationZero`, `accUpdate`; sensors/gyro.c, `gyroUpdateAndCalibrate`; docs/Settings.md (2026-07).
//!
//! Of the compass it computes `(code - magzero) 1024 / maggain` on the axes of the sensor: maggain is the reading for the field, and the output for the field
//! is 1024. INAV uses its direction only. Source: src/main/sensors/compass.c, `compassUpdate`.

use std::fmt::Display;

use clap::Args;
use mimu::quantity::{AXES, Sensor};
use mimu_recording::error::Result;
use nalgebra::Vector3;

use crate::body::FIELD;
use crate::convention::{Bias, Convention, Shape};
use crate::driver::{self, positive};
use crate::flight_codes::{CODE, CODES, MAG, codes, compass, whole};
use crate::layout::{Entry, Numbers};
use crate::{Export, Sources, Target};

/// INAV's gain of a scale factor of 1.
const UNITY: f64 = 4096.0;
/// Field for which the compass's output is 1024 if the calibration has it in microtesla: only ratios of the axes count.
const TYPICAL_FIELD_UT: f64 = 50.0;

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
    const ABOUT: &str =
        "Biases and scale factors of the accelerometer and the compass for INAV: lines of its CLI";
    const CONTENTS: &str = "biases and scale factors of the accelerometer and of the compass";
    const READERS: &str = "INAV";
    const CONVENTION: Convention = Convention::to_input(Shape::Axes, Bias::SubtractedFromReadings);
    const FURTHER_TRIADS: bool = true;
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Accel, Numbers::Bias, "acczero_{axis}").scaled(0.0, CODE),
        Entry::of(Sensor::Accel, Numbers::LeftDiagonal, "accgain_{axis}").scaled(0.0, 1.0 / UNITY),
    ];
    const NOT_READ: &[&str] = &["magzero", "maggain"];

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
        let gain = accel.gain.map(|gain| UNITY / gain);
        let lines = set(Sensor::Accel, "acczero", &accel.zero, CODES)?
            + &set(Sensor::Accel, "accgain", &gain, [1, 8192])?
            + &compass_lines(from, &mut export)?;
        let head = export.head("#", from);
        Ok(export.with(head + &lines + "save\n"))
    }
}

fn compass_lines(from: &Sources, export: &mut Export) -> Result<String> {
    let Some([zero, gain]) = compass(from, Inav::CONVENTION, export)? else {
        return Ok(String::new());
    };
    let (calibration, _) = from.calibration()?;
    let in_field = calibration.body.iter().any(|triad| triad.unit == FIELD);
    let (field, words) = match in_field {
        true => (1.0, "the field".into()),
        false => (TYPICAL_FIELD_UT, format!("{TYPICAL_FIELD_UT} uT")),
    };
    export.formula(format!(
        "mag: output = (code - magzero) 1024 / maggain on each axis of the sensor, 1024 for {words}"
    ));
    export.note("mag: axes have to be those of the sensor, before align_mag, and the codes those with magzero 0 and maggain 1024. Its cross terms have no place.");
    Ok(set(MAG, "magzero", &zero, CODES)? + &set(MAG, "maggain", &(field * gain), [1, 32767])?)
}

/// A line of the CLI for each axis.
fn set(
    triad: impl Display + Copy,
    stem: &str,
    values: &Vector3<f64>,
    range: [i32; 2],
) -> Result<String> {
    let name = |axis: &str| format!("{stem}_{axis}");
    let all = whole(triad, &name, values, range)?;
    let line = |(axis, value): (&str, i32)| format!("set {} = {value}\n", name(axis));
    Ok(AXES.into_iter().zip(all).map(line).collect())
}
