//! The further triads of a body in a calibration file: each with its C and o as the first two, and how it stands to a reference triad.

use mimu_recording::{RawUnit, TriadName};
use serde::{Deserialize, Serialize};

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
}
