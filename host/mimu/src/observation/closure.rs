//! Whole turns, after which the unit lies as it lay before: the heading that a gyro's calibration predicts must have returned too.
//!
//! Gravity shows the rest of the attitude ([`super::turn`]), better than the person who puts the unit back. About the vertical it shows nothing; there the
//! place where the unit lay is the reference. The error of N turns by a scale factor is N times that of one, and the error of putting it back is not.

use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::turn::{Path, Turn, Turned, attitude_error};
use super::{Block, ByTriad, place, slope};

/// Neighbouring turns that together are whole: one, or several with rests between them.
#[derive(Debug, Clone)]
pub struct Closure {
    /// Their places among the turns of the recording.
    pub turns: Range<usize>,
    /// How far the unit turned, by the calibration that they were found with.
    pub path: Path,
}

/// The whole turns among the turns of a recording, and what is known of where they end.
#[derive(Debug, Clone, Default)]
pub struct Closures {
    /// All of them, in order of time.
    pub list: Vec<Closure>,
    /// Variance of the heading in which the unit is put back, rad².
    pub placement_variance: f64,
    /// Known rate of the Earth about the vertical, rad/s, and the variance of the rest, rad²/s².
    pub vertical: [f64; 2],
    /// Standard deviation of the elements of C across the axes as delivered, relative to its size, if turns from pose to pose do not determine them.
    pub delivered: Option<f64>,
}

impl Closures {
    /// Known variance of one over these `turns`, rad², for a gyro with a mean square of `c2` per row of C.
    pub fn variance(&self, turns: &[Turn], c2: f64) -> f64 {
        let noise: f64 = turns.iter().map(|turn| turn.integral_variance).sum();
        let duration_s: f64 = turns.iter().map(|turn| turn.duration_s).sum();
        self.placement_variance + c2 * noise + self.vertical[1] * duration_s * duration_s
    }
}

/// The error of the heading after whole turns: the turn by the gyro minus the true one, about the direction of gravity after it.
#[derive(Debug, Clone, Copy)]
pub struct ClosureError {
    /// The error, rad, and its derivatives by the gyro; those by the accelerometer are [`Self::by_accel`].
    pub block: Block<1>,
    /// Derivatives by the force before and after, rad/(m/s²).
    pub by_force: [Vector3<f64>; 2],
}

impl ClosureError {
    /// Of neighbouring `turns` that together are whole, with the rotations of each by a gyro. `vertical` is the known rate of the Earth about the
    /// vertical, rad/s, with which the place itself turns.
    ///
    /// The attitude after is the one before, but for the shortest turn from the measured direction of gravity before to that after.
    pub(crate) fn of(turns: &[Turn], turned: &[Turned], vertical: f64) -> Option<Self> {
        let (first, last) = (turns.first()?, turns.last()?);
        let whole = turned.iter().skip(1).fold(*turned.first()?, Turned::then);
        let [before, after] = [first.before, last.after].map(|force| force.normalize());
        let error = attitude_error(&whole.rotation, &before, &after);
        let duration_s: f64 = turns.iter().map(|t| t.duration_s).sum();
        // The inverse Jacobian of a rotation, to second order in the error.
        let along = after + after.cross(&error) * 0.5 + error.cross(&error.cross(&after)) / 12.0;
        let slopes = whole.by.map(|by| by.tr_mul(&along));
        let by_gyro = SVector::<f64, 12>::from_fn(|k, _| match place(k) {
            (row, Some(column)) => slopes[column][row],
            (row, None) => slopes[3][row],
        });
        // What the shortest turn between two directions twists about its end if either of them moves.
        let twist = before.cross(&after) / (1.0 + before.dot(&after));
        let by_after = error * 0.5 - twist;
        let by_before = whole.rotation.tr_mul(&error) * 0.5 - twist;
        let ends = [(first.before, by_before), (last.after, by_after)];
        Some(Self {
            block: Block {
                residual: SVector::from([after.dot(&error) - vertical * duration_s]),
                by: SMatrix::from_rows(&[by_gyro.transpose()]),
            },
            by_force: ends.map(|(force, by)| {
                let up = force.normalize();
                (by - up * up.dot(&by)) / force.norm()
            }),
        })
    }

    /// Under the calibration `gyro`, raw to rad/s.
    pub fn at(turns: &[Turn], gyro: &Affine<f64>, vertical: f64) -> Option<Self> {
        let turned: Vec<Turned> = turns.iter().map(|turn| Turned::at(turn, gyro)).collect();
        Self::of(turns, &turned, vertical)
    }

    /// The rotation of `turns` together, which transforms a direction from the body frame before into that after them.
    pub fn rotation(turns: &[Turn], gyro: &Affine<f64>) -> Option<Matrix3<f64>> {
        let turned = turns.iter().map(|turn| Turned::at(turn, gyro));
        turned
            .reduce(|whole, next| whole.then(&next))
            .map(|whole| whole.rotation)
    }

    /// Derivatives by the accelerometer whose readings before and after are `raw`.
    pub fn by_accel(&self, raw: &[Vector3<f64>; 2]) -> ByTriad {
        let [before, after] = self.by_force;
        slope(&before, &raw[0]) + slope(&after, &raw[1])
    }
}
