//! Covariances of `sensor_msgs/Imu`, as YAML with the message's field names.
//!
//! The message has a covariance of one sample for rates and accelerations, nine numbers by rows. White noise N at the rate of the messages has the
//! variance `N² rate` on each axis. `orientation_covariance` begins with -1: the message says so where there is no orientation. Source:
//! ros2/common_interfaces, sensor_msgs/msg/Imu.msg.

use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::error::Result;

use crate::worst_axis::{Densities, NoiseOptions};
use crate::{Export, Sources, heading, yaml};

/// Options of the file.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Options common to all noise files.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub noise: NoiseOptions,
}

/// Text of the file.
///
/// # Errors
/// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::axes`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let noise = from.noise()?;
    let rate = options.noise.rate_hz(noise);
    let axes = options
        .noise
        .walks
        .axes(noise, &PerSensor::both([1.0; 3]))?;
    let mut export = Export::new("ros-imu", from);
    export.formulas.push(format!(
        "Variance of one message at {rate:.3} Hz: N^2 rate on the diagonal, (rad/s)^2 and (m/s^2)^2, by rows; axes are taken as independent."
    ));
    export.notes.push("This is the white noise of calibrated readings at rest. Vibration, and errors of the calibration, are not in it.".into());
    export
        .notes
        .push("A covariance has no place for K, the walk of the bias.".into());
    export.notes.extend(heading::needs_calibrated(from));
    let mut out = heading::comments("#", &heading::of_noise(noise, &export));
    let mut orientation = [0.0; 9];
    orientation[0] = -1.0;
    yaml::list(&mut out, "", "orientation_covariance", orientation);
    for (key, sensor) in [
        ("angular_velocity_covariance", Sensor::Gyro),
        ("linear_acceleration_covariance", Sensor::Accel),
    ] {
        yaml::list(&mut out, "", key, diagonal(&axes[sensor], rate));
    }
    export.content = out.into_bytes();
    Ok(export)
}

fn diagonal(axes: &[Densities; 3], rate: f64) -> [f64; 9] {
    let mut out = [0.0; 9];
    for (i, axis) in axes.iter().enumerate() {
        out[4 * i] = axis.white.value.powi(2) * rate;
    }
    out
}
