//! Calibration of one triad: inverse and forward model, their covariances, and the physical quantities.

use mimu_core::compensation::Affine;
use mimu_recording::NORMAL_95;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Covariance of twelve parameters, in the order of [`vector`].
pub type Covariance = SMatrix<f64, 12, 12>;

/// Twelve parameters of an affine model: matrix by rows (xx, xy, xz, yx, ...), then offset or bias.
pub fn vector(matrix: &Matrix3<f64>, offset: &Vector3<f64>) -> SVector<f64, 12> {
    SVector::from_fn(|i, _| {
        if i < 9 {
            matrix[(i / 3, i % 3)]
        } else {
            offset[i - 9]
        }
    })
}

/// Inverse of [`vector`].
pub fn affine(parameters: &SVector<f64, 12>) -> Affine<f64> {
    Affine {
        matrix: Matrix3::from_fn(|i, j| parameters[3 * i + j]),
        offset: Vector3::from_fn(|i, _| parameters[9 + i]),
    }
}

/// The other direction of an affine model: for `y = A x + b` it is `x = A⁻¹ y - A⁻¹ b`. `None` if A is singular.
pub fn invert(model: &Affine<f64>) -> Option<Affine<f64>> {
    let matrix = model.matrix.try_inverse()?;
    Some(Affine {
        matrix,
        offset: -(matrix * model.offset),
    })
}

/// Derivatives of the parameters `B, c` of one direction by those, `A, b`, of the other.
///
/// With `B = A⁻¹` and `c = -B b`: `dB = -B dA B`, `dc = -B (dA c + db)`.
fn inversion_jacobian(b: &Matrix3<f64>, c: &Vector3<f64>) -> SMatrix<f64, 12, 12> {
    let mut jacobian = SMatrix::zeros();
    for i in 0..3 {
        for j in 0..3 {
            let column = 3 * i + j;
            for r in 0..3 {
                for s in 0..3 {
                    jacobian[(3 * r + s, column)] = -b[(r, i)] * b[(j, s)];
                }
                jacobian[(9 + r, column)] = -b[(r, i)] * c[j];
            }
        }
        for r in 0..3 {
            jacobian[(9 + r, 9 + i)] = -b[(r, i)];
        }
    }
    jacobian
}

/// Sensitive directions of the sensors, by rows, unit vectors; and the scale factors, raw/SI.
pub fn directions(inverse: &Affine<f64>) -> Option<(Matrix3<f64>, Vector3<f64>, Forward)> {
    let forward = Forward::of(inverse)?;
    let scale = Vector3::from_fn(|i, _| forward.matrix.row(i).norm());
    let unit = Matrix3::from_fn(|i, j| forward.matrix[(i, j)] / scale[i]);
    Some((unit, scale, forward))
}

/// Forward model of a triad, SI to raw: `u = P x + b`, fang (15), (17). A separate type, so that it cannot be confused with the inverse
/// model, which also has twelve numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forward {
    /// P, raw per SI. Row: sensor. Column: axis of the body frame.
    pub matrix: Matrix3<f64>,
    /// b, raw.
    pub bias: Vector3<f64>,
}

impl Forward {
    /// Raw reading for the `input` (SI, body frame).
    pub fn apply(&self, input: &Vector3<f64>) -> Vector3<f64> {
        self.matrix * input + self.bias
    }

    /// The inverse model. `None` if P is singular.
    pub fn inverse(&self) -> Option<Affine<f64>> {
        invert(&Affine {
            matrix: self.matrix,
            offset: self.bias,
        })
    }

    /// The forward model of an inverse one. `None` if C is singular.
    pub fn of(inverse: &Affine<f64>) -> Option<Self> {
        invert(inverse).map(|f| Self {
            matrix: f.matrix,
            bias: f.offset,
        })
    }
}

/// What one group of residuals adds to the covariance of a calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Covariance of matrix by rows, then offset or bias.
    pub covariance: Covariance,
    /// Degrees of freedom from which its size was estimated; infinite if the noise was known beforehand.
    pub dof: f64,
    /// Share of it that what is known beforehand gives: noise and stated errors. The rest is by scatter beyond these, which a misfit widens.
    pub known: f64,
}

/// Half of a 95 % interval around an estimate whose error is the sum of independent `contributions`: the variance of each, and its degrees
/// of freedom.
pub fn half_width_95(contributions: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (variance, dof) = effective_dof(contributions);
    students_factor(dof) * variance.max(0.0).sqrt()
}

/// Variance of the sum of independent `contributions`, and its degrees of freedom by Welch and Satterthwaite (JCGM 100:2008, G.4).
///
/// With one factor for all parameters, that of the group with the fewest, the intervals of xu's offsets contained the truth in all runs.
pub fn effective_dof(contributions: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let (mut variance, mut doubt) = (0.0, 0.0);
    for (v, dof) in contributions {
        variance += v;
        doubt += v * v / dof;
    }
    let dof = if doubt > 0.0 {
        (variance * variance / doubt).max(1.0)
    } else {
        f64::INFINITY
    };
    (variance, dof)
}

/// Half of a 95 % interval in sigmas, of Student's distribution.
fn students_factor(dof: f64) -> f64 {
    // From 100 degrees on, the first terms of Abramowitz and Stegun (26.7.5) are exact to 3e-6; the library's search does not end for many
    // more.
    if dof < 100.0 {
        StudentsT::new(0.0, 1.0, dof).map_or(f64::NAN, |t| t.inverse_cdf(0.975))
    } else {
        let z = NORMAL_95;
        z + (z.powi(3) + z) / (4.0 * dof)
            + (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * dof * dof)
    }
}

/// Calibration of one triad.
#[derive(Debug, Clone, PartialEq)]
pub struct Triad {
    /// Raw to SI, xu (1), (2): `x = C u + o`.
    pub inverse: Affine<f64>,
    /// Covariance of C by rows, then o.
    pub inverse_covariance: Covariance,
    /// SI to raw, fang (15), (17): `u = P x + b`, P = K M.
    pub forward: Forward,
    /// Covariance of P by rows, then b.
    pub forward_covariance: Covariance,
    /// The parts that add up to `forward_covariance`.
    pub(crate) forward_parts: Vec<Part>,
}

impl Triad {
    /// Variance, from the error of the inverse model, of a quantity whose derivatives by the twelve parameters are `by`.
    pub fn variance(&self, by: &SVector<f64, 12>) -> f64 {
        by.dot(&(self.inverse_covariance * by)).max(0.0)
    }

    /// From the inverse model and the parts of its covariance. `None` if C is singular.
    pub fn from_inverse(inverse: Affine<f64>, parts: Vec<Part>) -> Option<Self> {
        let forward = Forward::of(&inverse)?;
        let j = inversion_jacobian(&forward.matrix, &forward.bias);
        let forward_parts: Vec<Part> = parts.iter().map(|p| p.seen_by(&j)).collect();
        Some(Self {
            inverse,
            inverse_covariance: sum(&parts),
            forward,
            forward_covariance: sum(&forward_parts),
            forward_parts,
        })
    }

    /// From the forward model and the parts of its covariance. `None` if P is singular.
    pub fn from_forward(forward: Forward, parts: Vec<Part>) -> Option<Self> {
        let inverse = forward.inverse()?;
        let j = inversion_jacobian(&inverse.matrix, &inverse.offset);
        Some(Self {
            inverse,
            inverse_covariance: j * sum(&parts) * j.transpose(),
            forward,
            forward_covariance: sum(&parts),
            forward_parts: parts,
        })
    }

    /// Adds an unknown rotation of the frame with this standard deviation, rad, about each axis. No dwell shows how a unit is mounted on a
    /// table; the mounting rotates gyro and accelerometer alike.
    pub fn mounted(mut self, sigma_rad: f64) -> Self {
        let mut covariance = Covariance::zeros();
        for axis in 0..3 {
            let turned = self.forward.matrix * Vector3::ith(axis, sigma_rad).cross_matrix();
            let by = vector(&turned, &Vector3::zeros());
            covariance += by * by.transpose();
        }
        self.forward_parts.push(Part::known(covariance));
        self.forward_covariance += covariance;
        let j = inversion_jacobian(&self.inverse.matrix, &self.inverse.offset);
        self.inverse_covariance += j * covariance * j.transpose();
        self
    }

    /// The parts that add up to the covariance of C and o.
    pub fn inverse_parts(&self) -> Vec<Part> {
        let j = inversion_jacobian(&self.inverse.matrix, &self.inverse.offset);
        self.forward_parts.iter().map(|p| p.seen_by(&j)).collect()
    }

    /// Covariance of C by rows, then o, by what is known beforehand alone: the noise, without the scatter beyond it.
    pub fn known_covariance(&self) -> Covariance {
        let parts = self.inverse_parts().into_iter();
        parts.fold(Covariance::zeros(), |sum, p| sum + p.covariance * p.known)
    }

    /// Whether that is all of the covariance.
    pub fn is_by_noise(&self) -> bool {
        self.forward_parts.iter().all(|part| part.known == 1.0)
    }

    /// P by rows, then b, each with sigma and interval.
    pub fn forward_estimates(&self) -> [Estimate; 12] {
        let at = vector(&self.forward.matrix, &self.forward.bias);
        self.estimates(&at, &SMatrix::identity())
    }

    /// C by rows, then o, each with sigma and interval.
    pub fn inverse_estimates(&self) -> [Estimate; 12] {
        let at = vector(&self.inverse.matrix, &self.inverse.offset);
        let jacobian = inversion_jacobian(&self.inverse.matrix, &self.inverse.offset);
        self.estimates(&at, &jacobian)
    }

    /// Functions of the forward parameters: their `values`, and the derivatives by P and b, one function a row.
    fn estimates(&self, values: &SVector<f64, 12>, jacobian: &Covariance) -> [Estimate; 12] {
        std::array::from_fn(|i| {
            let by = jacobian.row(i);
            let along = |c: &Covariance| (by * c * by.transpose())[0];
            let parts = &self.forward_parts;
            Estimate {
                value: values[i],
                sigma: along(&self.forward_covariance).max(0.0).sqrt(),
                interval: half_width_95(parts.iter().map(|p| (along(&p.covariance), p.dof))),
            }
        })
    }

    /// Physical quantities, with sigmas by the derivatives of the decomposition.
    pub fn physical(&self, angles: Angles) -> Physical {
        let values = Physical::vector_of(&self.forward, angles);
        let jacobian = Physical::jacobian(&self.forward, angles);
        Physical::of(angles, &self.estimates(&values, &jacobian))
    }

    /// The same twelve numbers as a vector: scale factors, misalignments, non-orthogonalities and biases, and the parts of their covariance.
    pub fn physical_parts(&self) -> (SVector<f64, 12>, Vec<Part>) {
        let jacobian = Physical::jacobian(&self.forward, Angles::Exact);
        let parts = self.forward_parts.iter().map(|p| p.seen_by(&jacobian));
        let values = Physical::vector_of(&self.forward, Angles::Exact);
        (values, parts.collect())
    }

    /// From the physical quantities, as [`Self::physical_parts`] gives them. `None` if they are no regular model.
    pub fn from_physical(values: &SVector<f64, 12>, parts: &[Part]) -> Option<Self> {
        let exact = values.map(|value| Estimate {
            value,
            sigma: 0.0,
            interval: 0.0,
        });
        let all: [Estimate; 12] = exact.into();
        let forward = Physical::of(Angles::Exact, &all).forward();
        let back = Physical::jacobian(&forward, Angles::Exact).try_inverse()?;
        let parts = parts.iter().map(|p| p.seen_by(&back)).collect();
        Self::from_forward(forward, parts)
    }
}

/// The physical parameters of an inverse model, in the order of [`Triad::physical_parts`], and their derivatives by C (rows) and o. `None` if C is singular.
pub(crate) fn physical_of(inverse: &Affine<f64>) -> Option<(SVector<f64, 12>, Covariance)> {
    let forward = Forward::of(inverse)?;
    let by_forward = Physical::jacobian(&forward, Angles::Exact);
    let values = Physical::vector_of(&forward, Angles::Exact);
    Some((
        values,
        by_forward * inversion_jacobian(&forward.matrix, &forward.bias),
    ))
}

/// A number with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// Value.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// Half of a 95 % interval.
    pub interval: f64,
}

impl Part {
    /// The same in other parameters, whose derivatives by these are `jacobian`.
    pub fn seen_by(&self, jacobian: &Covariance) -> Self {
        Self {
            covariance: jacobian * self.covariance * jacobian.transpose(),
            ..*self
        }
    }

    /// One whose size is known beforehand.
    pub fn known(covariance: Covariance) -> Self {
        Self {
            covariance,
            dof: f64::INFINITY,
            known: 1.0,
        }
    }
}

fn sum(parts: &[Part]) -> Covariance {
    parts
        .iter()
        .fold(Covariance::zeros(), |sum, p| sum + p.covariance)
}

/// Whether angles are taken as small, as fang does, or exactly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Angles {
    /// First order in all angles, fang (14), (16), (18).
    Small,
    /// Rotations and directions exactly.
    Exact,
}

/// The forward model as physical quantities: `P = K Mo Mp`.
///
/// # Conventions
///
/// * Package misalignment `Mp = Rz(θz) Ry(θy) Rx(θx)`, rotations by the right-hand rule, takes components from the body
///   frame to that of the sensors: seen from the sensors the body is turned by θ, so that for θz > 0 the sensor x
///   leans away from the body's y. Its first order is fang (12). (As printed, fang (9) and (10) turn the
///   other way than (11), and their product does not give (12); here (12) holds.)
/// * Non-orthogonality `Mo` is lower triangular (fang (13)): the sensor x lies along the frame's x, the sensor y in its
///   xy plane turned by βyz towards x, and the sensor z is turned by βzy away from x and by βzx towards y.
/// * Exactly, the rows of `Mo` have unit length, so that a scale factor is that along the sensor's own axis, and
///   the sines of the β are the off-diagonal elements. To first order this is fang's form.
#[derive(Debug, Clone, PartialEq)]
pub struct Physical {
    /// How angles were taken.
    pub angles: Angles,
    /// Scale factors K of the sensors x, y, z: raw per SI.
    pub scale: [Estimate; 3],
    /// Package misalignment θx, θy, θz, rad.
    pub misalignment: [Estimate; 3],
    /// Non-orthogonality βyz, βzy, βzx, rad.
    pub non_orthogonality: [Estimate; 3],
    /// Bias of the sensors x, y, z, raw.
    pub bias: [Estimate; 3],
}

impl Physical {
    fn of(angles: Angles, all: &[Estimate; 12]) -> Self {
        let triple = |from: usize| [all[from], all[from + 1], all[from + 2]];
        Self {
            angles,
            scale: triple(0),
            misalignment: triple(3),
            non_orthogonality: triple(6),
            bias: triple(9),
        }
    }

    /// Derivatives of the physical quantities by P and b.
    fn jacobian(forward: &Forward, angles: Angles) -> Covariance {
        let at = vector(&forward.matrix, &forward.bias);
        let scale = forward.matrix.norm();
        let decompose = |p: &SVector<f64, 12>| {
            let Affine { matrix, offset } = affine(p);
            let bias = offset;
            Self::vector_of(&Forward { matrix, bias }, angles)
        };
        let mut jacobian = Covariance::zeros();
        for k in 0..12 {
            // Central differences with steps of 1e-4: their error is of second order, 1e-9 of the slope.
            let step = if k < 9 { 1e-4 * scale } else { scale.max(1e-6) };
            let (mut up, mut down) = (at, at);
            up[k] += step;
            down[k] -= step;
            let slope = (decompose(&up) - decompose(&down)) / (2.0 * step);
            jacobian.set_column(k, &slope);
        }
        jacobian
    }

    fn vector_of(forward: &Forward, angles: Angles) -> SVector<f64, 12> {
        let p = &forward.matrix;
        let (scale, theta, beta) = match angles {
            Angles::Small => {
                let m = Matrix3::from_fn(|i, j| p[(i, j)] / p[(i, i)]);
                let theta = Vector3::new(-m[(1, 2)], m[(0, 2)], -m[(0, 1)]);
                let beta = Vector3::new(
                    m[(1, 0)] - theta.z,
                    -m[(2, 0)] - theta.y,
                    m[(2, 1)] - theta.x,
                );
                (p.diagonal(), theta, beta)
            }
            Angles::Exact => {
                // P = L Q, by the QR factorization of P' = Q' L'. The signs of the sensors are free, but Q must be a rotation for its
                // angles to have a meaning. Of the four choices of signs that make it one, the smallest rotation is taken. A sensor mounted
                // backwards then has a negative scale factor.
                let qr = p.transpose().qr();
                let (mut q, mut l) = (qr.q().transpose(), qr.r().transpose());
                let choices = (0..8u8)
                    .map(|k| Vector3::from_fn(|i, _| if k & (1 << i) == 0 { 1.0 } else { -1.0 }));
                let rotation = |s: &Vector3<f64>| s.product() * q.determinant() > 0.0;
                let trace = |s: &Vector3<f64>| s.dot(&q.diagonal());
                let flips = choices
                    .filter(rotation)
                    .max_by(|a, b| trace(a).total_cmp(&trace(b)))
                    .unwrap_or_else(|| Vector3::repeat(1.0));
                for k in 0..3 {
                    q.row_mut(k).scale_mut(flips[k]);
                    l.column_mut(k).scale_mut(flips[k]);
                }
                let signs = Vector3::from_fn(|i, _| l[(i, i)].signum());
                let scale = Vector3::from_fn(|i, _| signs[i] * l.row(i).norm());
                let mo = Matrix3::from_fn(|i, j| l[(i, j)] / scale[i]);
                // Rz Ry Rx has -sin θy at zx, cos θy sin θx at zy and cos θy sin θz at yx.
                let theta = Vector3::new(
                    q[(2, 1)].atan2(q[(2, 2)]),
                    (-q[(2, 0)]).clamp(-1.0, 1.0).asin(),
                    q[(1, 0)].atan2(q[(0, 0)]),
                );
                let beta = Vector3::new(mo[(1, 0)], -mo[(2, 0)], mo[(2, 1)]).map(f64::asin);
                (scale, theta, beta)
            }
        };
        let mut out = SVector::zeros();
        for i in 0..3 {
            out[i] = scale[i];
            out[3 + i] = theta[i];
            out[6 + i] = beta[i];
            out[9 + i] = forward.bias[i];
        }
        out
    }

    /// Forward model `P, b` of these quantities, the inverse of the decomposition: for checks by hand.
    pub fn forward(&self) -> Forward {
        let value = |e: &[Estimate; 3]| Vector3::from_fn(|i, _| e[i].value);
        let (theta, beta) = (value(&self.misalignment), value(&self.non_orthogonality));
        let m = match self.angles {
            Angles::Small => Matrix3::new(
                1.0,
                -theta.z,
                theta.y,
                beta.x + theta.z,
                1.0,
                -theta.x,
                -beta.y - theta.y,
                beta.z + theta.x,
                1.0,
            ),
            Angles::Exact => {
                let s = beta.map(f64::sin);
                let mo = Matrix3::new(
                    1.0,
                    0.0,
                    0.0,
                    s.x,
                    (1.0 - s.x * s.x).sqrt(),
                    0.0,
                    -s.y,
                    s.z,
                    (1.0 - s.y * s.y - s.z * s.z).sqrt(),
                );
                let mp = nalgebra::Rotation3::from_euler_angles(theta.x, theta.y, theta.z);
                mo * mp.matrix()
            }
        };
        Forward {
            matrix: Matrix3::from_diagonal(&value(&self.scale)) * m,
            bias: value(&self.bias),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn students_factors_are_those_of_printed_tables() {
        let table = [
            (1.0, 12.7062),
            (4.0, 2.7764),
            (30.0, 2.0423),
            (100.0, 1.9840),
            (120.0, 1.9799),
            (f64::INFINITY, 1.9600),
        ];
        for (dof, factor) in table {
            assert!((students_factor(dof) - factor).abs() < 1e-4, "{dof}");
        }
        let library = StudentsT::new(0.0, 1.0, 100.0).unwrap().inverse_cdf(0.975);
        assert!((students_factor(100.0) - library).abs() < 3e-6);
    }
}
