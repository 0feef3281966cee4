//! The part of a residual that temperature explains: whether readings follow their inputs with temperature in the model, if they do not without.
//!
//! A chamber that sweeps 80 °C changes the bias of an ordinary gyro by 8 deg/s, which is as much as all rates of a thermal plan. Then no affine model
//! follows the inputs, although the recording is good.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::sensor::Residual;
use crate::effects::temperature::lagged;
use crate::estimate::Observation;
use crate::prepared::Prepared;
use crate::quantity::Sensor;

/// Constant, input, T, T² and T behind a lag: the changes of a bias. Scale factors are left out: 300 ppm/K is 3 % of the inputs in 100 K, and a plan
/// with all of its rates at one temperature does not show it.
const COLUMNS: usize = 7;
/// Lag of the die behind the thermometer, s. On a ramp, lags from some tens of seconds to some minutes look alike.
const LAG_S: f64 = 60.0;
/// Fewest dwells, twice the columns: with fewer, temperature would explain unrelated errors.
const LEAST: usize = 2 * COLUMNS;

/// Residuals of a fit with temperature in its model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WithTemperature {
    /// Root mean square of these residuals, corrected for the number of coefficients, SI.
    pub rms: f64,
    /// Mean temperature of the dwells, °C.
    pub mean_c: f64,
}

/// Fits the dwells of `residuals`, which have a known input. `None` if the temperature is unknown or hardly changes, if there are too few dwells, or
/// if the readings depend on the temperature and on no input.
pub(super) fn with_temperature(
    prepared: &Prepared,
    sensor: Sensor,
    residuals: &[Residual],
) -> Option<WithTemperature> {
    let judged = |o: &Observation| residuals.iter().any(|r| r.dwell == o.dwell);
    let observations = prepared.observations(sensor);
    let used: Vec<(&Observation, f64)> = observations
        .iter()
        .filter(|o| judged(o))
        .map(|o| (o, prepared.dwells.list[o.dwell].temp_c))
        .filter(|(_, t)| t.is_finite())
        .collect();
    let n = used.len();
    if n < LEAST || n < residuals.len() {
        return None;
    }
    let temperatures = || used.iter().map(|u| u.1);
    let mean_c = temperatures().sum::<f64>() / n as f64;
    let widest = temperatures()
        .map(|t| (t - mean_c).abs())
        .fold(0.0, f64::max);
    if widest < 0.5 * super::ISOTHERMAL_C {
        return None;
    }
    let dwell = |o: &Observation| &prepared.dwells.list[o.dwell];
    let signal: Vec<(f64, f64)> = used.iter().map(|u| (dwell(u.0).start_s, u.1)).collect();
    let late = lagged(&signal, LAG_S);
    let size = used.iter().map(|u| u.0.input.norm()).fold(0.0, f64::max);
    let design = DMatrix::from_fn(n, COLUMNS, |i, k| {
        let (input, t) = (used[i].0.input / size, (used[i].1 - mean_c) / widest);
        match k {
            0 => 1.0,
            1..=3 => input[k - 1],
            4 => t,
            5 => t * t,
            _ => (late[i] - used[i].1) / widest,
        }
    });
    let raw = DMatrix::from_fn(n, 3, |i, axis| used[i].0.raw[axis]);
    let found = design.clone().svd(true, true).solve(&raw, 1e-9).ok()?;
    let forward = Matrix3::from_fn(|axis, k| found[(1 + k, axis)] / size);
    let inverse = forward.try_inverse()?;
    let left = raw - design * found;
    let squares = left.row_iter().map(|row| {
        let raw = Vector3::new(row[0], row[1], row[2]);
        (inverse * raw).norm_squared()
    });
    let dof = 3.0 * (n - COLUMNS) as f64;
    let rms = (squares.sum::<f64>() / dof).sqrt();
    rms.is_finite().then_some(WithTemperature { rms, mean_c })
}
