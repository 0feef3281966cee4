//! The further triads of a body in a calibration file: each with its C and o as the first two, and how it stands to a reference triad.

use mimu_core::compensation::Affine;
use mimu_recording::{RawUnit, TriadName};
use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};

use crate::judgement::Judgement;

/// A triad of a body beyond the first gyro and accelerometer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)] // C: the letter of the formula, in the file as in the papers
pub struct BodyTriad {
    /// Its name, such as `mag` or `gyro2`.
    #[cfg_attr(feature = "schema", schemars(with = "String"))]
    pub triad: TriadName,
    /// The triad that rotation, delay and lever arm are against: `gyro` or `accel`.
    #[cfg_attr(feature = "schema", schemars(with = "String"))]
    pub reference: TriadName,
    /// `x = C u + o`.
    pub formula: String,
    /// `raw to SI`; of a magnetometer, raw to its unit.
    pub direction: String,
    /// Unit of u.
    #[cfg_attr(feature = "schema", schemars(with = "String", extend("enum" = ["V", "count", "SI"])))]
    pub raw_unit: RawUnit,
    /// Unit of x: `rad/s`, `m/s^2`, `uT`, or `field` if the size of the field is not given and counts as 1.
    pub unit: String,
    /// Per raw unit, by rows, in the triad's own frame: x along its first axis, y in the plane of the first two.
    pub C: [[f64; 3]; 3],
    /// In `unit`.
    pub o: [f64; 3],
    /// Standard deviations of C.
    pub sigma_C: [[f64; 3]; 3],
    /// Standard deviations of o.
    pub sigma_o: [f64; 3],
    /// Halves of the 95 % intervals of C.
    pub interval_C: [[f64; 3]; 3],
    /// Halves of the 95 % intervals of o.
    pub interval_o: [f64; 3],
    /// Rotation vector from the frame of the triad to that of the reference, degrees: `R x` is in the frame of the reference.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation_deg: Option<[f64; 3]>,
    /// Halves of its 95 % intervals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval_rotation_deg: Option<[f64; 3]>,
    /// By how much its readings are later than those of the reference, ms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay_ms: Option<f64>,
    /// Half of its 95 % interval.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval_delay_ms: Option<f64>,
    /// From the reference to the triad, in the frame of the reference, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lever_arm_mm: Option<[f64; 3]>,
    /// Halves of its 95 % intervals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval_lever_arm_mm: Option<[f64; 3]>,
    /// Its judgement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub judgement: Option<Judgement>,
    /// How the hard iron of a magnetometer moves with the temperature, where it does: `x = C u + o - per_k (T - temp_c)`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub iron: Option<MovingIron>,
}

/// Hard iron that moves with the temperature.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MovingIron {
    /// By how much its field grows, in the triad's own frame, in its unit per kelvin.
    pub per_k: [f64; 3],
    /// Halves of the 95 % intervals.
    pub interval_per_k: [f64; 3],
    /// The temperature at which o holds, °C.
    pub temp_c: f64,
}

impl BodyTriad {
    /// `x = C u + o`, raw to its [unit](Self::unit), in its own frame.
    pub fn model(&self) -> Affine<f64> {
        Affine {
            matrix: Matrix3::from_fn(|i, j| self.C[i][j]),
            offset: self.o.into(),
        }
    }

    /// R of `R x`: from its own frame to that of the reference.
    pub fn rotation(&self) -> Option<Matrix3<f64>> {
        let vector = Vector3::from(self.rotation_deg?).map(f64::to_radians);
        Some(Rotation3::new(vector).into_inner())
    }

    /// `R (C u + o)`, in the frame of the reference; in its own frame if the rotation is not known.
    pub fn in_reference(&self) -> Affine<f64> {
        let Affine { matrix, offset } = self.model();
        let rotation = self.rotation().unwrap_or_else(Matrix3::identity);
        Affine {
            matrix: rotation * matrix,
            offset: rotation * offset,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mimu_recording::parse_toml;

    /// A second gyro whose own x looks along the body's y: turned by 90 degrees about z.
    #[test]
    fn a_triad_turned_about_z_reads_its_x_along_the_bodys_y() {
        let triad: BodyTriad = parse_toml(
            "triad = \"gyro2\"\nreference = \"gyro\"\nformula = \"x = C u + o\"\ndirection = \"raw to SI\"\nraw_unit = \"count\"\nunit = \"rad/s\"\n\
             C = [[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]]\no = [1.0, 0.0, 0.0]\n\
             sigma_C = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]\nsigma_o = [0.0, 0.0, 0.0]\n\
             interval_C = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]\ninterval_o = [0.0, 0.0, 0.0]\nrotation_deg = [0.0, 0.0, 90.0]\n",
            "test",
            None,
        )
        .unwrap();
        let raw = Vector3::new(4.0, 0.0, 6.0);
        assert_eq!(triad.model().apply(&raw), Vector3::new(3.0, 0.0, 3.0));
        let turned = triad.in_reference().apply(&raw);
        assert!((turned - Vector3::new(0.0, 3.0, 3.0)).amax() < 1e-12);
    }
}
