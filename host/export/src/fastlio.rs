//! Noise for FAST-LIO: acc_cov, gyr_cov, b_acc_cov and b_gyr_cov of its configuration.
//!
//! All four are variances of one sample at the message rate: with each sample the filter adds `(dt F_w) Q (dt F_w)ᵀ`, with these on the diagonal of
//! Q. White noise N has the variance `N² rate`. A bias whose variance grows by `K² dt` per message has the variance `K² rate`.
//! Source: hku-mars/FAST_LIO, src/IMU_Processing.hpp, `UndistortPcl`; include/IKFoM_toolkit/esekfom/esekfom.hpp, `predict` (2024-07);
//! config/*.yaml on main and on its branch ROS2.

use mimu_recording::error::Result;

use crate::worst_axis::{NoiseOptions, line};
use crate::{Export, Sources, heading};

/// Options of the file.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Layout of parameters in ROS 2
    #[cfg_attr(feature = "clap", arg(long))]
    pub ros2: bool,
    /// Options common to all noise files.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub noise: NoiseOptions,
}

/// The keys of the inertial unit.
///
/// # Errors
/// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::densities`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let noise = from.noise()?;
    let densities = options.noise.walks.calibrated(noise)?;
    let rate = options.noise.rate_hz(noise);
    let mut export = Export::new("fastlio", from);
    export.formulas.push(format!(
        "Variances of one sample at {rate:.3} Hz: acc_cov = N^2 rate, b_acc_cov = K^2 rate, and so for the gyro; the worst axis, with the {} % interval behind each.",
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
        let variance = |density: f64| density * density * rate;
        out.push_str(&line(indent, key, variance, unit, density));
    }
    export.content = out.into_bytes();
    Ok(export)
}
