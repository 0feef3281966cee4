//! What one session has in common: errors of the calibration, biases, and how a reference is mounted.
//!
//! The errors of all segments depend on it, and a filter over the segments learns it. The order is that of the constants below.

use std::ops::Range;

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::quantity::{PerSensor, Sensor};

/// Number of all.
pub(super) const STATES: usize = 49;
/// Errors of C (by rows) and o of the gyro, then of the accelerometer, in the order of [`crate::triad::vector`].
const AFFINE: [usize; 2] = [0, 12];
/// Sensitivity of the gyro to specific force, by rows, rad/s per m/s².
pub(super) const G_SENSITIVITY: Range<usize> = 24..33;
/// Rate and force that vibration is rectified to, per mean square of the acceleration above 10 Hz: rad/s and m/s² per (m/s²)².
const RECTIFICATION: [usize; 2] = [33, 36];
/// Place of the reference's origin in the body frame, m.
pub(super) const LEVER: Range<usize> = 39..42;
/// Rotation of the reference's axes against those of the unit, rad.
pub(super) const MOUNTING: Range<usize> = 42..45;
/// Error of gravity in the frame of the reference, m/s².
pub(super) const GRAVITY: Range<usize> = 45..48;
/// What to add to the times of the reference, s.
pub(super) const CLOCK: usize = 48;

/// Errors of C.
pub(super) fn matrix(sensor: Sensor) -> Range<usize> {
    let from = AFFINE[sensor as usize];
    from..from + 9
}

/// Errors of o: the biases.
pub(super) fn offset(sensor: Sensor) -> Range<usize> {
    let from = AFFINE[sensor as usize] + 9;
    from..from + 3
}

/// Coefficients of the rectification of vibration.
pub(super) fn rectification(sensor: Sensor) -> Range<usize> {
    let from = RECTIFICATION[sensor as usize];
    from..from + 3
}

/// Derivatives of a vector by the state, a column for each.
pub(super) type By = SMatrix<f64, 3, STATES>;

/// What the sensors read for a time, calibrated and raw, with everything that their errors depend on.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Readings {
    /// Time that it lasts, s.
    pub duration_s: f64,
    /// Rate, rad/s.
    pub rate: Vector3<f64>,
    /// Specific force, m/s².
    pub force: Vector3<f64>,
    /// Readings as they came, without the errors that effects explain.
    pub raw: PerSensor<Vector3<f64>>,
    /// Square of the acceleration above 10 Hz, (m/s²)².
    pub vibration: f64,
}

impl Readings {
    /// Without the biases that are known already.
    pub fn without(&self, biases: &PerSensor<Vector3<f64>>) -> Self {
        Self {
            rate: self.rate - biases.gyro,
            force: self.force - biases.accel,
            ..*self
        }
    }

    /// Adds the errors that this causes in what `sensor` measures, rotated by `rotation` and times `weight`.
    pub fn add_errors(&self, by: &mut By, sensor: Sensor, rotation: &Matrix3<f64>, weight: f64) {
        let (c, raw) = (matrix(sensor).start, self.raw[sensor]);
        let scaled = rotation * weight;
        for row in 0..3 {
            for column in 0..3 {
                add(by, c + 3 * row + column, &scaled, row, raw[column]);
            }
            add(by, offset(sensor).start + row, &scaled, row, 1.0);
            let bends = rectification(sensor).start + row;
            add(by, bends, &scaled, row, self.vibration);
            if sensor == Sensor::Gyro {
                for column in 0..3 {
                    let g = G_SENSITIVITY.start + 3 * row + column;
                    add(by, g, &scaled, row, self.force[column]);
                }
            }
        }
    }
}

fn add(by: &mut By, state: usize, rotation: &Matrix3<f64>, row: usize, times: f64) {
    for i in 0..3 {
        by[(i, state)] += rotation[(i, row)] * times;
    }
}
