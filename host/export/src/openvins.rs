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

use mimu::quantity::PerSensor;
use mimu_recording::error::Result;
use nalgebra::{Matrix3, Matrix4};

use crate::intrinsics::{Factors, Intrinsics, Triangle};
use crate::kalibr::write_densities;
use crate::worst_axis::NoiseOptions;
use crate::{Export, Sources, driver, heading, yaml};

/// Which half of the matrices is not zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Model {
    /// Lower: Kalibr's
    Kalibr,
    /// Upper
    Rpng,
}

/// Options of the file.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Model of the intrinsics
    #[cfg_attr(feature = "clap", arg(long, value_enum, default_value = "kalibr"))]
    pub model: Model,
    /// Topic of the messages
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "TOPIC", default_value = "/imu0")
    )]
    pub rostopic: String,
    /// Options common to all noise files.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub noise: NoiseOptions,
    /// The driver's conversion.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub driver: driver::Options,
}

/// Text of `kalibr_imu_chain.yaml`.
///
/// # Errors
/// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::densities`] or [`Intrinsics::of`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let noise = from.noise()?;
    let mut export = Export::new("openvins", from);
    export.notes.extend(from.other_device());
    let (half, model) = match options.model {
        Model::Kalibr => (Triangle::Lower, "kalibr"),
        Model::Rpng => (Triangle::Upper, "rpng"),
    };
    let none = Factors {
        triangle: Matrix3::identity(),
        rotation: Matrix3::identity(),
    };
    let mut factors = PerSensor::both(none);
    let mut sag = Matrix3::zeros();
    let mut gain = PerSensor::both([1.0; 3]);
    export.formulas.push(format!(
        "Continuous-time densities of the worst axis; {} % interval behind each.",
        100.0 * noise.confidence
    ));
    let comments = match from.calibration {
        None => {
            options.driver.unused()?;
            let note = "Intrinsics are the identity: the program needs calibrated readings.";
            export.notes.push(note.into());
            heading::of_noise(noise, &export)
        }
        Some((calibration, place)) => {
            let known = Intrinsics::of(calibration, place, &options.driver, half)?;
            factors = known.factors;
            sag = known.g_sensitivity;
            gain = known.readings.as_ref().map(driver::Readings::noise_gain);
            let models = [
                "Intrinsics, the program's readings to calibrated ones, SI to SI, in the frame of the calibration:",
                "  a = R_IMUtoACC' Ta^-1 (reading - bias),  w = R_IMUtoGYRO' Tw^-1 (reading - bias - Tg a)",
            ];
            export.formulas.extend(models.map(String::from));
            known.describe(calibration, &mut export);
            let mut comments = heading::of_calibration(calibration, &export);
            comments.insert(2, heading::noise_from(noise));
            comments
        }
    };
    let densities = options.noise.walks.densities(noise, &gain)?;
    // OpenCV requires the version in the first line.
    let mut out = "%YAML:1.0\n\n".to_owned();
    out.push_str(&heading::comments("#", &comments));
    out.push_str("\nimu0:\n");
    yaml::matrix(&mut out, "  ", "T_i_b", &Matrix4::identity());
    write_densities(&mut out, "  ", &densities);
    let topic = serde_json::Value::from(options.rostopic.as_str());
    let rate = options.noise.rate_hz(noise);
    let _ = writeln!(
        out,
        "  rostopic: {topic}\n  time_offset: 0.0\n  update_rate: {rate:.3}\n  model: \"{model}\""
    );
    let PerSensor { gyro, accel } = factors;
    let matrices = [
        ("Tw", &gyro.triangle),
        ("R_IMUtoGYRO", &gyro.rotation),
        ("Ta", &accel.triangle),
        ("R_IMUtoACC", &accel.rotation),
        ("Tg", &sag),
    ];
    for (key, matrix) in matrices {
        yaml::matrix(&mut out, "  ", key, matrix);
    }
    export.content = out.into_bytes();
    Ok(export)
}
