//! Noise for Kalibr: imu.yaml.
//!
//! Kalibr's continuous-time densities are the coefficients themselves: its discrete noise is `density/√dt` a sample, which has
//! N = density, and its bias walks by `random_walk √dt` a sample, which has K = random_walk (Kalibr wiki, "IMU noise model"). The worst
//! axis of each sensor is stated, as the file has one number for three.
//!
//! A random walk that the record does not show on some axis is the one given by hand or, without one, the upper end of its interval there:
//! an estimator that takes a bias for steadier than it is will not follow it, one that takes it for less steady only follows it less
//! smoothly.

use std::fmt::Write as _;

use mimu::allan::model::Term;
use mimu::noise::noise_file::{NoiseChannel, NoiseFile};
use mimu::quantity::Sensor;
use mimu_recording::error::{Error, Result};

use crate::{Export, Sources, heading};

/// What the person has decided about Kalibr's file.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Topic of Kalibr's messages
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "TOPIC", default_value = "/imu0")
    )]
    pub rostopic: String,
    /// What all files of noise have to be told.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub noise: NoiseOptions,
}

/// What a person decides about noise, whatever the program.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct NoiseOptions {
    /// Messages a second; without it the rate of the recording
    #[cfg_attr(feature = "clap", arg(long, value_name = "HZ", value_parser = crate::options::positive))]
    pub update_rate: Option<f64>,
    /// Random walk to state where the record shows none on some axis, rad/s²/√Hz
    #[cfg_attr(feature = "clap", arg(long, value_name = "SI", value_parser = crate::options::positive))]
    pub gyro_walk: Option<f64>,
    /// The same for the accelerometer, m/s³/√Hz
    #[cfg_attr(feature = "clap", arg(long, value_name = "SI", value_parser = crate::options::positive))]
    pub accel_walk: Option<f64>,
}

/// A coefficient of the worst axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Worst {
    /// SI.
    pub value: f64,
    /// Axis and interval, or where else it is from.
    pub comment: String,
}

impl NoiseOptions {
    /// Messages a second.
    pub fn rate_hz(&self, noise: &NoiseFile) -> f64 {
        self.update_rate.unwrap_or(noise.sample_rate_hz)
    }

    /// N or K of the worst axis of `sensor`.
    ///
    /// # Errors
    /// The sensor is missing or not in SI; N is missing on an axis; K is, and nothing bounds it.
    pub fn worst(&self, noise: &NoiseFile, sensor: Sensor, term: Term) -> Result<Worst> {
        let fallback = match (term, sensor) {
            (Term::K, Sensor::Gyro) => self.gyro_walk,
            (Term::K, Sensor::Accel) => self.accel_walk,
            _ => None,
        };
        let (value, comment) = worst(noise, sensor, term, fallback)?;
        Ok(Worst { value, comment })
    }
}

/// Text of `imu.yaml`.
///
/// # Errors
/// There is no noise; those of [`NoiseOptions::worst`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let noise = from.noise()?;
    let mut export = Export::new("kalibr");
    export.formulas.push(format!(
        "Continuous-time densities of the worst axis; {} % interval behind each.",
        100.0 * noise.confidence
    ));
    let mut out = heading::comments("#", &heading::of_noise(noise, &export));
    for sensor in [Sensor::Accel, Sensor::Gyro] {
        let (prefix, units) = match sensor {
            Sensor::Accel => ("accelerometer", ["m/s^2/sqrt(Hz)", "m/s^3/sqrt(Hz)"]),
            Sensor::Gyro => ("gyroscope", ["rad/s/sqrt(Hz)", "rad/s^2/sqrt(Hz)"]),
        };
        let entries = [(Term::N, "noise_density"), (Term::K, "random_walk")];
        for ((term, key), unit) in entries.into_iter().zip(units) {
            let Worst { value, comment } = options.noise.worst(noise, sensor, term)?;
            let _ = writeln!(out, "{prefix}_{key}: {value:.6e}  # {unit}, {comment}");
        }
    }
    let rate = options.noise.rate_hz(noise);
    let topic = serde_json::Value::from(options.rostopic.as_str());
    let _ = writeln!(out, "\nrostopic: {topic}\nupdate_rate: {rate:.3}  # Hz");
    export.content = out.into_bytes();
    Ok(export)
}

/// The largest coefficient of `term` among the axes of `sensor`, and what to say of it.
fn worst(
    file: &NoiseFile,
    sensor: Sensor,
    term: Term,
    fallback: Option<f64>,
) -> Result<(f64, String)> {
    let (channels, place) = (file.of(sensor), &file.place);
    let Some(first) = channels.first() else {
        return Err(Error::new(
            place,
            format!("there is no channel of the {sensor}"),
            "record both sensors: the file needs both",
        ));
    };
    if let Err([found, remedy]) = first.model_in(sensor.unit()) {
        let problem = format!("it is in {found} and not in {}", sensor.unit());
        let place = format!("{place}, channel {}", first.name);
        return Err(Error::new(place, problem, remedy));
    }
    let mut largest: Option<(f64, String)> = None;
    let mut missing: Vec<(&NoiseChannel, &str)> = Vec::new();
    let mut take = |value: f64, said: String| {
        if largest.as_ref().is_none_or(|(v, _)| value > *v) {
            largest = Some((value, said));
        }
    };
    for channel in channels {
        let (name, bound) = (&channel.name, channel.k_at_most);
        match (channel.get(term), bound) {
            (Ok(c), _) => take(
                c.value,
                format!("{name}: {:.2e} to {:.2e}", c.lower, c.upper),
            ),
            (Err(_), Some(bound)) if term == Term::K && fallback.is_none() => {
                take(
                    bound,
                    format!("{name}: not seen, the upper end of its interval"),
                );
            }
            (Err(why), _) => missing.push((channel, why)),
        }
    }
    if let (Some((value, said)), true) = (&largest, missing.is_empty()) {
        return Ok((*value, said.clone()));
    }
    let names: Vec<&str> = missing.iter().map(|(c, _)| c.name.as_str()).collect();
    if let Some(fallback) = fallback {
        // The larger of the two: the axes that show it are no better for the others.
        return Ok(match largest {
            Some((value, said)) if value >= fallback => {
                (value, format!("{said}; not seen on {}", names.join(", ")))
            }
            _ => (
                fallback,
                format!("given by hand: not seen on {}", names.join(", ")),
            ),
        });
    }
    let (channel, why) = missing[0];
    let remedy = match (term, sensor) {
        (Term::K, Sensor::Gyro) => "record for longer, or state one with --gyro-walk",
        (Term::K, Sensor::Accel) => "record for longer, or state one with --accel-walk",
        _ => "record again, at rest",
    };
    Err(Error::new(
        format!("{place}, channel {}", channel.name),
        format!("{} ({}): {why}", term.letter(), term.name()),
        remedy,
    ))
}
