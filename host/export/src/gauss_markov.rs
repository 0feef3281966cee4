//! Noise for navigation filters whose biases are Gauss-Markov processes of first order: KF-GINS and NaveGo.
//!
//! A process of standard deviation σ and correlation time T has for times much shorter than T the random walk of density K = σ √(2/T) in KF-GINS, whose driving
//! noise is `2 σ²/T`, and K = σ/√T in NaveGo, whose density is `gb_dyn ./ sqrt(gb_corr)`. So T is chosen, longer than a run, and σ follows from K.

use clap::Args;
use mimu::quantity::PerSensor;
use mimu_recording::error::Result;

use crate::driver::positive;
use crate::layout::NoiseKey;
use crate::worst_axis::{Densities, WalkOptions};
use crate::{Export, Sources, Target, yaml};

/// Options of both.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Correlation time of the biases, s: longer than a run
    #[arg(long, value_name = "S", default_value_t = 3600.0, value_parser = positive)]
    pub correlation_time: f64,
    /// Random walks.
    #[command(flatten)]
    pub walks: WalkOptions,
}

/// The export, and the keys of the format with their numbers of x, y and z; a walk becomes σ by `factor`, of K √s.
///
/// # Errors
/// The noise is missing, or an error of [`WalkOptions::axes`].
pub(crate) fn keys<T: Target>(
    from: &Sources,
    options: &Options,
    factor: f64,
) -> Result<(Export, Vec<(&'static NoiseKey, String)>)> {
    let axes = options
        .walks
        .axes(from.noise()?, &PerSensor::both([1.0; 3]))?;
    let mut export = Export::new::<T>(from);
    export.note(format!(
        "Biases are Gauss-Markov processes with a correlation time of {} s, whose driving noise is K.",
        options.correlation_time
    ));
    export.needs_calibrated(from);
    let numbers = |key: &'static NoiseKey| {
        let density = |axis: &Densities| axis.of(key.term).value;
        let scale = match key.correlation {
            Some(_) => factor * options.correlation_time.sqrt(),
            None => 1.0,
        };
        let values = axes[key.sensor].each_ref().map(|axis| {
            let number = key.number(scale * density(axis), f64::NAN);
            yaml::scientific(number, 6)
        });
        (key, values.join(", "))
    };
    Ok((export, T::NOISE_KEYS.iter().map(numbers).collect()))
}
