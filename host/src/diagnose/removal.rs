//! Taking effects out of readings, by what the device itself measures.

use mimu_core::compensation::Affine;
use nalgebra::Vector3;

use super::candidate::Candidate;
use super::effect::{Moment, REFERENCE_C};
use super::rows::{directions, late};
use crate::dwell::Sensor;
use crate::prepared::Prepared;

/// An effect with its numbers.
#[derive(Debug, Clone)]
pub struct Removed {
    /// Which.
    pub candidate: Candidate,
    /// Its nonlinear constant, 0 if it has none.
    pub form: f64,
    /// Coefficients, SI, in the order of the candidate's active ones.
    pub values: Vec<f64>,
}

impl Removed {
    /// Adds its error of the three axes at a moment, SI.
    fn add(&self, at: &Moment, error: &mut Vector3<f64>) {
        let mut regressors = [0.0; 9];
        let axes = self.candidate.axes();
        self.candidate
            .regressors(at, self.form, &mut regressors[..axes.len()]);
        for ((axis, value), regressor) in axes.iter().zip(&self.values).zip(regressors) {
            error[*axis] += value * regressor;
        }
    }
}

/// Errors of the axes of the sensor at some moments, SI. Of effects with a lag the moments have to come with that lag.
pub fn errors(effects: &[Removed], moments: &[Moment]) -> Vec<Vector3<f64>> {
    let mut all = vec![Vector3::zeros(); moments.len()];
    for effect in effects {
        for (error, moment) in all.iter_mut().zip(moments) {
            effect.add(moment, error);
        }
    }
    all
}

/// A recording with `effects` taken out of the readings: of each triad, given with its inverse model, in the raw domain. `None` if a
/// calibration is singular.
///
/// The conditions are what the device has: its own compensated readings and its temperature, not the table's.
pub fn remove(
    prepared: &Prepared,
    gyro: Option<&Affine<f64>>,
    accel: Option<&Affine<f64>>,
    effects: &[Removed],
) -> Option<Prepared> {
    let mut out = prepared.clone();
    if effects.is_empty() {
        return Some(out);
    }
    let blocks = &prepared.condensed.blocks;
    let t0_s = blocks.first()?.start_s;
    let raw = |b: &crate::blocks::Block, from: usize| Vector3::from_fn(|i, _| b.raw[from + i].mean);
    let apply = |model: Option<&Affine<f64>>, u: Vector3<f64>| {
        model.map_or(Vector3::repeat(f64::NAN), |m| m.apply(&u))
    };
    let warm: Vec<(f64, f64)> = blocks
        .iter()
        .map(|b| (0.5 * (b.start_s + b.last_s), b.temp_c.mean - REFERENCE_C))
        .collect();
    for sensor in Sensor::BOTH {
        let ours: Vec<&Removed> = effects
            .iter()
            .filter(|e| e.candidate.sensor == sensor)
            .collect();
        let model = match sensor {
            Sensor::Gyro => gyro,
            Sensor::Accel => accel,
        };
        let (Some(model), false) = (model, ours.is_empty()) else {
            continue;
        };
        let (direction, scale, _) = directions(model)?;
        let from = sensor.channels().start;
        let moment =
            |at: usize, t_s: f64, duration_s: f64, rate: Vector3<f64>, force: Vector3<f64>| {
                Moment {
                    session: 0,
                    t_s: t_s - t0_s,
                    duration_s,
                    rate,
                    force,
                    angular_acceleration: Vector3::zeros(),
                    sensed: direction
                        * match sensor {
                            Sensor::Gyro => rate,
                            Sensor::Accel => force,
                        },
                    warm_c: warm[at].1,
                    late_c: warm[at].1,
                }
            };
        let mut of_blocks: Vec<Moment> = blocks
            .iter()
            .enumerate()
            .map(|(at, b)| {
                let duration_s = f64::from(b.rows) * prepared.condensed.period_s;
                moment(
                    at,
                    warm[at].0,
                    duration_s,
                    apply(gyro, raw(b, 0)),
                    apply(accel, raw(b, 3)),
                )
            })
            .collect();
        let mut of_increments: Vec<Moment> = Vec::new();
        let mut block_of = Vec::new();
        if sensor == Sensor::Gyro {
            for piece in &prepared.condensed.increments {
                let t_s = piece.end_s - 0.5 * piece.duration_s;
                let at = blocks
                    .partition_point(|b| b.last_s < t_s)
                    .min(blocks.len() - 1);
                let rate = apply(gyro, Vector3::from(piece.integral) / piece.duration_s);
                of_increments.push(moment(at, t_s, piece.duration_s, rate, of_blocks[at].force));
                block_of.push(at);
            }
        }
        let mut of_block = vec![Vector3::zeros(); blocks.len()];
        let mut of_increment = vec![Vector3::zeros(); of_increments.len()];
        for effect in ours {
            if let Some(lag_s) = effect.candidate.lag_s(effect.form) {
                let late = late(&warm, lag_s);
                for (moment, late) in of_blocks.iter_mut().zip(&late) {
                    moment.late_c = *late;
                }
                for (moment, at) in of_increments.iter_mut().zip(&block_of) {
                    moment.late_c = late[*at];
                }
            }
            for (error, moment) in of_block.iter_mut().zip(&of_blocks) {
                effect.add(moment, error);
            }
            for (error, moment) in of_increment.iter_mut().zip(&of_increments) {
                effect.add(moment, error);
            }
        }
        for (block, error) in out.condensed.blocks.iter_mut().zip(&of_block) {
            for i in 0..3 {
                block.raw[from + i].mean -= scale[i] * error[i];
            }
        }
        for (piece, error) in out.condensed.increments.iter_mut().zip(&of_increment) {
            for i in 0..3 {
                piece.integral[i] -= scale[i] * error[i] * piece.duration_s;
            }
        }
        for dwell in &mut out.dwells.list {
            let range = dwell.blocks.clone();
            let total: f64 = of_blocks[range.clone()].iter().map(|m| m.duration_s).sum();
            let pairs = of_blocks[range.clone()].iter().zip(&of_block[range]);
            let mean: Vector3<f64> = pairs.map(|(m, e)| e * (m.duration_s / total)).sum();
            for i in 0..3 {
                dwell.raw[from + i].mean -= scale[i] * mean[i];
            }
        }
    }
    Some(out)
}
