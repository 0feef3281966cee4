//! The inverse matrix as a misalignment times the sensitivities of the axes.

use mimu::quantity::{AXES, Sensor};
use mimu_recording::error::{Error, Result};
use nalgebra::{Matrix3, Vector3};

/// Smallest diagonal element relative to its column, which is divided by it.
const LEAST_ALONG: f64 = 0.1;

/// `C = T K`: T has ones on its diagonal, K is diagonal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misalignment {
    /// The matrix T.
    pub matrix: Matrix3<f64>,
    /// Diagonal of K, SI per raw unit.
    pub sensitivity: Vector3<f64>,
}

impl Misalignment {
    /// Factors of the matrix of an inverse model of `sensor`.
    ///
    /// # Errors
    /// An axis of the readings hardly measures the same axis of the body: T would contain a permutation.
    pub fn of(inverse: &Matrix3<f64>, sensor: Sensor) -> Result<Self> {
        let sensitivity = inverse.diagonal();
        for (i, axis) in AXES.iter().enumerate() {
            let share = (sensitivity[i] / inverse.column(i).norm()).abs();
            if !(share >= LEAST_ALONG) {
                return Err(Error::new(
                    format!("{sensor}, axis {axis}"),
                    format!(
                        "only {:.0} % of its sensitivity is along {axis} of the body",
                        100.0 * share
                    ),
                    "order the columns as the body's axes, and calibrate again",
                ));
            }
        }
        let back = Matrix3::from_diagonal(&sensitivity.map(f64::recip));
        Ok(Self {
            matrix: inverse * back,
            sensitivity,
        })
    }
}
