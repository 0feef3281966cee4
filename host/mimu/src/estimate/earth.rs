//! The Earth's rate on a gyro that nothing else turns.
//!
//! Its part about the vertical goes by the latitude, and the accelerometer says where up is: it is known, and taken off. Its part across
//! goes by the heading, which hands do not know: it is noise, independent from pose to pose, in each reading at rest, and in where
//! gravity stands after a turn. Left out, 10 of 18 clean units of three grades in somebody's hands were not called clean: 0.003 deg/s is more
//! than the noise of a mean over 2.5 s of any gyro below 0.005 deg/s/√Hz.

use nalgebra::Vector3;

/// Rate of the Earth, rad/s (WGS 84).
pub const RATE: f64 = 7.292_115e-5;

/// What is known of the Earth's rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Earth {
    /// About the vertical, up positive, rad/s; 0 where the latitude is not known, and `earth_rate` is then an effect to be found.
    vertical: f64,
    /// Mean square of the rate along each of two level directions, rad²/s².
    level: f64,
}

impl Earth {
    /// At a latitude in degrees. Where it is not known, the level part is that of the mean of a sphere.
    pub fn at(latitude_deg: Option<f64>) -> Self {
        let (sin, cos2) = latitude_deg.map_or((0.0, 2.0 / 3.0), |degrees| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            (sin, cos * cos)
        });
        Self {
            vertical: RATE * sin,
            level: 0.5 * RATE * RATE * cos2,
        }
    }

    /// What a gyro at rest reads where gravity pushes along `up` (body axes, any length), rad/s: the part that is known.
    pub fn rate(&self, up: &Vector3<f64>) -> Vector3<f64> {
        unit(up).map_or_else(Vector3::zeros, |up| up * self.vertical)
    }

    /// Variance of the part that is not, of each axis, rad²/s².
    pub fn variance(&self, up: &Vector3<f64>) -> Vector3<f64> {
        let level = |up: Vector3<f64>| up.map(|u| self.level * (1.0 - u * u));
        unit(up).map_or_else(|| Vector3::repeat(self.level), level)
    }

    /// Variance of where gravity stands after a turn of so long, of each of two components, rad².
    pub fn of_direction(&self, duration_s: f64) -> f64 {
        self.level * duration_s * duration_s
    }
}

/// `None` where the accelerometer says nothing.
fn unit(up: &Vector3<f64>) -> Option<Vector3<f64>> {
    up.try_normalize(0.0).filter(|up| up.norm().is_finite())
}

/// Two poses are one while their verticals are less than this apart, rad.
const ONE_POSE: f64 = 0.05;

/// For each of `ups` the first that is the same pose: in it the heading may be the same, and what a gyro reads of the Earth with it.
pub fn poses(ups: &[Vector3<f64>]) -> Vec<usize> {
    let mut leaders: Vec<usize> = Vec::new();
    let mut out = Vec::with_capacity(ups.len());
    for (i, up) in ups.iter().enumerate() {
        let near = |k: &&usize| ups[**k].angle(up) < ONE_POSE;
        let leader = leaders.iter().find(near).copied();
        out.push(leader.unwrap_or_else(|| {
            leaders.push(i);
            i
        }));
    }
    out
}
