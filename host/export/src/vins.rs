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

use clap::Args;
use mimu::quantity::Sensor::{Accel, Gyro};
use mimu_recording::error::Result;

use crate::layout::{NoiseKey, NoiseOf, walk, white};
use crate::worst_axis::{GravityOptions, NoiseOptions, keys_file};
use crate::{Export, Noise, Page, Sources, Target, noise_interval};

/// Options of the file.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Options common to all noise files.
    #[command(flatten)]
    pub noise: NoiseOptions,
    /// Gravity.
    #[command(flatten)]
    pub gravity: GravityOptions,
}

/// The format.
pub struct Vins;

impl Target for Vins {
    type Options = Options;
    const NAME: &str = "vins";
    const ABOUT: &str = "Noise for VINS-Fusion and VINS-Mono";
    const CONTENTS: &str = "noise of one sample, gravity";
    const READERS: &str = "VINS-Fusion, VINS-Mono";
    const NOISE: Noise = Noise::Only;
    const NOISE_KEYS: &[NoiseKey] = &[
        white("acc_n", "m/s^2", Accel).of(NoiseOf::Deviation),
        white("gyr_n", "rad/s", Gyro).of(NoiseOf::Deviation),
        walk("acc_w", "m/s^3", Accel).of(NoiseOf::Deviation),
        walk("gyr_w", "rad/s^2", Gyro).of(NoiseOf::Deviation),
    ];
    const PAGES: &[Page] = &[Page::of("VINS-Fusion", "vins.yaml")];

    /// # Errors
    /// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::densities`].
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let noise = from.noise()?;
        let rate = options.noise.rate_hz(noise);
        let mut export = Export::new::<Self>(from);
        export.formula(format!(
            "Of one sample at {rate:.3} Hz: acc_n = N sqrt(rate), acc_w = K sqrt(rate), and so for the gyro; the worst axis{}.",
            noise_interval(noise, ", with the {} % interval behind each")
        ));
        export.note("VINS treats the two readings at the ends of an interval as independent. Multiplied by 1.41, acc_n and gyr_n give the right covariance.");
        export.note("Copy these keys into the configuration of VINS; its other keys are those of cameras and tracking.");
        let text = ["%YAML:1.0\n\n", "", ""];
        let mut export = keys_file::<Self>(export, from, (&options.noise.walks, rate), text)?;
        export
            .content
            .extend(options.gravity.line("g_norm", from).bytes());
        Ok(export)
    }
}
