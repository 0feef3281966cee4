//! Gyro calibration without a table: from the turns between dwells, and from the dwells themselves.
//!
//! Gravity is the reference. The integrated gyro rotates the direction of gravity of one dwell into the frame of the next, where it must agree with
//! the measured direction (references 19 of xu and 12 of fang); at rest the rate is zero. Both are fitted together, because the turns and the
//! readings at rest may need different biases if the model lacks something. The frame is that of the accelerometer, so the full 3x3 matrix contains
//! the alignment of gyro to accelerometer.

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

use super::chains::Chains;
use super::least_squares::{Linearized, Observability, Reweighted};
use super::{Estimated, Failure};
use crate::observable::Observable;
use crate::observation::turn::{Motion, Rest, Rotations, Turn, TurnError};
use crate::observation::{ByTriad, from_centre, vector};
use crate::quantity::AXES;
use crate::triad::{Covariance, Part, Triad};

/// Number of parameters: nine of C, three of o.
pub const PARAMETERS: usize = 12;

/// First guess of C, to within some ten per cent. A direction fixed in the world moves by `f × ω` in the body, so `df = [f]× C (u - u0) dt` is linear
/// in C. It works for any mounting of the gyro and any scale.
///
/// If hands shake, the accelerometer shows more than gravity: a pair has the less weight, the more its magnitude is off.
fn guess(motions: &[Motion], rest: &Vector3<f64>, gravity: f64) -> Option<Matrix3<f64>> {
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    let mut right = SVector::<f64, 9>::zeros();
    for m in motions {
        let off = (m.force.norm() - gravity) / (0.1 * gravity);
        let weight = 1.0 / (1.0 + off * off);
        let turned = (m.raw - rest) * m.duration_s;
        let across = m.force.cross_matrix();
        let mut rows = SMatrix::<f64, 3, 9>::zeros();
        for i in 0..3 {
            for j in 0..3 {
                for r in 0..3 {
                    rows[(r, 3 * i + j)] = across[(r, i)] * turned[j];
                }
            }
        }
        normal += rows.transpose() * rows * weight;
        right += rows.transpose() * m.change * weight;
    }
    // Columns of unit size, so that volts and counts are judged alike.
    let scale = normal.diagonal().map(|d| d.sqrt().max(f64::MIN_POSITIVE));
    let scaled = SMatrix::<f64, 9, 9>::from_fn(|i, j| normal[(i, j)] / (scale[i] * scale[j]));
    let solution = scaled
        .cholesky()?
        .solve(&right.component_div(&scale))
        .component_div(&scale);
    let c = Matrix3::from_fn(|i, j| solution[3 * i + j]);
    c.iter().all(|x| x.is_finite()).then_some(c)
}

/// Fits `ω = C u + o` to the turns and to the dwells (`rest`) together.
///
/// The directions of gravity come from `accel`. Its errors are common to all turns, so its covariance is propagated into that of the gyro. (Without
/// this, the intervals of a quiet gyro beside a noisy accelerometer contained the truth in 75 to 81 % of the cases.) `motions` give the first guess
/// unless `start` does; `gravity` in m/s².
pub fn estimate(
    turns: &[Turn],
    rest: &[Rest],
    accel: &Triad,
    motions: &[Motion],
    start: Option<&Affine<f64>>,
    gravity: f64,
) -> Result<Estimated, Failure> {
    if rest.is_empty() || 2 * turns.len() + 3 < PARAMETERS {
        return Err(Failure::Undetermined {
            parameters: "C of the gyro".into(),
            add: format!(
                "{} turns between dwells can be used; at least 5 about different axes are needed: turn the unit about each axis, and hold it still in between",
                turns.len()
            )
            .into(),
        });
    }
    let at_rest = rest.iter().map(|o| o.raw).sum::<Vector3<f64>>() / rest.len() as f64;
    let first = match start {
        Some(start) => start.matrix,
        None => guess(motions, &at_rest, gravity).ok_or_else(|| {
            Failure::NoSolution(
                "no scale factor of the gyro makes its turns agree with those of gravity".into(),
            )
        })?,
    };
    // Parameters of order one: C in units of its own size, o about the reading at rest.
    let unit = first.norm() / 3f64.sqrt();
    let rotations = Rotations::new(turns, &at_rest);
    let unpack = |p: &DVector<f64>| Affine {
        matrix: Matrix3::from_fn(|i, j| unit * p[3 * i + j]),
        offset: Vector3::new(p[9], p[10], p[11]),
    };
    let scale = ByTriad::from_fn(|k, _| if k < 9 { unit } else { 1.0 });
    let chains = Chains::of(turns, rest);
    let all = PARAMETERS + 2 * chains.count;
    let (n_turns, n_rest) = (2 * turns.len(), 3 * rest.len());
    // The turns at some parameters.
    let errors = |model: &Affine<f64>| -> Vec<TurnError> {
        let turned = rotations.at(&model.matrix, &model.offset);
        let each = turns.iter().zip(&turned);
        each.map(|(turn, turned)| TurnError::of(turn, turned))
            .collect()
    };
    // Unweighted residuals and derivatives: rad, then rad/s.
    let linearize = |p: &DVector<f64>| {
        let model = unpack(p);
        let mut out = Linearized::zeros(n_turns + n_rest, all);
        let mut add =
            |row: usize, residual: f64, by: ByTriad, chain: Option<usize>, level: [f64; 2]| {
                let mut columns = out.jacobian.row_mut(row);
                let own = by.component_mul(&scale);
                columns
                    .columns_mut(0, PARAMETERS)
                    .copy_from(&own.transpose());
                out.residuals[row] = residual;
                if let Some(chain) = chain {
                    for (l, by) in level.into_iter().enumerate() {
                        let column = PARAMETERS + 2 * chain + l;
                        columns[column] = by;
                        out.residuals[row] += by * p[column];
                    }
                }
            };
        let turned = errors(&model);
        let level = chains.level(turns, turned.iter().map(|t| t.rotation));
        for (t, error) in turned.iter().enumerate() {
            let earth = chains.of_turn[t].zip(level.get(&turns[t].to));
            for k in 0..2 {
                let by = earth.map(|(_, level)| error.by_level(k, level, turns[t].duration_s));
                let (residual, chain) = (error.block.residual[k], earth.map(|e| e.0));
                add(
                    2 * t + k,
                    residual,
                    error.block.by(k),
                    chain,
                    by.unwrap_or_default(),
                );
            }
        }
        for (s, o) in rest.iter().enumerate() {
            let block = vector::at(&model, &(o.raw - at_rest), &o.rate);
            let earth = chains.of_rest[s].zip(level.get(&o.dwell));
            for axis in 0..3 {
                let by = earth.map(|(_, level)| level.map(|level| -level[axis]));
                let (residual, chain) = (block.residual[axis], earth.map(|e| e.0));
                add(
                    n_turns + 3 * s + axis,
                    residual,
                    block.by(axis),
                    chain,
                    by.unwrap_or_default(),
                );
            }
        }
        out
    };
    let known = |p: &DVector<f64>| -> Vec<f64> {
        let c = unpack(p).matrix;
        let squared = c.component_mul(&c);
        let mean = squared.sum() / 3.0;
        let turns = turns.iter().zip(&chains.of_turn).flat_map(|(t, chain)| {
            let earth = if chain.is_some() {
                0.0
            } else {
                t.earth_variance
            };
            [t.variance(mean) + earth; 2]
        });
        let rest = rest.iter().zip(&chains.of_rest).flat_map(|(o, chain)| {
            let earth = o.rate_variance * if chain.is_some() { 0.0 } else { 1.0 };
            let v = squared * o.variance + earth + o.vertical_variance;
            [v.x, v.y, v.z]
        });
        turns.chain(rest).map(|v| v.max(1e-20)).collect()
    };
    // Derivatives of the turns' residuals by C and o of the accelerometer.
    let by_accelerometer = |p: &DVector<f64>| {
        let mut by = DMatrix::zeros(n_turns, 12);
        for (t, (turn, error)) in turns.iter().zip(errors(&unpack(p))).enumerate() {
            for (k, columns) in error.by_accel(&turn.raw).iter().enumerate() {
                by.row_mut(2 * t + k).copy_from(&columns.transpose());
            }
        }
        by
    };
    let accel_covariance = DMatrix::from_fn(12, 12, |i, j| accel.inverse_covariance[(i, j)]);
    let mut p = DVector::from_fn(all, |k, _| {
        if k < 9 {
            first[(k / 3, k % 3)] / unit
        } else {
            0.0
        }
    });
    // The first weights: half a degree, and the scatter of the dwells.
    let r = linearize(&p).residuals;
    let of_rest = r.rows(n_turns, n_rest).norm_squared() / n_rest as f64;
    let mut groups = Reweighted::new(
        [0..n_turns, n_turns..n_turns + n_rest],
        [0.5f64.to_radians().powi(2), of_rest],
    );
    let lost = || Failure::NoSolution("the fit of the gyro to the turns does not converge".into());
    let mut gain = DMatrix::zeros(all, 12);
    let mut of_groups = [(); 2].map(|()| DMatrix::zeros(all, all));
    let mut condition = f64::INFINITY;
    for round in 0..30 {
        let variances = known(&p);
        let found = groups.minimize(p, &variances, linearize).ok_or_else(lost)?;
        let last = &found.at;
        let turns_only = last.jacobian.rows(0, n_turns).columns(0, 9).into_owned();
        let shape = Observability::of(&turns_only);
        if !shape.is_complete() {
            let names: Vec<String> = shape
                .undetermined
                .iter()
                .map(|(k, _)| format!("C_{}{}", AXES[k / 3], AXES[k % 3]))
                .collect();
            return Err(Failure::Undetermined {
                parameters: names.join(", "),
                add: "add turns about every axis, with that axis level and slanted: gravity does not show a turn about the vertical".into(),
            });
        }
        condition = shape.condition;
        let covariance = last.covariance()?;
        // Errors of the accelerometer's calibration are common to all turns. They go into the parameters in full, and into the size that residuals
        // may have, but not into the weights.
        let by = by_accelerometer(&found.parameters);
        let mut weighted = by.clone();
        for (mut row, weight) in weighted.row_iter_mut().zip(&found.weights) {
            row *= *weight;
        }
        gain = &covariance * last.jacobian.rows(0, n_turns).transpose() * weighted;
        of_groups = groups
            .rows
            .each_ref()
            .map(|rows| last.part(&covariance, rows));
        let common = (&by * &accel_covariance).component_mul(&by).column_sum();
        let allowed: Vec<f64> = variances
            .iter()
            .enumerate()
            .map(|(k, v)| v + common.get(k).copied().unwrap_or(0.0))
            .collect();
        let converged = groups.update(&found, &covariance, &allowed, 1e-3);
        p = found.parameters;
        if converged && round > 0 {
            break;
        }
    }
    let Affine { matrix, offset } = unpack(&p);
    let inverse = Affine {
        matrix,
        offset: offset - matrix * at_rest,
    };
    let change = from_centre(&at_rest) * SMatrix::from_diagonal(&scale);
    let in_unit = |m: &DMatrix<f64>| Covariance::from_fn(|i, j| m[(i, j)]);
    let own = of_groups
        .iter()
        .zip(&groups.scatter)
        .map(|(c, group)| Part {
            covariance: in_unit(c),
            dof: group.variance_dof(),
        });
    let gain = Covariance::from_fn(|i, j| gain[(i, j)]);
    let of_accelerometer = accel.inverse_parts();
    let shared = of_accelerometer.iter().map(|part| part.seen_by(&gain));
    let parts = own.chain(shared).map(|part| part.seen_by(&change));
    let scatter = [Observable::Turns, Observable::Rest]
        .into_iter()
        .zip(groups.scatter)
        .collect();
    let triad = Triad::from_inverse(inverse, parts.collect()).ok_or_else(|| {
        Failure::NoSolution(
            "C is singular: the gyro does not respond to turns about some axis".into(),
        )
    })?;
    Ok(Estimated {
        triad,
        scatter,
        condition,
        delays: None,
        earth: Vec::new(),
        notes: Vec::new(),
    })
}
