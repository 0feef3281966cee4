//! The scale factors of a gyro as degrees that it reads too much in a turn, for programs that store nothing else.

use mimu::calibration::Calibration;
use mimu::quantity::Sensor;
use mimu_recording::error::Result;
use nalgebra::Vector3;

use crate::driver;
use crate::remaining::{self, Places};
use crate::{Export, heading};

/// What the gyro reads on each axis for a rate of 1 about it, the diagonal of P of the driver's readings; adds to `export` what such a format leaves.
///
/// # Errors
/// No gyro is calibrated, C is singular, the driver's factor is unknown, or this build cannot evaluate an effect.
pub(crate) fn gains(
    calibration: &Calibration,
    place: &str,
    driver: &driver::Options,
    export: &mut Export,
) -> Result<Vector3<f64>> {
    driver.needs_factor(calibration, Sensor::Gyro)?;
    let readings = driver.readings(calibration, place, Sensor::Gyro)?;
    let places = Places {
        cross_terms: false,
        temperature: false,
        effects: false,
    };
    export.notes.push(readings.line());
    export.notes.extend(heading::temperature(calibration));
    if calibration.accel.is_some() {
        export.notes.push("The accelerometer has no place in this format: the program keeps its own calibration of it.".into());
    }
    export.remaining = remaining::of(calibration, places)?;
    export.remaining.retain(|r| r.sensor == Sensor::Gyro);
    Ok(readings.forward.matrix.diagonal())
}
