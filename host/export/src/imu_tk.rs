//! One triad for IMU-TK: acc.calib or gyro.calib.
//!
//! `x = T K (raw - B)`, raw readings to SI: nine numbers of T by rows, nine of the diagonal matrix K, and three of B. T has ones on its diagonal, so
//! T K = C, and B is the bias of the raw readings. `load` reads only these 21 numbers, so the comments are below them. Source: imu_tk,
//! include/imu_tk/calibration.h, `CalibratedTriad_` (2016-02).

use std::fmt::Write as _;

use mimu::quantity::Sensor;
use mimu::triad::Forward;
use mimu_recording::error::{Error, Result};
use nalgebra::Matrix3;

use crate::misalignment::Misalignment;
use crate::remaining::{self, Places};
use crate::{Export, Sources, heading};

/// The triad that the option names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Triad {
    /// Gyro
    Gyro,
    /// Accelerometer
    Accel,
}

/// Options of the file.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Which triad: the program has a file for each
    #[cfg_attr(feature = "clap", arg(long, value_enum))]
    pub sensor: Triad,
}

/// Text of the file.
///
/// # Errors
/// The triad is not calibrated, or an error of [`Misalignment::of`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let sensor = match options.sensor {
        Triad::Gyro => Sensor::Gyro,
        Triad::Accel => Sensor::Accel,
    };
    let model = calibration.inverse(sensor).ok_or_else(|| {
        let problem = format!("the {sensor} is not calibrated");
        Error::new(place, problem, "fit a recording that determines it")
    })?;
    let raw = Forward::of(&model).ok_or_else(|| {
        Error::new(
            place,
            format!("C of the {sensor} is singular"),
            "fit the recording again",
        )
    })?;
    let factors = Misalignment::of(&model.matrix, sensor)?;
    let mut export = Export::new("imu-tk", from);
    export.formulas.push(format!(
        "{sensor}: output = T K (raw - B), {} to {}; above T and K by rows, then B",
        calibration.recording.raw_unit,
        sensor.unit()
    ));
    export.notes.extend(heading::temperature(calibration));
    let places = Places {
        cross_terms: true,
        temperature: false,
        effects: false,
    };
    export.remaining = remaining::of(calibration, places)?;
    export.remaining.retain(|r| r.sensor == sensor);
    let mut out = String::new();
    for matrix in [factors.matrix, Matrix3::from_diagonal(&factors.sensitivity)] {
        for row in matrix.row_iter() {
            let _ = writeln!(out, "{:.12e} {:.12e} {:.12e}", row[0], row[1], row[2]);
        }
        out.push('\n');
    }
    for value in raw.bias.iter() {
        let _ = writeln!(out, "{value:.12e}");
    }
    out.push('\n');
    let comments = heading::of_calibration(calibration, &export);
    out.push_str(&heading::comments("#", &comments));
    export.content = out.into_bytes();
    Ok(export)
}
