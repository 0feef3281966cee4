//! The accelerometer and the bias of the gyro for DLIO: `imu/intrinsics` of its dlio.yaml.
//!
//! DLIO computes `sm reading - bias` of the accelerometer and `reading - bias` of the gyro, SI to SI, before the rotation to the base link; sm is one list by rows.
//! It has no scale factors of the gyro and no noise. With `calibration: true`, as in its file, it measures the biases at its start instead. Source:
//! vectr-ucla/direct_lidar_inertial_odometry, src/dlio/odom.cc, `callbackImu` (`imu_accel_sm_`); cfg/dlio.yaml (version 1.1.1).

use std::fmt::Write as _;

use mimu::quantity::Sensor;
use mimu_recording::error::Result;

use crate::convention::{Bias, Convention, Parts, Shape};
use crate::layout::{Entry, Numbers};
use crate::remaining::{Places, Remaining};
use crate::{Export, Page, Sources, Target, driver, layout, yaml};

/// The format.
pub struct Dlio;

impl Target for Dlio {
    type Options = driver::Options;
    const NAME: &str = "dlio";
    const ABOUT: &str = "Accelerometer and bias of the gyro for DLIO: intrinsics of dlio.yaml";
    const CONTENTS: &str = "C and o of the accelerometer, bias of the gyro";
    const READERS: &str = "DLIO";
    const CONVENTION: Convention = Convention::to_input(Shape::Whole, Bias::SubtractedFromInput);
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Accel, Numbers::Bias, "intrinsics/accel/bias"),
        Entry::of(Sensor::Accel, Numbers::Left, "intrinsics/accel/sm"),
        Entry::of(Sensor::Gyro, Numbers::Bias, "intrinsics/gyro/bias"),
    ];
    const PAGES: &[Page] = &[Page::of("DLIO", "dlio.yaml")];

    /// # Errors
    /// The calibration or a triad of it is missing, or C is singular.
    fn export(from: &Sources, options: &driver::Options) -> Result<Export> {
        let (calibration, readings) = options.both(from)?;
        let mut export = Export::new::<Self>(from);
        export.formula("accel: output = sm reading - bias, m/s^2 to m/s^2, sm by rows, in the frame of the calibration; gyro: output = reading - bias, rad/s");
        export.note(readings.accel.line());
        export.note(readings.gyro.line());
        export.note("Copy the keys into dlio.yaml, and set dlio/imu/calibration to false: with true DLIO measures both biases at its start.");
        export.temperature(calibration);
        export.leaves(calibration, Places::Matrix);
        // Whatever its matrix, the gyro is right at rest.
        let gyro = &readings.gyro.forward;
        let error = Remaining::of_readings(Sensor::Gyro, &gyro.matrix);
        export.remaining.push(error);
        let accel = Self::CONVENTION.of(&readings.accel)?;
        // Whose matrix is the identity, so that its bias is that of the readings.
        let gyro = Parts {
            bias: gyro.bias,
            ..layout::nothing()
        };
        let mut out =
            export.head("#", from) + "dlio:\n  imu:\n    calibration: false\n    intrinsics:\n";
        for entry in Self::LAYOUT {
            let key = entry.key.rsplit('/').next().unwrap_or(entry.key);
            let parts = match entry.sensor {
                Sensor::Accel => &accel,
                Sensor::Gyro => &gyro,
            };
            if entry.numbers == Numbers::Bias {
                let _ = writeln!(out, "      {}:", entry.sensor);
            }
            yaml::list(&mut out, "        ", key, entry.values(parts));
        }
        Ok(export.with(out))
    }
}
