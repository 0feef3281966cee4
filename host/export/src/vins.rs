//! Noise for VINS-Fusion and VINS-Mono: acc_n, gyr_n, acc_w, gyr_w and g_norm of their configuration.
//!
//! All four apply to one sample at the message rate. With every message, `IntegrationBase` adds `V Q Vᵀ`. V contains the factor dt for the white
//! noise of both readings, half each, and for the steps of the biases. The variance of a bias therefore grows by `dt² acc_w²` per message, which is
//! `K² dt` for `acc_w = K √rate`. (`K √dt`, which is sometimes recommended, leaves the bias hardly any freedom.) A reading with the standard
//! deviation `acc_n = N √rate` has white noise N.
//!
//! The two readings of a step count as independent, although each is used in two steps. The covariance is therefore half of the one that such
//! readings cause. This is less than the margin usually added for vibration, so the file contains the values that the keys are named for, and a note.
//!
//! Source: HKUST-Aerial-Robotics/VINS-Fusion, vins_estimator/src/factor/integration_base.h, `midPointIntegration`;
//! estimator/parameters.cpp (2021-07); VINS-Mono, the same files (2024-05).

use mimu_recording::error::Result;

use crate::worst_axis::{GravityOptions, NoiseOptions, line};
use crate::{Export, Sources, heading};

/// Options of the file.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Options common to all noise files.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub noise: NoiseOptions,
    /// Gravity.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub gravity: GravityOptions,
}

/// The keys of the inertial unit.
///
/// # Errors
/// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::densities`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let noise = from.noise()?;
    let densities = options.noise.walks.calibrated(noise)?;
    let rate = options.noise.rate_hz(noise);
    let mut export = Export::new("vins", from);
    export.formulas.push(format!(
        "Of one sample at {rate:.3} Hz: acc_n = N sqrt(rate), acc_w = K sqrt(rate), and so for the gyro; the worst axis, with the {} % interval behind each.",
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
        out.push_str(&line(
            "",
            key,
            |density| density * rate.sqrt(),
            unit,
            density,
        ));
    }
    let (gravity, source) = options.gravity.gravity(from);
    out.push_str(&format!("g_norm: {gravity:.6}  # m/s^2, {source}\n"));
    export.content = out.into_bytes();
    Ok(export)
}
