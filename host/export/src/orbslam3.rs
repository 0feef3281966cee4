//! Noise for ORB-SLAM3: the keys IMU.* of its settings.
//!
//! Continuous-time densities: ORB-SLAM3 uses `NoiseGyro √Frequency` as the standard deviation of one sample, and `GyroWalk / √Frequency` as the step
//! of a bias per sample. Source: UZ-SLAMLab/ORB_SLAM3, src/Settings.cc, `readIMU`; src/Tracking.cc, `newParameterLoader`; src/ImuTypes.cc,
//! `IntegrateNewMeasurement`. The reader of settings without `File.version` accepts an integer for the frequency, and only reals for the others.

use std::fmt::Write as _;

use mimu_recording::error::Result;

use crate::worst_axis::{NoiseOptions, line};
use crate::{Export, Sources, heading};

/// Options of the file.
pub type Options = NoiseOptions;

/// The keys of the inertial unit.
///
/// # Errors
/// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::densities`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let noise = from.noise()?;
    let densities = options.walks.calibrated(noise)?;
    let mut export = Export::new("orbslam3", from);
    export.formulas.push(format!(
        "Continuous-time densities of the worst axis; {} % interval behind each.",
        100.0 * noise.confidence
    ));
    export.notes.push(
        "Copy these keys into the settings of ORB-SLAM3; IMU.T_b_c1 comes from Kalibr.".into(),
    );
    export.notes.extend(heading::needs_calibrated(from));
    let mut out = "%YAML:1.0\n\n".to_owned();
    out.push_str(&heading::comments("#", &heading::of_noise(noise, &export)));
    let keys = [
        ("IMU.NoiseGyro", "rad/s/sqrt(Hz)", &densities.gyro.white),
        ("IMU.NoiseAcc", "m/s^2/sqrt(Hz)", &densities.accel.white),
        ("IMU.GyroWalk", "rad/s^2/sqrt(Hz)", &densities.gyro.walk),
        ("IMU.AccWalk", "m/s^3/sqrt(Hz)", &densities.accel.walk),
    ];
    for (key, unit, density) in keys {
        out.push_str(&line("", key, |density| density, unit, density));
    }
    let rate = options.rate_hz(noise);
    let _ = match (rate - rate.round()).abs() < 0.0005 {
        true => writeln!(out, "IMU.Frequency: {rate:.0}  # Hz"),
        false => writeln!(out, "IMU.Frequency: {rate:.3}  # Hz"),
    };
    export.content = out.into_bytes();
    Ok(export)
}
