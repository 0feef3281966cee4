//! The inertial part of Basalt's calibration file.
//!
//! Basalt computes `calibrated = (I + S) reading - b`, SI to SI. S of the gyro is full, by columns after b: twelve numbers. S of the accelerometer is
//! lower triangular, by columns: nine numbers, so the accelerometer defines the frame. With `C = Qᵀ L`, L lower triangular and Q a rotation,
//! `x_i = Q x_body` is the frame of Basalt: I + S is L for the accelerometer and Q C for the gyro, and `b = -Q o`. The densities are continuous-time,
//! one for each axis.
//!
//! The other keys of the file are those of the cameras. Source: VladyslavUsenko/basalt-headers, calibration/calib_bias.hpp, `CalibAccelBias` and
//! `CalibGyroBias`; calibration/calibration.hpp; serialization/headers_serialization.h (2021-06). Files of before 2020 have one density for three axes.

use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::error::{Error, Result};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use crate::intrinsics::{Factors, Triangle};
use crate::remaining::{self, Places};
use crate::worst_axis::{Densities, NoiseOptions};
use crate::{Export, Sources, driver, heading};

/// Options of the file.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Options common to all noise files.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub noise: NoiseOptions,
    /// The driver's conversion.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub driver: driver::Options,
}

/// The file. Basalt's reader takes the first key for the calibration, so the comments are the second.
#[derive(Serialize)]
struct File {
    value0: Value0,
    about: Vec<String>,
}

#[derive(Serialize)]
struct Value0 {
    calib_accel_bias: Vec<f64>,
    calib_gyro_bias: Vec<f64>,
    #[serde(flatten)]
    noise: Option<Noise>,
}

#[derive(Serialize)]
struct Noise {
    imu_update_rate: f64,
    accel_noise_std: [f64; 3],
    gyro_noise_std: [f64; 3],
    accel_bias_std: [f64; 3],
    gyro_bias_std: [f64; 3],
}

/// Text of the file.
///
/// # Errors
/// The calibration or a triad of it is missing, C is singular, or an error of [`crate::worst_axis::WalkOptions::axes`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let gyro = options.driver.readings(calibration, place, Sensor::Gyro)?;
    let accel = options.driver.readings(calibration, place, Sensor::Accel)?;
    // C = Qᵀ L is Cᵀ = Lᵀ Q.
    let factors = Factors::of(&accel.inverse.matrix.transpose(), Triangle::Upper);
    let rotation = factors.rotation;
    let mut export = Export::new("basalt", from);
    export.notes.extend(from.other_device());
    export.formulas.push("calibrated = (I + S) reading - b, SI to SI, in the frame i; b first, then S by columns, of the accelerometer its lower triangle".into());
    export.formulas.push(format!(
        "  x_i = Q x_body, body the frame of the calibration, Q by rows = [{}]",
        rotation
            .transpose()
            .iter()
            .map(|v| format!("{v:.7}"))
            .collect::<Vec<_>>()
            .join(", ")
    ));
    export.notes.extend([accel.line(), gyro.line()]);
    export.notes.push("Copy the keys of value0 into value0 of the calibration of the cameras, instead of those of the same names.".into());
    export.notes.extend(heading::temperature(calibration));
    let places = Places {
        cross_terms: true,
        temperature: false,
        effects: false,
    };
    export.remaining = remaining::of(calibration, places)?;
    let noise = match from.noise {
        Some(noise) => {
            export.formulas.push("noise_std = N and bias_std = K, continuous time, of the calibrated readings, x y z".into());
            let axes = options
                .noise
                .walks
                .axes(noise, &PerSensor::both([1.0; 3]))?;
            Some(densities(&axes, options.noise.rate_hz(noise)))
        }
        None => {
            export.notes.push("The file has no noise. Add --noise for accel_noise_std, gyro_noise_std, accel_bias_std and gyro_bias_std.".into());
            None
        }
    };
    let lower = |i: usize, j: usize| i >= j;
    let value0 = Value0 {
        calib_accel_bias: parameters(
            &factors.triangle.transpose(),
            &(rotation * accel.inverse.offset),
            lower,
        ),
        calib_gyro_bias: parameters(
            &(rotation * gyro.inverse.matrix),
            &(rotation * gyro.inverse.offset),
            |_, _| true,
        ),
        noise,
    };
    let about = heading::of_calibration(calibration, &export);
    let text = serde_json::to_string_pretty(&File { value0, about }).map_err(|e| {
        let problem = format!("it cannot be written as JSON: {e}");
        Error::new(place, problem, "fit the recording again")
    })?;
    export.content = (text + "\n").into_bytes();
    Ok(export)
}

/// b and the elements of S that `has` a place, by columns.
fn parameters(
    matrix: &Matrix3<f64>,
    offset: &Vector3<f64>,
    has: impl Fn(usize, usize) -> bool,
) -> Vec<f64> {
    let s = matrix - Matrix3::identity();
    let mut out: Vec<f64> = offset.iter().map(|o| -o).collect();
    for j in 0..3 {
        out.extend((0..3).filter(|i| has(*i, j)).map(|i| s[(i, j)]));
    }
    out
}

fn densities(axes: &PerSensor<[Densities; 3]>, rate: f64) -> Noise {
    let white = |sensor: Sensor| [0, 1, 2].map(|i| axes[sensor][i].white.value);
    let walk = |sensor: Sensor| [0, 1, 2].map(|i| axes[sensor][i].walk.value);
    Noise {
        imu_update_rate: rate,
        accel_noise_std: white(Sensor::Accel),
        gyro_noise_std: white(Sensor::Gyro),
        accel_bias_std: walk(Sensor::Accel),
        gyro_bias_std: walk(Sensor::Gyro),
    }
}
