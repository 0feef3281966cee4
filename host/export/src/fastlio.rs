//! Noise for FAST-LIO: acc_cov, gyr_cov, b_acc_cov and b_gyr_cov of its configuration.
//!
//! All four are variances of one sample at the rate of the messages: with each, the filter adds `(dt F_w) Q (dt F_w)ᵀ` with these on the
//! diagonal of Q. White noise N then has the variance `N² rate`, and a bias whose variance grows by `K² dt` a message has `K² rate`.
//! Source: hku-mars/FAST_LIO, src/IMU_Processing.hpp, `UndistortPcl`; include/IKFoM_toolkit/esekfom/esekfom.hpp, `predict` (2024-07);
//! config/*.yaml on main and on its branch ROS2.

use mimu_recording::error::Result;

use crate::worst_axis::{NoiseOptions, line};
use crate::{Export, Sources, heading};

/// What the person has decided about the file.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Layout of parameters in ROS 2
    #[cfg_attr(feature = "clap", arg(long))]
    pub ros2: bool,
    /// What all files of noise have to be told.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub noise: NoiseOptions,
}

/// The keys of the inertial unit.
///
/// # Errors
/// The noise is missing; those of [`crate::worst_axis::WalkOptions::densities`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let noise = from.noise()?;
    let densities = options.noise.walks.calibrated(noise)?;
    let rate = options.noise.rate_hz(noise);
    let mut export = Export::new("fastlio");
    export.formulas.push(format!(
        "Variances of one sample at {rate:.3} Hz: acc_cov = N^2 rate, b_acc_cov = K^2 rate, and so for the gyro; the worst axis, {} % interval of N and K behind each.",
        100.0 * noise.confidence
    ));
    export
        .notes
        .push("Copy these keys into the configuration of FAST-LIO.".into());
    export.notes.extend(heading::needs_calibrated(from));
    let mut out = heading::comments("#", &heading::of_noise(noise, &export));
    let (layout, indent) = match options.ros2 {
        true => ("/**:\n  ros__parameters:\n    mapping:\n", "      "),
        false => ("mapping:\n", "  "),
    };
    out.push_str(layout);
    let keys = [
        ("acc_cov", "(m/s^2)^2", &densities.accel.white),
        ("gyr_cov", "(rad/s)^2", &densities.gyro.white),
        ("b_acc_cov", "(m/s^3)^2", &densities.accel.walk),
        ("b_gyr_cov", "(rad/s^2)^2", &densities.gyro.walk),
    ];
    for (key, unit, density) in keys {
        let variance = density.value * density.value * rate;
        out.push_str(&line(indent, key, variance, unit, density));
    }
    export.content = out.into_bytes();
    Ok(export)
}
