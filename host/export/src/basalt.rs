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
use mimu_core::compensation::Affine;
use mimu_recording::error::{Error, Result};
use nalgebra::Matrix3;
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::convention::{Bias, Convention, Factors, Shape, Triangle};
use crate::driver::Readings;
use crate::layout::{Entry, NoiseKey, Numbers, walk, white};
use crate::remaining::Places;
use crate::worst_axis::{Densities, NoiseAndDriver};
use crate::{Export, Page, Sources, Target, heading};

/// The file. Basalt's reader takes the first key for the calibration, so the comments are the second.
#[derive(Serialize)]
struct File {
    value0: Map<String, Value>,
    about: Vec<String>,
}

/// The format.
pub struct Basalt;

impl Target for Basalt {
    type Options = NoiseAndDriver;
    const NAME: &str = "basalt";
    const ABOUT: &str = "Both triads and noise for Basalt: the inertial part of its calibration";
    const CONTENTS: &str = "C and o of both triads; with `--noise` also noise";
    const READERS: &str = "Basalt";
    const CONVENTION: Convention = Convention::to_input(Shape::Whole, Bias::SubtractedFromInput);
    const NOISE: crate::Noise = crate::Noise::Optional;
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Accel, Numbers::BiasThenLower, "calib_accel_bias").scaled(1.0, 1.0),
        Entry::of(Sensor::Gyro, Numbers::BiasThenLeft, "calib_gyro_bias").scaled(1.0, 1.0),
    ];
    const NOISE_KEYS: &[NoiseKey] = &[
        white("accel_noise_std", "", Sensor::Accel),
        white("gyro_noise_std", "", Sensor::Gyro),
        walk("accel_bias_std", "", Sensor::Accel),
        walk("gyro_bias_std", "", Sensor::Gyro),
    ];
    const RATE_KEY: Option<&str> = Some("imu_update_rate");
    const PAGES: &[Page] = &[Page::of("Basalt", "basalt_imu.json")];

    /// # Errors
    /// The calibration or a triad of it is missing, C is singular, or an error of [`crate::worst_axis::WalkOptions::axes`].
    fn export(from: &Sources, options: &NoiseAndDriver) -> Result<Export> {
        let (calibration, readings) = options.driver.both(from)?;
        // C = Qᵀ L is Cᵀ = Lᵀ Q.
        let c = &readings.accel.inverse.matrix;
        let Factors { triangle, rotation } = Factors::of(&c.transpose(), Triangle::Upper);
        let mut export = Export::new::<Self>(from);
        export.formula("calibrated = (I + S) reading - b, SI to SI, in the frame i; b first, then S by columns, of the accelerometer its lower triangle");
        let q: Vec<String> = rotation
            .transpose()
            .iter()
            .map(|v| format!("{v:.7}"))
            .collect();
        export.formula(format!(
            "  x_i = Q x_body, body the frame of the calibration, Q by rows = [{}]",
            q.join(", ")
        ));
        export.note(readings.accel.line());
        export.note(readings.gyro.line());
        export.note("Copy the keys of value0 into value0 of the calibration of the cameras, instead of those of the same names.");
        export.temperature(calibration);
        export.leaves(calibration, Places::Matrix);
        let noise = match from.noise {
            Some(noise) => {
                export.formula("noise_std = N and bias_std = K, continuous time, of the calibrated readings, x y z");
                let axes = options
                    .noise
                    .walks
                    .axes(noise, &PerSensor::both([1.0; 3]))?;
                Some((axes, options.noise.rate_hz(noise)))
            }
            None => {
                export.note("The file has no noise. Add --noise for accel_noise_std, gyro_noise_std, accel_bias_std and gyro_bias_std.");
                None
            }
        };
        let in_frame = |readings: Readings, matrix: Matrix3<f64>| {
            let offset = rotation * readings.inverse.offset;
            let inverse = Affine { matrix, offset };
            Self::CONVENTION.of(&Readings {
                inverse,
                ..readings
            })
        };
        let gyro = rotation * readings.gyro.inverse.matrix;
        let gyro = in_frame(readings.gyro, gyro)?;
        let accel = in_frame(readings.accel, triangle.transpose())?;
        let mut value0 = Map::new();
        for (entry, parts) in Self::LAYOUT.iter().zip([&accel, &gyro]) {
            value0.insert(entry.key.into(), json!(entry.values(parts)));
        }
        if let Some((axes, rate_hz)) = noise {
            value0.insert("imu_update_rate".into(), json!(rate_hz));
            for key in Self::NOISE_KEYS {
                let number = |axis: &Densities| key.number(axis.of(key.term).value, rate_hz);
                let numbers = axes[key.sensor].each_ref().map(number);
                value0.insert(key.key.into(), json!(numbers));
            }
        }
        let about = heading::of(&export, from);
        let text = serde_json::to_string_pretty(&File { value0, about });
        let text = text.map_err(|e| {
            let problem = format!("it cannot be written as JSON: {e}");
            Error::new("export", problem, "fit the recording again")
        })?;
        Ok(export.with(text + "\n"))
    }
}
