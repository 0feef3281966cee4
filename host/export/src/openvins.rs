//! Noise and intrinsics for OpenVINS: kalibr_imu_chain.yaml.
//!
//! Noise: the same continuous-time densities as for Kalibr ([`crate::worst_axis`]).
//!
//! Intrinsics, from the program's readings to calibrated ones, SI to SI, in the body frame of the calibration:
//!
//! ```text
//! a = R_IMUtoACCᵀ Ta⁻¹ (reading - b),   w = R_IMUtoGYROᵀ Tw⁻¹ (reading - b - Tg a)
//! ```
//!
//! Ta and Tw are lower triangular in the model "kalibr" and upper triangular in "rpng": OpenVINS keeps only that half of their inverses. It uses both
//! rotations in both models, so the frame remains that of the calibration. Without a calibration, the intrinsics are those of calibrated readings.
//!
//! Source: rpng/open_vins, ov_msckf/src/core/VioManagerOptions.h and state/Propagator.cpp; config/rpng_sim/kalibr_imu_chain.yaml (2025-11). OpenVINS
//! does not read T_i_b, time_offset and update_rate, but its examples and Kalibr's result contain them.

use std::fmt::Write as _;

use clap::{Args, ValueEnum};
use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::error::Result;
use nalgebra::Matrix4;

use crate::convention::{Bias, Convention, Shape, Triangle};
use crate::intrinsics::Intrinsics;
use crate::kalibr::KEYS;
use crate::layout::{Entry, NoiseKey, Numbers};
use crate::worst_axis::{NoiseOptions, lines};
use crate::{Export, Noise, Page, Sources, Target, driver, yaml};

/// Which half of the matrices is not zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Model {
    /// Lower: Kalibr's
    Kalibr,
    /// Upper
    Rpng,
}

/// Options of the file.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Model of the intrinsics
    #[arg(long, value_enum, default_value = "kalibr")]
    pub model: Model,
    /// Topic of the messages
    #[arg(long, value_name = "TOPIC", default_value = "/imu0")]
    pub rostopic: String,
    /// Options common to all noise files.
    #[command(flatten)]
    pub noise: NoiseOptions,
    /// The driver's conversion.
    #[command(flatten)]
    pub driver: driver::Options,
}

/// The format.
pub struct OpenVins;

impl Target for OpenVins {
    type Options = Options;
    const NAME: &str = "openvins";
    const ABOUT: &str = "Noise and intrinsics for OpenVINS: kalibr_imu_chain.yaml";
    const CONTENTS: &str = "noise; with `--calibration` also the intrinsics";
    const READERS: &str = "OpenVINS";
    const CONVENTION: Convention =
        Convention::to_reading(Shape::TriangleRotation(Triangle::Lower), Bias::Absent);
    const NOISE: Noise = Noise::Needed;
    const NOISE_KEYS: &[NoiseKey] = &KEYS;
    const NOISE_OF_READINGS: bool = true;
    const RATE_KEY: Option<&str> = Some("update_rate");
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Gyro, Numbers::Left, "Tw"),
        Entry::of(Sensor::Gyro, Numbers::Right, "R_IMUtoGYRO").optional(),
        Entry::of(Sensor::Accel, Numbers::Left, "Ta"),
        Entry::of(Sensor::Accel, Numbers::Right, "R_IMUtoACC").optional(),
    ];
    const NOT_READ: &[&str] = &["Tg"];
    const PAGES: &[Page] = &[Page::of("OpenVINS", "kalibr_imu_chain.yaml")];

    /// # Errors
    /// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::densities`] or [`Intrinsics::of`].
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let noise = from.noise()?;
        let mut export = Export::new::<Self>(from);
        let (half, model) = match options.model {
            Model::Kalibr => (Triangle::Lower, "kalibr"),
            Model::Rpng => (Triangle::Upper, "rpng"),
        };
        export.continuous_densities(noise);
        let known = Intrinsics::of(from, &options.driver, half, &mut export)?;
        match from.calibration {
            None => {
                export.note("Intrinsics are the identity: the program needs calibrated readings.");
            }
            Some(_) => {
                export.formula("Intrinsics, the program's readings to calibrated ones, SI to SI, in the frame of the calibration:");
                export.formula("  a = R_IMUtoACC' Ta^-1 (reading - bias),  w = R_IMUtoGYRO' Tw^-1 (reading - bias - Tg a)");
                known.describe(from, &mut export);
            }
        }
        let densities = options.noise.walks.densities(noise, &known.gain)?;
        // OpenCV requires the version in the first line.
        let mut out = "%YAML:1.0\n\n".to_owned() + &export.head("#", from) + "\nimu0:\n";
        yaml::matrix(&mut out, "  ", "T_i_b", &Matrix4::identity());
        out += &lines("  ", &KEYS, &densities, f64::NAN);
        let topic = serde_json::Value::from(options.rostopic.as_str());
        let rate = options.noise.rate_hz(noise);
        let _ = writeln!(
            out,
            "  rostopic: {topic}\n  time_offset: 0.0\n  update_rate: {rate:.3}\n  model: \"{model}\""
        );
        let PerSensor { gyro, accel } = known.factors;
        for (key, matrix) in [
            ("Tw", &gyro.triangle),
            ("R_IMUtoGYRO", &gyro.rotation),
            ("Ta", &accel.triangle),
            ("R_IMUtoACC", &accel.rotation),
            ("Tg", &known.g_sensitivity),
        ] {
            yaml::matrix(&mut out, "  ", key, matrix);
        }
        Ok(export.with(out))
    }
}
