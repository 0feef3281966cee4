//! Noise coefficients, and biases over temperature, in the formats of other programs.

pub mod autopilot;

use std::fmt::Write as _;

use mimu::allan::model::Term;
use mimu::noise::noise_file::{NoiseChannel, NoiseFile};
use mimu::quantity::Sensor;
use mimu_recording::error::{Error, Result};

/// What the person has decided about Kalibr's file.
#[derive(Debug, Clone, PartialEq)]
pub struct KalibrOptions {
    /// Topic of the messages.
    pub rostopic: String,
    /// Messages a second; `None`: the rate of the recording.
    pub update_rate_hz: Option<f64>,
    /// Random walk to state where the record shows none, SI per √s: gyro, accelerometer.
    pub walk_fallback: [Option<f64>; 2],
}

/// Text of Kalibr's `imu.yaml`.
///
/// Kalibr's continuous-time densities are the coefficients themselves: its discrete noise is `density/√dt` a sample, which
/// has N = density, and its bias walks by `random_walk √dt` a sample, which has K = random_walk (Kalibr wiki, "IMU noise
/// model"). The worst axis of each sensor is stated, as the file has one number for three.
///
/// A random walk that the record does not show on some axis is the one given by hand or, without one, the upper end of its
/// interval there: an estimator that takes a bias for steadier than it is will not follow it, one that takes it for less steady
/// only follows it less smoothly.
///
/// Errors: a sensor is missing or not in SI; N is missing on an axis; K is, and nothing bounds it.
pub fn kalibr(file: &NoiseFile, options: &KalibrOptions) -> Result<String> {
    let mut out = format!(
        "# {}: noise from {:.0} s at rest, by mimu {}.\n\
         # Continuous-time densities of the worst axis; {} % interval behind each.\n",
        file.device,
        file.duration_s,
        env!("CARGO_PKG_VERSION"),
        100.0 * file.confidence,
    );
    for sensor in [Sensor::Accel, Sensor::Gyro] {
        let (prefix, unit) = match sensor {
            Sensor::Accel => ("accelerometer", ["m/s^2/sqrt(Hz)", "m/s^3/sqrt(Hz)"]),
            Sensor::Gyro => ("gyroscope", ["rad/s/sqrt(Hz)", "rad/s^2/sqrt(Hz)"]),
        };
        let entries = [
            (Term::N, "noise_density", unit[0], None),
            (
                Term::K,
                "random_walk",
                unit[1],
                options.walk_fallback[sensor as usize],
            ),
        ];
        for (term, key, unit, fallback) in entries {
            let (value, comment) = worst(file, sensor, term, fallback)?;
            let _ = writeln!(out, "{prefix}_{key}: {value:.6e}  # {unit}, {comment}");
        }
    }
    let rate = options.update_rate_hz.unwrap_or(file.sample_rate_hz);
    let topic = serde_json::Value::from(options.rostopic.as_str());
    let _ = writeln!(out, "\nrostopic: {topic}\nupdate_rate: {rate:.3}  # Hz");
    Ok(out)
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
            "record both sensors: Kalibr's file needs both",
        ));
    };
    if let Err(other) = first.model_in(sensor.unit()) {
        let problem = format!("it is in {} and not in {}", other.found, sensor.unit());
        return Err(other.refused(format!("{place}, channel {}", first.name), problem));
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
