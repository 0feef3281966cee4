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

use super::least_squares::{Linearized, Reweighted};
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

impl JointFit<'_> {
    /// Fits both and returns the accelerometer.
    pub fn estimate(&self) -> Result<Estimated, Failure> {
        let g = self.gravity;
        let at_rest =
            self.rest.iter().map(|o| o.raw).sum::<Vector3<f64>>() / self.rest.len().max(1) as f64;
        let unit = self.gyro.matrix.norm() / 3f64.sqrt();
        let rotations = Rotations::new(self.turns, &at_rest);
        let unpack = |p: &DVector<f64>| Models {
            accel: lower_triangular(p),
            gyro: Affine {
                matrix: Matrix3::from_fn(|i, j| unit * p[ACCEL + 3 * i + j]),
                offset: Vector3::new(p[18], p[19], p[20]),
            },
        };
        let order_one = |raw: &Vector3<f64>| self.accel.apply(raw) / g;
        let rows = [self.poses.len(), 2 * self.turns.len(), 3 * self.rest.len()];
        let from = [0, rows[0], rows[0] + rows[1]];
        let scale = ByTriad::from_fn(|k, _| if k < 9 { unit } else { 1.0 });
        // Residuals without weights: share of gravity, rad, rad/s.
        let linearize = |p: &DVector<f64>| {
            let Models { accel, gyro } = unpack(p);
            let mut out = Linearized::zeros(rows.iter().sum(), ALL);
            let (r, j) = (&mut out.residuals, &mut out.jacobian);
            let mut by_accel = |row: usize, by: &ByTriad| {
                let by = free(by, &LOWER).transpose();
                j.view_mut((row, 0), (1, ACCEL)).copy_from(&by);
            };
            let mut own = Vec::with_capacity(rows[1] + rows[2]);
            for (row, o) in self.poses.iter().enumerate() {
                let found = Magnitude::at(&accel, &order_one(&o.raw), 1.0);
                r[row] = found.residual();
                by_accel(row, &found.block.by(0));
            }
            let turned = rotations.at(&gyro.matrix, &gyro.offset);
            for (t, (turn, turned)) in self.turns.iter().zip(&turned).enumerate() {
                let raw = turn.raw.map(|raw| order_one(&raw));
                let [before, after] = raw.map(|raw| accel.apply(&raw));
                let turn = Turn {
                    before,
                    after,
                    ..*turn
                };
                let error = TurnError::of(&turn, turned);
                for (k, by) in error.by_accel(&raw).iter().enumerate() {
                    let row = from[1] + 2 * t + k;
                    r[row] = error.block.residual[k];
                    by_accel(row, by);
                    own.push((row, error.block.by(k)));
                }
            }
            for (s, o) in self.rest.iter().enumerate() {
                let block = vector::at(&gyro, &(o.raw - at_rest), &o.rate);
                for axis in 0..3 {
                    let row = from[2] + 3 * s + axis;
                    r[row] = block.residual[axis];
                    own.push((row, block.by(axis)));
                }
            }
            for (row, by) in own {
                let by = by.component_mul(&scale).transpose();
                j.view_mut((row, ACCEL), (1, 12)).copy_from(&by);
            }
            out
        };
        let known = |p: &DVector<f64>| -> Vec<f64> {
            let c = unpack(p).gyro.matrix;
            let squared = c.component_mul(&c);
            let mean = squared.sum() / 3.0;
            let poses = self.variances.iter().map(|v| v / (g * g));
            let turns = self
                .turns
                .iter()
                .flat_map(|t| [t.variance(mean) + t.earth_variance; 2]);
            let rest = self.rest.iter().flat_map(|o| {
                let v = squared * o.variance + o.rate_variance;
                [v.x, v.y, v.z]
            });
            poses
                .chain(turns)
                .chain(rest)
                .map(|v| v.max(1e-20))
                .collect()
        };
        let mut p = DVector::zeros(ALL);
        for k in [0, 2, 5] {
            p[k] = 1.0;
        }
        for i in 0..3 {
            for k in 0..3 {
                p[ACCEL + 3 * i + k] = self.gyro.matrix[(i, k)] / unit;
            }
        }
        let start = self.gyro.apply(&at_rest);
        for i in 0..3 {
            p[18 + i] = start[i];
        }
        let lost = || {
            Failure::NoSolution("the fit to the magnitudes and the turns does not converge".into())
        };
        // The first weights: 5 milli-g, half a degree, and the scatter of the dwells.
        let r = linearize(&p).residuals;
        let of_rest = r.rows(from[2], rows[2]).norm_squared() / rows[2].max(1) as f64;
        let groups = [0, 1, 2].map(|g| from[g]..from[g] + rows[g]);
        let mut groups = Reweighted::new(groups, [2.5e-5, 7.6e-5, of_rest]);
        let mut first_chi2 = None;
        let mut round = 0;
        let (found, covariance) = loop {
            let variances = known(&p);
            let found = groups.minimize(p, &variances, linearize).ok_or_else(lost)?;
            let covariance = found.at.covariance()?;
            let converged = groups.update(&found, &covariance, &variances, 1e-3);
            first_chi2.get_or_insert(groups.scatter[0].chi2);
            round += 1;
            if converged || round == 30 {
                break (found, covariance);
            }
            p = found.parameters;
        };
        let p = &found.parameters;
        let c = unpack(p).accel.matrix;
        if (0..3).any(|k| !(c[(k, k)] > 0.0)) {
            return Err(lost());
        }
        // Of the accelerometer's parameters alone, whose columns share one unit. Those of the gyro have others.
        let own = covariance.view((0, 0), (ACCEL, ACCEL)).into_owned();
        let eigen = own.symmetric_eigenvalues();
        let condition = (eigen.max() / eigen.min()).sqrt();
        let mut change = SMatrix::<f64, 12, 9>::zeros();
        let Affine { matrix, offset } = self.accel;
        for (k, parameter) in LOWER.into_iter().enumerate() {
            match place(parameter) {
                (row, Some(column)) => {
                    for m in 0..3 {
                        change[(3 * row + m, k)] += matrix[(column, m)];
                    }
                    change[(9 + row, k)] += offset[column];
                }
                (row, None) => change[(9 + row, k)] = g,
            }
        }
        let parts = (0..3).map(|g| {
            let own = found.at.part(&covariance, &groups.rows[g]);
            let nine = SMatrix::<f64, 9, 9>::from_fn(|i, j| own[(i, j)]);
            let covariance: Covariance = change * nine * change.transpose();
            Part {
                covariance,
                dof: groups.scatter[g].variance_dof(),
            }
        });
        let change = unpack(p).accel;
        let inverse = Affine {
            matrix: change.matrix * matrix,
            offset: change.matrix * offset + change.offset * g,
        };
        let triad = Triad::from_inverse(inverse, parts.collect())
            .ok_or_else(|| Failure::NoSolution("C is singular".into()))?;
        let mut magnitude = groups.scatter[0];
        magnitude.extra_variance *= g * g;
        magnitude.chi2 = first_chi2.unwrap_or(magnitude.chi2);
        Ok(Estimated {
            triad,
            scatter: vec![(Observable::Magnitude, magnitude)],
            condition,
            delays: None,
            earth: Vec::new(),
            notes: vec![Warning::WithTurns],
        })
    }
}
