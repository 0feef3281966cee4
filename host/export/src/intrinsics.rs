//! Both triads, each as a triangular matrix times a rotation, with the gyro's g-sensitivity: the parameters of Kalibr and OpenVINS.
//!
//! Readings are those of a [driver]: `y = P x + b`, SI to SI. `P = T R` with T triangular and R a rotation is the exact counterpart of a QR
//! factorisation: scale factors and non-orthogonality are in T, the misalignment of the package is in R.

use mimu::calibration::Calibration;
use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::error::Result;
use nalgebra::{Matrix3, Vector3};

use crate::driver::{self, Readings};
use crate::remaining::{self, Places, Remaining};
use crate::{Export, heading};

/// Id of the only effect that these formats can store.
const G_SENSITIVITY: &str = "gyro_g_sensitivity";

/// Which half of the matrix is not zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Triangle {
    /// Below and on the diagonal.
    Lower,
    /// Above and on the diagonal.
    Upper,
}

/// Factors of a matrix `triangle * rotation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Factors {
    /// Triangular.
    pub triangle: Matrix3<f64>,
    /// Orthogonal, with determinant 1.
    pub rotation: Matrix3<f64>,
}

/// Intrinsics of both triads.
#[derive(Debug, Clone)]
pub struct Intrinsics {
    /// `P = T R`; R rotates from the calibration's body frame to the triad's frame.
    pub factors: PerSensor<Factors>,
    /// Error of the gyro's readings by the specific force in the body frame, (rad/s)/(m/s²).
    pub g_sensitivity: Matrix3<f64>,
    /// The driver's readings.
    pub readings: PerSensor<Readings>,
    /// Parts of the calibration that are not included.
    pub remaining: Vec<Remaining>,
}

impl Factors {
    /// Factors of a regular matrix. If the axes are mirrored, no rotation can invert one alone: the diagonal is then negative for the axis that looks
    /// most like an inverted sensor.
    pub fn of(matrix: &Matrix3<f64>, half: Triangle) -> Self {
        // Reversing rows and columns turns a lower triangle into an upper one.
        let reverse = match half {
            Triangle::Lower => Matrix3::identity(),
            Triangle::Upper => Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0),
        };
        let qr = (reverse * matrix * reverse).transpose().qr();
        let mut triangle = reverse * qr.r().transpose() * reverse;
        let mut rotation = reverse * qr.q().transpose() * reverse;
        let mut signs = triangle.diagonal().map(f64::signum);
        if matrix.determinant() < 0.0 {
            let turned = Vector3::from_fn(|i, _| signs[i] * rotation[(i, i)]);
            signs[turned.imin()] *= -1.0;
        }
        for (i, sign) in signs.iter().enumerate() {
            triangle.column_mut(i).scale_mut(*sign);
            rotation.row_mut(i).scale_mut(*sign);
        }
        Self { triangle, rotation }
    }
}

impl Intrinsics {
    /// Intrinsics of both triads of `calibration`.
    ///
    /// # Errors
    /// The errors of [`driver::Options::readings`].
    pub fn of(
        calibration: &Calibration,
        place: &str,
        driver: &driver::Options,
        half: Triangle,
    ) -> Result<Self> {
        let readings = PerSensor {
            gyro: driver.readings(calibration, place, Sensor::Gyro)?,
            accel: driver.readings(calibration, place, Sensor::Accel)?,
        };
        let mut sag = Matrix3::zeros();
        for effect in calibration.effects() {
            if effect.id() == G_SENSITIVITY {
                // Coefficients are by rows. Those that the experiment did not determine are absent.
                let known = effect.candidate.active.iter().zip(&effect.values);
                known.for_each(|(k, value)| sag[(k / 3, k % 3)] += value);
            }
        }
        // Effects are in SI along each sensor's axis: x = C (u - S e) + o.
        let gain = Vector3::from(readings.gyro.noise_gain());
        let places = Places {
            cross_terms: true,
            temperature: false,
            effects: false,
        };
        let mut remaining = remaining::of(calibration, places)?;
        remaining.retain(|r| r.source != G_SENSITIVITY);
        Ok(Self {
            factors: PerSensor::from_fn(|s| Factors::of(&readings[s].forward.matrix, half)),
            g_sensitivity: Matrix3::from_diagonal(&gain) * sag,
            readings,
            remaining,
        })
    }

    /// Adds the notes common to all files with intrinsics.
    pub fn describe(self, calibration: &Calibration, export: &mut Export) {
        export.notes.extend(heading::temperature(calibration));
        for sensor in [Sensor::Accel, Sensor::Gyro] {
            let readings = &self.readings[sensor];
            let bias = readings.forward.bias;
            export.notes.push(readings.line());
            export.notes.push(format!(
                "{sensor}: the program estimates the bias of these readings; it was [{:.4}, {:.4}, {:.4}] {}.",
                bias.x,
                bias.y,
                bias.z,
                sensor.unit()
            ));
        }
        export.remaining = self.remaining;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_multiply_to_the_matrix_and_rotate_without_mirroring() {
        let p = Matrix3::new(0.98, 0.02, -0.03, -0.01, 1.03, 0.04, 0.05, -0.02, 1.01);
        let inverted = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
        let permuted = Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0);
        for matrix in [p, inverted * p, permuted * p, permuted * inverted * p] {
            for half in [Triangle::Lower, Triangle::Upper] {
                let Factors { triangle, rotation } = Factors::of(&matrix, half);
                assert!((triangle * rotation - matrix).amax() < 1e-12);
                assert!((rotation.determinant() - 1.0).abs() < 1e-12);
                assert!((rotation * rotation.transpose() - Matrix3::identity()).amax() < 1e-12);
                let other = match half {
                    Triangle::Lower => triangle.upper_triangle(),
                    Triangle::Upper => triangle.lower_triangle(),
                };
                assert!((other - Matrix3::from_diagonal(&triangle.diagonal())).amax() < 1e-12);
            }
        }
        // An inverted axis appears as a negative diagonal, with almost no rotation.
        let Factors { triangle, rotation } = Factors::of(&(inverted * p), Triangle::Lower);
        assert!(triangle[(1, 1)] < -0.9 && (rotation - Matrix3::identity()).amax() < 0.1);
    }
}
