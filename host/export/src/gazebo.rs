//! Noise of an inertial unit for Gazebo: the element `<imu>` of SDF.
//!
//! Gazebo adds to each axis, with every message, a normal number with `mean` and `stddev`, and a bias `b` that follows
//! `b = exp(-dt/τ) b + σ √(τ/2 (1 - exp(-2 dt/τ)))` times a normal number, with σ = dynamic_bias_stddev and τ = dynamic_bias_correlation_time. For τ much
//! longer than a run this is the walk of density K = σ. `stddev` is that of one message, `N √rate`. The bias of the readings is written to `mean`: Gazebo
//! gives bias_mean the opposite sign in every second run.
//!
//! Source: gazebosim/gz-sensors, src/GaussianNoiseModel.cc, `ApplyImpl`, `Load` (9ba02f24, 2026-05); gazebosim/sdformat, sdf/1.12/imu.sdf, noise.sdf.

use std::fmt::Write as _;

use mimu::quantity::{AXES, PerSensor, Sensor};
use mimu_recording::error::Result;
use nalgebra::Vector3;

use crate::driver::Readings;
use crate::remaining::{self, Places};
use crate::worst_axis::{Densities, NoiseOptions};
use crate::{Export, Sources, driver, heading, yaml};

/// Options of the element.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Correlation time of the bias, s: longer than a run, or else the bias comes back to 0 within it
    #[cfg_attr(feature = "clap", arg(long, value_name = "S", default_value_t = 3600.0, value_parser = crate::options::positive))]
    pub correlation_time: f64,
    /// Options common to all noise files.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub noise: NoiseOptions,
    /// The driver's conversion.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub driver: driver::Options,
}

/// Text of the element.
///
/// # Errors
/// The noise is missing, a triad is missing or singular if a calibration is given, or an error of [`crate::worst_axis::WalkOptions::axes`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let noise = from.noise()?;
    let mut export = Export::new("gazebo", from);
    export.notes.extend(from.other_device());
    let (mut gain, mut bias) = (PerSensor::both([1.0; 3]), PerSensor::both(Vector3::zeros()));
    match from.calibration {
        Some((calibration, place)) => {
            let readings = PerSensor {
                gyro: options.driver.readings(calibration, place, Sensor::Gyro)?,
                accel: options.driver.readings(calibration, place, Sensor::Accel)?,
            };
            export
                .notes
                .extend([readings.gyro.line(), readings.accel.line()]);
            export.notes.extend(heading::temperature(calibration));
            let places = Places {
                cross_terms: true,
                temperature: false,
                effects: false,
            };
            export.remaining = remaining::of(calibration, places)?;
            export.remaining.extend(
                Sensor::BOTH
                    .map(|s| remaining::Remaining::of_readings(s, &readings[s].forward.matrix)),
            );
            gain = readings.as_ref().map(Readings::noise_gain);
            bias = readings.map(|of| of.forward.bias);
        }
        None => options.driver.unused()?,
    }
    let axes = options.noise.walks.axes(noise, &gain)?;
    let rate = options.noise.rate_hz(noise);
    export.formulas.push(format!(
        "stddev = N sqrt(rate) of one message at {rate:.3} Hz, which has to be update_rate of the sensor; dynamic_bias_stddev = K; mean = bias of the readings; rad/s and m/s^2"
    ));
    export.notes.push(format!(
        "The bias wanders by K sqrt(t) for times much shorter than {} s, and at most by K sqrt({0}/2).",
        options.correlation_time
    ));
    export.notes.push("Copy the element into <sensor type=\"imu\">. Gazebo simulates no scale factors, cross terms or flicker.".into());
    let mut comments = match from.calibration {
        Some((calibration, _)) => {
            let mut comments = heading::of_calibration(calibration, &export);
            comments.insert(2, heading::noise_from(noise));
            comments
        }
        None => heading::of_noise(noise, &export),
    };
    // Two hyphens end a comment of XML.
    comments
        .iter_mut()
        .for_each(|line| *line = line.replace("--", "- -"));
    let mut out = format!("<!--\n{}-->\n<imu>\n", heading::comments(" ", &comments));
    for (name, sensor) in [
        ("angular_velocity", Sensor::Gyro),
        ("linear_acceleration", Sensor::Accel),
    ] {
        let _ = writeln!(out, "  <{name}>");
        for (i, axis) in AXES.iter().enumerate() {
            out.push_str(&element(
                axis,
                bias[sensor][i],
                &axes[sensor][i],
                rate,
                options.correlation_time,
            ));
        }
        let _ = writeln!(out, "  </{name}>");
    }
    out.push_str("</imu>\n");
    export.content = out.into_bytes();
    Ok(export)
}

fn element(axis: &str, mean: f64, density: &Densities, rate: f64, correlation_s: f64) -> String {
    let [mean, stddev, walk] =
        [mean, density.white.value * rate.sqrt(), density.walk.value].map(yaml::number);
    format!(
        "    <{axis}>\n      <noise type=\"gaussian\">\n        <mean>{mean}</mean>\n        <stddev>{stddev}</stddev>\n        \
         <dynamic_bias_stddev>{walk}</dynamic_bias_stddev>\n        \
         <dynamic_bias_correlation_time>{correlation_s}</dynamic_bias_correlation_time>\n      </noise>\n    </{axis}>\n"
    )
}
