//! Noise for FAST-LIO: acc_cov, gyr_cov, b_acc_cov and b_gyr_cov of its configuration.
//!
//! All four are variances of one sample at the message rate: with each sample the filter adds `(dt F_w) Q (dt F_w)ᵀ`, with these on the diagonal of
//! Q. White noise N has the variance `N² rate`. A bias whose variance grows by `K² dt` per message has the variance `K² rate`.
//! Source: hku-mars/FAST_LIO, src/IMU_Processing.hpp, `UndistortPcl`; include/IKFoM_toolkit/esekfom/esekfom.hpp, `predict` (2024-07);
//! config/*.yaml on main and on its branch ROS2.

use clap::Args;
use mimu::quantity::Sensor::{Accel, Gyro};
use mimu_recording::error::Result;

use crate::layout::{NoiseKey, NoiseOf, walk, white};
use crate::worst_axis::{NoiseOptions, keys_file};
use crate::{Export, Noise, Page, Sources, Target, noise_interval};

/// Options of the file.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Layout of parameters in ROS 2
    #[arg(long)]
    pub ros2: bool,
    /// Options common to all noise files.
    #[command(flatten)]
    pub noise: NoiseOptions,
}

/// The format.
pub struct FastLio;

impl Target for FastLio {
    type Options = Options;
    const NAME: &str = "fastlio";
    const ABOUT: &str = "Noise for FAST-LIO";
    const CONTENTS: &str = "variances of one sample";
    const READERS: &str = "FAST-LIO (`--ros2` likewise)";
    const NOISE: Noise = Noise::Only;
    const NOISE_KEYS: &[NoiseKey] = &[
        white("acc_cov", "(m/s^2)^2", Accel).of(NoiseOf::Variance),
        white("gyr_cov", "(rad/s)^2", Gyro).of(NoiseOf::Variance),
        walk("b_acc_cov", "(m/s^3)^2", Accel).of(NoiseOf::Variance),
        walk("b_gyr_cov", "(rad/s^2)^2", Gyro).of(NoiseOf::Variance),
    ];
    const PAGES: &[Page] = &[Page::of("FAST-LIO", "fastlio.yaml")];

    /// # Errors
    /// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::densities`].
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let noise = from.noise()?;
        let rate = options.noise.rate_hz(noise);
        let mut export = Export::new::<Self>(from);
        export.formula(format!(
            "Variances of one sample at {rate:.3} Hz: acc_cov = N^2 rate, b_acc_cov = K^2 rate, and so for the gyro; the worst axis{}.",
            noise_interval(noise, ", with the {} % interval behind each")
        ));
        export.note("Copy these keys into the configuration of FAST-LIO.");
        let (layout, indent) = match options.ros2 {
            true => ("/**:\n  ros__parameters:\n    mapping:\n", "      "),
            false => ("mapping:\n", "  "),
        };
        let text = ["", layout, indent];
        keys_file::<Self>(export, from, (&options.noise.walks, rate), text)
    }
}
