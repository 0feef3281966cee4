//! By hand, six faces and nothing between them: scale factors and biases of the accelerometer.
//!
//! The magnitude of gravity on a face does not depend on the angles between the axes, to first order. They are therefore taken from data sheets, as a prior, whose width is in
//! all intervals. Scale factors and biases have a prior so wide that the faces alone determine them.

use std::sync::Arc;

use mimu_core::compensation::Affine;
use mimu_recording::Reference;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::determined::faces_not_up;
use super::{Fit, Options, SensorFit, fit_as_prepared, fit_biases};
use crate::prepared::Prepared;
use crate::prior::{Prior, PriorTable};
use crate::quantity::{PerSensor, Sensor};
use crate::signal::blocks::extent;
use crate::triad::Covariance;
use crate::warning::Warning;

/// Standard deviation of the angle between two axes, rad: data sheets of consumer parts have a cross-axis sensitivity of 2 % at most, and the angle is the sum of
/// two of them, each anywhere within that limit: 0.02 times the root of 2/3. With 0.01 the intervals of scale factors and biases held 56 of 72.
const ANGLE: f64 = 0.0163;
/// Standard deviations of scale factors, of themselves, and of biases, of gravity: they leave both to the faces.
const OPEN: f64 = 0.5;
/// Numbers of scale factors, non-orthogonalities and biases among the physical parameters. The accelerometer's own axes are the body's.
const FREE: [usize; 9] = [0, 1, 2, 6, 7, 8, 9, 10, 11];
/// A prior of so many units is a known one.
const KNOWN: usize = 1_000_000;

/// The fit with these angles, if `prepared` has all six faces by hand. `None` if it does not, or if they too determine nothing.
pub(super) fn fit(prepared: Prepared, options: Options) -> Option<Fit> {
    let by_hand = prepared.manifest.reference == Reference::Gravity;
    if !by_hand || prepared.whole_turns().is_some() || !options.wants(Sensor::Accel) {
        return None;
    }
    let gravity = prepared.manifest.gravity_mps2;
    let raw = prepared.observations(Sensor::Accel);
    let raw: Vec<Vector3<f64>> = raw.into_iter().map(|o| o.raw).collect();
    let ends = [0, 1, 2].map(|axis| extent(raw.iter().map(|u| u[axis])));
    let scale = ends.map(|[low, high]| 0.5 * (high - low) / gravity);
    let bias = ends.map(|[low, high]| 0.5 * (high + low));
    let matrix = Matrix3::from_diagonal(&Vector3::from(scale.map(f64::recip)));
    let guess = Affine {
        matrix,
        offset: -matrix * Vector3::from(bias),
    };
    if scale.iter().any(|s| !(*s > 0.0)) || faces_not_up(&guess, &raw).is_some() {
        return None;
    }
    let (mean, sigma): (Vec<f64>, Vec<f64>) = FREE
        .iter()
        .map(|k| match (k / 3, k % 3) {
            (0, axis) => (scale[axis], OPEN * scale[axis]),
            (3, axis) => (bias[axis], OPEN * scale[axis] * gravity),
            _ => (0.0, ANGLE),
        })
        .unzip();
    let variances = DVector::from_vec(sigma).map(|s| s * s);
    let raw_unit = prepared.manifest.raw_unit;
    let covariance = DMatrix::from_diagonal(&variances);
    let accel = PriorTable::new(Sensor::Accel, raw_unit, KNOWN, &FREE, &mean, &covariance);
    let tables = PerSensor {
        gyro: None,
        accel: Some(accel),
    };
    let prior = Prior::new("data sheets".into(), raw_unit, Reference::Gravity, tables);
    let with = prepared.clone().with_prior(Arc::new(prior)).ok()?;
    let only = Options {
        only: Some(Sensor::Accel),
        ..options
    };
    // The turns between the faces depend on the angles: a gyro fitted to them would err by what these are off.
    let mut found = fit_as_prepared(with, only).ok()?;
    let axes = Warning::AxesOfDataSheet { sigma: ANGLE };
    found.warnings.push(axes.of(Sensor::Accel));
    if options.wants(Sensor::Gyro) && prepared.has(Sensor::Gyro) {
        match gyro_biases(prepared, options) {
            Some(gyro) => found.sensors.insert(0, gyro),
            None => found.warnings.push(Warning::FewTurns.of(Sensor::Gyro)),
        }
    }
    Some(found)
}

/// The biases of a gyro whose unit is known: five turns between faces are too few for more.
fn gyro_biases(prepared: Prepared, options: Options) -> Option<SensorFit> {
    if !prepared.is_in_si() {
        return None;
    }
    let options = Options {
        only: Some(Sensor::Gyro),
        ..options
    };
    let sigma = Covariance::from_fn(|i, j| match i == j && i < 9 {
        true => ANGLE * ANGLE,
        false => 0.0,
    });
    let given = [Some(Affine::identity()), None];
    let found = fit_biases(prepared, options, given, &[Some(sigma), None]);
    found.ok()?.sensors.pop()
}
