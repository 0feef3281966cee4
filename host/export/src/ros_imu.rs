//! Covariances of `sensor_msgs/Imu`, as YAML with the message's field names.
//!
//! The message has a covariance of one sample for rates and accelerations, nine numbers by rows. White noise N at the rate of the messages has the
//! variance `N² rate` on each axis. `orientation_covariance` begins with -1: the message says so where there is no orientation. Source:
//! ros2/common_interfaces, sensor_msgs/msg/Imu.msg.

use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::error::Result;

use crate::layout::{NoiseKey, NoiseOf, white};
use crate::worst_axis::NoiseOptions;
use crate::{Export, Noise, Page, Sources, Target, yaml};

/// The format.
pub struct RosImu;

impl Target for RosImu {
    type Options = NoiseOptions;
    const NAME: &str = "ros-imu";
    const ABOUT: &str = "Covariances of sensor_msgs/Imu for ROS";
    const CONTENTS: &str = "variances of one sample";
    const READERS: &str = "nodes that publish `sensor_msgs/Imu`";
    const NOISE: Noise = Noise::Only;
    const NOISE_KEYS: &[NoiseKey] = &[
        white("angular_velocity_covariance", "", Sensor::Gyro).of(NoiseOf::Variance),
        white("linear_acceleration_covariance", "", Sensor::Accel).of(NoiseOf::Variance),
    ];
    const PAGES: &[Page] = &[Page::of("ROS, sensor_msgs/Imu", "covariances.yaml")];

    /// # Errors
    /// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::axes`].
    fn export(from: &Sources, options: &NoiseOptions) -> Result<Export> {
        let noise = from.noise()?;
        let rate = options.rate_hz(noise);
        let axes = options.walks.axes(noise, &PerSensor::both([1.0; 3]))?;
        let mut export = Export::new::<Self>(from);
        export.formula(format!(
            "Variance of one message at {rate:.3} Hz: N^2 rate on the diagonal, (rad/s)^2 and (m/s^2)^2, by rows; axes are taken as independent."
        ));
        export.note("This is the white noise of calibrated readings at rest. Vibration, and errors of the calibration, are not in it.");
        export.note("A covariance has no place for K, the walk of the bias.");
        export.needs_calibrated(from);
        let mut out = export.head("#", from);
        let mut orientation = [0.0; 9];
        orientation[0] = -1.0;
        yaml::list(&mut out, "", "orientation_covariance", orientation);
        for key in Self::NOISE_KEYS {
            let mut covariance = [0.0; 9];
            for (i, axis) in axes[key.sensor].iter().enumerate() {
                covariance[4 * i] = key.number(axis.white.value, rate);
            }
            yaml::list(&mut out, "", key.key, covariance);
        }
        Ok(export.with(out))
    }
}
