//! The centripetal and Euler force on an accelerometer that is not where the axes of the table meet.
//!
//! At 250 deg/s a board 4 mm beside the axis feels 76 mm/s², which the known forces do not contain. The arm belongs to the place on the table, and not to the
//! unit: no calibration stores it, and every recording determines it anew. In the fit it is a nuisance parameter of each axis with a mean of zero, whose
//! covariance is added to that of the dwell means. Then least squares is the joint estimate of parameters and arm if the rates distinguish the two, and widens
//! the intervals if they do not. What all three axes have in common of it is reported; only what differs between them is an error of the unit.

use std::sync::Arc;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};

use crate::estimate::Observation;
use crate::prepared::Prepared;
use crate::quantity::Sensor;
use crate::signal::dwell::Dwell;
use crate::triad::NORMAL_95;
use crate::warning::Warning;
use mimu_recording::Reference;

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

/// The arm that all axes have in common, m, by least squares beside the errors of C and o: what a wrong matrix does to turning dwells would else pass for an arm.
fn arm(prepared: &Prepared, inverse: &Affine<f64>) -> Option<(Vector3<f64>, Warning)> {
    let list = &prepared.dwells.list;
    let observations = prepared.observations(Sensor::Accel);
    let turns = |o: &Observation| list[o.dwell].spins();
    let both = observations.iter().any(turns) && !observations.iter().all(turns);
    if prepared.manifest.reference != Reference::Table || !both {
        return None;
    }
    let mut normal = SMatrix::<f64, 15, 15>::zeros();
    let mut right = SVector::<f64, 15>::zeros();
    let mut squares = 0.0;
    for o in &observations {
        let mut by = SMatrix::<f64, 3, 15>::zeros();
        by.fixed_columns_mut::<3>(0)
            .copy_from(&mean(&by_block(prepared, &list[o.dwell])));
        by.fixed_columns_mut::<3>(3).fill_with_identity();
        for row in 0..3 {
            let force = &o.input.transpose();
            by.fixed_view_mut::<1, 3>(row, 6 + 3 * row).copy_from(force);
        }
        let error = inverse.apply(&o.raw) - o.input;
        normal += by.transpose() * by;
        right += by.transpose() * error;
        squares += error.norm_squared();
    }
    // What the forces do not show of C is as it was.
    for k in 6..15 {
        normal[(k, k)] += (TYPICAL_MPS2 / OF_MATRIX).powi(2);
    }
    let covariance = normal.try_inverse()?;
    let found = covariance * right;
    let residuals = (3 * observations.len()).saturating_sub(15).max(1);
    let scatter = (squares - found.dot(&right)).max(0.0) / residuals as f64;
    let mm = |m: f64| 1e3 * m;
    let half = |i: usize| NORMAL_95 * (covariance[(i, i)] * scatter).sqrt();
    let warning = Warning::BesideAxis {
        arm_mm: [0, 1, 2].map(|i| mm(found[i])),
        interval_mm: [0, 1, 2].map(|i| mm(half(i))),
    };
    Some((found.fixed_rows::<3>(0).into_owned(), warning))
}

/// Error of a dwell on a table, m/s².
const TYPICAL_MPS2: f64 = 3e-3;
/// Change of an element of C from recording to recording, relative to its size: as much as between units.
const OF_MATRIX: f64 = 0.02;
