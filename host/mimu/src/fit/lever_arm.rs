//! The centripetal force of an accelerometer that is not on the axis of the table.
//!
//! At 250 deg/s a board 4 mm beside the axis feels 76 mm/s², which the known forces do not contain. The arm is not reported: it is a nuisance
//! parameter of each axis with a mean of zero. Its covariance is added to that of the dwell means. Then least squares is the joint estimate of
//! parameters and arm if the rates distinguish the two, and widens the intervals if they do not.

use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::estimate::Observation;
use crate::quantity::Sensor;
use crate::signal::dwell::Dwell;

/// Covariance of the mean readings over `dwells` by that force, raw units squared, axis by axis, for an arm of `sigma_m` and the sensor's `forward`
/// matrix, raw per m/s².
pub(super) fn covariance(
    dwells: &[Dwell],
    forward: &Matrix3<f64>,
    sigma_m: f64,
) -> [DMatrix<f64>; 3] {
    // The reading of each axis by an arm of one metre.
    let by_arm: Vec<Matrix3<f64>> = dwells
        .iter()
        .map(|dwell| {
            let rate = dwell.input(Sensor::Gyro).unwrap_or_else(Vector3::zeros);
            forward * (rate.cross_matrix() * rate.cross_matrix())
        })
        .collect();
    std::array::from_fn(|axis| {
        DMatrix::from_fn(dwells.len(), dwells.len(), |i, j| {
            sigma_m * sigma_m * by_arm[i].row(axis).dot(&by_arm[j].row(axis))
        })
    })
}

/// `observations` with the variances of that force added, from `covariance`.
pub(super) fn widened(
    observations: &[Observation],
    covariance: &[DMatrix<f64>; 3],
) -> Vec<Observation> {
    let wider = |o: &Observation| Observation {
        variance: Vector3::from_fn(|k, _| o.variance[k] + covariance[k][(o.dwell, o.dwell)]),
        ..*o
    };
    observations.iter().map(wider).collect()
}
