//! A fit of the biases alone: for a unit whose matrix is known, in a recording that does not determine it.

use mimu_core::compensation::Affine;
use nalgebra::Vector3;

use super::hold_out::HoldOut;
use super::judged::Judged;
use super::sensor::{Residual, SensorFit};
use super::{Fit, Options, earth, finish, plausible, refuse_wrong_gravity, session_bias};
use crate::estimate::{Estimated, Observation};
use crate::prepared::{Prepared, si_covariance};
use crate::quantity::Figure;
use crate::quantity::Sensor;
use crate::triad::{Covariance, Part, Triad};
use crate::warning::Warning;
use mimu_recording::{Error, Reference, Result};

/// The uncertainty that a given C, with this covariance by rows, causes in a model whose biases were fitted beside it. At the mean reading the fitted
/// bias cancels the error of the matrix.
fn with_biases(covariance: &Covariance, mean: &Vector3<f64>) -> Part {
    let mut by = Covariance::zeros();
    for i in 0..9 {
        by[(i, i)] = 1.0;
        by[(9 + i / 3, i)] = -mean[i % 3];
    }
    Part::known(by * covariance * by.transpose())
}

/// Fits the biases of `prepared` to matrices that are `given`: gyro, accelerometer, raw to SI. `covariances` are those of C by rows, then o, if they
/// are known.
pub fn fit_biases(
    prepared: Prepared,
    options: Options,
    given: [Option<Affine<f64>>; 2],
    covariances: &[Option<Covariance>; 2],
) -> Result<Fit> {
    let mut warnings = prepared.condensed.warnings.clone();
    warnings.extend(prepared.dwells.warnings.iter().cloned());
    let mut sensors = Vec::new();
    let given_accel = given[Sensor::Accel as usize].filter(|_| prepared.has(Sensor::Accel));
    let given = Sensor::BOTH.into_iter().zip(given).zip(covariances);
    for ((sensor, known), covariance) in given {
        let Some(known) = known.filter(|_| prepared.has(sensor)) else {
            continue;
        };
        let observations = match sensor {
            Sensor::Gyro if prepared.manifest.reference != Reference::Table => {
                prepared.at_rest_on_the_ground(given_accel.as_ref())
            }
            _ => prepared.observations(sensor),
        };
        if observations.is_empty() {
            let unused = prepared.dwells.unused(sensor);
            warnings.push(Warning::NoDwell { why: unused }.of(sensor));
            continue;
        }
        refuse_wrong_gravity(&prepared, sensor, &observations)?;
        let accel = given_accel.as_ref();
        let mut estimated = session_bias::estimate(&prepared, sensor, &known, accel)
            .map_err(|f| prepared.refused(f, sensor))?;
        if let Some(covariance) = covariance {
            let raw: Vector3<f64> = observations.iter().map(|o| o.raw).sum();
            let mut parts = estimated.triad.inverse_parts();
            parts.push(with_biases(covariance, &(raw / observations.len() as f64)));
            if let Some(triad) = Triad::from_inverse(estimated.triad.inverse, parts) {
                estimated.triad = triad;
            }
            estimated.notes = vec![Warning::MatrixGiven {
                with_intervals: true,
            }];
        }
        sensors.push(judged(&prepared, sensor, estimated, &observations));
    }
    let without_inputs = prepared.manifest.reference == Reference::Table
        && prepared.condensed.has_reference == [false; 6];
    if sensors.is_empty() && without_inputs {
        return Err(Error::new(
            &prepared.place,
            "reference is \"table\", and no dwell has a known input",
            "give the inputs of dwells of a second or more in the ref_ columns, or set reference = \"gravity\" if there was no table",
        ));
    }
    if sensors.is_empty() {
        return Err(Error::new(
            &prepared.place,
            "no triad has both a known matrix and a usable dwell",
            "give the calibration of this unit, and a recording with dwells of a second or more",
        ));
    }
    for sensor in &mut sensors {
        plausible::check_numbers(sensor)?;
        sensor
            .warnings
            .extend(earth::in_intervals(&prepared, sensor));
    }
    Ok(Fit {
        prepared,
        options,
        sensors,
        changes: Vec::new(),
        warnings,
    })
}

/// The fit with the error of each dwell, in sample: with the matrix given nothing is held out.
fn judged(
    prepared: &Prepared,
    sensor: Sensor,
    estimated: Estimated,
    observations: &[Observation],
) -> SensorFit {
    let inverse = estimated.triad.inverse;
    let reference = prepared.manifest.reference;
    let by_size = reference == Reference::Gravity && sensor == Sensor::Accel;
    let floors: Vec<f64> = match by_size {
        true => prepared.magnitude_variances(&inverse, observations),
        false => observations
            .iter()
            .map(|o| si_covariance(&inverse.matrix, &o.variance).trace() / 3.0)
            .collect(),
    };
    let residuals = observations.iter().zip(floors).map(|(o, floor)| {
        let is = inverse.apply(&o.raw);
        let value = match (reference, sensor) {
            (Reference::Table, _) | (_, Sensor::Gyro) => estimated.error(o, 1.0),
            (_, Sensor::Accel) => {
                Vector3::new(is.norm() - prepared.manifest.gravity_mps2, 0.0, 0.0)
            }
        };
        Residual {
            dwell: o.dwell,
            within: false,
            value,
            held_out: None,
            floor: prepared.if_noise_known(&[sensor], floor.sqrt()),
        }
    });
    let residuals = residuals.collect();
    let figure = match by_size {
        true => Figure::GravityMagnitude,
        false => Figure::Input,
    };
    let judged = Judged {
        figure,
        residuals,
        dwells: observations.len(),
        static_rms: None,
        held_out: HoldOut::none(),
        unseen: Vec::new(),
        uncalibrated_rms: None,
    };
    finish(sensor, estimated, judged)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_the_mean_reading_an_error_of_a_given_matrix_is_one_of_the_bias_and_does_nothing() {
        let given = Covariance::from_fn(|i, j| if i == j { 1.0 } else { 0.3 });
        let mean = Vector3::new(2.5, -1.0, 0.5);
        let part = with_biases(&given, &mean);
        let variance = |raw: Vector3<f64>| {
            let mut by = nalgebra::SVector::<f64, 12>::zeros();
            for k in 0..3 {
                by[3 + k] = raw[k];
            }
            by[10] = 1.0;
            (by.transpose() * part.covariance * by)[0]
        };
        assert!(variance(mean).abs() < 1e-12);
        // One unit away along an axis the variance is that of one element.
        assert!((variance(mean + Vector3::x()) - 1.0).abs() < 1e-12);
    }
}
