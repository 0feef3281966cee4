//! Scale factors of the gyro for the Pigeon 2 of CTR Electronics: GyroScalarX, Y and Z of Phoenix 6, in degrees per rotation.
//!
//! The number is what the Pigeon reads too much in one turn: `360 (gain - 1)`, with `gain` the reading for a rate of 1. The sign is that of Phoenix 5,
//! "Degrees that Pigeon 2.0 overshot after 1 rotation (i.e. overshot 1 degree is 1; undershot by 3 degrees is -3)", which sets the same numbers under
//! the names XAxisGyroError and so on. The firmware is not public, and the simulation of Phoenix 6 ignores these numbers.
//!
//! Source: Phoenix 5, ctre/phoenix/sensors/Pigeon2.h, `ConfigXAxisGyroError`; Phoenix 6 26.3, configs `GyroTrimConfigs` (range and unit).

use mimu::quantity::AXES;
use mimu_recording::error::{Argument, Error, Result};

use crate::degrees_per_turn::gains;
use crate::one_temperature::LETTERS;
use crate::{Export, Sources, driver, heading};

/// Options of the lines.
pub type Options = driver::Options;

/// Largest number that Phoenix 6 takes, degrees per rotation.
const MOST_DEG: f64 = 180.0;

/// Lines for a program in Java, C++ or C#.
///
/// # Errors
/// No gyro is calibrated, C is singular, or a number is beyond the range.
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let mut export = Export::new("pigeon", from);
    export.formulas.push(
        "GyroScalar = 360 (gain - 1), degrees that the Pigeon reads too much in one rotation; gain: reading for a rate of 1".into(),
    );
    let gain = gains(calibration, place, options, &mut export)?;
    export.notes.push("Record the rates of the device (getAngularVelocityXDevice and so on), with GyroTrim and MountPose at 0: the numbers belong to the axes of the Pigeon.".into());
    export.notes.push("`config` is a Pigeon2Configuration; in Python the names are config.gyro_trim.gyro_scalar_x and so on. Phoenix Tuner X takes the same numbers.".into());
    export.notes.push("The sign is that of CTRE's documentation. Check it by one turn: the error of the yaw has to become smaller.".into());
    let mut lines = String::new();
    for (i, letter) in LETTERS.iter().enumerate() {
        let degrees = 360.0 * (gain[i] - 1.0);
        if !(degrees.abs() <= MOST_DEG) {
            return Err(Error::new(
                format!("gyro, axis {}", AXES[i]),
                format!("GyroScalar{letter} would be {degrees:.1} degrees per rotation, but its range is -180 to 180"),
                "give the factor by which the readings were converted to rad/s",
            )
            .about(Argument::GyroConversion));
        }
        lines.push_str(&format!(
            "config.GyroTrim.GyroScalar{letter} = {degrees:.4};\n"
        ));
    }
    let mut out = heading::comments("//", &heading::of_calibration(calibration, &export));
    out.push_str(&lines);
    export.content = out.into_bytes();
    Ok(export)
}
