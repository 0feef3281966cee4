//! Noise for LIO-SAM: imuAccNoise, imuGyrNoise, imuAccBiasN, imuGyrBiasN and imuGravity of params.yaml.
//!
//! Continuous-time densities. Their squares are the `accelerometerCovariance` and `gyroscopeCovariance` of GTSAM's preintegration, which divides by
//! dt. Between key frames, a bias may change by `imuAccBiasN √Δt`. Source: TixiaoShan/LIO-SAM, src/imuPreintegration.cpp (2023-04), the same on its
//! branch ros2; include/utility.h for the names.

use std::fmt::Write as _;

use mimu_recording::error::Result;

use crate::worst_axis::{GravityOptions, WalkOptions, line};
use crate::{Export, Sources, heading};

/// Options of the file.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Layout of parameters in ROS 2
    #[cfg_attr(feature = "clap", arg(long))]
    pub ros2: bool,
    /// Random walks.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub walks: WalkOptions,
    /// Gravity.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub gravity: GravityOptions,
}

/// The keys of the inertial unit.
///
/// # Errors
/// The noise is missing, or an error of [`WalkOptions::densities`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let noise = from.noise()?;
    let densities = options.walks.calibrated(noise)?;
    let mut export = Export::new("liosam", from);
    export.formulas.push(format!(
        "Continuous-time densities of the worst axis; {} % interval behind each.",
        100.0 * noise.confidence
    ));
    export
        .notes
        .push("Copy these keys into params.yaml of LIO-SAM.".into());
    export.notes.extend(heading::needs_calibrated(from));
    let mut out = heading::comments("#", &heading::of_noise(noise, &export));
    let (layout, indent) = match options.ros2 {
        true => ("/**:\n  ros__parameters:\n", "    "),
        false => ("lio_sam:\n", "  "),
    };
    out.push_str(layout);
    let keys = [
        ("imuAccNoise", "m/s^2/sqrt(Hz)", &densities.accel.white),
        ("imuGyrNoise", "rad/s/sqrt(Hz)", &densities.gyro.white),
        ("imuAccBiasN", "m/s^3/sqrt(Hz)", &densities.accel.walk),
        ("imuGyrBiasN", "rad/s^2/sqrt(Hz)", &densities.gyro.walk),
    ];
    for (key, unit, density) in keys {
        out.push_str(&line(indent, key, |density| density, unit, density));
    }
    let (gravity, source) = options.gravity.gravity(from);
    let _ = writeln!(out, "{indent}imuGravity: {gravity:.6}  # m/s^2, {source}");
    export.content = out.into_bytes();
    Ok(export)
}
