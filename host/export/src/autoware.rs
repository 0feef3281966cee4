//! Biases of the gyro and noise for Autoware's imu_corrector: imu_corrector.param.yaml.
//!
//! The node subtracts angular_velocity_offset from the rates in the frame of the message, and sets the covariances to the squares of the standard
//! deviations of one message. It has a scale factor only from its own estimator, which a file does not set, and nothing for the accelerometer but one
//! standard deviation. Source: autowarefoundation/autoware_universe, sensing/autoware_imu_corrector/src/imu_corrector_core.cpp, `callback_imu`
//! (0ddc7223, 2026).

use mimu::quantity::{AXES, PerSensor, Sensor};
use mimu_recording::error::Result;

use crate::remaining::{self, Places, Remaining};
use crate::worst_axis::NoiseOptions;
use crate::{Export, Sources, driver, heading, yaml};

/// Options of the file.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Options common to all noise files.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub noise: NoiseOptions,
    /// The driver's conversion.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub driver: driver::Options,
}

/// Text of the file.
///
/// # Errors
/// The calibration, a triad of it or the noise is missing, C is singular, or an error of [`crate::worst_axis::WalkOptions::axes`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let noise = from.noise()?;
    let readings = PerSensor {
        gyro: options.driver.readings(calibration, place, Sensor::Gyro)?,
        accel: options.driver.readings(calibration, place, Sensor::Accel)?,
    };
    let gain = readings.as_ref().map(driver::Readings::noise_gain);
    let axes = options.noise.walks.axes(noise, &gain)?;
    let rate = options.noise.rate_hz(noise);
    let deviations = axes.map(|three| three.map(|axis| axis.white.value * rate.sqrt()));
    let mut export = Export::new("autoware", from);
    export.notes.extend(from.other_device());
    export.formulas.push(
        "gyro: output = reading - angular_velocity_offset, rad/s, in the frame of the message"
            .into(),
    );
    export.formulas.push(format!("stddev = N sqrt(rate) of one message at {rate:.3} Hz; of the accelerometer that of the worst axis"));
    export
        .notes
        .extend([readings.gyro.line(), readings.accel.line()]);
    export.notes.push("If on_off_correction.correct_for_dynamic_bias (in older versions correct_for_bias) is on, set the offsets to 0: the node subtracts its own estimate.".into());
    export.notes.extend(heading::temperature(calibration));
    let places = Places {
        cross_terms: true,
        temperature: false,
        effects: false,
    };
    export.remaining = remaining::of(calibration, places)?;
    for sensor in Sensor::BOTH {
        let error = Remaining::of_readings(sensor, &readings[sensor].forward.matrix);
        export.remaining.push(error);
    }
    export.remaining.push(Remaining::of_bias(
        Sensor::Accel,
        &readings.accel.forward.bias,
    ));
    let mut comments = heading::of_calibration(calibration, &export);
    comments.insert(2, heading::noise_from(noise));
    let mut out = heading::comments("#", &comments);
    out.push_str("/**:\n  ros__parameters:\n");
    for (axis, offset) in AXES.iter().zip(readings.gyro.forward.bias.iter()) {
        out.push_str(&format!(
            "    angular_velocity_offset_{axis}: {}  # rad/s\n",
            yaml::number(*offset)
        ));
    }
    for (axis, deviation) in AXES.iter().zip(deviations.gyro) {
        out.push_str(&format!(
            "    angular_velocity_stddev_{axis}{axis}: {}  # rad/s\n",
            yaml::number(deviation)
        ));
    }
    let worst = deviations.accel.into_iter().fold(0.0, f64::max);
    out.push_str(&format!(
        "    acceleration_stddev: {}  # m/s^2\n",
        yaml::number(worst)
    ));
    export.content = out.into_bytes();
    Ok(export)
}
