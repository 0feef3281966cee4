//! Sensitive directions of a triad.

use nalgebra::{Matrix3, RealField, Vector3, convert};

/// Sensitive directions of the sensors of a triad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Directions<T: RealField> {
    /// D: sensitive directions in the body frame, rows of the forward matrix at unit length.
    pub sensed: Matrix3<T>,
    /// R, its inverse: converts errors along the sensors to errors in the body frame.
    pub to_body: Matrix3<T>,
}

/// Largest allowed difference of R D from 1. In single precision R has entries up to a thousand if sensors are as close as
/// [`LEAST_VOLUME`](crate::compensation::LEAST_VOLUME) allows, each with a relative error of 1e-7.
const OFF_INVERSE: f64 = 1e-3;

impl<T: RealField + Copy> Directions<T> {
    /// Whether R is the inverse of D; false for NaN.
    pub fn are_inverse(&self) -> bool {
        let product = self.to_body * self.sensed;
        let one = |i: usize, j: usize| match i == j {
            true => T::one(),
            false => T::zero(),
        };
        let most: T = convert(OFF_INVERSE);
        let off = product - Matrix3::from_fn(one);
        off.iter().all(|off| off.abs() <= most)
    }

    /// Directions of a triad with this C, raw to SI; `None` if it is singular. Computed in double precision for any T, on the PC: the
    /// device receives the result and computes no inverse.
    pub fn of(inverse: &Matrix3<f64>) -> Option<Self> {
        let forward = inverse.try_inverse()?;
        let scale = Vector3::from_fn(|i, _| forward.row(i).norm());
        let positive = |s: &f64| *s > 0.0 && s.is_finite();
        scale.iter().all(positive).then(|| Self {
            // Adding zero turns -0 into +0: the sign of a zero in an inverse is chance, but the bytes are hashed.
            sensed: Matrix3::from_fn(|i, j| convert(forward[(i, j)] / scale[i] + 0.0)),
            to_body: (inverse * Matrix3::from_diagonal(&scale)).map(|r| convert(r + 0.0)),
        })
    }
}
