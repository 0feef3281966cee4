//! A turn from dwell to dwell, and the direction of gravity that a gyro's calibration predicts after it.
//!
//! Gravity is the reference: the integrated gyro rotates the direction of gravity of one dwell into the frame of the next, where it must agree with
//! the measured direction (references 19 of xu and 12 of fang).

use std::cell::RefCell;

use mimu_core::compensation::Affine;
use nalgebra::{Matrix2, Matrix3, Rotation3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::{Block, ByTriad, place, slope};
use crate::signal::increment::Increment;

/// One turn from dwell to dwell.
#[derive(Debug, Clone, Copy)]
pub struct Turn<'a> {
    /// Index of the dwell that it begins in.
    pub from: usize,
    /// Index of the dwell that it ends in.
    pub to: usize,
    /// Numbers of these dwells.
    pub steps: [i32; 2],
    /// The raw gyro, integrated piece by piece.
    pub increments: &'a [Increment],
    /// Specific force before and after, m/s², by the calibrated accelerometer.
    pub before: Vector3<f64>,
    /// See `before`.
    pub after: Vector3<f64>,
    /// Mean raw accelerometer readings that `before` and `after` come from.
    pub raw: [Vector3<f64>; 2],
    /// Variance of the angle between the two directions by the accelerometer's noise, rad² (one component).
    pub direction_variance: f64,
    /// The same by the Earth's rate across the vertical, if the heading is unknown.
    pub earth_variance: f64,
    /// Variance of the integral of the gyro by its noise, raw²·s², mean of the three axes.
    pub integral_variance: f64,
    /// Length, s.
    pub duration_s: f64,
}

impl Turn<'_> {
    /// Variance of one component of the direction error, rad², for a gyro with a mean square of `c2` per row of C: by noise, and by the Earth's rate about
    /// a heading that is unknown. A quiet gyro in turns of eight seconds errs by the Earth twice as much as by its noise.
    pub fn variance(&self, c2: f64) -> f64 {
        self.direction_variance + c2 * self.integral_variance + self.earth_variance
    }

    /// Size of the direction error (rad, two components) by noise and the Earth, with `c2` as for [`Self::variance`].
    pub fn floor(&self, c2: f64) -> f64 {
        (2.0 * self.variance(c2)).sqrt()
    }

    /// The same turn with the forces by the accelerometer `accel`, raw to m/s².
    pub fn with(&self, accel: &Affine<f64>) -> Self {
        let [before, after] = self.raw.map(|raw| accel.apply(&raw));
        Self {
            before,
            after,
            ..*self
        }
    }

    fn pieces(&self) -> impl DoubleEndedIterator<Item = Piece> + ExactSizeIterator {
        self.increments.iter().map(Piece::of)
    }
}

/// A dwell at rest: only the Earth turns the gyro.
#[derive(Debug, Clone, Copy)]
pub struct Rest {
    /// Index of the dwell.
    pub dwell: usize,
    /// Mean reading, raw.
    pub raw: Vector3<f64>,
    /// Its variances by noise, raw².
    pub variance: Vector3<f64>,
    /// The known part of the rate, rad/s.
    pub rate: Vector3<f64>,
    /// Variances of the part that depends on the heading, rad²/s².
    pub rate_variance: Vector3<f64>,
    /// Variances of the vertical part; zero if the latitude is known.
    pub vertical_variance: Vector3<f64>,
}

/// Mean force and turn over two neighbouring blocks in motion, for the first guess.
#[derive(Debug, Clone, Copy)]
pub struct Motion {
    /// Mean specific force, m/s².
    pub force: Vector3<f64>,
    /// Its change, m/s².
    pub change: Vector3<f64>,
    /// Mean raw gyro reading.
    pub raw: Vector3<f64>,
    /// Time over which it changed, s.
    pub duration_s: f64,
}

/// An increment as vectors.
#[derive(Debug, Clone, Copy)]
struct Piece {
    integral: Vector3<f64>,
    coning: Vector3<f64>,
    moment: Vector3<f64>,
    duration: f64,
}

impl Piece {
    fn of(increment: &Increment) -> Self {
        Self {
            integral: increment.integral.into(),
            coning: increment.coning.into(),
            moment: increment.moment.into(),
            duration: increment.duration_s,
        }
    }

    /// Rotation vector under `ω = C u + o`, rad; `half` is half the cofactor matrix of C.
    fn rotation(&self, c: &Matrix3<f64>, o: &Vector3<f64>, half: &Matrix3<f64>) -> Vector3<f64> {
        c * self.integral
            + o * self.duration
            + half * self.coning
            + (c * self.moment).cross(o) * 0.5
    }
}

/// Cofactor matrix: `(C a) × (C b) = cof(C) (a × b)`.
fn cofactor(c: &Matrix3<f64>) -> Matrix3<f64> {
    let [x, y, z] = [0, 1, 2].map(|i| c.row(i).transpose());
    Matrix3::from_rows(&[
        y.cross(&z).transpose(),
        z.cross(&x).transpose(),
        x.cross(&y).transpose(),
    ])
}

/// `exp([φ]×)` and the right Jacobian of the rotation at φ.
fn exponential(phi: &Vector3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let angle2 = phi.norm_squared();
    let k = phi.cross_matrix();
    let k2 = k * k;
    let (a, b, c) = if angle2 < 1e-4 {
        // Next terms: 1e-4³/5040 and less.
        (
            1.0 - angle2 / 6.0 + angle2 * angle2 / 120.0,
            0.5 - angle2 / 24.0 + angle2 * angle2 / 720.0,
            1.0 / 6.0 - angle2 / 120.0 + angle2 * angle2 / 5040.0,
        )
    } else {
        let angle = angle2.sqrt();
        let (sin, cos) = angle.sin_cos();
        (
            sin / angle,
            (1.0 - cos) / angle2,
            (angle - sin) / (angle2 * angle),
        )
    };
    let one = Matrix3::identity();
    (one + k * a + k2 * b, one - k * b + k2 * c)
}

/// A turn under a calibration of the gyro.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Turned {
    /// Transforms a direction from the body frame before the turn into that after it.
    pub rotation: Matrix3<f64>,
    /// Derivatives of the turn (rad, in the frame after) by each column of C and by o.
    pub(super) by: [Matrix3<f64>; 4],
}

impl Turned {
    /// Under the calibration `gyro`, raw to rad/s.
    pub(crate) fn at(turn: &Turn, gyro: &Affine<f64>) -> Self {
        integrate(turn.pieces(), gyro, |_, _| ())
    }

    /// The same, with the matrix for each increment that takes its rotation vector into the frame after the turn.
    pub(super) fn with_increments(turn: &Turn, gyro: &Affine<f64>) -> (Self, Vec<Matrix3<f64>>) {
        let mut into = vec![Matrix3::zeros(); turn.increments.len()];
        let turned = integrate(turn.pieces(), gyro, |k, matrix| into[k] = *matrix);
        (turned, into)
    }

    /// This turn and the `next`, as one.
    pub(super) fn then(self, next: &Self) -> Self {
        let rotation = next.rotation;
        Self {
            rotation: rotation * self.rotation,
            by: [0, 1, 2, 3].map(|k| rotation * self.by[k] + next.by[k]),
        }
    }
}

/// How far the unit turned on its way, by the calibration `gyro`.
#[derive(Debug, Clone, Copy)]
pub struct Path {
    /// The angle about the mean axis, rad.
    pub angle: f64,
    /// The mean axis, unit vector in the body; zero without a turn.
    pub axis: Vector3<f64>,
    /// The fastest rate over some 10 ms, rad/s.
    pub fastest: f64,
}

impl Path {
    /// Of neighbouring `turns`.
    pub fn of(turns: &[Turn], gyro: &Affine<f64>) -> Self {
        let half = cofactor(&gyro.matrix) * 0.5;
        let (mut sum, mut fastest) = (Vector3::zeros(), 0.0_f64);
        for piece in turns.iter().flat_map(Turn::pieces) {
            let turned = piece.rotation(&gyro.matrix, &gyro.offset, &half);
            sum += turned;
            fastest = fastest.max(turned.norm() / piece.duration);
        }
        Self {
            angle: sum.norm(),
            axis: sum.try_normalize(0.0).unwrap_or_else(Vector3::zeros),
            fastest,
        }
    }

    /// Number of turns.
    pub fn turns(&self) -> f64 {
        self.angle / std::f64::consts::TAU
    }
}

/// The turn over `pieces` under the calibration `gyro`. `each` is called with the index of each piece, and with the matrix that takes its rotation vector
/// into the frame after the turn.
fn integrate(
    pieces: impl DoubleEndedIterator<Item = Piece> + ExactSizeIterator,
    gyro: &Affine<f64>,
    mut each: impl FnMut(usize, &Matrix3<f64>),
) -> Turned {
    let (c, o) = (&gyro.matrix, &gyro.offset);
    let half = cofactor(c) * 0.5;
    let mut rotation = Matrix3::identity();
    let mut by = [Matrix3::zeros(); 4];
    // Backwards: the product of the later pieces transforms each piece into the frame at the end.
    for (index, piece) in pieces.enumerate().rev() {
        let phi = piece.rotation(c, o, &half);
        let (turn, right) = exponential(&phi);
        let into = rotation * right;
        for (k, by) in by.iter_mut().take(3).enumerate() {
            *by += into * piece.integral[k];
        }
        by[3] += into * piece.duration;
        each(index, &into);
        rotation *= turn.transpose();
    }
    Turned { rotation, by }
}

/// If calibrations differ by less than this turn, rad, the rotations of one follow from those of the other to first order. The neglected term is half
/// its square, 5e-9 rad; the best gyros and accelerometers show 1e-5.
const NEAR: f64 = 1e-4;

/// Rotations of turns as [`integrate`] gives them, at one calibration.
#[derive(Clone)]
struct Reference {
    gyro: Affine<f64>,
    turned: Vec<Turned>,
}

/// The rotations of turns under calibrations that a fit tries one after the other. After the first few these are near each other, and are not
/// integrated again: integrating took 80 % of the time of a fit of 36 turns with its held-out refits.
#[derive(Default, Clone)]
pub(crate) struct Rotations {
    pieces: Vec<Vec<Piece>>,
    reference: RefCell<Option<Reference>>,
}

impl Rotations {
    /// The rotations of `turns`.
    pub(crate) fn new(turns: &[Turn]) -> Self {
        Self {
            pieces: turns.iter().map(|turn| turn.pieces().collect()).collect(),
            reference: RefCell::new(None),
        }
    }

    /// Each turn under the calibration `gyro`, raw to rad/s.
    pub(crate) fn at(&self, gyro: &Affine<f64>) -> Vec<Turned> {
        let mut reference = self.reference.borrow_mut();
        let near = reference.as_ref().and_then(|reference| {
            let (c, o) = (
                gyro.matrix - reference.gyro.matrix,
                gyro.offset - reference.gyro.offset,
            );
            let moved = reference.turned.iter().map(|Turned { rotation, by }| {
                let by_c: Vector3<f64> = (0..3).map(|k| by[k] * c.column(k)).sum();
                let more = by_c + by[3] * o;
                let near = more.norm() <= NEAR;
                near.then(|| Turned {
                    rotation: exponential(&-more).0 * rotation,
                    by: *by,
                })
            });
            moved.collect::<Option<Vec<_>>>()
        });
        near.unwrap_or_else(|| {
            let whole = |pieces: &Vec<Piece>| integrate(pieces.iter().copied(), gyro, |_, _| ());
            let turned: Vec<_> = self.pieces.iter().map(whole).collect();
            *reference = Some(Reference {
                gyro: *gyro,
                turned: turned.clone(),
            });
            turned
        })
    }
}

/// The error of the direction of gravity after a turn: the rotation from the direction that a calibration predicts to the measured one. About an axis
/// across gravity it is positive if the gyro turns too far: the turn by the gyro minus the true one.
#[derive(Debug, Clone, Copy)]
pub struct TurnError {
    /// Transforms a direction from the body frame before the turn into that after it.
    pub rotation: Matrix3<f64>,
    /// Directions of the two components of the error, across the measured direction, body frame after the turn.
    pub sides: [Vector3<f64>; 2],
    /// The two components, rad, and their derivatives by the gyro; those by the accelerometer are [`Self::by_accel`].
    pub block: Block<2>,
    /// Derivatives of each component by the force before and after the turn, rad/(m/s²).
    pub by_force: [[Vector3<f64>; 2]; 2],
}

impl TurnError {
    /// Of a turn whose rotation is known.
    pub(crate) fn of(turn: &Turn, turned: &Turned) -> Self {
        let (before, measured) = (turn.before.normalize(), turn.after.normalize());
        let rotation = turned.rotation;
        let error = between(&(rotation * before), &measured);
        let sides = across(&measured);
        let by_gyro = sides.map(|side| {
            let slopes = turned.by.map(|by| by.tr_mul(&side));
            SVector::<f64, 12>::from_fn(|k, _| match place(k) {
                (row, Some(column)) => slopes[column][row],
                (row, None) => slopes[3][row],
            })
            .transpose()
        });
        Self {
            rotation,
            sides,
            block: Block {
                residual: SVector::from(sides.map(|side| side.dot(&error))),
                by: SMatrix::from_rows(&by_gyro),
            },
            by_force: sides.map(|side| by_forces(turn, &rotation, &side)),
        }
    }

    /// Under the calibration `gyro`, raw to rad/s.
    pub fn at(turn: &Turn, gyro: &Affine<f64>) -> Self {
        Self::of(turn, &Turned::at(turn, gyro))
    }

    /// The same with the derivatives of both components by the rotation vector of each increment, rad/rad, body frame.
    pub fn with_increments(turn: &Turn, gyro: &Affine<f64>) -> (Self, Vec<[Vector3<f64>; 2]>) {
        let (turned, into) = Turned::with_increments(turn, gyro);
        let error = Self::of(turn, &turned);
        let by = into.iter();
        let by = by.map(|into| error.sides.map(|side| into.tr_mul(&side)));
        (error, by.collect())
    }

    /// The error as a rotation vector in the body frame after the turn, rad.
    pub fn vector(&self) -> Vector3<f64> {
        let [a, b] = self.sides;
        a * self.block.residual[0] + b * self.block.residual[1]
    }

    /// Derivatives of both components by the accelerometer whose readings before and after the turn are `raw`.
    pub fn by_accel(&self, raw: &[Vector3<f64>; 2]) -> [ByTriad; 2] {
        self.by_force
            .map(|[before, after]| slope(&before, &raw[0]) + slope(&after, &raw[1]))
    }

    /// Derivatives of both components by the Earth's level rate, whose two directions `level` are known in the body frame after a turn of `duration_s`.
    pub fn by_level(&self, level: &[Vector3<f64>; 2], duration_s: f64) -> Matrix2<f64> {
        Matrix2::from_fn(|k, l| -duration_s * self.sides[k].dot(&level[l]))
    }
}

/// Derivatives of the component `e` of the direction error of a turn by the force before and after it; `rotation` transforms a direction from the
/// body frame before into that after. Only the part of a force error across a direction moves the direction.
fn by_forces(turn: &Turn, rotation: &Matrix3<f64>, e: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let side = e.cross(&turn.after.normalize());
    let ends = [(turn.before, -rotation.tr_mul(&side)), (turn.after, side)];
    ends.map(|(force, side)| {
        let up = force.normalize();
        (side - up * up.dot(&side)) / force.norm()
    })
}

/// Rotation vector that turns the unit vector `a` into `b` the shortest way.
fn between(a: &Vector3<f64>, b: &Vector3<f64>) -> Vector3<f64> {
    let axis = a.cross(b);
    let sin = axis.norm();
    let angle = sin.atan2(a.dot(b));
    if sin > 0.0 {
        axis * (angle / sin)
    } else {
        axis
    }
}

/// The rotation vector by which a turn errs, in the body frame after it: `rotation` minus the shortest turn from the unit vector `before` to `after`.
pub(super) fn attitude_error(
    rotation: &Matrix3<f64>,
    before: &Vector3<f64>,
    after: &Vector3<f64>,
) -> Vector3<f64> {
    let shortest = Rotation3::from_scaled_axis(between(before, after));
    let error = Rotation3::from_matrix_unchecked(*rotation) * shortest.inverse();
    // Directions turn in the body the other way than the body does.
    -UnitQuaternion::from_rotation_matrix(&error).scaled_axis()
}

/// Two unit vectors across `w`.
pub(crate) fn across(w: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let pick = w.iamin();
    let e = w.cross(&Vector3::ith(pick, 1.0)).normalize();
    [e, w.cross(&e)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rotation by the rate `ω(t)` in ten thousand small steps, which need no correction.
    fn brute_force(rate: impl Fn(f64) -> Vector3<f64>, from: f64, to: f64) -> Matrix3<f64> {
        let steps = 10_000;
        let h = (to - from) / f64::from(steps);
        (0..steps).fold(Matrix3::identity(), |r, k| {
            let middle = from + (f64::from(k) + 0.5) * h;
            r * nalgebra::Rotation3::new(rate(middle) * h).matrix()
        })
    }

    #[test]
    fn a_direction_is_carried_along_as_by_ten_thousand_small_turns() {
        let rate = |t: f64| Vector3::new(3.0 * (5.0 * t).sin(), 4.0 * (3.0 * t).cos(), 2.0 - t);
        let c = Matrix3::new(
            0.02, 0.001, -0.002, 0.0005, -0.018, 0.001, 0.0, 0.002, 0.022,
        );
        let o = Vector3::new(-0.5, 0.3, 0.1);
        let to_raw = |w: Vector3<f64>| c.try_inverse().unwrap() * (w - o);
        // The rate is linear between samples, as the condenser assumes: 10 ms pieces of 1 ms samples.
        let mut increments = Vec::new();
        let sample = |k: usize| rate(1e-3 * k as f64);
        for piece in 0..100 {
            let mut open = Increment::EMPTY;
            let (mut a, mut sum, mut b) =
                (Vector3::zeros(), Vector3::zeros(), Vector3::<f64>::zeros());
            for k in 10 * piece..10 * piece + 10 {
                let (u0, u1) = (to_raw(sample(k)), to_raw(sample(k + 1)));
                let step = (u0 + u1) * 0.5e-3;
                b += a.cross(&step) + u0.cross(&u1) * (1e-6 / 6.0);
                sum += a * 1e-3 + (u0 * 2.0 + u1) * (1e-6 / 6.0);
                a += step;
            }
            open.duration_s = 0.01;
            open.integral = a.into();
            open.coning = b.into();
            open.moment = (sum * 2.0 - a * 0.01).into();
            increments.push(open);
        }
        let before = Vector3::new(0.1, -0.7, 0.7).normalize();
        let turn = Turn {
            from: 0,
            to: 1,
            steps: [0, 1],
            increments: &increments,
            before,
            after: brute_force(rate, 0.0, 1.0).transpose() * before,
            raw: [Vector3::zeros(); 2],
            direction_variance: 0.0,
            earth_variance: 0.0,
            integral_variance: 0.0,
            duration_s: 1.0,
        };
        let gyro = Affine {
            matrix: c,
            offset: o,
        };
        let error = TurnError::at(&turn, &gyro).vector().norm();
        // 1 ms samples of a rate with a curvature of 75 rad/s³ err by 1e-3²/12 * 75 rad in a second.
        assert!(error < 1e-5, "{error:e} rad");
    }
}
