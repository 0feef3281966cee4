//! Sensitive directions of a triad.

use nalgebra::{Matrix3, RealField, Vector3, convert};

/// Where the sensors of a triad look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Directions<T: RealField> {
    /// D: sensitive directions in the body frame, rows of the forward matrix at unit length.
    pub sensed: Matrix3<T>,
    /// R, its inverse: errors along the sensors into errors in the body frame.
    pub to_body: Matrix3<T>,
}

/// Most that R D may differ from 1 by: R of single precision has entries up to a thousand where sensors are as near to each other as
/// [`LEAST_VOLUME`](crate::compensation::LEAST_VOLUME) lets them, each within 1e-7 of itself.
const OFF_INVERSE: f64 = 1e-3;

impl<T: RealField + Copy> Directions<T> {
    /// Whether R is the inverse of D. Numbers that are none are not.
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

    /// Of a triad with this C, raw to SI; `None` if it is singular. In double precision whatever T is, and for the PC: no inverse is
    /// taken on the device, which is sent this.
    pub fn of(inverse: &Matrix3<f64>) -> Option<Self> {
        let forward = inverse.try_inverse()?;
        let scale = Vector3::from_fn(|i, _| forward.row(i).norm());
        let positive = |s: &f64| *s > 0.0 && s.is_finite();
        scale.iter().all(positive).then(|| Self {
            // Zero added: of the two zeros there is one, as whether an inverse has the other is chance, and bytes are hashed.
            sensed: Matrix3::from_fn(|i, j| convert(forward[(i, j)] / scale[i] + 0.0)),
            to_body: (inverse * Matrix3::from_diagonal(&scale)).map(|r| convert(r + 0.0)),
        })
    }
}
