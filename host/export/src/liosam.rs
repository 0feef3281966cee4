//! Noise for LIO-SAM: imuAccNoise, imuGyrNoise, imuAccBiasN, imuGyrBiasN and imuGravity of params.yaml.
//!
//! Continuous-time densities. Their squares are the `accelerometerCovariance` and `gyroscopeCovariance` of GTSAM's preintegration, which divides by
//! dt. Between key frames, a bias may change by `imuAccBiasN √Δt`. Source: TixiaoShan/LIO-SAM, src/imuPreintegration.cpp (2023-04), the same on its
//! branch ros2; include/utility.h for the names.

use clap::Args;
use mimu::quantity::Sensor::{Accel, Gyro};
use mimu_recording::error::Result;

use crate::layout::{NoiseKey, walk, white};
use crate::worst_axis::{GravityOptions, WalkOptions, keys_file};
use crate::{Export, Noise, Page, Sources, Target};

/// Options of the file.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Layout of parameters in ROS 2
    #[arg(long)]
    pub ros2: bool,
    /// Random walks.
    #[command(flatten)]
    pub walks: WalkOptions,
    /// Gravity.
    #[command(flatten)]
    pub gravity: GravityOptions,
}

/// The format.
pub struct LioSam;

impl Target for LioSam {
    type Options = Options;
    const NAME: &str = "liosam";
    const ABOUT: &str = "Noise for LIO-SAM";
    const CONTENTS: &str = "noise, gravity";
    const READERS: &str = "LIO-SAM (`--ros2` for its branch for ROS 2)";
    const NOISE: Noise = Noise::Only;
    const NOISE_KEYS: &[NoiseKey] = &[
        white("imuAccNoise", "m/s^2/sqrt(Hz)", Accel),
        white("imuGyrNoise", "rad/s/sqrt(Hz)", Gyro),
        walk("imuAccBiasN", "m/s^3/sqrt(Hz)", Accel),
        walk("imuGyrBiasN", "rad/s^2/sqrt(Hz)", Gyro),
    ];
    const PAGES: &[Page] = &[Page::of("LIO-SAM", "liosam.yaml")];

    /// # Errors
    /// The noise is missing, or an error of [`WalkOptions::densities`].
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let mut export = Export::new::<Self>(from);
        export.continuous_densities(from.noise()?);
        export.note("Copy these keys into params.yaml of LIO-SAM.");
        let (layout, indent) = match options.ros2 {
            true => ("/**:\n  ros__parameters:\n", "    "),
            false => ("lio_sam:\n", "  "),
        };
        let text = ["", layout, indent];
        let mut export = keys_file::<Self>(export, from, (&options.walks, f64::NAN), text)?;
        let gravity = options.gravity.line("imuGravity", from);
        export.content.extend([indent, &gravity].concat().bytes());
        Ok(export)
    }
}
