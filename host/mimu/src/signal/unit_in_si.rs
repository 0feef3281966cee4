//! Whether readings that are declared as SI are in SI: their magnitudes at rest, and rates at rest that differ.

use mimu_recording::health::{Finding, accel_at_rest, gyro_at_rest};
use mimu_recording::{Manifest, RawUnit, Reference};

use crate::quantity::Sensor;
use crate::signal::blocks::quantile;
use crate::signal::dwell::Dwell;
use crate::warning::Warning;

/// Findings about readings at rest that should be in SI. With known inputs the fit judges instead.
pub(crate) fn at_rest(list: &[Dwell], manifest: &Manifest) -> Vec<Finding> {
    // On a turntable most dwells are not rests of the gyro, and a fit judges its readings by the rates.
    if manifest.reference != Reference::Gravity {
        return Vec::new();
    }
    let usual = |sensor: Sensor| {
        let usable = list.iter().filter(|d| d.faults[sensor].is_none());
        let sizes = usable.map(|d| d.raw_mean(sensor).norm());
        let mut sizes: Vec<f64> = sizes.filter(|size| *size > 0.0).collect();
        quantile(&mut sizes, 0.5)
    };
    of_sizes(Sensor::BOTH.map(usual), manifest)
}

/// Findings about readings that should be in SI, from their magnitudes at rest (gyro, accelerometer).
pub(crate) fn of_sizes([rate, force]: [Option<f64>; 2], manifest: &Manifest) -> Vec<Finding> {
    if manifest.raw_unit != RawUnit::Si {
        return Vec::new();
    }
    let force = force.and_then(|size| accel_at_rest(size, manifest.gravity_mps2));
    force
        .into_iter()
        .chain(rate.and_then(gyro_at_rest))
        .collect()
}

/// A larger scatter of the calibrated rate at rest, rad/s, exceeds that of any bias and g-sensitivity: 2 deg/s.
const RESTLESS: f64 = 0.035;

/// The warning about calibrated rates at rest that scatter by `rms`. A fit by turns knows the scale factor, also of readings in counts. It
/// cannot judge the size of a bias, because a converter's null may be anywhere, but a bias is nearly the same in all dwells.
pub(crate) fn restless(rms: f64) -> Option<Warning> {
    (rms > RESTLESS).then(|| Warning::Restless { rms }.of(Sensor::Gyro))
}
