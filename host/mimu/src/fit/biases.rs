//! A fit of the biases alone: for a unit whose matrix is known, in a recording that does not determine it.

use mimu_core::compensation::Affine;
use nalgebra::Vector3;

use super::sensor::Residual;
use super::{Fit, Options, finish, plausible, refuse_wrong_gravity, session_bias};
use crate::prepared::{Prepared, si_covariance};
use crate::quantity::Figure;
use crate::quantity::Sensor;
use mimu_recording::Reference;
use mimu_recording::error::{Error, Result};

/// Fits the biases of `prepared` to matrices that are `given`: gyro, accelerometer, raw to SI.
pub fn fit_biases(
    prepared: Prepared,
    options: Options,
    given: [Option<Affine<f64>>; 2],
) -> Result<Fit> {
    let mut warnings = prepared.condensed.warnings.clone();
    warnings.extend(prepared.dwells.warnings.iter().cloned());
    let mut sensors = Vec::new();
    for (sensor, known) in Sensor::BOTH.into_iter().zip(given) {
        let Some(known) = known.filter(|_| prepared.has(sensor)) else {
            continue;
        };
        let observations = prepared.observations(sensor);
        if observations.is_empty() {
            let unused = prepared.dwells.unused(sensor);
            warnings.push(format!("{sensor}: no dwell can be used{unused}"));
            continue;
        }
        refuse_wrong_gravity(&prepared, sensor, &observations)?;
        let estimated = session_bias::estimate(&prepared, sensor, &known)
            .map_err(|f| prepared.refused(f, sensor))?;
        let inverse = estimated.triad.inverse;
        let reference = prepared.manifest.reference;
        let by_size = reference == Reference::Gravity && sensor == Sensor::Accel;
        let floors: Vec<f64> = match by_size {
            true => prepared.size_variances(&inverse, &observations),
            false => observations
                .iter()
                .map(|o| si_covariance(&inverse.matrix, &o.variance).trace() / 3.0)
                .collect(),
        };
        let residuals = observations.iter().zip(floors).map(|(o, floor)| {
            let is = inverse.apply(&o.raw);
            let value = match (reference, sensor) {
                (Reference::Table, _) => is - o.input,
                (Reference::Gravity, Sensor::Gyro) => is,
                (Reference::Gravity, Sensor::Accel) => {
                    Vector3::new(is.norm() - prepared.manifest.gravity_mps2, 0.0, 0.0)
                }
            };
            Residual {
                dwell: o.dwell,
                within: false,
                value,
                held_out: None,
                floor: floor.sqrt(),
            }
        });
        let figure = match by_size {
            true => Figure::GravitySize,
            false => Figure::Input,
        };
        let residuals = residuals.collect();
        let n = observations.len();
        sensors.push(finish(
            sensor,
            estimated,
            figure,
            residuals,
            n,
            None,
            Vec::new(),
        ));
    }
    if sensors.is_empty() {
        return Err(Error::new(
            &prepared.place,
            "there is no triad with a known matrix and a usable dwell",
            "give the calibration of this unit, and a recording with dwells of a second and more",
        ));
    }
    for sensor in &mut sensors {
        plausible::check_numbers(sensor)?;
    }
    Ok(Fit {
        prepared,
        options,
        sensors,
        warnings,
    })
}
