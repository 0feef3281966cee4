//! Accelerometer calibration from the magnitude of gravity and from the turns between the poses together.
//!
//! If the poses do not show both ends of an axis, the magnitude alone hardly determines that axis ([`super::magnitude`]): ten poses of a fixture gave
//! a scale factor of 6.0 ± 9.1. But the gyro carries the direction of gravity from pose to pose, and an error of the accelerometer's direction shows
//! against it. Here C and o of the accelerometer (nine parameters, as in [`super::magnitude`]) and C and o of the gyro (twelve) are fitted to the
//! magnitudes, the turns and the readings at rest at once.
//!
//! Only the accelerometer is returned. With it, [`super::rotation`] finds the gyro of the joint minimum. If it also propagates the covariance of this
//! accelerometer, the gyro's covariance is that of the joint fit, by the inverse of a block matrix. Errors of the gyro's model enter the
//! accelerometer this way, so this fit is used only if the magnitude alone does not suffice.

use mimu_core::compensation::Affine;
use nalgebra::{DVector, Matrix3, SMatrix, Vector3};

use super::least_squares::{Grouped, Linearized, Reweighted, Solved};
use super::{Estimated, Failure, Observation, lower_triangular};
use crate::observable::Observable;
use crate::observation::magnitude::Magnitude;
use crate::observation::turn::{Rest, Rotations, Turn, TurnError};
use crate::observation::{ByTriad, LOWER, free, place, vector};
use crate::triad::{Covariance, Part, Triad};
use crate::warning::Warning;

/// Parameters: six of C and three of o of the accelerometer, then nine of C and three of o of the gyro.
const ACCEL: usize = 9;
const ALL: usize = ACCEL + 12;

/// The data of the joint fit.
pub struct JointFit<'a> {
    /// Poses.
    pub poses: &'a [Observation],
    /// Variances of their magnitudes by noise, (m/s²)².
    pub variances: &'a [f64],
    /// Turns between them; only the raw readings of their forces are used.
    pub turns: &'a [Turn<'a>],
    /// Readings of the gyro at rest.
    pub rest: &'a [Rest],
    /// First guess of the accelerometer.
    pub accel: Affine<f64>,
    /// First guess of the gyro.
    pub gyro: Affine<f64>,
    /// Magnitude of gravity, m/s².
    pub gravity: f64,
}

/// Both models at some parameters.
struct Models {
    /// For readings that the first guess scales to order one: `f = g (C v + o)`.
    accel: Affine<f64>,
    gyro: Affine<f64>,
}

/// The fit in units in which its parameters are of order one. Rows are the magnitudes, then two for each turn, then three for each rest.
struct Scaled<'a> {
    data: &'a JointFit<'a>,
    /// Mean reading of the gyro at rest.
    at_rest: Vector3<f64>,
    /// Scale of the gyro's matrix.
    unit: f64,
    rotations: Rotations,
    /// Number of rows of each group, and where each begins.
    rows: [usize; 3],
    from: [usize; 3],
}

impl<'a> Scaled<'a> {
    fn of(data: &'a JointFit<'a>) -> Self {
        let rest = data.rest.iter().map(|o| o.raw).sum::<Vector3<f64>>();
        let at_rest = rest / data.rest.len().max(1) as f64;
        let rows = [data.poses.len(), 2 * data.turns.len(), 3 * data.rest.len()];
        Self {
            at_rest,
            unit: data.gyro.matrix.norm() / 3f64.sqrt(),
            rotations: Rotations::new(data.turns, &at_rest),
            rows,
            from: [0, rows[0], rows[0] + rows[1]],
            data,
        }
    }

    fn start(&self) -> DVector<f64> {
        let mut p = DVector::zeros(ALL);
        for k in [0, 2, 5] {
            p[k] = 1.0;
        }
        let bias = self.data.gyro.apply(&self.at_rest);
        for i in 0..3 {
            for k in 0..3 {
                p[ACCEL + 3 * i + k] = self.data.gyro.matrix[(i, k)] / self.unit;
            }
            p[18 + i] = bias[i];
        }
        p
    }

    fn models(&self, p: &DVector<f64>) -> Models {
        Models {
            accel: lower_triangular(p),
            gyro: Affine {
                matrix: Matrix3::from_fn(|i, j| self.unit * p[ACCEL + 3 * i + j]),
                offset: Vector3::new(p[18], p[19], p[20]),
            },
        }
    }

    /// The accelerometer in SI, and the derivatives of its twelve numbers by the nine parameters.
    fn to_si(&self, p: &DVector<f64>) -> (Affine<f64>, SMatrix<f64, 12, 9>) {
        let g = self.data.gravity;
        let Affine { matrix, offset } = self.data.accel;
        let mut by = SMatrix::<f64, 12, 9>::zeros();
        for (k, parameter) in LOWER.into_iter().enumerate() {
            match place(parameter) {
                (row, Some(column)) => {
                    for m in 0..3 {
                        by[(3 * row + m, k)] += matrix[(column, m)];
                    }
                    by[(9 + row, k)] += offset[column];
                }
                (row, None) => by[(9 + row, k)] = g,
            }
        }
        let change = self.models(p).accel;
        let inverse = Affine {
            matrix: change.matrix * matrix,
            offset: change.matrix * offset + change.offset * g,
        };
        (inverse, by)
    }
}

impl Grouped<3> for Scaled<'_> {
    const SHARE: f64 = 1e-3;

    /// Share of gravity, rad, rad/s.
    fn linearize(&self, p: &DVector<f64>) -> Linearized {
        let JointFit {
            poses,
            turns,
            rest,
            gravity,
            ..
        } = self.data;
        let order_one = |raw: &Vector3<f64>| self.data.accel.apply(raw) / *gravity;
        let Models { accel, gyro } = self.models(p);
        let mut out = Linearized::zeros(self.rows.iter().sum(), ALL);
        let (r, j) = (&mut out.residuals, &mut out.jacobian);
        let mut by_accel = |row: usize, by: &ByTriad| {
            let by = free(by, &LOWER).transpose();
            j.view_mut((row, 0), (1, ACCEL)).copy_from(&by);
        };
        let mut own = Vec::with_capacity(self.rows[1] + self.rows[2]);
        for (row, o) in poses.iter().enumerate() {
            let found = Magnitude::at(&accel, &order_one(&o.raw), 1.0);
            r[row] = found.residual();
            by_accel(row, &found.block.by(0));
        }
        let turned = self.rotations.at(&gyro.matrix, &gyro.offset);
        for (t, (turn, turned)) in turns.iter().zip(&turned).enumerate() {
            let raw = turn.raw.map(|raw| order_one(&raw));
            let [before, after] = raw.map(|raw| accel.apply(&raw));
            let turn = Turn {
                before,
                after,
                ..*turn
            };
            let error = TurnError::of(&turn, turned);
            for (k, by) in error.by_accel(&raw).iter().enumerate() {
                let row = self.from[1] + 2 * t + k;
                r[row] = error.block.residual[k];
                by_accel(row, by);
                own.push((row, error.block.by(k)));
            }
        }
        for (s, o) in rest.iter().enumerate() {
            let block = vector::at(&gyro, &(o.raw - self.at_rest), &o.rate);
            for axis in 0..3 {
                let row = self.from[2] + 3 * s + axis;
                r[row] = block.residual[axis];
                own.push((row, block.by(axis)));
            }
        }
        let scale = ByTriad::from_fn(|k, _| if k < 9 { self.unit } else { 1.0 });
        for (row, by) in own {
            let by = by.component_mul(&scale).transpose();
            j.view_mut((row, ACCEL), (1, 12)).copy_from(&by);
        }
        out
    }

    fn variances(&self, p: &DVector<f64>) -> Vec<f64> {
        let c = self.models(p).gyro.matrix;
        let squared = c.component_mul(&c);
        let mean = squared.sum() / 3.0;
        let g = self.data.gravity;
        let poses = self.data.variances.iter().map(|v| v / (g * g));
        let turns = self.data.turns.iter();
        let turns = turns.flat_map(|t| [t.variance(mean); 2]);
        let rest = self.data.rest.iter().flat_map(|o| {
            let v = squared * o.variance + o.rate_variance;
            [v.x, v.y, v.z]
        });
        let all = poses.chain(turns).chain(rest);
        all.map(|v| v.max(1e-20)).collect()
    }

    fn lost(&self) -> Failure {
        Failure::NoSolution("the fit to the magnitudes and the turns does not converge".into())
    }
}

impl JointFit<'_> {
    /// Fits both and returns the accelerometer.
    pub fn estimate(&self) -> Result<Estimated, Failure> {
        let scaled = Scaled::of(self);
        let start = scaled.start();
        // The first weights: 5 milli-g, half a degree, and the scatter of the dwells.
        let Scaled { rows, from, .. } = scaled;
        let r = scaled.linearize(&start).residuals;
        let of_rest = r.rows(from[2], rows[2]).norm_squared() / rows[2].max(1) as f64;
        let groups = [0, 1, 2].map(|g| from[g]..from[g] + rows[g]);
        let mut groups = Reweighted::new(groups, [2.5e-5, 7.6e-5, of_rest]);
        let Solved {
            found,
            covariance,
            first_chi2,
        } = groups.solve(&scaled, start)?;
        let p = &found.parameters;
        let c = scaled.models(p).accel.matrix;
        if (0..3).any(|k| !(c[(k, k)] > 0.0)) {
            return Err(scaled.lost());
        }
        // Of the accelerometer's parameters alone, whose columns share one unit. Those of the gyro have others.
        let own = covariance.view((0, 0), (ACCEL, ACCEL)).into_owned();
        let eigen = own.symmetric_eigenvalues();
        let condition = (eigen.max() / eigen.min()).sqrt();
        let (inverse, by) = scaled.to_si(p);
        let parts = (0..3).map(|g| {
            let own = found.at.part(&covariance, &groups.rows[g]);
            let nine = SMatrix::<f64, 9, 9>::from_fn(|i, j| own[(i, j)]);
            let covariance: Covariance = by * nine * by.transpose();
            Part {
                covariance,
                dof: groups.scatter[g].variance_dof(),
                known: groups.scatter[g].known,
            }
        });
        let triad = Triad::from_inverse(inverse, parts.collect())
            .ok_or_else(|| Failure::NoSolution("C is singular".into()))?;
        let mut magnitude = groups.scatter[0];
        magnitude.extra_variance *= self.gravity * self.gravity;
        magnitude.chi2 = first_chi2[0];
        Ok(Estimated {
            triad,
            scatter: vec![(Observable::Magnitude, magnitude)],
            condition,
            delays: None,
            earth: Vec::new(),
            follows_accel: None,
            notes: vec![Warning::WithTurns],
        })
    }
}
