//! The accelerometer and the compass in the codes of a flight controller of the Cleanflight family, Betaflight and INAV.
//!
//! Their drivers deliver whole codes, `acc_1G` of them for 1 g, whatever the unit's scale factor. The firmware subtracts whole codes.

use std::fmt::Display;

use mimu::{AXES, STANDARD_GRAVITY, Sensor};
use mimu_recording::{Argument, RawUnit, Result, TriadName};
use nalgebra::Vector3;

use crate::convention::{Convention, within};
use crate::remaining::{self, Places, Remaining};
use crate::{Export, Sources, body, driver};

/// Biases and scale factors of the accelerometer in codes.
pub(crate) struct Codes {
    /// Bias in the convention of the firmware, codes, not yet rounded.
    pub zero: Vector3<f64>,
    /// Reading for 1 g divided by `acc_1G`.
    pub gain: Vector3<f64>,
    /// One code, m/s².
    step: f64,
}

impl Codes {
    /// The error of whole codes.
    pub fn rounding(&self) -> Remaining {
        Remaining::of_rounding(Sensor::Accel, self.step)
    }
}

/// The accelerometer in codes. Adds notes and what no format of the family stores to `export`: cross terms, the gyro's scale factors, curves, effects.
///
/// # Errors
/// No accelerometer is calibrated, C is singular, or the driver's factor is unknown.
pub(crate) fn codes(
    from: &Sources,
    acc_1g: f64,
    known: &driver::Options,
    convention: Convention,
    export: &mut Export,
) -> Result<Codes> {
    let (calibration, place) = from.calibration()?;
    let step = STANDARD_GRAVITY / acc_1g;
    let mut driver = known.clone();
    let raw_unit = calibration.recording.raw_unit;
    if raw_unit == RawUnit::Count && driver.accel_si_per_raw.is_none() {
        driver.accel_si_per_raw = Some(step);
        export.note(format!("accel: the counts of the recording are taken for the flight controller's codes, {acc_1g} for 1 g."));
    }
    driver.needs_factor(calibration, Sensor::Accel)?;
    let accel = driver.readings(calibration, place, Sensor::Accel)?;
    export.note(accel.line());
    export.temperature(calibration);
    export.leaves(calibration, Places::Axes);
    if calibration.gyro.is_some() {
        export.note(
            "gyro: the firmware measures its bias at every start and has no scale factors for it.",
        );
        let error = if raw_unit == RawUnit::Si || known.gyro_si_per_raw.is_some() {
            let gyro = driver.readings(calibration, place, Sensor::Gyro)?;
            remaining::scale_factors(Sensor::Gyro, &gyro.forward.matrix.diagonal())
        } else {
            let why = "the firmware's factor is not given (--gyro-si-per-raw)";
            Remaining::unknown(Sensor::Gyro, "scale factors", why)
        };
        export.remaining.push(error);
    }
    Ok(Codes {
        zero: convention.of(&accel)?.bias / step,
        gain: accel.forward.matrix.diagonal(),
        step,
    })
}

/// The compass of these firmwares.
pub(crate) const MAG: TriadName = TriadName::MAG;
/// Range of a bias in codes.
pub(crate) const CODES: [i32; 2] = [-32768, 32767];
/// One code of nearly every accelerometer, m/s², for files that do not say it: 2048 for 1 g.
pub(crate) const CODE: f64 = STANDARD_GRAVITY / 2048.0;

/// The magnetometer in codes: its bias in the convention of the firmware, and the codes for the calibration's unit of the field, on the sensor's own axes.
/// `None`, with a note, if there is none or its readings are not in codes.
///
/// # Errors
/// C is singular.
pub(crate) fn compass(
    from: &Sources,
    convention: Convention,
    export: &mut Export,
) -> Result<Option<[Vector3<f64>; 2]>> {
    let (calibration, place) = from.calibration()?;
    let Some(mag) = body::only_mag(calibration, export) else {
        return Ok(None);
    };
    if mag.raw_unit != RawUnit::Count {
        export.note(format!(
            "{MAG}: its readings are in {}, not in codes of the firmware, so nothing is written for it.",
            body::raw_unit(mag)
        ));
        return Ok(None);
    }
    let readings = body::readings(mag, true, Some(1.0), place)?;
    let bias = convention.of(&readings)?.bias;
    Ok(Some([bias, readings.forward.matrix.diagonal().abs()]))
}

/// `values` as whole numbers within `range`; `name` is that of an axis in the firmware.
///
/// # Errors
/// One is outside.
pub(crate) fn whole(
    triad: impl Display + Copy,
    name: &dyn Fn(&str) -> String,
    values: &Vector3<f64>,
    range: [i32; 2],
) -> Result<[i32; 3]> {
    let remedy = match triad.to_string() == MAG.to_string() {
        true => (
            "record the codes of the firmware, and fit again",
            Argument::RawUnit,
        ),
        false => (
            "check --acc-1g, and give the factor by which the readings were converted",
            Argument::AccelConversion,
        ),
    };
    for (i, axis) in AXES.iter().enumerate() {
        let value = (values[i].round(), 0, "");
        within((triad, i), &name(axis), value, range.map(f64::from), remedy)?;
    }
    Ok([0, 1, 2].map(|i| values[i].round() as i32))
}
