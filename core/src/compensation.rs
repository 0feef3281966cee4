//! Compensation of raw readings: the inverse model.

use nalgebra::{Matrix3, RealField, Vector3};

/// Inverse model of one triad, raw to SI.
///
/// `x = C u + o` (xu (1) for the gyro, (2) for the accelerometer), where
///
/// * `u` is the raw reading of the three sensors, in volts or in counts,
/// * `x` is the input in the body frame: rad/s for a gyro, m/s² of specific force for an
///   accelerometer (at rest it points up),
/// * `C` is in SI per raw unit, `o` in SI.
///
/// The inverse model and not the forward one, `u = P x + b`, because nothing is inverted on the
/// device then: nine multiplications and nine additions a sample.
///
/// ```
/// # use mimu_core::compensation::Affine;
/// # use nalgebra::{Matrix3, Vector3};
/// // An accelerometer of 0.08 V per m/s² with its null at 1.65 V, standing upright:
/// let accel = Affine::<f64> {
///     matrix: Matrix3::from_diagonal_element(1.0 / 0.08),
///     offset: Vector3::repeat(-1.65 / 0.08),
/// };
/// let force = accel.apply(&Vector3::new(1.65, 1.65, 1.65 + 0.08 * 9.80665));
/// assert!((force - Vector3::new(0.0, 0.0, 9.80665)).norm() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine<T: RealField> {
    /// `C`, SI per raw unit. Row: axis of the body frame. Column: sensor.
    pub matrix: Matrix3<T>,
    /// `o`, SI.
    pub offset: Vector3<T>,
}

impl<T: RealField + Copy> Affine<T> {
    /// SI input in the body frame from the raw reading `u`. Not a number in, not a number out.
    #[inline]
    pub fn apply(&self, raw: &Vector3<T>) -> Vector3<T> {
        self.matrix * raw + self.offset
    }
}

/// Inverse models of both triads of an inertial unit, raw to SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compensation<T: RealField> {
    /// Gyro triad, raw to rad/s.
    pub gyro: Affine<T>,
    /// Accelerometer triad, raw to m/s².
    pub accel: Affine<T>,
}

/// One sample of an inertial unit, raw or SI as the context says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample<T: RealField> {
    /// Gyro x, y, z.
    pub gyro: Vector3<T>,
    /// Accelerometer x, y, z.
    pub accel: Vector3<T>,
}

impl<T: RealField + Copy> Compensation<T> {
    /// SI sample (rad/s, m/s²) in the body frame from a raw one.
    #[inline]
    pub fn apply(&self, raw: &Sample<T>) -> Sample<T> {
        Sample {
            gyro: self.gyro.apply(&raw.gyro),
            accel: self.accel.apply(&raw.accel),
        }
    }
}
