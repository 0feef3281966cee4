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

impl Closure {
    /// The error of the heading over its own `turns`, rad, under the calibration `gyro`.
    pub fn error(&self, turns: &[Turn], gyro: &Affine<f64>, vertical: f64) -> f64 {
        let error = ClosureError::at(turns, gyro, vertical);
        error.map_or(0.0, |e| e.block.residual[0])
    }
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

/// What a rotation in the frame after a turn adds to the part of its `error` along the unit vector `after`, by its components: a row of the inverse Jacobian of a
/// rotation, to second order in the error.
fn along(after: &Vector3<f64>, error: &Vector3<f64>) -> Vector3<f64> {
    after + after.cross(error) * 0.5 + error.cross(&error.cross(after)) / 12.0
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
        let along = along(&after, &error);
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

    /// Derivatives of the error by the rotation vector of each increment of each turn, rad/rad, body frame.
    pub fn by_increments(turns: &[Turn], gyro: &Affine<f64>) -> Option<Vec<Vec<Vector3<f64>>>> {
        let each = turns.iter();
        let each: Vec<_> = each
            .map(|turn| Turned::with_increments(turn, gyro))
            .collect();
        let whole = Self::rotation(turns, gyro)?;
        let [before, after] = [turns.first()?.before, turns.last()?.after].map(|f| f.normalize());
        let mut along = along(&after, &attitude_error(&whole, &before, &after));
        // Backwards: the later turns take each increment into the frame at the end.
        let mut by = Vec::new();
        for (turned, into) in each.iter().rev() {
            by.push(into.iter().map(|into| into.tr_mul(&along)).collect());
            along = turned.rotation.tr_mul(&along);
        }
        by.reverse();
        Some(by)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::increment::Increment;

    #[test]
    fn derivatives_by_increments_are_those_of_differences() {
        let gyro = Affine {
            matrix: Matrix3::identity(),
            offset: Vector3::zeros(),
        };
        let error = |moved: Option<(usize, usize, Vector3<f64>)>| {
            let pieces: Vec<Vec<Increment>> = (0..2)
                .map(|turn| {
                    let of = |k: usize| {
                        let mut one = Increment::EMPTY;
                        one.duration_s = 1.0;
                        let mut angle = Vector3::new(0.1 * k as f64, -0.2, 1.5 + turn as f64);
                        if let Some((_, _, by)) = moved.filter(|m| (m.0, m.1) == (turn, k)) {
                            angle += by;
                        }
                        one.integral = angle.into();
                        one
                    };
                    (0..3).map(of).collect()
                })
                .collect();
            let force = Vector3::new(1.0, -2.0, 9.5);
            let turn = |k: usize| Turn {
                from: k,
                to: k + 1,
                steps: [0; 2],
                increments: &pieces[k],
                before: force,
                after: force,
                raw: [force; 2],
                direction_variance: 0.0,
                earth_variance: 0.0,
                integral_variance: 0.0,
                duration_s: 3.0,
            };
            let turns = [turn(0), turn(1)];
            let at = ClosureError::at(&turns, &gyro, 0.0).expect("two turns");
            (
                at.block.residual[0],
                ClosureError::by_increments(&turns, &gyro).expect("two turns"),
            )
        };
        let by = error(None).1;
        for (turn, k, axis) in (0..18).map(|i| (i / 9, i / 3 % 3, i % 3)) {
            let at = |step: f64| error(Some((turn, k, step * Vector3::ith(axis, 1.0)))).0;
            let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
            let off = (slope - by[turn][k][axis]).abs();
            assert!(
                off < 2e-3,
                "{turn} {k} {axis}: {slope} {}",
                by[turn][k][axis]
            );
        }
    }
}
