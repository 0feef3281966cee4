//! The accelerometer in the codes of a flight controller of the Cleanflight family, Betaflight and INAV.
//!
//! Their drivers deliver whole codes, `acc_1G` of them for 1 g, whatever the unit's scale factor. The firmware subtracts whole codes.

use mimu::calibration::Calibration;
use mimu::quantity::Sensor;
use mimu::readable::STANDARD_GRAVITY;
use mimu_recording::RawUnit;
use mimu_recording::error::{Argument, Error, Result};
use nalgebra::Vector3;

use crate::remaining::{self, Places, Remaining};
use crate::{Export, driver, heading};

/// Biases and scale factors of the accelerometer in codes.
pub(crate) struct Codes {
    /// Reading without input, codes, not yet rounded.
    pub zero: Vector3<f64>,
    /// Reading for 1 g divided by `acc_1G`.
    pub gain: Vector3<f64>,
    /// One code, m/s².
    pub step: f64,
}

/// The accelerometer in codes. Adds notes and what no format of the family stores to `export`: cross terms, the gyro's scale factors, curves, effects.
///
/// # Errors
/// No accelerometer is calibrated, C is singular, the driver's factor is unknown, or this build cannot evaluate an effect.
pub(crate) fn codes(
    calibration: &Calibration,
    place: &str,
    acc_1g: f64,
    known: &driver::Options,
    export: &mut Export,
) -> Result<Codes> {
    let step = STANDARD_GRAVITY / acc_1g;
    let mut driver = known.clone();
    let counts = calibration.recording.raw_unit == RawUnit::Count;
    if counts && driver.accel_si_per_raw.is_none() {
        driver.accel_si_per_raw = Some(step);
        export.notes.push(format!("accel: the counts of the recording are taken for the flight controller's codes, {acc_1g} for 1 g."));
    }
    driver.needs_factor(calibration, Sensor::Accel)?;
    let accel = driver.readings(calibration, place, Sensor::Accel)?;
    export.notes.push(accel.line());
    export.notes.extend(heading::temperature(calibration));
    let places = Places {
        cross_terms: false,
        temperature: false,
        effects: false,
    };
    export.remaining = remaining::of(calibration, places)?;
    if calibration.gyro.is_some() {
        export.notes.push(
            "gyro: the firmware measures its bias at every start and has no scale factors for it."
                .into(),
        );
        let scaled =
            calibration.recording.raw_unit == RawUnit::Si || known.gyro_si_per_raw.is_some();
        export.remaining.push(match scaled {
            true => {
                let gyro = driver.readings(calibration, place, Sensor::Gyro)?;
                remaining::scale_factors(Sensor::Gyro, &gyro.forward.matrix.diagonal())
            }
            false => Remaining::unknown(
                Sensor::Gyro,
                "scale factors",
                "the firmware's factor is not given (--gyro-si-per-raw)",
            ),
        });
    }
    Ok(Codes {
        zero: accel.forward.bias / step,
        gain: accel.forward.matrix.diagonal(),
        step,
    })
}

/// `value` as a whole number within `range`.
///
/// # Errors
/// It is outside.
pub(crate) fn whole(axis: &str, name: &str, value: f64, range: [i32; 2]) -> Result<i32> {
    let rounded = value.round();
    if (f64::from(range[0])..=f64::from(range[1])).contains(&rounded) {
        return Ok(rounded as i32);
    }
    Err(Error::new(
        format!("accel, axis {axis}"),
        format!(
            "{name} would be {value:.0}, but its range is {} to {}",
            range[0], range[1]
        ),
        "check --acc-1g, and give the factor by which the readings were converted",
    )
    .about(Argument::AccelConversion))
}
