//! What happened to a unit before a session: power-ons, ageing, a shock, and a cause that nobody records.
//!
//! The affine model of a session is that of the rig file, changed by each of these. A pattern of independent normal numbers for scale factors, directions and
//! biases, times the sizes of the file, is drawn: of a power-on by the session's seed, of the others by the unit's, so that all sessions share it.

use serde::{Deserialize, Serialize};

use crate::random::Random;
use crate::refusal::{Refusal, within};
use crate::rotation::{Vector, add, cross, norm, scale};
use crate::sensor::TriadTruth;

/// Sizes of a change, standard deviations over the axes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ChangeSizes {
    /// Scale factors of the gyros, ppm.
    pub gyro_scale_ppm: f64,
    /// Directions of the gyros, mrad.
    pub gyro_angle_mrad: f64,
    /// Biases of the gyros, deg/s.
    pub gyro_bias_dps: f64,
    /// Scale factors of the accelerometers, ppm.
    pub accel_scale_ppm: f64,
    /// Directions of the accelerometers, mrad.
    pub accel_angle_mrad: f64,
    /// Biases of the accelerometers, mg.
    pub accel_bias_mg: f64,
}

/// `[history]`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct History {
    /// Number of the session, from 0.
    pub session: u32,
    /// Seed of the patterns that belong to the unit.
    pub unit_seed: u64,
    /// Change of each power-on.
    pub power_on: ChangeSizes,
    /// Change from each session to the next, always in the same direction.
    pub ageing: ChangeSizes,
    /// Change with a cause that is common to all axes and another number in each session, as an unrecorded temperature is.
    pub common: ChangeSizes,
    /// Change by a shock.
    pub shock: ChangeSizes,
    /// The first session after the shock; 0: the shock was before all of them.
    pub shock_before: u32,
}

impl ChangeSizes {
    fn check(&self, path: &str) -> Result<(), Refusal> {
        for (key, value, most) in [
            ("gyro_scale_ppm", self.gyro_scale_ppm, 2e5),
            ("gyro_angle_mrad", self.gyro_angle_mrad, 200.0),
            ("gyro_bias_dps", self.gyro_bias_dps, 1e3),
            ("accel_scale_ppm", self.accel_scale_ppm, 2e5),
            ("accel_angle_mrad", self.accel_angle_mrad, 200.0),
            ("accel_bias_mg", self.accel_bias_mg, 1e4),
        ] {
            within(&format!("history.{path}.{key}"), &[value], [0.0, most])?;
        }
        Ok(())
    }

    /// Relative scale, rad, and SI of a triad.
    fn of(&self, gyro: bool) -> [f64; 3] {
        match gyro {
            true => [
                1e-6 * self.gyro_scale_ppm,
                1e-3 * self.gyro_angle_mrad,
                self.gyro_bias_dps.to_radians(),
            ],
            false => [
                1e-6 * self.accel_scale_ppm,
                1e-3 * self.accel_angle_mrad,
                // Standard gravity.
                9.806_65e-3 * self.accel_bias_mg,
            ],
        }
    }
}

impl History {
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        self.power_on.check("power_on")?;
        self.ageing.check("ageing")?;
        self.common.check("common")?;
        self.shock.check("shock")
    }

    /// Whether nothing happened.
    pub fn is_empty(&self) -> bool {
        [self.power_on, self.ageing, self.common, self.shock] == [ChangeSizes::default(); 4]
    }

    /// Changes a triad as of session `seed`.
    pub(crate) fn apply(&self, triad: &mut TriadTruth, gyro: bool, seed: u64) {
        let name = if gyro { "gyro" } else { "accel" };
        let session = f64::from(self.session);
        let shocked = f64::from(u8::from(self.session >= self.shock_before));
        let cause = Random::new(seed, "history common cause").normal();
        for (what, sizes, of_seed, times) in [
            ("power-on", &self.power_on, seed, 1.0),
            ("ageing", &self.ageing, self.unit_seed, session),
            ("common", &self.common, self.unit_seed, cause),
            ("shock", &self.shock, self.unit_seed, shocked),
        ] {
            let mut random = Random::new(of_seed, &format!("history {name} {what}"));
            let [relative, angle, bias] = sizes.of(gyro);
            for axis in &mut triad.axes {
                let along = axis.direction;
                let across = across(along);
                let numbers: [f64; 4] = std::array::from_fn(|_| times * random.normal());
                axis.null += bias * numbers[3] * axis.sensitivity;
                axis.sensitivity *= 1.0 + relative * numbers[0];
                let turned = add(
                    along,
                    add(
                        scale(angle * numbers[1], across[0]),
                        scale(angle * numbers[2], across[1]),
                    ),
                );
                axis.direction = scale(1.0 / norm(turned), turned);
            }
        }
    }
}

/// Two directions at right angles to `along` and to each other.
fn across(along: Vector) -> [Vector; 2] {
    let least = if along[0].abs() < 0.6 { 0 } else { 1 };
    let mut other = [0.0; 3];
    other[least] = 1.0;
    let first = cross(along, other);
    let first = scale(1.0 / norm(first), first);
    [first, cross(along, first)]
}
