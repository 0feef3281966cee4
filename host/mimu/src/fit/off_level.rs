//! Known forces that point elsewhere than the reference says: faces off level.
//!
//! A tilt leaves the size of a force and moves its direction, and so errs across it; a sensor's own errors lie along it as well.

use nalgebra::{DMatrix, DVector, Vector3};

use super::sensor::{Residual, SensorFit};
use crate::prepared::Prepared;
use crate::quantity::{Figure, Sensor};
use crate::warning::Warning;

/// Errors across the known force over those along it, and over noise, from which on the force is not where the reference says.
const ACROSS: f64 = 3.0;
/// Root mean square angle, rad, below which that is not said: a fifth of a degree, what a good level shows.
const LEVEL: f64 = 3.5e-3;
/// With so many dwells, two on each face, or fewer a model with cross terms has taken up most of a tilt, and smeared what is left over all
/// directions: of six faces 2.5 times as much lies across as along, where the tilts themselves have nothing along. There only what no error
/// along the forces can be is compared, and with the noise alone.
const FEW: usize = 12;
/// Fewest degrees of freedom that are left for it: of six faces an axis has one, whether it reads the same bias on the two other pairs.
const FEWEST_FREE: usize = 3;

/// A dwell: its error, and where its force is.
struct Dwell<'a> {
    residual: &'a Residual,
    force: Vector3<f64>,
}

/// What to say of an accelerometer whose faces were off level, whatever estimator found it.
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
    (angle > LEVEL).then(|| Warning::OffLevel(angle).of(Sensor::Accel))
}

/// Angle, rad, if the errors across the forces are far beyond those along them and the noise.
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

/// The same for few dwells, by the part of their errors that neither the model nor errors along the forces can be.
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
    // Where the noise is not known nothing tells that it is not all there is, and where what errors along the forces would explain is far larger
    // it is they.
    let beyond = across > ACROSS * ACROSS * floor && rest < ACROSS * ACROSS * across * free as f64;
    beyond.then(|| (2.0 * across).sqrt() / size)
}
