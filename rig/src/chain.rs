//! A chain of turning frames: rate, angular acceleration and specific force at its end, by exact differentiation.

use std::ops::{Add, Mul};

use crate::motion::Motion;
use crate::place::Place;
use crate::rotation::{Rotation, Vector, add, cross, scale};

/// A quantity with its first two time derivatives, a second-order jet. Its arithmetic follows the chain rule.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Jet {
    /// The quantity.
    pub value: f64,
    /// Its first time derivative, 1/s.
    pub rate: f64,
    /// Its second time derivative, 1/s².
    pub acceleration: f64,
}

impl Jet {
    /// A constant.
    pub fn constant(value: f64) -> Self {
        Self {
            value,
            ..Self::default()
        }
    }

    /// A function of the quantity, from the function's value and first two derivatives at this point.
    pub fn through(self, [f, df, ddf]: [f64; 3]) -> Self {
        Self {
            value: f,
            rate: df * self.rate,
            acceleration: df * self.acceleration + ddf * self.rate * self.rate,
        }
    }

    /// Sine of an angle.
    pub fn sin(self) -> Self {
        let (s, c) = self.value.sin_cos();
        self.through([s, c, -s])
    }

    /// Product with a number.
    pub fn times(self, factor: f64) -> Self {
        Self {
            value: factor * self.value,
            rate: factor * self.rate,
            acceleration: factor * self.acceleration,
        }
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            rate: self.rate + other.rate,
            acceleration: self.acceleration + other.acceleration,
        }
    }
}

impl Mul for Jet {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            rate: self.rate * other.value + self.value * other.rate,
            acceleration: self.acceleration * other.value
                + 2.0 * self.rate * other.rate
                + self.value * other.acceleration,
        }
    }
}

/// A frame that turns relative to the ground, built from the ground up: each link turns the frame about one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// This frame's axes into level axes (east, north, up).
    pub attitude: Rotation,
    /// Angular rate against inertial space, this frame's axes, rad/s.
    pub rate: Vector,
    /// Its time derivative in this frame's axes, rad/s².
    pub angular_acceleration: Vector,
}

impl Frame {
    /// The ground: level axes, turning with the Earth.
    pub fn ground(place: &Place) -> Self {
        Self {
            attitude: Rotation::NONE,
            rate: place.earth_rate(),
            angular_acceleration: [0.0; 3],
        }
    }

    /// A frame fixed in this one: `rotation` converts components along the new axes into those along these.
    pub fn fixed(self, rotation: Rotation) -> Self {
        let back = rotation.inverse();
        Self {
            attitude: self.attitude * rotation,
            rate: back.turn(self.rate),
            angular_acceleration: back.turn(self.angular_acceleration),
        }
    }

    /// A frame that turns by `angle` (rad) about `axis`, a unit vector of this frame.
    pub fn about(self, axis: Vector, angle: Jet) -> Self {
        let carried = self.fixed(Rotation::about(axis, angle.value));
        let spin = scale(angle.rate, axis);
        // d(Rᵀω)/dt = Rᵀ dω/dt - spin x Rᵀω: the components change because their axes turn.
        Self {
            attitude: carried.attitude,
            rate: add(carried.rate, spin),
            angular_acceleration: add(
                add(carried.angular_acceleration, cross(carried.rate, spin)),
                scale(angle.acceleration, axis),
            ),
        }
    }

    /// As [`Frame::about`], about one of this frame's axes: 0 is x, 1 y, 2 z. Several times faster.
    pub fn about_own<const AXIS: usize>(self, angle: Jet) -> Self {
        let (j, k) = ((AXIS + 1) % 3, (AXIS + 2) % 3);
        let (sh, ch) = (0.5 * angle.value).sin_cos();
        let (s, c) = (2.0 * sh * ch, (ch - sh) * (ch + sh));
        let back = |v: Vector| {
            let mut turned = v;
            turned[j] = c * v[j] + s * v[k];
            turned[k] = c * v[k] - s * v[j];
            turned
        };
        let mut rate = back(self.rate);
        let mut angular_acceleration = back(self.angular_acceleration);
        angular_acceleration[j] += rate[k] * angle.rate;
        angular_acceleration[k] -= rate[j] * angle.rate;
        angular_acceleration[AXIS] += angle.acceleration;
        rate[AXIS] += angle.rate;
        Self {
            attitude: self.attitude.then_about_own::<AXIS>(sh, ch),
            rate,
            angular_acceleration,
        }
    }

    /// Motion of a board in this frame, at the lever `lever` (m, this frame's axes) from a pivot that moves relative to the ground (m, level axes).
    ///
    /// The rate against inertial space includes the lever's Coriolis acceleration and the change of the Earth's centrifugal acceleration along it.
    /// The gradient of gravity is neglected, 3e-6 m/s² per metre.
    pub fn motion(self, t_s: f64, place: &Place, lever: Vector, pivot: [Jet; 3]) -> Motion {
        let velocity = pivot.map(|p| p.rate);
        let acceleration = pivot.map(|p| p.acceleration);
        let coriolis = scale(2.0, cross(place.earth_rate(), velocity));
        let level = add(place.force_at_rest(), add(acceleration, coriolis));
        let euler = cross(self.angular_acceleration, lever);
        let centripetal = cross(self.rate, cross(self.rate, lever));
        Motion {
            t_s,
            attitude: self.attitude,
            position: add(pivot.map(|p| p.value), self.attitude.turn(lever)),
            rate: self.rate,
            angular_acceleration: self.angular_acceleration,
            force: add(self.attitude.inverse().turn(level), add(euler, centripetal)),
        }
    }
}
