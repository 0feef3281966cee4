//! The place of the bench on the Earth: gravity and the Earth's rotation.

use crate::rotation::Vector;

/// Rate of the Earth against inertial space, rad/s (WGS 84).
pub const EARTH_RATE: f64 = 7.292_115e-5;

/// Place of the bench.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Geodetic latitude, north positive, degrees.
    pub latitude_deg: f64,
    /// Gravity, m/s², reduced by the Earth's rotation. It points down along the level z axis.
    pub gravity: f64,
    /// Rate of the Earth, rad/s: [`EARTH_RATE`], or zero for studies without it.
    pub rotation: f64,
}

impl Place {
    /// Place at a latitude in degrees, with normal gravity on the ellipsoid unless `gravity_mps2` is given.
    pub fn new(latitude_deg: f64, gravity_mps2: Option<f64>) -> Self {
        Self {
            latitude_deg,
            gravity: gravity_mps2.unwrap_or_else(|| normal_gravity(latitude_deg.to_radians())),
            rotation: EARTH_RATE,
        }
    }

    /// Rate of the ground, level axes (east, north, up), rad/s.
    pub fn earth_rate(&self) -> Vector {
        let (s, c) = self.latitude_deg.to_radians().sin_cos();
        [0.0, self.rotation * c, self.rotation * s]
    }

    /// Specific force on a board at rest, level axes (east, north, up), m/s²: the reaction to gravity, up.
    pub fn force_at_rest(&self) -> Vector {
        [0.0, 0.0, self.gravity]
    }
}

/// Normal gravity on the WGS 84 ellipsoid, m/s², at a geodetic latitude in rad: Somigliana's closed form
/// (NIMA TR8350.2, 3rd edition, equation 4-1 and table 3.4).
pub fn normal_gravity(latitude: f64) -> f64 {
    let s2 = latitude.sin().powi(2);
    9.780_325_335_9 * (1.0 + 0.001_931_852_652_41 * s2) / (1.0 - 0.006_694_379_990_13 * s2).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_gravity_is_that_of_wgs_84_at_the_equator_and_the_pole() {
        // TR8350.2, table 3.4: normal gravity at the equator and at the pole.
        assert!((normal_gravity(0.0) - 9.780_325_335_9).abs() < 1e-10);
        assert!((normal_gravity(90f64.to_radians()) - 9.832_184_937_8).abs() < 1e-9);
    }

    #[test]
    fn the_ground_turns_north_at_the_equator_and_up_at_the_pole() {
        assert_eq!(Place::new(0.0, None).earth_rate(), [0.0, EARTH_RATE, 0.0]);
        let pole = Place::new(90.0, None).earth_rate();
        assert!(pole[1].abs() < 1e-20 && pole[2] == EARTH_RATE);
        assert!(Place::new(-30.0, None).earth_rate()[2] < 0.0);
    }
}
