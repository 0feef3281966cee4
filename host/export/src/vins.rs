//! Noise for VINS-Fusion and VINS-Mono: acc_n, gyr_n, acc_w, gyr_w and g_norm of their configuration.
//!
//! All four are of one sample at the rate of the messages. `IntegrationBase` adds `V Q Vᵀ` with every message, in which V has the factor dt
//! for the white noise of both readings, half each, and for the steps of the biases. The variance of a bias thus grows by `dt² acc_w²` a
//! message, which is `K² dt` for `acc_w = K √rate` (`K √dt`, which is sometimes recommended, leaves the bias hardly any freedom). A reading with the standard deviation `acc_n = N √rate` has white noise N.
//!
//! The two readings of a step count as independent there, although each is in two steps: the covariance is then half of what readings of
//! this noise make. That is within what people add for vibration, so the file has what the keys are named for, and says it.
//!
//! Source: HKUST-Aerial-Robotics/VINS-Fusion, vins_estimator/src/factor/integration_base.h, `midPointIntegration`;
//! estimator/parameters.cpp (2021-07); VINS-Mono, the same files (2024-05).

use mimu_recording::error::Result;

use crate::worst_axis::{GravityOptions, NoiseOptions, line};
use crate::{Export, Sources, heading};

/// What the person has decided about the file.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// What all files of noise have to be told.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub noise: NoiseOptions,
    /// Gravity.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub gravity: GravityOptions,
}

/// The keys of the inertial unit.
///
/// # Errors
/// The noise is missing; those of [`crate::worst_axis::WalkOptions::densities`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let noise = from.noise()?;
    let densities = options.noise.walks.calibrated(noise)?;
    let rate = options.noise.rate_hz(noise);
    let mut export = Export::new("vins");
    export.formulas.push(format!(
        "Of one sample at {rate:.3} Hz: acc_n = N sqrt(rate), acc_w = K sqrt(rate), and so for the gyro; the worst axis, {} % interval of N and K behind each.",
        100.0 * noise.confidence
    ));
    export.notes.push("VINS treats the two readings at the ends of an interval as independent. Multiplied by 1.41, acc_n and gyr_n give the right covariance.".into());
    export.notes.push("Copy these keys into the configuration of VINS; its other keys are those of cameras and tracking.".into());
    export.notes.extend(heading::needs_calibrated(from));
    let mut out = "%YAML:1.0\n\n".to_owned();
    out.push_str(&heading::comments("#", &heading::of_noise(noise, &export)));
    let keys = [
        ("acc_n", "m/s^2", &densities.accel.white),
        ("gyr_n", "rad/s", &densities.gyro.white),
        ("acc_w", "m/s^3", &densities.accel.walk),
        ("gyr_w", "rad/s^2", &densities.gyro.walk),
    ];
    for (key, unit, density) in keys {
        out.push_str(&line("", key, density.value * rate.sqrt(), unit, density));
    }
    let (gravity, source) = options.gravity.gravity(from);
    out.push_str(&format!("g_norm: {gravity:.6}  # m/s^2, {source}\n"));
    export.content = out.into_bytes();
    Ok(export)
}
