//! `mimu-verify/1`: what a calibration does to another recording.

use serde::Serialize;

use super::Sensors;
use crate::quantity::{Figure, Sensor};
use crate::verify::{SensorVerification, Verification};
use crate::warning::Warning;

/// Result of a verification.
#[derive(Debug, Clone, Serialize)]
pub struct VerifyResult {
    /// `mimu-verify/1`.
    pub format: &'static str,
    /// Its figures.
    pub sensors: Sensors<SensorVerifyResult>,
    /// What a person should know.
    pub warnings: Vec<Warning>,
}

/// Figures of one triad.
#[derive(Debug, Clone, Serialize)]
pub struct SensorVerifyResult {
    /// With the mean of the calibration's scale factors and of its biases on all three axes and no misalignment, in [`Self::unit`]: fitted
    /// means in place of a data sheet's.
    pub rms_raw: f64,
    /// The readings as they came, in [`Self::unit`]; absent where they are not in SI.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_as_they_came: Option<f64>,
    /// With the calibration, in [`Self::unit`].
    pub rms: f64,
    /// With the calibration but for its effects, in [`Self::unit`]; absent if it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_affine: Option<f64>,
    /// The largest error with the calibration, in [`Self::unit`].
    pub max: f64,
    /// What noise alone would give, in [`Self::unit`]; null where the noise is not known.
    pub noise_floor: f64,
    /// SI unit of the figures.
    pub unit: &'static str,
    /// What they are about.
    pub figure: Figure,
    /// Dwells or turns judged.
    pub count: usize,
    /// Compensated gyro dwell means without a table, rad/s; absent with one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub static_rms: Option<f64>,
}

impl VerifyResult {
    /// The result of `verification`.
    pub fn of(verification: &Verification) -> Self {
        let of = |sensor: Sensor| {
            let found = verification.sensors.iter().find(|s| s.sensor == sensor);
            found.map(SensorVerifyResult::of)
        };
        Self {
            format: "mimu-verify/1",
            sensors: Sensors {
                gyro: of(Sensor::Gyro),
                accel: of(Sensor::Accel),
            },
            warnings: verification.warnings.clone(),
        }
    }
}

impl SensorVerifyResult {
    fn of(found: &SensorVerification) -> Self {
        Self {
            rms_raw: found.rms_raw,
            rms_as_they_came: found.rms_as_came,
            rms: found.rms,
            rms_affine: found.rms_affine,
            max: found.max,
            noise_floor: found.noise_floor,
            unit: found.figure.unit(found.sensor),
            figure: found.figure,
            count: found.count,
            static_rms: found.static_rms,
        }
    }
}
