//! The accelerometer for the ROS package imu_calib: imu_calib.yaml.
//!
//! `corrected = SM raw - bias`, readings of a driver, SI to SI. Therefore SM = C and bias = -o; SM is one list by rows. The node `apply_calib` has no
//! calibration of the gyro: it subtracts the mean of the first messages, and leaves scale factors and cross terms. Source: dpkoch/imu_calib,
//! src/accel_calib/accel_calib.cpp, `loadCalib` and `applyCalib`; src/apply_calib.cpp (2016-06).

use mimu::quantity::Sensor;
use mimu_recording::error::Result;

use crate::convention::{Bias, Convention, Shape};
use crate::layout::{Entry, Numbers};
use crate::remaining::{Places, Remaining};
use crate::{Export, Page, Sources, Target, driver, yaml};

/// The format.
pub struct ImuCalib;

impl Target for ImuCalib {
    type Options = driver::Options;
    const NAME: &str = "imu-calib";
    const ABOUT: &str = "Accelerometer for the ROS package imu_calib: imu_calib.yaml";
    const CONTENTS: &str = "C and o of the accelerometer";
    const READERS: &str = "the ROS package imu_calib";
    const CONVENTION: Convention = Convention::to_input(Shape::Whole, Bias::SubtractedFromInput);
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Accel, Numbers::Left, "SM"),
        Entry::of(Sensor::Accel, Numbers::Bias, "bias"),
    ];
    const PAGES: &[Page] = &[Page::of("ROS imu_calib", "imu_calib.yaml")];

    /// # Errors
    /// No accelerometer is calibrated, or C is singular.
    fn export(from: &Sources, options: &driver::Options) -> Result<Export> {
        let (calibration, place) = from.calibration()?;
        let readings = options.readings(calibration, place, Sensor::Accel)?;
        let mut export = Export::new::<Self>(from);
        export.formula("accel: output = SM reading - bias, m/s^2 to m/s^2; SM by rows, output in the frame of the calibration");
        export.note(readings.line());
        export.temperature(calibration);
        export.leaves(calibration, Places::Matrix);
        export.remaining.retain(|r| r.sensor == Sensor::Accel);
        if calibration.gyro.is_some() {
            let gyro = options.readings(calibration, place, Sensor::Gyro)?;
            export.note("gyro: imu_calib only subtracts the mean of the first messages. Keep the unit still during them.");
            export.note(gyro.line());
            let error = Remaining::of_readings(Sensor::Gyro, &gyro.forward.matrix);
            export.remaining.push(error);
        }
        let mut out = export.head("#", from);
        let parts = Self::CONVENTION.of(&readings)?;
        for entry in Self::LAYOUT {
            yaml::list(&mut out, "", entry.key, entry.values(&parts));
        }
        Ok(export.with(out))
    }
}
