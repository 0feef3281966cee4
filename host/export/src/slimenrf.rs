//! Scale factors of the gyro for SlimeVR trackers with the SlimeNRF firmware: the line `sens x,y,z` of the tracker's console.
//!
//! The firmware multiplies the rate of each axis, after its own bias, by `1 / (1 - degrees / (360 revolutions))`. A gyro that reads `gain` times the
//! rate therefore gets `degrees = 360 revolutions (1 - gain)`: a gyro that reads too much gets a negative number. `revolutions` is the firmware's
//! SENSOR_SENS_REV, 2 unless it was built otherwise.
//!
//! Source: jitingcn/SlimeVR-Tracker-nRF, src/console.c, `command_sens`; src/sensor/sensor.c; Kconfig, SENSOR_SENS_REV (2025-11).

use clap::Args;
use mimu::quantity::{AXES, Sensor};
use mimu_recording::error::{Argument, Error, Result};

use crate::convention::{Bias, Convention, Shape};
use crate::degrees_per_turn::gains;
use crate::layout::{Entry, Numbers};
use crate::{Export, Page, Sources, Target, driver};

/// Options of the line.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Turns that the firmware counts on: its SENSOR_SENS_REV, which `info` on its console shows as "degrees diff over N rev"
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..))]
    pub revolutions: u16,
    /// The driver's conversion.
    #[command(flatten)]
    pub driver: driver::Options,
}

/// Scale factors beyond this belong to another unit or range: the firmware's own calibration refuses them too (`SENS_CAL_MIN_SCALE`).
const MOST: f64 = 0.1;

/// The format.
pub struct SlimeNrf;

impl Target for SlimeNrf {
    type Options = Options;
    const NAME: &str = "slimenrf";
    const ABOUT: &str = "Scale factors of the gyro for a SlimeVR tracker with SlimeNRF: the line `sens x,y,z` of its console";
    const CONTENTS: &str = "scale factors of the gyro";
    const READERS: &str = "SlimeVR trackers with SlimeNRF";
    const CONVENTION: Convention = Convention::to_reading(Shape::Axes, Bias::Absent);
    const LAYOUT: &[Entry] =
        &[Entry::of(Sensor::Gyro, Numbers::LeftDiagonal, "sens").scaled(1.0, -1.0 / 720.0)];
    const PAGES: &[Page] = &[Page::of("SlimeVR tracker (SlimeNRF)", "sens.txt")];

    /// # Errors
    /// No gyro is calibrated, C is singular, or a scale factor differs from 1 by more than a tenth.
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let turns = f64::from(options.revolutions);
        let mut export = Export::new::<Self>(from);
        export.formula(format!(
            "rate = reading / (1 - degrees / (360 * {turns})) on each axis of the sensor, after the tracker's own bias"
        ));
        let parts = gains(from, &options.driver, Self::CONVENTION, &mut export)?;
        let gain = parts.left.diagonal();
        for (axis, gain) in AXES.iter().zip(gain.iter()) {
            if !((gain - 1.0).abs() <= MOST) {
                return Err(Error::new(
                    format!("gyro, axis {axis}"),
                    format!("its readings are {gain:.4} times the rate, and a tracker corrects at most {:.0} %", 100.0 * MOST),
                    "give the factor by which the firmware converts",
                )
                .about(Argument::GyroConversion));
            }
        }
        export.note("Axes are those of the sensor, as in the tracker's raw data. The tracker measures the bias itself (ZRO or T-Cal).");
        export.note("Send the line `sens ...` to the tracker's console, and `sens reset` to undo it. Record with `sens reset` in force.");
        let [x, y, z] = [0, 1, 2].map(|i| 360.0 * turns * (1.0 - gain[i]));
        let head = export.head("#", from);
        Ok(export.with(format!("{head}sens {x:.4},{y:.4},{z:.4}\n")))
    }
}
