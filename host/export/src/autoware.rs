//! Biases of the gyro and noise for Autoware's imu_corrector: imu_corrector.param.yaml.
//!
//! The node subtracts angular_velocity_offset from the rates in the frame of the message, and sets the covariances to the squares of the standard
//! deviations of one message. It has a scale factor only from its own estimator, which a file does not set, and nothing for the accelerometer but one
//! standard deviation. Source: autowarefoundation/autoware_universe, sensing/autoware_imu_corrector/src/imu_corrector_core.cpp, `callback_imu`
//! (0ddc7223, 2026).

use std::fmt::Write as _;

use mimu::quantity::{AXES, Sensor};
use mimu_recording::error::Result;

use crate::convention::{Bias, Convention, Shape};
use crate::layout::{Entry, NoiseKey, NoiseOf, Numbers, white};
use crate::remaining::{Places, Remaining};
use crate::worst_axis::NoiseAndDriver;
use crate::{Export, Noise, Sources, Target, driver, yaml};

/// The format.
pub struct Autoware;

impl Target for Autoware {
    type Options = NoiseAndDriver;
    const NAME: &str = "autoware";
    const ABOUT: &str = "Biases of the gyro and noise for Autoware: imu_corrector.param.yaml";
    const CONTENTS: &str = "bias of the gyro, noise";
    const READERS: &str = "Autoware's imu_corrector";
    const CONVENTION: Convention =
        Convention::to_input(Shape::Absent, Bias::SubtractedFromReadings);
    const NOISE: Noise = Noise::Needed;
    const LAYOUT: &[Entry] = &[Entry::of(
        Sensor::Gyro,
        Numbers::Bias,
        "angular_velocity_offset_{axis}",
    )];
    const NOISE_OF_READINGS: bool = true;
    const NOISE_KEYS: &[NoiseKey] = &[
        white(
            "angular_velocity_stddev_{axis}{axis}",
            "rad/s",
            Sensor::Gyro,
        )
        .of(NoiseOf::Deviation),
        white("acceleration_stddev", "m/s^2", Sensor::Accel).of(NoiseOf::Deviation),
    ];

    /// # Errors
    /// The calibration, a triad of it or the noise is missing, C is singular, or an error of [`crate::worst_axis::WalkOptions::axes`].
    fn export(from: &Sources, options: &NoiseAndDriver) -> Result<Export> {
        from.calibration()?;
        let noise = from.noise()?;
        let (calibration, readings) = options.driver.both(from)?;
        let gain = readings.as_ref().map(driver::Readings::noise_gain);
        let axes = options.noise.walks.axes(noise, &gain)?;
        let rate = options.noise.rate_hz(noise);
        let deviations =
            axes.map(|three| three.map(|axis| NoiseOf::Deviation.number(axis.white.value, rate)));
        let mut export = Export::new::<Self>(from);
        export.formula(
            "gyro: output = reading - angular_velocity_offset, rad/s, in the frame of the message",
        );
        export.formula(format!("stddev = N sqrt(rate) of one message at {rate:.3} Hz; of the accelerometer that of the worst axis"));
        export.note(readings.gyro.line());
        export.note(readings.accel.line());
        export.note("If on_off_correction.correct_for_dynamic_bias (in older versions correct_for_bias) is on, set the offsets to 0: the node subtracts its own estimate.");
        export.temperature(calibration);
        export.leaves(calibration, Places::Matrix);
        export
            .remaining
            .extend(Sensor::BOTH.map(|s| Remaining::of_readings(s, &readings[s].forward.matrix)));
        let bias = Remaining::of_bias(Sensor::Accel, &readings.accel.forward.bias);
        export.remaining.push(bias);
        let mut out = export.head("#", from) + "/**:\n  ros__parameters:\n";
        for (key, offset) in Self::LAYOUT[0].written(&Self::CONVENTION.of(&readings.gyro)?) {
            let _ = writeln!(out, "    {key}: {}  # rad/s", yaml::number(offset[0]));
        }
        for (axis, deviation) in AXES.iter().zip(deviations.gyro) {
            let deviation = yaml::number(deviation);
            let _ = writeln!(
                out,
                "    angular_velocity_stddev_{axis}{axis}: {deviation}  # rad/s"
            );
        }
        let worst = yaml::number(deviations.accel.into_iter().fold(0.0, f64::max));
        let _ = writeln!(out, "    acceleration_stddev: {worst}  # m/s^2");
        Ok(export.with(out))
    }
}
