//! The magnetic field on the bench: the Earth's, and dipoles of steel and magnets near it.

use serde::{Deserialize, Serialize};

use crate::refusal::{Refusal, within};
use crate::rotation::{Vector, add, dot, norm, scale};

/// `[field]` of a rig file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FieldTruth {
    /// Size of the Earth's field, µT.
    pub size_ut: f64,
    /// Angle at which it points below the level plane, degrees.
    pub dip_deg: f64,
    /// Direction of its level part, from north to east, degrees.
    pub heading_deg: f64,
    /// Dipoles.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub magnet: Vec<MagnetTruth>,
}

/// `[[field.magnet]]`: a magnet, or steel that the Earth's field magnetises, as a dipole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MagnetTruth {
    /// Its position relative to the place on the desk around which a person puts the board down, or to the intersection of a table's axes, level
    /// axes (east, north, up), m.
    pub at_m: Vector,
    /// Its dipole moment, level axes, A m².
    pub moment_am2: Vector,
    /// When it is put there, s of the recording.
    #[serde(default)]
    pub from_s: f64,
    /// When it is taken away, s.
    #[serde(default = "never")]
    pub to_s: f64,
}

fn never() -> f64 {
    f64::INFINITY
}

/// µ0 / 4π in µT m³ / (A m²).
const PERMEABILITY: f64 = 0.1;

/// Distance within which the field of a dipole grows no further, m: a magnet has a size.
const NEAREST_M: f64 = 0.01;

impl Default for FieldTruth {
    fn default() -> Self {
        Self {
            size_ut: 48.0,
            dip_deg: 65.0,
            heading_deg: 3.0,
            magnet: Vec::new(),
        }
    }
}

impl FieldTruth {
    /// The field at a position (m) at a time (s), level axes (east, north, up), µT.
    pub fn at(&self, position: Vector, t_s: f64) -> Vector {
        let (down, level) = self.dip_deg.to_radians().sin_cos();
        let (east, north) = self.heading_deg.to_radians().sin_cos();
        let earth = scale(self.size_ut, [level * east, level * north, -down]);
        let present = self
            .magnet
            .iter()
            .filter(|m| t_s >= m.from_s && t_s < m.to_s);
        present.fold(earth, |sum, magnet| add(sum, magnet.field(position)))
    }

    /// Refuses impossible values.
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        within("field.size_ut", &[self.size_ut], [0.0, 1e6])?;
        within("field.dip_deg", &[self.dip_deg], [-90.0, 90.0])?;
        within("field.heading_deg", &[self.heading_deg], [-360.0, 360.0])?;
        for (i, magnet) in self.magnet.iter().enumerate() {
            let at = |key: &str| format!("field.magnet.{i}.{key}");
            within(&at("at_m"), &magnet.at_m, [-100.0, 100.0])?;
            within(&at("moment_am2"), &magnet.moment_am2, [-1e6, 1e6])?;
            within(&at("from_s"), &[magnet.from_s], [0.0, f64::INFINITY])?;
            within(&at("to_s"), &[magnet.to_s], [0.0, f64::INFINITY])?;
        }
        Ok(())
    }
}

impl MagnetTruth {
    /// Its field at a position, µT: (3 (m · r) r / r² - m) / r³.
    fn field(&self, position: Vector) -> Vector {
        let away = add(position, scale(-1.0, self.at_m));
        let distance = norm(away).max(NEAREST_M);
        let along = 3.0 * dot(self.moment_am2, away) / (distance * distance);
        let sum = add(scale(along, away), scale(-1.0, self.moment_am2));
        scale(PERMEABILITY / distance.powi(3), sum)
    }
}
