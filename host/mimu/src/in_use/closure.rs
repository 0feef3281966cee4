//! What a segment shows: the errors of dead reckoning at its end, what they depend on, and how far each source of noise explains them.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::dead_reckoning::DeadReckoning;
use super::estimates::Smoothed;
use super::state::{self, By, STATES};
use crate::quantity::{PerSensor, Sensor};

/// Variances that an error of a segment may have beside the known noise; see [`super::component`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Share {
    /// White noise of density 1 on every axis.
    White(Sensor),
    /// White noise whose variance is the mean square of the acceleration above 10 Hz.
    Shaken(Sensor),
    /// An error of 1 of each element of the scale matrix, other in each segment.
    Turned(Sensor),
    /// An error of 1 rad of each attitude that the reference gives.
    Attitude,
    /// An error of 1 of each velocity (m/s), or of each position (m), that the reference gives.
    Reference,
}

/// All of them, in the order of [`Closure::shares`].
const SHARES: [Share; 8] = [
    Share::White(Sensor::Gyro),
    Share::White(Sensor::Accel),
    Share::Shaken(Sensor::Gyro),
    Share::Shaken(Sensor::Accel),
    Share::Turned(Sensor::Gyro),
    Share::Turned(Sensor::Accel),
    Share::Attitude,
    Share::Reference,
];

/// The errors of a segment, or of the rate in a rest.
#[derive(Debug, Clone)]
pub(super) struct Closure {
    /// Middle of its time, s.
    pub at_s: f64,
    /// Length, s.
    pub duration_s: f64,
    /// Whether it is a segment in motion, which is judged; a rest only shows the gyro's bias.
    pub moves: bool,
    /// Errors: estimate minus reference. Of those that the state of the session makes, what is linear in the whole state: see [`Self::about`].
    pub residual: DVector<f64>,
    /// Derivatives by the state of the session.
    pub by: DMatrix<f64>,
    /// Covariance by the noise file.
    pub known: DMatrix<f64>,
    /// Covariances by [`SHARES`].
    pub shares: Vec<DMatrix<f64>>,
    /// Angle turned on the way, rad.
    pub turned: f64,
    /// Mean square of the acceleration above 10 Hz, (m/s²)².
    pub vibration: f64,
}

/// What a reference adds to the errors of dead reckoning: by the state, and by its own errors.
pub(super) struct Ends {
    /// Errors by attitude, velocity, position and marked position.
    pub of: DMatrix<f64>,
    /// Errors.
    pub residual: DVector<f64>,
    /// What the state adds at the end.
    pub by: DMatrix<f64>,
    /// Covariance at the end by the noise file.
    pub known: DMatrix<f64>,
    /// By errors of attitudes and of velocities or positions.
    pub reference: [DMatrix<f64>; 2],
}

impl Closure {
    /// Of a segment that was dead reckoned to its end.
    pub fn of(
        reckoned: &DeadReckoning,
        ends: Ends,
        start_s: f64,
        matrices: &PerSensor<Matrix3<f64>>,
    ) -> Self {
        let Ends {
            of,
            residual,
            by,
            known,
            reference: [attitude, reference],
        } = ends;
        let errors_by = DMatrix::from_column_slice(12, STATES, reckoned.by.as_slice());
        let by = &of * errors_by + by;
        let gramian = |k: usize| {
            let own = DMatrix::from_column_slice(12, 12, reckoned.gramians[k].as_slice());
            &of * own * of.transpose()
        };
        let turned = Sensor::BOTH.map(|s| {
            let by = scales(&by, s, &matrices[s]);
            &by * by.transpose()
        });
        let [turned_gyro, turned_accel] = turned;
        let shares = vec![
            gramian(1),
            gramian(2),
            gramian(3),
            gramian(4),
            turned_gyro,
            turned_accel,
            attitude,
            reference,
        ];
        Self {
            at_s: start_s + 0.5 * reckoned.duration_s,
            duration_s: reckoned.duration_s,
            moves: true,
            known: gramian(0) + known,
            residual,
            by,
            shares,
            turned: reckoned.turned,
            vibration: reckoned.vibration / reckoned.duration_s,
        }
    }

    /// The covariance of a share at a value of 1.
    pub fn share(&self, share: Share) -> &DMatrix<f64> {
        let at = SHARES.iter().position(|s| *s == share);
        &self.shares[at.unwrap_or(0)]
    }

    /// The errors of the whole state, given those that remain without the `biases` and the mounting and clock of `about`.
    pub fn about(mut self, about: &Smoothed, biases: &PerSensor<Vector3<f64>>) -> Self {
        self.residual += &self.by * about.state(biases);
        self
    }
}

/// Derivatives by the elements of a matrix E, where `E C` is the error of C.
pub(super) fn scales(by: &DMatrix<f64>, sensor: Sensor, c: &Matrix3<f64>) -> DMatrix<f64> {
    let from = state::matrix(sensor).start;
    DMatrix::from_fn(by.nrows(), 9, |row, element| {
        let (i, j) = (element / 3, element % 3);
        (0..3)
            .map(|k| by[(row, from + 3 * i + k)] * c[(j, k)])
            .sum()
    })
}

/// A matrix whose rows are those of `by` that `rows` picks, after `into` others.
pub(super) fn rows_of(by: &By, rows: &[usize], into: usize, all: usize) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(all, STATES);
    for (k, row) in rows.iter().enumerate() {
        out.row_mut(into + k).copy_from(&by.row(*row));
    }
    out
}

/// Errors of dead reckoning by an error of the attitude at its beginning: 12 x 3, as the nominal path gives them.
pub(super) fn by_first_attitude(
    reckoned: &DeadReckoning,
    gravity: f64,
    marked_s: f64,
) -> DMatrix<f64> {
    let up = Vector3::z() * gravity;
    let t = reckoned.duration_s;
    let blocks = [
        Matrix3::identity(),
        -(reckoned.velocity + up * t).cross_matrix(),
        -(reckoned.position + up * (0.5 * t * t)).cross_matrix(),
        -(reckoned.marked + up * (0.5 * marked_s * marked_s)).cross_matrix(),
    ];
    DMatrix::from_fn(12, 3, |i, j| blocks[i / 3][(i % 3, j)])
}
