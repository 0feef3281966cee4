//! Noise for ORB-SLAM3: the keys IMU.* of its settings.
//!
//! Continuous-time densities: ORB-SLAM3 uses `NoiseGyro √Frequency` as the standard deviation of one sample, and `GyroWalk / √Frequency` as the step
//! of a bias per sample. Source: UZ-SLAMLab/ORB_SLAM3, src/Settings.cc, `readIMU`; src/Tracking.cc, `newParameterLoader`; src/ImuTypes.cc,
//! `IntegrateNewMeasurement`. The reader of settings without `File.version` accepts an integer for the frequency, and only reals for the others.

use mimu::quantity::Sensor::{Accel, Gyro};
use mimu_recording::error::Result;

use crate::layout::{NoiseKey, walk, white};
use crate::worst_axis::{NoiseOptions, keys_file};
use crate::{Export, Noise, Page, Sources, Target};

/// The format.
pub struct OrbSlam3;

impl Target for OrbSlam3 {
    type Options = NoiseOptions;
    const NAME: &str = "orbslam3";
    const ABOUT: &str = "Noise for ORB-SLAM3";
    const CONTENTS: &str = "noise";
    const READERS: &str = "ORB-SLAM3";
    const NOISE: Noise = Noise::Only;
    const NOISE_KEYS: &[NoiseKey] = &[
        white("IMU.NoiseGyro", "rad/s/sqrt(Hz)", Gyro),
        white("IMU.NoiseAcc", "m/s^2/sqrt(Hz)", Accel),
        walk("IMU.GyroWalk", "rad/s^2/sqrt(Hz)", Gyro),
        walk("IMU.AccWalk", "m/s^3/sqrt(Hz)", Accel),
    ];
    const RATE_KEY: Option<&str> = Some("IMU.Frequency");
    const PAGES: &[Page] = &[Page::of("ORB-SLAM3", "orbslam3.yaml")];

    /// # Errors
    /// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::densities`].
    fn export(from: &Sources, options: &NoiseOptions) -> Result<Export> {
        let noise = from.noise()?;
        let mut export = Export::new::<Self>(from);
        export.continuous_densities(noise);
        export
            .note("Copy these keys into the settings of ORB-SLAM3; IMU.T_b_c1 comes from Kalibr.");
        let (text, walks) = (["%YAML:1.0\n\n", "", ""], &options.walks);
        let rate = options.rate_hz(noise);
        let mut export = keys_file::<Self>(export, from, (walks, rate), text)?;
        let rate = match (rate - rate.round()).abs() < 0.0005 {
            true => format!("IMU.Frequency: {rate:.0}  # Hz\n"),
            false => format!("IMU.Frequency: {rate:.3}  # Hz\n"),
        };
        export.content.extend(rate.bytes());
        Ok(export)
    }
}
