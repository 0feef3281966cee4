//! Biases of the accelerometer and of the compass for Betaflight, as lines of its CLI.
//!
//! Betaflight rotates the codes of the accelerometer to the axes of the craft (x forward, y left, z up) and subtracts three whole codes:
//! `acc_calibration = x,y,z,1`; the last number says that there is a calibration. It has no scale factors, and measures the gyro's bias at every start.
//! Source: betaflight/betaflight, src/main/sensors/acceleration.c, `accUpdate`, `applyAccelerationTrims`; acceleration_init.c,
//! `performAccelerometerCalibration`; sensors/boardalignment.c; cli/settings.c, `acc_calibration` (2026-08).
//!
//! Of the compass it subtracts `mag_calibration = x,y,z` in codes, after the alignment too. Source: src/main/sensors/compass.c, `compassUpdate`;
//! cli/settings.c, `mag_calibration`.

use clap::Args;
use mimu::quantity::Sensor;
use mimu_recording::error::Result;

use crate::convention::{Bias, Convention, Shape};
use crate::craft_axes::CraftAxes;
use crate::driver::{self, positive};
use crate::flight_codes::{CODE, CODES, MAG, codes, compass, whole};
use crate::layout::{Entry, Numbers};
use crate::remaining;
use crate::{Export, Page, Sources, Target};

/// Options of the lines.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Codes of the accelerometer for 1 g: 2048 with nearly every sensor, 4096 with a BMI160, 1024 with one of 32 g
    #[arg(long = "acc-1g", value_name = "CODES", default_value_t = 2048.0, value_parser = positive)]
    pub acc_1g: f64,
    /// The driver's conversion.
    #[command(flatten)]
    pub driver: driver::Options,
}

/// The format.
pub struct Betaflight;

impl Target for Betaflight {
    type Options = Options;
    const NAME: &str = "betaflight";
    const ABOUT: &str =
        "Biases of the accelerometer and the compass for Betaflight: lines of its CLI";
    const CONTENTS: &str = "biases of the accelerometer and of the compass";
    const READERS: &str = "Betaflight";
    const CONVENTION: Convention =
        Convention::to_input(Shape::Absent, Bias::SubtractedFromReadings);
    const AXES: Option<CraftAxes> = Some(CraftAxes::ForwardLeftUp);
    const FURTHER_TRIADS: bool = true;
    const LAYOUT: &[Entry] =
        &[Entry::of(Sensor::Accel, Numbers::Bias, "acc_calibration").scaled(0.0, CODE)];
    const NOT_READ: &[&str] = &["mag_calibration"];
    const PAGES: &[Page] = &[Page::of("Betaflight", "betaflight.txt")];

    /// # Errors
    /// No accelerometer is calibrated, C is singular, or a bias does not fit into 16 bits.
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let mut export = Export::new::<Self>(from);
        export.formula(format!(
            "accel: output = code - acc_calibration on each axis of the craft (x forward, y left, z up), {} codes for 1 g",
            options.acc_1g
        ));
        let accel = codes(
            from,
            options.acc_1g,
            &options.driver,
            Self::CONVENTION,
            &mut export,
        )?;
        export.note("Axes have to be those of the craft, after the alignment of sensor and board, as in accSmooth of a log. Record with acc_calibration = 0,0,0,1.");
        export.note("Paste the lines into the CLI. The trims for level flight (acc_trim_roll, acc_trim_pitch) are left as they are.");
        let scale = remaining::scale_factors(Sensor::Accel, &accel.gain);
        export.remaining.push(scale);
        export.remaining.push(accel.rounding());
        let [x, y, z] = whole(
            Sensor::Accel,
            &|_| "acc_calibration".into(),
            &accel.zero,
            CODES,
        )?;
        let mut lines = format!("set acc_calibration = {x},{y},{z},1\n");
        if let Some([zero, gain]) = compass(from, Self::CONVENTION, &mut export)? {
            let [x, y, z] = whole(MAG, &|_| "mag_calibration".into(), &zero, CODES)?;
            lines += &format!("set mag_calibration = {x},{y},{z}\n");
            let (mean, most) = (gain.mean(), gain.max() - gain.min());
            export.formula("mag: output = code - mag_calibration on each axis of the craft, after the alignment of sensor and board");
            export.note(format!("mag: scale factors and cross terms have no place: the axes differ by up to {:.1} %. Record with mag_calibration = 0,0,0.", 100.0 * most / mean));
        }
        let head = export.head("#", from);
        Ok(export.with(format!("{head}{lines}save\n")))
    }
}
