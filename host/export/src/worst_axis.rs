//! Noise of the worst axis, for programs that have one number for three axes.
//!
//! Kalibr and similar programs take continuous-time densities (Kalibr wiki, "IMU noise model"). N is the density of white noise: `density/√dt` per
//! sample. K is that of a bias random walk: `random_walk √dt` per sample. Other programs take values per sample, which depend on the message rate.
//!
//! If the record does not show a random walk on some axis, the value given by hand is used or, without one, the upper end of its interval. An
//! estimator that believes a bias to be too steady cannot follow it; one that believes it to be too unsteady only follows it less smoothly.

use mimu::noise::noise_file::{NoiseChannel, NoiseFile};
use mimu::quantity::{AXES, PerSensor, Sensor};
use mimu::readable::STANDARD_GRAVITY;
use mimu_allan::model::Term;
use mimu_recording::error::{Argument, Error, Result};

use crate::{Sources, yaml};

/// Options of the random walks, the same for all programs.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct WalkOptions {
    /// Random walk to state where the record shows none on some axis, rad/s²/√Hz
    #[cfg_attr(feature = "clap", arg(long, value_name = "SI", value_parser = crate::options::positive))]
    pub gyro_walk: Option<f64>,
    /// The same for the accelerometer, m/s³/√Hz
    #[cfg_attr(feature = "clap", arg(long, value_name = "SI", value_parser = crate::options::positive))]
    pub accel_walk: Option<f64>,
}

/// Options of programs that need the message rate too.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct NoiseOptions {
    /// Messages a second; without it the rate of the recording
    #[cfg_attr(feature = "clap", arg(long, value_name = "HZ", value_parser = crate::options::positive))]
    pub update_rate: Option<f64>,
    /// Random walks.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub walks: WalkOptions,
}

/// Option of programs that take local gravity with the noise.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct GravityOptions {
    /// Local gravity, m/s²; without it that of the calibration, or else 9.80665
    #[cfg_attr(feature = "clap", arg(long, value_name = "MPS2", value_parser = crate::options::positive))]
    pub gravity: Option<f64>,
}

/// The largest coefficient of the three axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Worst {
    /// Value, SI.
    pub value: f64,
    /// Ends of its interval, SI, if it was measured.
    pub interval: Option<[f64; 2]>,
    /// Axis, or another origin.
    pub origin: String,
    /// What else there is to say of it.
    pub remark: Option<String>,
}

/// White noise and random walk of a triad.
#[derive(Debug, Clone, PartialEq)]
pub struct Densities {
    /// N, rad/s/√Hz or m/s²/√Hz.
    pub white: Worst,
    /// K, rad/s²/√Hz or m/s³/√Hz.
    pub walk: Worst,
}

impl NoiseOptions {
    /// Messages per second.
    pub fn rate_hz(&self, noise: &NoiseFile) -> f64 {
        self.update_rate.unwrap_or(noise.sample_rate_hz)
    }
}

impl GravityOptions {
    /// Gravity, m/s², and its origin.
    pub fn gravity(&self, from: &Sources) -> (f64, &'static str) {
        let calibrated = from.calibration.and_then(|(c, _)| c.recording.gravity_mps2);
        match (self.gravity, calibrated) {
            (Some(given), _) => (given, "given by hand"),
            (None, Some(calibrated)) => (calibrated, "where it was calibrated"),
            (None, None) => (STANDARD_GRAVITY, "standard gravity"),
        }
    }
}

impl WalkOptions {
    /// N and K of the worst axis of each sensor, times `gain` of the axis; 1 for noise of calibrated readings.
    ///
    /// # Errors
    /// A sensor is missing or not in SI, N is missing on an axis, or K is missing on an axis and has no upper bound.
    pub fn densities(
        &self,
        noise: &NoiseFile,
        gain: &PerSensor<[f64; 3]>,
    ) -> Result<PerSensor<Densities>> {
        let of = |sensor| -> Result<Densities> {
            Ok(Densities {
                white: worst(noise, sensor, Term::N, None, &gain[sensor])?,
                walk: worst(noise, sensor, Term::K, self.given(sensor), &gain[sensor])?,
            })
        };
        Ok(PerSensor {
            accel: of(Sensor::Accel)?,
            gyro: of(Sensor::Gyro)?,
        })
    }

    /// N and K of every axis, times `gain` of the axis, for programs that have a number for each.
    ///
    /// # Errors
    /// Those of [`Self::densities`], or an axis is missing.
    pub fn axes(
        &self,
        noise: &NoiseFile,
        gain: &PerSensor<[f64; 3]>,
    ) -> Result<PerSensor<[Densities; 3]>> {
        let of = |sensor: Sensor, axis: usize| -> Result<Densities> {
            let name = format!("{sensor}_{}", AXES[axis]);
            let mut channels = noise.of(sensor);
            channels.retain(|channel| channel.name == name);
            let term = |term, given| {
                worst_of(
                    noise,
                    &channels,
                    &name,
                    (sensor, term),
                    given,
                    &gain[sensor],
                )
            };
            Ok(Densities {
                white: term(Term::N, None)?,
                walk: term(Term::K, self.given(sensor))?,
            })
        };
        let three = |sensor| -> Result<[Densities; 3]> {
            Ok([of(sensor, 0)?, of(sensor, 1)?, of(sensor, 2)?])
        };
        Ok(PerSensor {
            accel: three(Sensor::Accel)?,
            gyro: three(Sensor::Gyro)?,
        })
    }

    /// [`Self::densities`] of calibrated readings.
    ///
    /// # Errors
    /// The same as of [`Self::densities`].
    pub fn calibrated(&self, noise: &NoiseFile) -> Result<PerSensor<Densities>> {
        self.densities(noise, &PerSensor::both([1.0; 3]))
    }

    fn given(&self, sensor: Sensor) -> Option<f64> {
        match sensor {
            Sensor::Gyro => self.gyro_walk,
            Sensor::Accel => self.accel_walk,
        }
    }
}

/// Bias instability B of an axis, if the record shows it; the largest, if it was recorded at several temperatures.
pub(crate) fn instability(noise: &NoiseFile, sensor: Sensor, axis: &str) -> Option<f64> {
    let name = format!("{sensor}_{axis}");
    let channels = noise.of(sensor).into_iter().filter(|c| c.name == name);
    let all = channels.filter_map(|c| Some(c.get(Term::B).ok()?.value));
    all.reduce(f64::max)
}

/// A line of YAML: the value that a program takes, which `convert` makes of the density `from`, its unit, and its interval in the same unit.
pub fn line(
    indent: &str,
    key: &str,
    convert: impl Fn(f64) -> f64,
    unit: &str,
    from: &Worst,
) -> String {
    let value = yaml::scientific(convert(from.value), 6);
    let mut comment = from.origin.clone();
    if let Some([lower, upper]) = from.interval.map(|ends| ends.map(&convert)) {
        comment += &format!(": {lower:.2e} to {upper:.2e}");
    }
    if let Some(remark) = &from.remark {
        comment += &format!("; {remark}");
    }
    format!("{indent}{key}: {value}  # {unit}, {comment}\n")
}

/// The largest coefficient of `term` among the axes of `sensor`, with a comment.
fn worst(
    file: &NoiseFile,
    sensor: Sensor,
    term: Term,
    fallback: Option<f64>,
    gain: &[f64; 3],
) -> Result<Worst> {
    let name = format!("the {sensor}");
    worst_of(
        file,
        &file.of(sensor),
        &name,
        (sensor, term),
        fallback,
        gain,
    )
}

/// The same among these `channels`, which are those of `name`.
fn worst_of(
    file: &NoiseFile,
    channels: &[&NoiseChannel],
    name: &str,
    (sensor, term): (Sensor, Term),
    fallback: Option<f64>,
    gain: &[f64; 3],
) -> Result<Worst> {
    let place = &file.place;
    let Some(first) = channels.first() else {
        return Err(Error::new(
            place,
            format!("it has no channel of {name}"),
            "record both sensors: the file needs all six axes",
        ));
    };
    if let Err(other) = first.model_in(sensor.unit()) {
        let problem = format!("its unit is {}, not {}", other.found, sensor.unit());
        return Err(other.refused(format!("{place}, channel {}", first.name), problem));
    }
    let mut largest: Option<Worst> = None;
    let mut missing: Vec<(&NoiseChannel, &str)> = Vec::new();
    let mut take = |value: f64, interval: Option<[f64; 2]>, origin: String| {
        if largest.as_ref().is_none_or(|worst| value > worst.value) {
            largest = Some(Worst {
                value,
                interval,
                origin,
                remark: None,
            });
        }
    };
    for channel in channels {
        let (name, bound) = (&channel.name, channel.k_at_most);
        let axis = AXES.iter().position(|axis| name.ends_with(axis));
        let gain = axis.map_or(1.0, |axis| gain[axis]);
        match (channel.get(term), bound) {
            (Ok(c), _) => take(
                gain * c.value,
                Some([gain * c.lower, gain * c.upper]),
                name.clone(),
            ),
            (Err(_), Some(bound)) if term == Term::K && fallback.is_none() => {
                let origin = format!("{name}: not seen, the upper end of its interval");
                take(gain * bound, None, origin);
            }
            (Err(why), _) => missing.push((channel, why)),
        }
    }
    let largest = match (largest, missing.is_empty()) {
        (Some(worst), true) => return Ok(worst),
        (largest, _) => largest,
    };
    let names: Vec<&str> = missing.iter().map(|(c, _)| c.name.as_str()).collect();
    if let Some(fallback) = fallback {
        let unseen = format!("not seen on {}", names.join(", "));
        // Uses the larger of the two: axes with a visible walk do not limit that of the others.
        return Ok(match largest.filter(|worst| worst.value >= fallback) {
            Some(worst) => Worst {
                remark: Some(unseen),
                ..worst
            },
            None => Worst {
                value: fallback,
                interval: None,
                origin: format!("given by hand: {unseen}"),
                remark: None,
            },
        });
    }
    let (channel, why) = missing[0];
    let remedy = match term {
        Term::K => "record for longer, or give one",
        _ => "record again, at rest",
    };
    let error = Error::new(
        format!("{place}, channel {}", channel.name),
        format!("{} ({}): {why}", term.letter(), term.name()),
        remedy,
    );
    Err(match (term, sensor) {
        (Term::K, Sensor::Gyro) => error.about(Argument::GyroWalk),
        (Term::K, Sensor::Accel) => error.about(Argument::AccelWalk),
        _ => error,
    })
}
