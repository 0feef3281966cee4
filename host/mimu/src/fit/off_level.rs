//! Known forces whose direction differs from the reference: faces off level.
//!
//! A tilt keeps the magnitude of a force and changes its direction, so its error is across the force. A sensor's own errors are along it as well.

use nalgebra::{DMatrix, DVector, Vector3};

use super::sensor::{Residual, SensorFit};
use crate::prepared::Prepared;
use crate::quantity::{Figure, Sensor};
use crate::warning::Warning;

/// If the errors across the known force exceed those along it and the noise by this factor, the force has another direction.
const ACROSS: f64 = 3.0;
/// Root mean square angle, rad, below which there is no warning: a fifth of a degree, what a good level shows.
const LEVEL: f64 = 3.5e-3;
/// With this many dwells or fewer (two on each face), a model with cross terms takes up most of a tilt and spreads the rest over all directions: with
/// six faces 2.5 times as much is across as along, although the tilts have nothing along. Then only the part that no errors along the forces explain
/// is compared, with the noise alone.
const FEW: usize = 12;
/// Fewest degrees of freedom for this part. With six faces an axis has one: whether it reads the same bias on the two other pairs.
const FEWEST_FREE: usize = 3;

/// A dwell: its error and its known force.
struct Dwell<'a> {
    residual: &'a Residual,
    force: Vector3<f64>,
}

/// The warning about an accelerometer whose faces were off level, for any estimator.
pub fn off_level(prepared: &Prepared, fit: &SensorFit) -> Option<Warning> {
    if fit.sensor != Sensor::Accel || fit.figure != Figure::Input {
        return None;
    }
    let means = fit.residuals.iter().filter(|r| !r.within);
    let dwells: Option<Vec<Dwell<'_>>> = means
        .map(|residual| {
            let force = prepared.dwells.list[residual.dwell].input(fit.sensor)?;
            Some(Dwell { residual, force })
        })
        .collect();
    let dwells = dwells?;
    let angle = beside_those_along(&dwells).or_else(|| no_error_along(&dwells))?;
    (angle > LEVEL).then(|| Warning::OffLevel { angle }.of(Sensor::Accel))
}

/// Root mean square angle, rad, if the errors across the forces are far beyond those along them and the noise.
fn beside_those_along(dwells: &[Dwell<'_>]) -> Option<f64> {
    let (mut along, mut across, mut floor, mut angles) = (0.0, 0.0, 0.0, 0.0);
    for Dwell { residual, force } in dwells {
        let part = residual.value.dot(&force.normalize());
        let side = residual.value.norm_squared() - part * part;
        along += part * part;
        across += 0.5 * side;
        floor += residual.floor * residual.floor;
        angles += side / force.norm_squared();
    }
    let beyond = across > ACROSS * ACROSS * along.max(if floor.is_nan() { 0.0 } else { floor });
    beyond.then(|| (angles / dwells.len() as f64).sqrt())
}

/// The same for few dwells, by the part of their errors that neither the model nor errors along the forces explain.
fn no_error_along(dwells: &[Dwell<'_>]) -> Option<f64> {
    let n = dwells.len();
    if n > FEW {
        return None;
    }
    let size = dwells.iter().map(|d| d.force.norm()).sum::<f64>() / n as f64;
    let error = DVector::from_fn(3 * n, |i, _| dwells[i / 3].residual.value[i % 3]);
    // The nine cross terms and scale factors and the three biases, then an error along the force of each dwell.
    let explained = DMatrix::from_fn(3 * n, 12 + n, |i, j| {
        let (dwell, axis) = (i / 3, i % 3);
        let up = dwells[dwell].force / size;
        match j {
            0..9 if j / 3 == axis => up[j % 3],
            9..12 if j - 9 == axis => 1.0,
            12.. if j - 12 == dwell => up[axis],
            _ => 0.0,
        }
    });
    let svd = explained.svd(true, false);
    let (u, values) = (svd.u?, &svd.singular_values);
    let rank: Vec<usize> = (0..values.len())
        .filter(|k| values[*k] > 1e-9 * values.max())
        .collect();
    let free = (3 * n).checked_sub(rank.len())?;
    if free < FEWEST_FREE {
        return None;
    }
    let taken: f64 = rank.iter().map(|k| u.column(*k).dot(&error).powi(2)).sum();
    let [across, rest] = [error.norm_squared() - taken, taken];
    let across = across / free as f64;
    let floor = dwells.iter().map(|d| d.residual.floor.powi(2)).sum::<f64>() / n as f64;
    // If the noise is not known, the errors may be noise; if errors along the forces explain far more, they are the cause.
    let beyond = across > ACROSS * ACROSS * floor && rest < ACROSS * ACROSS * across * free as f64;
    beyond.then(|| (2.0 * across).sqrt() / size)
}
