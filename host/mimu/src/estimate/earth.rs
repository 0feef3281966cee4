//! The Earth's rate, the only rate of a gyro at rest.
//!
//! Its vertical part depends on the latitude. The accelerometer shows the vertical, so this part is known and subtracted. Its level part depends on
//! the heading, which is unknown by hand. It is noise, independent from pose to pose, both in each reading at rest and in the direction of gravity
//! after a turn. Without this noise, 10 of 18 clean units of three grades, turned by hand, were not called clean: 0.003 deg/s is more than the noise
//! of a mean over 2.5 s of any gyro below 0.005 deg/s/√Hz.

use nalgebra::{Matrix3, Vector3};

use crate::observation::turn::across;

/// Rate of the Earth, rad/s (WGS 84).
pub const RATE: f64 = 7.292_115e-5;

/// The known part of the Earth's rate, and the variance of the rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Earth {
    /// About the vertical, up positive, rad/s; 0 if the latitude is unknown, and `earth_rate` is then an effect to be found.
    vertical: f64,
    /// Mean square of its error, rad²/s².
    vertical_error: f64,
    /// Mean square of the rate along each of two level directions, rad²/s².
    level: f64,
}

impl Earth {
    /// At a latitude in degrees. If it is unknown, the level part is the mean over a sphere.
    pub fn at(latitude_deg: Option<f64>) -> Self {
        let (sin, cos2) = latitude_deg.map_or((0.0, 2.0 / 3.0), |degrees| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            (sin, cos * cos)
        });
        Self {
            vertical: RATE * sin,
            vertical_error: match latitude_deg {
                Some(_) => 0.0,
                None => RATE * RATE / 3.0,
            },
            level: 0.5 * RATE * RATE * cos2,
        }
    }

    /// The known part of the rate, and the standard deviations of the rest, rad/s: z is the vertical, x and y are fixed to the ground in an unknown direction.
    pub fn on_the_ground(&self) -> [Vector3<f64>; 2] {
        let [level, up] = [self.level, self.vertical_error].map(f64::sqrt);
        [
            Vector3::new(0.0, 0.0, self.vertical),
            Vector3::new(level, level, up),
        ]
    }

    /// The known part of what a gyro at rest reads, rad/s, if the specific force points along `up` (body axes, any length).
    pub fn rate(&self, up: &Vector3<f64>) -> Vector3<f64> {
        unit(up).map_or_else(Vector3::zeros, |up| up * self.vertical)
    }

    /// The known rate about the vertical, rad/s, and the variance of the rest, rad²/s².
    pub fn about_vertical(&self) -> [f64; 2] {
        [self.vertical, self.vertical_error]
    }

    /// Variance of the unknown part on each axis, rad²/s².
    pub fn variance(&self, up: &Vector3<f64>) -> Vector3<f64> {
        let level = |up: Vector3<f64>| up.map(|u| self.level * (1.0 - u * u));
        unit(up).map_or_else(|| Vector3::repeat(self.level), level)
    }

    /// Variance of the vertical part on each axis, rad²/s²; zero if the latitude is known.
    pub fn vertical_variance(&self, up: &Vector3<f64>) -> Vector3<f64> {
        unit(up).map_or_else(Vector3::zeros, |up| up.map(|u| self.vertical_error * u * u))
    }

    /// Standard deviations of the unknown part of the rate, as columns in body axes: two across `up`, and one along it. If `up` is unknown, the rate has
    /// any direction.
    pub fn unknown(&self, up: &Vector3<f64>) -> Matrix3<f64> {
        match unit(up) {
            Some(up) => {
                let [a, b] = across(&up).map(|side| side * self.level.sqrt());
                Matrix3::from_columns(&[a, b, up * self.vertical_error.sqrt()])
            }
            None => Matrix3::from_diagonal_element(RATE / 3f64.sqrt()),
        }
    }

    /// Variance of each of the two components of gravity's direction after a turn of this duration, rad².
    pub fn of_direction(&self, duration_s: f64) -> f64 {
        self.level * duration_s * duration_s
    }
}

/// `None` without a reading of the accelerometer.
fn unit(up: &Vector3<f64>) -> Option<Vector3<f64>> {
    up.try_normalize(0.0).filter(|up| up.norm().is_finite())
}

/// Two poses count as one if the angle between their verticals is less than this, rad.
const ONE_POSE: f64 = 0.05;

/// For each of `ups` the first that is the same pose. In one pose the heading may be the same, and then so is the Earth's rate that a gyro reads.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ground_turns_up_at_the_north_pole_level_at_the_equator_and_more_up_than_level_at_60_deg()
    {
        // The Earth turns once in a sidereal day, 86164.0905 s. At 60 deg its axis stands 60 deg above the horizon: the legs are half and √3/2.
        let day = std::f64::consts::TAU / 86_164.090_5;
        for (latitude_deg, up, level) in [
            (90.0, day, 0.0),
            (0.0, 0.0, day),
            (60.0, 0.75f64.sqrt() * day, 0.5 * day),
            (-60.0, -0.75f64.sqrt() * day, 0.5 * day),
            (-90.0, -day, 0.0),
        ] {
            let earth = Earth::at(Some(latitude_deg));
            assert!(
                (earth.vertical - up).abs() < 1e-6 * day,
                "{latitude_deg}: {earth:?}"
            );
            let mean_square = 0.5 * level * level;
            assert!(
                (earth.level - mean_square).abs() < 1e-6 * day * day,
                "{latitude_deg}: {earth:?}"
            );
            assert_eq!(earth.vertical_error, 0.0);
        }
    }

    #[test]
    fn without_a_latitude_the_mean_squares_of_the_components_add_up_to_that_of_the_rate() {
        let Earth {
            vertical,
            vertical_error,
            level,
        } = Earth::at(None);
        assert_eq!(vertical, 0.0);
        assert!((vertical_error + 2.0 * level - RATE * RATE).abs() < 1e-9 * RATE * RATE);
    }
}
