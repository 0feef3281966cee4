//! The centripetal and Euler force on an accelerometer that is not where the axes of the table meet.
//!
//! At 250 deg/s a board 4 mm beside the axis feels 76 mm/s², which the known forces do not contain. The arm belongs to the place on the table, and not to the
//! unit: no calibration stores it, and every recording determines it anew. In the fit it is a nuisance parameter of each axis with a mean of zero, whose
//! covariance is added to that of the dwell means. Then least squares is the joint estimate of parameters and arm if the rates distinguish the two, and widens
//! the intervals if they do not. What all three axes have in common of it is reported; only what differs between them is an error of the unit.

use std::sync::Arc;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::estimate::Observation;
use crate::prepared::Prepared;
use crate::quantity::Sensor;
use crate::signal::dwell::Dwell;
use crate::warning::Warning;
use mimu_recording::{NORMAL_95, Reference};

/// Standard deviation of the arm of an axis, m: as much as a large fixture has, so that the rates alone determine it.
const SIGMA_M: f64 = 0.1;

/// Specific force at an arm of one metre, `[α]× + [ω]×²`, in each block of `dwell`, by the rate of the table; zero where that is not known.
pub(crate) fn by_block(prepared: &Prepared, dwell: &Dwell) -> Vec<Matrix3<f64>> {
    let of = |rate: &Vector3<f64>, change: &Vector3<f64>| {
        change.cross_matrix() + rate.cross_matrix() * rate.cross_matrix()
    };
    let steady = dwell.input(Sensor::Gyro);
    let steady = steady.map_or_else(Matrix3::zeros, |rate| of(&rate, &Vector3::zeros()));
    let mut all = vec![steady; dwell.blocks.len().max(1)];
    let moves = dwell.moves(Sensor::Gyro);
    let course = moves.then(|| prepared.course(dwell)).flatten();
    if let Some(course) = &course
        && let Some([rate, change]) = &course.of[Sensor::Gyro as usize]
    {
        for ((at, rate), change) in course.blocks.iter().zip(rate).zip(change) {
            all[at - dwell.blocks.start] = of(rate, change);
        }
    }
    all
}

fn mean(by_block: &[Matrix3<f64>]) -> Matrix3<f64> {
    by_block.iter().sum::<Matrix3<f64>>() / by_block.len() as f64
}

/// Covariance of the mean readings over the dwells by that force, raw units squared, axis by axis, for the sensor's `forward` matrix, raw per m/s². `None` if
/// the table does not turn the unit.
pub(super) fn covariance(prepared: &Prepared, forward: &Matrix3<f64>) -> Option<[DMatrix<f64>; 3]> {
    let dwells = &prepared.dwells.list;
    if !dwells.iter().any(Dwell::spins) {
        return None;
    }
    // The reading of each axis by an arm of one standard deviation.
    let by_arm = dwells.iter().map(|d| mean(&by_block(prepared, d)));
    let by_arm: Vec<Matrix3<f64>> = by_arm.map(|by| SIGMA_M * forward * by).collect();
    Some(std::array::from_fn(|axis| {
        DMatrix::from_fn(dwells.len(), dwells.len(), |i, j| {
            by_arm[i].row(axis).dot(&by_arm[j].row(axis))
        })
    }))
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

/// The recording as an accelerometer where the axes meet would have read it, and what that removes. `inverse` is the accelerometer's model, raw to m/s²; its
/// bias may be another in this recording. `None` without a table, or if the recording has not both turns and rests of the accelerometer.
pub(crate) fn without_arm(
    prepared: &Prepared,
    inverse: &Affine<f64>,
) -> Option<(Prepared, Warning)> {
    let forward = inverse.matrix.try_inverse()?;
    let (arm, warning) = arm(prepared, inverse)?;
    let mut out = prepared.clone();
    let channels = Sensor::Accel.channels();
    let blocks = &mut Arc::make_mut(&mut out.condensed).blocks;
    for dwell in &mut out.dwells.list {
        let by_block = by_block(prepared, dwell);
        let readings = |by: &Matrix3<f64>| forward * (by * arm);
        let of_mean = readings(&mean(&by_block));
        for (i, c) in channels.clone().enumerate() {
            dwell.raw[c].mean -= of_mean[i];
            for (block, by) in blocks[dwell.blocks.clone()].iter_mut().zip(&by_block) {
                block.raw[c].mean -= readings(by)[i];
            }
        }
    }
    Some((out, warning))
}

/// The arm that all axes have in common, m, by least squares beside the biases; with enough dwells also beside errors of C, because what a wrong matrix does to
/// turning dwells would else pass for an arm. `None` if chance explains it: a few slow turns show an arm to some centimetres, and removing it would do harm.
fn arm(prepared: &Prepared, inverse: &Affine<f64>) -> Option<(Vector3<f64>, Warning)> {
    let list = &prepared.dwells.list;
    let observations = prepared.observations(Sensor::Accel);
    let turns = |o: &Observation| list[o.dwell].spins();
    let both = observations.iter().any(turns) && !observations.iter().all(turns);
    if prepared.manifest.reference != Reference::Table || !both {
        return None;
    }
    let rows = 3 * observations.len();
    let columns = if rows >= 2 * 15 { 15 } else { 6 };
    let mut design = DMatrix::zeros(rows, columns);
    let mut errors = DVector::zeros(rows);
    for (i, o) in observations.iter().enumerate() {
        let by_arm = mean(&by_block(prepared, &list[o.dwell]));
        let error = inverse.apply(&o.raw) - o.input;
        for axis in 0..3 {
            let mut row = design.row_mut(3 * i + axis);
            row.fixed_columns_mut::<3>(0).copy_from(&by_arm.row(axis));
            row[3 + axis] = 1.0;
            if columns > 6 {
                row.fixed_columns_mut::<3>(6 + 3 * axis)
                    .copy_from(&o.input.transpose());
            }
            errors[3 * i + axis] = error[axis];
        }
    }
    let covariance = (design.transpose() * &design).try_inverse()?;
    let found = &covariance * design.tr_mul(&errors);
    let dof = rows.checked_sub(columns).filter(|dof| *dof > 0)? as f64;
    let scatter = (&errors - design * &found).norm_squared() / dof;
    let arm: Vector3<f64> = found.fixed_rows::<3>(0).into_owned();
    let of_arm: Matrix3<f64> = covariance.fixed_view::<3, 3>(0, 0) * scatter;
    let square = arm.dot(&(of_arm.try_inverse()? * arm)) / 3.0;
    if FisherSnedecor::new(3.0, dof).ok()?.sf(square) > BY_CHANCE {
        return None;
    }
    let warning = Warning::BesideAxis {
        arm_mm: [0, 1, 2].map(|i| 1e3 * arm[i]),
        interval_mm: [0, 1, 2].map(|i| 1e3 * NORMAL_95 * of_arm[(i, i)].sqrt()),
    };
    Some((arm, warning))
}

/// Probability of an arm by chance from which on it is one.
const BY_CHANCE: f64 = 1e-3;
