//! The board's sensors according to their data sheets.

use mimu_core::compensation::Affine;
use nalgebra::{Matrix3, Vector3};

/// Inverse models (V to SI) of gyro and accelerometer from the data sheets, for a board without a calibration: ADXRS300, 2.5 V and 5 mV per deg/s;
/// MMA7260QT at 1.5 g, 1.65 V and 800 mV/g.
pub fn nominal() -> [Affine<f64>; 2] {
    let triad = |null: f64, raw_per_si: f64| Affine {
        matrix: Matrix3::identity() / raw_per_si,
        offset: Vector3::repeat(-null / raw_per_si),
    };
    [
        triad(2.5, 0.005 * 1f64.to_degrees()),
        triad(1.65, 0.8 / mimu::readable::STANDARD_GRAVITY),
    ]
}
