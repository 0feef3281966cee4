//! How programs write the model of a triad: the one place that relates their numbers to a calibration, in both directions.
//!
//! A calibration is `x = C u + o`, or `u = P x + b` with P = C⁻¹ and b = -P o; u are raw readings, or those of a [driver](crate::driver). A program's
//! equation has another direction, factors of the matrix, and sign or place of the bias. Each format declares its own as a [`Convention`]:
//!
//! | [`Maps`] | [`Bias`] at the input | at the readings |
//! |---|---|---|
//! | `ToInput` | `x = M y ± β`, β = ±o | `x = M (y ± β)`, β = ∓b |
//! | `ToReading` | | `y = M x ± β`, β = ±b |
//!
//! M is C or P, as [`Shape`] says how much of it. The frame is that of the calibration where a format does not say another. [`Convention::of`] makes the
//! numbers of a file, [`Convention::inverse`] reads them. Where they are in the file, its [`Entry`](crate::layout::Entry)s say.

use mimu::quantity::AXES;
use mimu_core::compensation::Affine;
use mimu_recording::{Argument, Error, Result, TriadName};
use nalgebra::{Matrix3, Vector3};

use crate::driver::Readings;

/// Direction of the matrix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Maps {
    /// From readings to the input: C.
    ToInput,
    /// From the input to readings: P.
    ToReading,
}

/// Sign and place of the bias in the program's equation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bias {
    /// Added to the readings: before the matrix `ToInput`, after the matrix `ToReading`.
    AddedToReadings,
    /// Subtracted from the readings.
    SubtractedFromReadings,
    /// Added to the input.
    AddedToInput,
    /// Subtracted from the input.
    SubtractedFromInput,
    /// The file has no bias.
    Absent,
}

/// What the file has of the matrix, as factors `left right`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// The matrix.
    Whole,
    /// A matrix with ones on its diagonal, times a diagonal one.
    MisalignmentSensitivity,
    /// A triangular matrix, times a rotation.
    TriangleRotation(Triangle),
    /// A rotation, times a symmetric matrix. Programs store the symmetric one.
    RotationSymmetric,
    /// A factor for each axis: the diagonal of P, or one over it.
    Axes,
    /// Nothing.
    Absent,
}

/// How a program writes the model of a triad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Convention {
    /// Direction of the matrix.
    pub maps: Maps,
    /// What there is of the matrix.
    pub shape: Shape,
    /// Sign and place of the bias.
    pub bias: Bias,
}

/// The numbers of a triad in a [`Convention`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parts {
    /// Left factor of the matrix; the whole matrix of a shape with one factor.
    pub left: Matrix3<f64>,
    /// Right factor of the matrix, or the identity.
    pub right: Matrix3<f64>,
    /// β, in the unit of the readings or of the input.
    pub bias: Vector3<f64>,
}

impl Convention {
    /// A convention whose matrix maps readings to the input.
    pub const fn to_input(shape: Shape, bias: Bias) -> Self {
        let maps = Maps::ToInput;
        Self { maps, shape, bias }
    }

    /// A convention whose matrix maps the input to readings.
    pub const fn to_reading(shape: Shape, bias: Bias) -> Self {
        let maps = Maps::ToReading;
        Self { maps, shape, bias }
    }

    /// The numbers of these readings.
    ///
    /// # Errors
    /// Those of `misalignment`.
    pub fn of(&self, readings: &Readings) -> Result<Parts> {
        let matrix = match self.maps {
            Maps::ToInput => readings.inverse.matrix,
            Maps::ToReading => readings.forward.matrix,
        };
        let one = Matrix3::identity();
        let (left, right) = match self.shape {
            Shape::Whole => (matrix, one),
            Shape::MisalignmentSensitivity => misalignment(&matrix, readings.triad)?,
            Shape::TriangleRotation(half) => {
                let factors = Factors::of(&matrix, half);
                (factors.triangle, factors.rotation)
            }
            Shape::RotationSymmetric => polar(&matrix),
            Shape::Axes => {
                let gain = readings.forward.matrix.diagonal();
                let axes = match self.maps {
                    Maps::ToInput => gain.map(f64::recip),
                    Maps::ToReading => gain,
                };
                (Matrix3::from_diagonal(&axes), one)
            }
            Shape::Absent => (one, one),
        };
        let reading = match self.maps {
            Maps::ToInput => -readings.forward.bias,
            Maps::ToReading => readings.forward.bias,
        };
        let bias = match self.bias {
            Bias::AddedToReadings => reading,
            Bias::SubtractedFromReadings => -reading,
            Bias::AddedToInput => readings.inverse.offset,
            Bias::SubtractedFromInput => -readings.inverse.offset,
            Bias::Absent => Vector3::zeros(),
        };
        Ok(Parts { left, right, bias })
    }

    /// `x = C y + o` of these numbers, the reverse of [`Self::of`]; `None` if the matrix is singular.
    pub fn inverse(&self, parts: &Parts) -> Option<Affine<f64>> {
        let product = parts.left * parts.right;
        let matrix = match self.maps {
            Maps::ToInput => product,
            Maps::ToReading => product.try_inverse()?,
        };
        let to_input = match self.maps {
            Maps::ToInput => matrix,
            Maps::ToReading => -matrix,
        };
        let offset = match self.bias {
            Bias::AddedToReadings => to_input * parts.bias,
            Bias::SubtractedFromReadings => -to_input * parts.bias,
            Bias::AddedToInput => parts.bias,
            Bias::SubtractedFromInput => -parts.bias,
            Bias::Absent => Vector3::zeros(),
        };
        Some(Affine { matrix, offset })
    }
}

/// Refuses a `value` (with so many decimals and this unit in the message) outside the range of the program's number `name` of an axis.
///
/// # Errors
/// It is outside.
pub(crate) fn within(
    (triad, axis): (impl std::fmt::Display, usize),
    name: &str,
    (value, decimals, unit): (f64, usize, &str),
    [least, most]: [f64; 2],
    (remedy, argument): (&str, Argument),
) -> Result<()> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    let problem =
        format!("{name} would be {value:.decimals$}{unit}, but its range is {least} to {most}");
    let place = format!("{triad}, axis {}", AXES[axis]);
    Err(Error::new(place, problem, remedy).about(argument))
}

/// Smallest diagonal element relative to its column, which is divided by it.
const LEAST_ALONG: f64 = 0.1;

/// `T K` with ones on the diagonal of T, and K diagonal: the sensitivities, SI per unit of the readings.
///
/// # Errors
/// An axis of the readings hardly measures the same axis of the body: T would contain a permutation.
fn misalignment(inverse: &Matrix3<f64>, triad: TriadName) -> Result<(Matrix3<f64>, Matrix3<f64>)> {
    let sensitivity = inverse.diagonal();
    for (i, axis) in AXES.iter().enumerate() {
        let share = (sensitivity[i] / inverse.column(i).norm()).abs();
        if !(share >= LEAST_ALONG) {
            let problem = format!(
                "only {:.0} % of its sensitivity is along {axis} of the body",
                100.0 * share
            );
            let remedy = "order the columns as the body's axes, and calibrate again";
            return Err(Error::new(format!("{triad}, axis {axis}"), problem, remedy));
        }
    }
    let back = Matrix3::from_diagonal(&sensitivity.map(f64::recip));
    Ok((inverse * back, Matrix3::from_diagonal(&sensitivity)))
}

/// The polar factors of a regular matrix: `rotation symmetric`, the symmetric one positive definite. The rotation mirrors if the matrix does.
fn polar(matrix: &Matrix3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let eigen = (matrix.transpose() * matrix).symmetric_eigen();
    let root = |power: f64| {
        let values = eigen.eigenvalues.map(|v| v.powf(power));
        eigen.eigenvectors * Matrix3::from_diagonal(&values) * eigen.eigenvectors.transpose()
    };
    (matrix * root(-0.5), root(0.5))
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use mimu::calibration::bias_cubic::Conversion;
    use mimu::triad::Forward;
    use mimu_recording::TriadKind;

    #[test]
    fn the_symmetric_factor_keeps_sizes_and_what_is_left_is_a_rotation() {
        let quarter = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        let soft_iron = Matrix3::new(1.1, 0.05, 0.0, 0.05, 0.9, -0.02, 0.0, -0.02, 1.0);
        let (rotation, symmetric) = polar(&(quarter * soft_iron));
        assert!((rotation - quarter).amax() < 1e-12);
        assert!((symmetric - soft_iron).amax() < 1e-12);
    }

    #[test]
    fn the_equation_of_every_convention_holds_between_input_and_readings() {
        let matrix = Matrix3::new(0.98, 0.02, -0.03, -0.01, 1.03, 0.04, 0.05, -0.02, 1.01);
        let bias = Vector3::new(0.3, -0.2, 0.1);
        let x = Vector3::new(1.0, -2.0, 3.0);
        let y = matrix * x + bias;
        let forward = Forward { matrix, bias };
        let readings = Readings {
            triad: TriadName::first(TriadKind::Accel),
            unit: "m/s^2".into(),
            conversion: Conversion {
                si_per_raw: [1.0; 3],
                zero_raw: [0.0; 3],
            },
            inverse: forward.inverse().unwrap(),
            forward,
        };
        for shape in [
            Shape::Whole,
            Shape::MisalignmentSensitivity,
            Shape::TriangleRotation(Triangle::Lower),
            Shape::TriangleRotation(Triangle::Upper),
            Shape::RotationSymmetric,
        ] {
            let of = |convention: Convention| {
                let parts = convention.of(&readings).unwrap();
                let read = convention.inverse(&parts).unwrap();
                assert!((read.apply(&y) - x).amax() < 1e-12, "{convention:?}");
                (parts.left * parts.right, parts.bias)
            };
            let (c, b) = of(Convention::to_input(shape, Bias::AddedToReadings));
            assert!((c * (y + b) - x).amax() < 1e-12, "{shape:?}");
            let (c, b) = of(Convention::to_input(shape, Bias::SubtractedFromReadings));
            assert!((c * (y - b) - x).amax() < 1e-12, "{shape:?}");
            let (c, b) = of(Convention::to_input(shape, Bias::AddedToInput));
            assert!((c * y + b - x).amax() < 1e-12, "{shape:?}");
            let (c, b) = of(Convention::to_input(shape, Bias::SubtractedFromInput));
            assert!((c * y - b - x).amax() < 1e-12, "{shape:?}");
            let (p, b) = of(Convention::to_reading(shape, Bias::AddedToReadings));
            assert!((p * x + b - y).amax() < 1e-12, "{shape:?}");
            let (p, b) = of(Convention::to_reading(shape, Bias::SubtractedFromReadings));
            assert!((p * x - b - y).amax() < 1e-12, "{shape:?}");
        }
    }

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
