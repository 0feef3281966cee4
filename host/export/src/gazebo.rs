//! Noise of an inertial unit for Gazebo: the element `<imu>` of SDF.
//!
//! Gazebo adds to each axis, with every message, a normal number with `mean` and `stddev`, and a bias `b` that follows
//! `b = exp(-dt/τ) b + σ √(τ/2 (1 - exp(-2 dt/τ)))` times a normal number, with σ = dynamic_bias_stddev and τ = dynamic_bias_correlation_time. For τ much
//! longer than a run this is the walk of density K = σ. `stddev` is that of one message, `N √rate`. The bias of the readings is written to `mean`: Gazebo
//! gives bias_mean the opposite sign in every second run.
//!
//! Source: gazebosim/gz-sensors, src/GaussianNoiseModel.cc, `ApplyImpl`, `Load` (9ba02f24, 2026-05); gazebosim/sdformat, sdf/1.12/imu.sdf, noise.sdf.

use std::fmt::Write as _;

use clap::Args;
use mimu::quantity::{AXES, PerSensor, Sensor};
use mimu_recording::error::Result;
use nalgebra::Vector3;

use crate::convention::{Bias, Convention, Shape};
use crate::driver::{self, Readings, positive};
use crate::layout::{Entry, NoiseKey, NoiseOf, Numbers, walk, white};
use crate::remaining::{Places, Remaining};
use crate::worst_axis::NoiseOptions;
use crate::{Export, Noise, Page, Sources, Target, yaml};

/// Options of the element.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Correlation time of the bias, s: longer than a run, or else the bias comes back to 0 within it
    #[arg(long, value_name = "S", default_value_t = 3600.0, value_parser = positive)]
    pub correlation_time: f64,
    /// Options common to all noise files.
    #[command(flatten)]
    pub noise: NoiseOptions,
    /// The driver's conversion.
    #[command(flatten)]
    pub driver: driver::Options,
}

/// The format.
pub struct Gazebo;

impl Target for Gazebo {
    type Options = Options;
    const NAME: &str = "gazebo";
    const ABOUT: &str = "Biases and noise for Gazebo: the element imu of SDF";
    const CONTENTS: &str = "biases and noise of the unit, to simulate it";
    const READERS: &str = "Gazebo";
    const CONVENTION: Convention = Convention::to_reading(Shape::Absent, Bias::AddedToReadings);
    const NOISE: Noise = Noise::Needed;
    const LAYOUT: &[Entry] = &[
        Entry::of(
            Sensor::Gyro,
            Numbers::Bias,
            "angular_velocity/{axis}/noise/mean",
        ),
        Entry::of(
            Sensor::Accel,
            Numbers::Bias,
            "linear_acceleration/{axis}/noise/mean",
        ),
    ];
    const NOISE_OF_READINGS: bool = true;
    const NOISE_KEYS: &[NoiseKey] = &[
        white("angular_velocity/{axis}/noise/stddev", "", Sensor::Gyro).of(NoiseOf::Deviation),
        white("linear_acceleration/{axis}/noise/stddev", "", Sensor::Accel).of(NoiseOf::Deviation),
        walk(
            "angular_velocity/{axis}/noise/dynamic_bias_stddev",
            "",
            Sensor::Gyro,
        ),
        walk(
            "linear_acceleration/{axis}/noise/dynamic_bias_stddev",
            "",
            Sensor::Accel,
        ),
    ];
    const PAGES: &[Page] = &[Page::of("Gazebo", "imu.sdf")];

    /// # Errors
    /// The noise is missing, a triad is missing or singular if a calibration is given, or an error of [`crate::worst_axis::WalkOptions::axes`].
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let noise = from.noise()?;
        let mut export = Export::new::<Self>(from);
        let (mut gain, mut bias) = (PerSensor::both([1.0; 3]), PerSensor::both(Vector3::zeros()));
        if from.calibration.is_none() {
            options.driver.unused()?;
        } else {
            let (calibration, readings) = options.driver.both(from)?;
            export.note(readings.gyro.line());
            export.note(readings.accel.line());
            export.temperature(calibration);
            export.leaves(calibration, Places::Matrix);
            for sensor in Sensor::BOTH {
                let error = Remaining::of_readings(sensor, &readings[sensor].forward.matrix);
                export.remaining.push(error);
                bias[sensor] = Self::CONVENTION.of(&readings[sensor])?.bias;
            }
            gain = readings.as_ref().map(Readings::noise_gain);
        }
        let axes = options.noise.walks.axes(noise, &gain)?;
        let rate = options.noise.rate_hz(noise);
        let correlation_s = options.correlation_time;
        export.formula(format!(
            "stddev = N sqrt(rate) of one message at {rate:.3} Hz, which has to be update_rate of the sensor; dynamic_bias_stddev = K; mean = bias of the readings; rad/s and m/s^2"
        ));
        export.note(format!(
            "The bias wanders by K sqrt(t) for times much shorter than {correlation_s} s, and at most by K sqrt({correlation_s}/2)."
        ));
        export.note("Copy the element into <sensor type=\"imu\">. Gazebo simulates no scale factors, cross terms or flicker.");
        // Two hyphens end a comment of XML.
        let head = export.head(" ", from).replace("--", "- -");
        let mut out = format!("<!--\n{head}-->\n<imu>\n");
        for (name, sensor) in [
            ("angular_velocity", Sensor::Gyro),
            ("linear_acceleration", Sensor::Accel),
        ] {
            let _ = writeln!(out, "  <{name}>");
            for (i, axis) in AXES.iter().enumerate() {
                let density = &axes[sensor][i];
                let stddev = NoiseOf::Deviation.number(density.white.value, rate);
                let [mean, stddev, walk] =
                    [bias[sensor][i], stddev, density.walk.value].map(yaml::number);
                let _ = writeln!(
                    out,
                    "    <{axis}>\n      <noise type=\"gaussian\">\n        <mean>{mean}</mean>\n        <stddev>{stddev}</stddev>\n        \
                     <dynamic_bias_stddev>{walk}</dynamic_bias_stddev>\n        \
                     <dynamic_bias_correlation_time>{correlation_s}</dynamic_bias_correlation_time>\n      </noise>\n    </{axis}>"
                );
            }
            let _ = writeln!(out, "  </{name}>");
        }
        Ok(export.with(out + "</imu>\n"))
    }
}
