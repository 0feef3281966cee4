//! Attitudes as unit quaternions, derived from kinematics for the rig alone.

use std::ops::Mul;

/// Three numbers along x, y, z.
pub type Vector = [f64; 3];

/// Scalar product.
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
pub fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Sum.
pub fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Product with a number.
pub fn scale(s: f64, a: Vector) -> Vector {
    a.map(|x| s * x)
}

/// Unit vector along `v`. `None` if it has no length or is not finite.
pub fn direction(v: Vector) -> Option<Vector> {
    let largest = v.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
    if largest == 0.0 || !v.iter().all(|x| x.is_finite()) {
        return None;
    }
    // Divided by the largest first, because squares of 1e200 are infinite.
    let v = v.map(|x| x / largest);
    Some(scale(1.0 / norm(v), v))
}

/// Length.
pub fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// Unit quaternion w, x, y, z: converts the components of a vector in the first frame into those in the second. An attitude converts body into level
/// axes (east, north, up).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation([f64; 4]);

impl Rotation {
    /// No rotation.
    pub const NONE: Self = Self([1.0, 0.0, 0.0, 0.0]);

    /// By `angle` (rad, right-hand rule) about the `axis`, which need not have unit length.
    pub fn about(axis: Vector, angle: f64) -> Self {
        let length = norm(axis);
        if length == 0.0 {
            return Self::NONE;
        }
        let (s, c) = (0.5 * angle).sin_cos();
        let s = s / length;
        Self([c, s * axis[0], s * axis[1], s * axis[2]])
    }

    /// From four numbers, normalised. Four independent normal numbers give uniformly distributed attitudes.
    pub fn of(q: [f64; 4]) -> Self {
        let n = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        Self(q.map(|x| x / n))
    }

    /// The shortest rotation that turns the direction `from` into the direction `to`.
    pub fn between(from: Vector, to: Vector) -> Self {
        let (f, t) = (scale(1.0 / norm(from), from), scale(1.0 / norm(to), to));
        let cosine = dot(f, t);
        if cosine < -1.0 + 1e-12 {
            // Opposite directions: any perpendicular axis will do.
            let across = if f[0].abs() < 0.9 {
                cross(f, [1.0, 0.0, 0.0])
            } else {
                cross(f, [0.0, 1.0, 0.0])
            };
            return Self::about(across, std::f64::consts::PI);
        }
        let c = cross(f, t);
        Self::of([1.0 + cosine, c[0], c[1], c[2]])
    }

    /// The inverse rotation.
    pub fn inverse(self) -> Self {
        let [w, x, y, z] = self.0;
        Self([w, -x, -y, -z])
    }

    /// Components in the second frame of a vector given in the first.
    pub fn turn(self, v: Vector) -> Vector {
        let [w, x, y, z] = self.0;
        let q = [x, y, z];
        let t = scale(2.0, cross(q, v));
        add(add(v, scale(w, t)), cross(q, t))
    }

    /// Followed by a turn about the axis x (0), y (1) or z (2) of the frame that it starts from, given by sine and cosine of half the angle. Not
    /// normalised again: a dozen in a row stay within rounding.
    pub fn then_about_own<const AXIS: usize>(self, sine: f64, cosine: f64) -> Self {
        let [w, v @ ..] = self.0;
        let (j, k) = ((AXIS + 1) % 3, (AXIS + 2) % 3);
        let mut q = [w * cosine - v[AXIS] * sine, 0.0, 0.0, 0.0];
        q[1 + AXIS] = v[AXIS] * cosine + w * sine;
        q[1 + j] = v[j] * cosine + v[k] * sine;
        q[1 + k] = v[k] * cosine - v[j] * sine;
        Self(q)
    }

    /// By the rotation vector: its direction is the axis, its length the angle in rad.
    pub fn by(vector: Vector) -> Self {
        Self::about(vector, norm(vector))
    }

    /// Axis (unit length) and angle (0 to π).
    pub fn axis_angle(self) -> (Vector, f64) {
        let [w, x, y, z] = if self.0[0] < 0.0 {
            self.0.map(|q| -q)
        } else {
            self.0
        };
        let s = norm([x, y, z]);
        let axis = if s > 0.0 {
            scale(1.0 / s, [x, y, z])
        } else {
            [1.0, 0.0, 0.0]
        };
        (axis, 2.0 * s.atan2(w))
    }
}

impl Mul for Rotation {
    type Output = Self;
    /// `self` after `before`.
    fn mul(self, Self([w, x, y, z]): Self) -> Self {
        let [a, b, c, d] = self.0;
        Self::of([
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ])
    }
}
