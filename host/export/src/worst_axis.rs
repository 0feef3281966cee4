//! Noise of the worst axis, for programs that have one number for three axes.
//!
//! Kalibr and similar programs take continuous-time densities (Kalibr wiki, "IMU noise model"). N is the density of white noise: `density/√dt` per
//! sample. K is that of a bias random walk: `random_walk √dt` per sample. Other programs take values per sample, which depend on the message rate.
//!
//! If the record does not show a random walk on some axis, the value given by hand is used or, without one, the upper end of its interval. An
//! estimator that believes a bias to be too steady cannot follow it; one that believes it to be too unsteady only follows it less smoothly.

use clap::Args;
use mimu::noise::noise_file::{NoiseChannel, NoiseFile};
use mimu::{AXES, PerSensor, STANDARD_GRAVITY, Sensor};
use mimu_allan::model::Term;
use mimu_recording::error::{Argument, Error, Result};

use crate::driver::{self, positive};
use crate::layout::NoiseKey;
use crate::{Export, Sources, Target, yaml};

/// Options of the random walks, the same for all programs.
#[derive(Debug, Clone, Default, Args)]
pub struct WalkOptions {
    /// Random walk to state where the record shows none on some axis, rad/s²/√Hz
    #[arg(long, value_name = "SI", value_parser = positive)]
    pub gyro_walk: Option<f64>,
    /// The same for the accelerometer, m/s³/√Hz
    #[arg(long, value_name = "SI", value_parser = positive)]
    pub accel_walk: Option<f64>,
}

/// Options of programs that need the message rate too.
#[derive(Debug, Clone, Default, Args)]
pub struct NoiseOptions {
    /// Messages a second; without it the rate of the recording
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub update_rate: Option<f64>,
    /// Random walks.
    #[command(flatten)]
    pub walks: WalkOptions,
}

/// Options of programs that take noise and readings of a driver.
#[derive(Debug, Clone, Default, Args)]
pub struct NoiseAndDriver {
    /// Options common to all noise files.
    #[command(flatten)]
    pub noise: NoiseOptions,
    /// The driver's conversion.
    #[command(flatten)]
    pub driver: driver::Options,
}

/// Option of programs that take local gravity with the noise.
#[derive(Debug, Clone, Default, Args)]
pub struct GravityOptions {
    /// Local gravity, m/s²; without it that of the calibration, or else 9.80665
    #[arg(long, value_name = "MPS2", value_parser = positive)]
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

impl Densities {
    /// N, or else K.
    pub fn of(&self, term: Term) -> &Worst {
        match term {
            Term::N => &self.white,
            _ => &self.walk,
        }
    }
}

impl NoiseOptions {
    /// Messages per second.
    pub fn rate_hz(&self, noise: &NoiseFile) -> f64 {
        self.update_rate.unwrap_or(noise.sample_rate_hz)
    }
}

impl GravityOptions {
    /// The line of YAML with gravity, and its origin.
    pub(crate) fn line(&self, key: &str, from: &Sources) -> String {
        let calibrated = from.calibration.and_then(|(c, _)| c.recording.gravity_mps2);
        let (gravity, source) = match (self.gravity, calibrated) {
            (Some(given), _) => (given, "given by hand"),
            (None, Some(calibrated)) => (calibrated, "where it was calibrated"),
            (None, None) => (STANDARD_GRAVITY, "standard gravity"),
        };
        format!("{key}: {gravity:.6}  # m/s^2, {source}\n")
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
        let of = |s: Sensor| self.of(noise, s, &noise.of(s), &format!("the {s}"), &gain[s]);
        let [accel, gyro] = [of(Sensor::Accel)?, of(Sensor::Gyro)?];
        Ok(PerSensor { gyro, accel })
    }

    /// Those of the further unit with this number; `None` if the file has no channel of it.
    ///
    /// # Errors
    /// As for [`Self::densities`].
    pub(crate) fn of_unit(
        &self,
        noise: &NoiseFile,
        number: u8,
        gain: &PerSensor<[f64; 3]>,
    ) -> Result<Option<PerSensor<Densities>>> {
        let of = |sensor: Sensor| {
            let name = format!("{sensor}{number}");
            let names = AXES.map(|axis| format!("{name}_{axis}"));
            let channels = noise.channel.iter().filter(|c| names.contains(&c.name));
            let channels: Vec<&NoiseChannel> = channels.collect();
            self.of(
                noise,
                sensor,
                &channels,
                &format!("the {name}"),
                &gain[sensor],
            )
        };
        let stems = Sensor::BOTH.map(|sensor| format!("{sensor}{number}_"));
        let known = |stem: &String| noise.channel.iter().any(|c| c.name.starts_with(stem));
        if !stems.iter().any(known) {
            return Ok(None);
        }
        let [accel, gyro] = [of(Sensor::Accel)?, of(Sensor::Gyro)?];
        Ok(Some(PerSensor { gyro, accel }))
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
        let of = |sensor: Sensor| -> Result<[Densities; 3]> {
            let [x, y, z] = AXES.map(|axis| {
                let name = format!("{sensor}_{axis}");
                let mut channels = noise.of(sensor);
                channels.retain(|channel| channel.name == name);
                self.of(noise, sensor, &channels, &name, &gain[sensor])
            });
            Ok([x?, y?, z?])
        };
        let [accel, gyro] = [of(Sensor::Accel)?, of(Sensor::Gyro)?];
        Ok(PerSensor { gyro, accel })
    }

    /// N and K of the worst of these channels of `sensor`, which are those of `name`.
    fn of(
        &self,
        noise: &NoiseFile,
        sensor: Sensor,
        channels: &[&NoiseChannel],
        name: &str,
        gain: &[f64; 3],
    ) -> Result<Densities> {
        let walk = sensor.pick(self.gyro_walk, self.accel_walk);
        let of = |term, given| worst(noise, channels, name, (sensor, term), given, gain);
        Ok(Densities {
            white: of(Term::N, None)?,
            walk: of(Term::K, walk)?,
        })
    }
}

/// The file of a program that takes the noise of calibrated readings and nothing else: `before` the comments, then `body`, and a line for each key, for
/// messages at `rate_hz`.
///
/// # Errors
/// Those of [`WalkOptions::densities`].
pub(crate) fn keys_file<T: Target>(
    mut export: Export,
    from: &Sources,
    (walks, rate_hz): (&WalkOptions, f64),
    [before, body, indent]: [&str; 3],
) -> Result<Export> {
    let densities = walks.densities(from.noise()?, &PerSensor::both([1.0; 3]))?;
    export.needs_calibrated(from);
    let lines = lines(indent, T::NOISE_KEYS, &densities, rate_hz);
    let head = export.head("#", from);
    Ok(export.with([before, &head, body, &lines].concat()))
}

/// A line of YAML for each key, for messages at `rate_hz`.
pub(crate) fn lines(
    indent: &str,
    keys: &[NoiseKey],
    densities: &PerSensor<Densities>,
    rate_hz: f64,
) -> String {
    let of = |key: &NoiseKey| line(indent, key, densities[key.sensor].of(key.term), rate_hz);
    keys.iter().map(of).collect()
}

/// Bias instability B of an axis, if the record shows it; the largest, if it was recorded at several temperatures.
pub(crate) fn instability(noise: &NoiseFile, sensor: Sensor, axis: &str) -> Option<f64> {
    let name = format!("{sensor}_{axis}");
    let channels = noise.of(sensor).into_iter().filter(|c| c.name == name);
    let all = channels.filter_map(|c| Some(c.get(Term::B).ok()?.value));
    all.reduce(f64::max)
}

/// A line of YAML: the number that a program takes of the density `from`, its unit, and its interval in the same unit.
fn line(indent: &str, key: &NoiseKey, from: &Worst, rate_hz: f64) -> String {
    let number = |density| key.number(density, rate_hz);
    let value = yaml::scientific(number(from.value), 6);
    let mut comment = from.origin.clone();
    if let Some([lower, upper]) = from.interval.map(|ends| ends.map(number)) {
        comment += &format!(": {lower:.2e} to {upper:.2e}");
    }
    if let Some(remark) = &from.remark {
        comment += &format!("; {remark}");
    }
    let (key, unit) = (key.key, key.unit);
    format!("{indent}{key}: {value}  # {unit}, {comment}\n")
}

/// The largest coefficient of `term` among these `channels`, which are those of `name`, with a comment.
fn worst(
    file: &NoiseFile,
    channels: &[&NoiseChannel],
    name: &str,
    (sensor, term): (Sensor, Term),
    fallback: Option<f64>,
    gain: &[f64; 3],
) -> Result<Worst> {
    let place = &file.place;
    let no_channel = || {
        let problem = format!("it has no channel of {name}");
        Error::new(
            place,
            problem,
            "record both sensors: the file needs all six axes",
        )
    };
    let first = channels.first().ok_or_else(no_channel)?;
    first.model_in(sensor.unit(), place)?;
    let (mut seen, mut missing) = (Vec::new(), Vec::new());
    for channel in channels {
        let name = &channel.name;
        let axis = AXES.iter().position(|axis| name.ends_with(axis));
        let gain = axis.map_or(1.0, |axis| gain[axis]);
        let (value, interval, origin) = match (channel.get(term), channel.k_at_most) {
            (Ok(c), _) => {
                let ends = [gain * c.lower, gain * c.upper];
                // The noise of another program's file has none.
                let known = ends.iter().all(|end| end.is_finite());
                (gain * c.value, known.then_some(ends), name.clone())
            }
            (Err(_), Some(bound)) if term == Term::K && fallback.is_none() => {
                let origin = format!("{name}: not seen, the upper end of its interval");
                (gain * bound, None, origin)
            }
            (Err(why), _) => {
                missing.push((name.as_str(), why));
                continue;
            }
        };
        seen.push(Worst {
            value,
            interval,
            origin,
            remark: None,
        });
    }
    let larger = |a: Worst, b: Worst| if b.value > a.value { b } else { a };
    let largest = seen.into_iter().reduce(larger);
    let Some((channel, why)) = missing.first() else {
        return largest.ok_or_else(no_channel);
    };
    if let Some(fallback) = fallback {
        let names: Vec<&str> = missing.iter().map(|(name, _)| *name).collect();
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
    let remedy = match term {
        Term::K => "record for longer, or give one",
        _ => "record again, at rest",
    };
    let error = Error::new(
        format!("{place}, channel {channel}"),
        format!("{} ({}): {why}", term.letter(), term.name()),
        remedy,
    );
    Err(match (term, sensor) {
        (Term::K, Sensor::Gyro) => error.about(Argument::GyroWalk),
        (Term::K, Sensor::Accel) => error.about(Argument::AccelWalk),
        _ => error,
    })
}
