//! The scale factors of a gyro as degrees that it reads too much in a turn, for programs that store nothing else.

use mimu::quantity::Sensor;
use mimu_recording::error::Result;

use crate::convention::{Convention, Parts};
use crate::remaining::Places;
use crate::{Export, Sources, driver};

/// The numbers of the gyro, whose left factor is what it reads on each axis for a rate of 1 about it; adds to `export` what such a format leaves.
///
/// # Errors
/// No gyro is calibrated, C is singular, or the driver's factor is unknown.
pub(crate) fn gains(
    from: &Sources,
    driver: &driver::Options,
    convention: Convention,
    export: &mut Export,
) -> Result<Parts> {
    let (calibration, place) = from.calibration()?;
    driver.needs_factor(calibration, Sensor::Gyro)?;
    let readings = driver.readings(calibration, place, Sensor::Gyro)?;
    export.note(readings.line());
    export.temperature(calibration);
    if calibration.accel.is_some() {
        export.note("The accelerometer has no place in this format: the program keeps its own calibration of it.");
    }
    export.leaves(calibration, Places::Axes);
    export.remaining.retain(|r| r.sensor == Sensor::Gyro);
    convention.of(&readings)
}
