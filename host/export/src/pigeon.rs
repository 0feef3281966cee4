//! Scale factors of the gyro for the Pigeon 2 of CTR Electronics: GyroScalarX, Y and Z of Phoenix 6, in degrees per rotation.
//!
//! The number is what the Pigeon reads too much in one turn: `360 (gain - 1)`, with `gain` the reading for a rate of 1. The sign is that of Phoenix 5,
//! "Degrees that Pigeon 2.0 overshot after 1 rotation (i.e. overshot 1 degree is 1; undershot by 3 degrees is -3)", which sets the same numbers under
//! the names XAxisGyroError and so on. The firmware is not public, and the simulation of Phoenix 6 ignores these numbers.
//!
//! Source: Phoenix 5, ctre/phoenix/sensors/Pigeon2.h, `ConfigXAxisGyroError`; Phoenix 6 26.3, configs `GyroTrimConfigs` (range and unit).

use mimu::quantity::Sensor;
use mimu_recording::error::{Argument, Result};

use crate::convention::{Bias, Convention, Shape, within};
use crate::degrees_per_turn::gains;
use crate::layout::{Entry, Numbers};
use crate::{Export, Page, Sources, Target, driver};

/// Largest number that Phoenix 6 takes, degrees per rotation.
const MOST_DEG: f64 = 180.0;

/// The format.
pub struct Pigeon;

impl Target for Pigeon {
    type Options = driver::Options;
    const NAME: &str = "pigeon";
    const ABOUT: &str = "Scale factors of the gyro for a Pigeon 2 of CTR Electronics: GyroScalarX, Y and Z in degrees per rotation";
    const CONTENTS: &str = "scale factors of the gyro";
    const READERS: &str = "Pigeon 2 of CTR Electronics";
    const CONVENTION: Convention = Convention::to_reading(Shape::Axes, Bias::Absent);
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Gyro, Numbers::LeftDiagonal, "GyroScalar{AXIS}").scaled(1.0, 1.0 / 360.0),
    ];
    const PAGES: &[Page] = &[Page::of("Pigeon 2", "pigeon.txt")];

    /// # Errors
    /// No gyro is calibrated, C is singular, or a number is beyond the range.
    fn export(from: &Sources, options: &driver::Options) -> Result<Export> {
        let mut export = Export::new::<Self>(from);
        export.formula("GyroScalar = 360 (gain - 1), degrees that the Pigeon reads too much in one rotation; gain: reading for a rate of 1");
        let parts = gains(from, options, Self::CONVENTION, &mut export)?;
        export.note("Record the rates of the device (getAngularVelocityXDevice and so on), with GyroTrim and MountPose at 0: the numbers belong to the axes of the Pigeon.");
        export.note("`config` is a Pigeon2Configuration; in Python the names are config.gyro_trim.gyro_scalar_x and so on. Phoenix Tuner X takes the same numbers.");
        export.note("The sign is that of CTRE's documentation. Check it by one turn: the error of the yaw has to become smaller.");
        let mut out = export.head("//", from);
        for (i, (name, degrees)) in Self::LAYOUT[0].written(&parts).iter().enumerate() {
            let degrees = degrees[0];
            let remedy = (
                "give the factor by which the readings were converted to rad/s",
                Argument::GyroConversion,
            );
            let value = (degrees, 1, " degrees per rotation");
            within(
                (Sensor::Gyro, i),
                name,
                value,
                [-MOST_DEG, MOST_DEG],
                remedy,
            )?;
            out += &format!("config.GyroTrim.{name} = {degrees:.4};\n");
        }
        Ok(export.with(out))
    }
}
