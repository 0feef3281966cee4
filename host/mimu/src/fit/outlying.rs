//! Dwells and turns that err by far more than the others predict, left out before anything is concluded from them.
//!
//! One turn in which samples were lost, or one dwell against a soft cushion, bends all parameters, and its error then passes for an
//! effect. Each is compared with what the others predict of it: residuals of a robust fit (iteratively reweighted, with Cauchy's weights) about the
//! least-squares one, enlarged by the leverage as deletion residuals are.

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::blocks::quantile;
use crate::dwell::{Fault, LeftOut};
use crate::estimate::turn::{Turn, direction_error};
use crate::estimate::{Estimated, Observation, gravity_size, rotation};
use crate::prepared::{Prepared, si_covariance};
use crate::quantity::{Sensor, significant};

/// Standard deviations, by the noise or by the scatter of the others where that is more, from which on something is outlying.
const SIGMAS: f64 = 5.0;
/// And over the error that one in ten exceeds: where an effect is missing in the model, many err, and nothing stands out.
const OVER_TENTH: f64 = 2.0;
/// One in so many at most is left out: where more are, it is the model that is wrong.
const ONE_IN: usize = 10;
/// Cosine of the angle within which poses are near one axis of the sensor, either end up.
const NEAR: f64 = 0.9;
/// Standard deviations from which on a pose near the same axis errs as well: then both show an effect.
const WITNESS: f64 = 3.0;

/// Something judged: its error, the derivatives of that by the parameters, and the variance by noise.
struct Row {
    error: Vector3<f64>,
    by: DMatrix<f64>,
    variance: f64,
}

/// Error and standard deviations of each of the first `judged` rows against the prediction of the others; `dimensions` is the
/// number of components that their errors have.
fn against_others(rows: &[Row], judged: usize, dimensions: f64) -> Option<Vec<(f64, f64)>> {
    let parameters = rows.first()?.by.ncols();
    let mut weights: Vec<f64> = vec![1.0; rows.len()];
    // Median of the size of one, or two, normal components.
    let median = if dimensions < 1.5 { 0.6745 } else { 1.1774 };
    let mut found = Vec::new();
    for _ in 0..20 {
        let mut normal = DMatrix::zeros(parameters, parameters);
        let mut right = DVector::zeros(parameters);
        for (row, weight) in rows.iter().zip(&weights) {
            let weight = weight / row.variance;
            normal += row.by.tr_mul(&row.by) * weight;
            right += row.by.tr_mul(&row.error) * weight;
        }
        let scale = normal.diagonal().map(|d| d.sqrt().max(f64::MIN_POSITIVE));
        let scaled = DMatrix::from_fn(parameters, parameters, |i, j| {
            normal[(i, j)] / (scale[i] * scale[j])
        });
        // The decomposition never ends on what is not a number.
        if scaled.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let inverse = scaled.pseudo_inverse(1e-12).ok()?;
        let inverse = DMatrix::from_fn(parameters, parameters, |i, j| {
            inverse[(i, j)] / (scale[i] * scale[j])
        });
        let step = &inverse * right;
        let all = rows.iter().zip(&weights).map(|(row, weight)| {
            let left = row.error - &row.by * &step;
            let hat = &row.by * &inverse * row.by.transpose() * (weight / row.variance);
            let free = Matrix3::from_fn(|i, j| f64::from(u8::from(i == j)) - hat[(i, j)]);
            let inverse = free.try_inverse().unwrap_or_else(Matrix3::identity);
            // What nothing else determines is predicted by nothing.
            let inverse = match inverse.trace() < 100.0 {
                true => inverse,
                false => Matrix3::identity(),
            };
            let left = inverse * Vector3::new(left[0], left[1], left[2]);
            let variance = row.variance * inverse.trace() / 3.0;
            (left.norm(), left.norm() / variance.sqrt())
        });
        found = all.collect();
        let typical = |part: &[(f64, f64)]| {
            let mut sizes: Vec<f64> = part.iter().map(|f| f.1).collect();
            quantile(&mut sizes, 0.5).unwrap_or(0.0)
        };
        // What is judged, and what only holds the parameters as well, may have more than its noise.
        let scales = [&found[..judged], &found[judged..]].map(|p| (typical(p) / median).max(1.0));
        for (k, (f, weight)) in found.iter_mut().zip(&mut weights).enumerate() {
            f.1 /= scales[usize::from(k >= judged)];
            *weight = 1.0 / (1.0 + (f.1 / 2.4).powi(2)) / scales[usize::from(k >= judged)].powi(2);
        }
    }
    found.truncate(judged);
    Some(found)
}

/// The outlying ones, worst first, at most `most`.
fn outlying(found: &[(f64, f64)], most: usize) -> Vec<usize> {
    let mut sigmas: Vec<f64> = found.iter().map(|f| f.1).collect();
    let tenth = quantile(&mut sigmas, 0.9).unwrap_or(f64::INFINITY);
    let far = |k: &usize| found[*k].1 > SIGMAS && found[*k].1 > OVER_TENTH * tenth;
    let mut all: Vec<usize> = (0..found.len()).filter(far).collect();
    all.sort_by(|a, b| found[*b].1.total_cmp(&found[*a].1));
    all.truncate(most);
    all
}

/// Marks what is outlying in a recording with gravity as its only reference, dwells first. They keep their places in the list of
/// dwells, and whoever asks for observations or turns afterwards gets neither.
pub(super) fn leave_out(prepared: &mut Prepared) {
    if !prepared.has(Sensor::Accel) {
        return;
    }
    let poses = prepared.observations(Sensor::Accel);
    // Of fewer, none may be left out.
    if poses.len() < ONE_IN {
        return;
    }
    let g = prepared.manifest.gravity_mps2;
    let Some(accel) = fit_poses(prepared, &poses, g) else {
        return;
    };
    let model = accel.triad.inverse;
    for (i, (error, sigmas)) in outlying_poses(prepared, &poses, &model) {
        let dwell = &mut prepared.dwells.list[poses[i].dwell];
        dwell.accel_fault = Some(Fault::Outlying);
        let step = dwell.step;
        prepared.dwells.warnings.push(format!(
            "dwell {step} is not used for the accelerometer: its magnitude of specific force is {} mm/s² off what the other dwells predict, {sigmas:.0} sigma",
            significant(1e3 * error)
        ));
        prepared.dwells.left_out.push(LeftOut {
            sensor: Sensor::Accel,
            from: poses[i].dwell,
            to: poses[i].dwell,
            error,
            sigmas,
        });
    }
    if !prepared.has(Sensor::Gyro) {
        return;
    }
    let poses = prepared.observations(Sensor::Accel);
    let Some(accel) = fit_poses(prepared, &poses, g) else {
        return;
    };
    let found = outlying_turns(prepared, &accel, g);
    prepared.dwells.left_out.extend(found);
}

fn fit_poses(prepared: &Prepared, poses: &[Observation], g: f64) -> Option<Estimated> {
    let first = gravity_size::first_guess(poses, g)?;
    let variances = prepared.size_variances(&first, poses);
    gravity_size::estimate(poses, &variances, g).ok()
}

fn outlying_poses(
    prepared: &Prepared,
    poses: &[Observation],
    accel: &Affine<f64>,
) -> Vec<(usize, (f64, f64))> {
    let g = prepared.manifest.gravity_mps2;
    let variances = prepared.size_variances(accel, poses);
    let up: Vec<Vector3<f64>> = poses.iter().map(|o| accel.apply(&o.raw)).collect();
    let rows = poses.iter().enumerate().map(|(k, o)| {
        let direction = up[k].normalize();
        // By the lower triangle of C, which the size determines, and o.
        let by = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];
        let slope = |j: usize| match by.get(j) {
            Some((row, column)) => direction[*row] * o.raw[*column],
            None => direction[j - 6],
        };
        Row {
            error: Vector3::new(up[k].norm() - g, 0.0, 0.0),
            by: DMatrix::from_fn(3, 9, |i, j| if i == 0 { slope(j) } else { 0.0 }),
            variance: variances[k].max((1e-9 * g).powi(2)),
        }
    });
    let rows: Vec<Row> = rows.collect();
    let Some(found) = against_others(&rows, rows.len(), 1.0) else {
        return Vec::new();
    };
    // An effect that the model lacks shows in every pose near an axis, whichever end is up.
    let has_witness = |k: usize| {
        (0..poses.len()).any(|o| {
            let cosine = up[o].normalize().dot(&up[k].normalize()).abs();
            o != k && cosine > NEAR && found[o].1 > WITNESS
        })
    };
    let all = outlying(&found, poses.len() / ONE_IN).into_iter();
    all.filter(|k| !has_witness(*k))
        .map(|k| (k, found[k]))
        .collect()
}

fn outlying_turns(prepared: &Prepared, accel: &Estimated, g: f64) -> Vec<LeftOut> {
    let model = &accel.triad.inverse;
    let (turns, _) = prepared.turns(model);
    if turns.len() < ONE_IN {
        return Vec::new();
    }
    let rest = prepared.rest(&accel.triad.inverse);
    let motions = prepared.motions(model);
    let Ok(gyro) = rotation::estimate(&turns, &rest, &accel.triad, &motions, None, g) else {
        return Vec::new();
    };
    let Affine { matrix, offset } = gyro.triad.inverse;
    let mean_square = matrix.norm_squared() / 3.0;
    let turned = |turn: &Turn| Row {
        error: direction_error(turn, &gyro.triad.inverse),
        by: slopes(turn, &gyro.triad.inverse),
        variance: (turn.variance(mean_square) + turn.earth_variance).max(1e-18),
    };
    let mut rows: Vec<Row> = turns.iter().map(turned).collect();
    rows.extend(
        rest.iter().map(|o| Row {
            error: matrix * o.raw + offset - o.rate,
            by: DMatrix::from_fn(3, 12, |i, j| match j {
                0..9 if j / 3 == i => o.raw[j % 3],
                9.. if j - 9 == i => 1.0,
                _ => 0.0,
            }),
            variance: ((si_covariance(&matrix, &o.variance).trace() + o.rate_variance.sum()) / 3.0)
                .max(1e-24),
        }),
    );
    let Some(found) = against_others(&rows, turns.len(), 2.0) else {
        return Vec::new();
    };
    let left_out = |k: usize| LeftOut {
        sensor: Sensor::Gyro,
        from: turns[k].from,
        to: turns[k].to,
        error: found[k].0,
        sigmas: found[k].1,
    };
    let all = outlying(&found, turns.len() / ONE_IN).into_iter();
    all.map(left_out).collect()
}

/// Derivatives of the direction error of a turn by C (rows first) and o, by differences.
fn slopes(turn: &Turn, gyro: &Affine<f64>) -> DMatrix<f64> {
    // Turns of some radians: a thousandth of C moves the direction by milliradians, far above rounding and far below a bend.
    let size = gyro.matrix.norm() / 3f64.sqrt();
    let steps = [1e-3 * size, 1e-3 / turn.duration_s.max(1e-3)];
    let mut by = DMatrix::zeros(3, 12);
    for j in 0..12 {
        let step = steps[j / 9];
        let moved = |sign: f64| {
            let mut model = *gyro;
            match j {
                0..9 => model.matrix[(j / 3, j % 3)] += sign * step,
                _ => model.offset[j - 9] += sign * step,
            }
            direction_error(turn, &model)
        };
        let slope = (moved(1.0) - moved(-1.0)) / (2.0 * step);
        by.set_column(j, &slope);
    }
    by
}
