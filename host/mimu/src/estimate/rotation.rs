//! Gyro calibration without a table: from the turns between dwells, and from the dwells themselves.
//!
//! Gravity is the reference. The integrated gyro rotates the direction of gravity of one dwell into the frame of the next, where it must agree with
//! the measured direction (references 19 of xu and 12 of fang); at rest the rate is zero. Both are fitted together, because the turns and the
//! readings at rest may need different biases if the model lacks something. The frame is that of the accelerometer, so the full 3x3 matrix contains
//! the alignment of gyro to accelerometer.

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

use super::chains::Chains;
use super::least_squares::{Grouped, Linearized, Minimum, Observability, Reweighted, Solved};
use super::{Estimated, Failure};
use crate::observable::Observable;
use crate::observation::turn::{Motion, Rest, Rotations, Turn, TurnError};
use crate::observation::{ByTriad, from_centre};
use crate::quantity::AXES;
use crate::triad::{Covariance, Part, Triad, affine};

/// Number of parameters: nine of C, three of o.
pub const PARAMETERS: usize = 12;

/// First guess of C, to within some ten per cent. A direction fixed in the world moves by `f × ω` in the body, so `df = [f]× C (u - u0) dt` is linear
/// in C. It works for any mounting of the gyro and any scale.
///
/// If hands shake, the accelerometer shows more than gravity: a pair has the less weight, the more its magnitude is off.
fn guess(motions: &[Motion], rest: &Vector3<f64>, gravity: f64) -> Option<Matrix3<f64>> {
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    let mut right = SVector::<f64, 9>::zeros();
    for m in motions {
        let off = (m.force.norm() - gravity) / (0.1 * gravity);
        let weight = 1.0 / (1.0 + off * off);
        let turned = (m.raw - rest) * m.duration_s;
        let across = m.force.cross_matrix();
        let mut rows = SMatrix::<f64, 3, 9>::zeros();
        for i in 0..3 {
            for j in 0..3 {
                for r in 0..3 {
                    rows[(r, 3 * i + j)] = across[(r, i)] * turned[j];
                }
            }
        }
        normal += rows.transpose() * rows * weight;
        right += rows.transpose() * m.change * weight;
    }
    // Columns of unit size, so that volts and counts are judged alike.
    let scale = normal.diagonal().map(|d| d.sqrt().max(f64::MIN_POSITIVE));
    let scaled = SMatrix::<f64, 9, 9>::from_fn(|i, j| normal[(i, j)] / (scale[i] * scale[j]));
    let solution = scaled
        .cholesky()?
        .solve(&right.component_div(&scale))
        .component_div(&scale);
    let c = Matrix3::from_fn(|i, j| solution[3 * i + j]);
    c.iter().all(|x| x.is_finite()).then_some(c)
}

/// The turns and rests of a gyro about its mean reading at rest. Parameters are of order one: C in units of its own size, o about that reading, and the
/// Earth's level rate in each chain.
struct ByTurns<'a> {
    turns: &'a [Turn<'a>],
    rest: &'a [Rest],
    at_rest: Vector3<f64>,
    /// Units of the twelve parameters.
    scale: ByTriad,
    rotations: Rotations,
    chains: Chains,
    /// Covariance of C and o of the accelerometer.
    of_accel: Covariance,
}

impl<'a> ByTurns<'a> {
    /// `size` is that of a row of C.
    fn of(
        turns: &'a [Turn<'a>],
        rest: &'a [Rest],
        at_rest: Vector3<f64>,
        size: f64,
        of_accel: Covariance,
    ) -> Self {
        Self {
            of_accel,
            turns,
            rest,
            at_rest,
            scale: ByTriad::from_fn(|k, _| if k < 9 { size } else { 1.0 }),
            rotations: Rotations::new(turns, &at_rest),
            chains: Chains::of(turns, rest),
        }
    }

    /// Numbers of rows of turns and of rests.
    fn rows(&self) -> [usize; 2] {
        [2 * self.turns.len(), 3 * self.rest.len()]
    }

    /// Number of parameters.
    fn parameters(&self) -> usize {
        PARAMETERS + 2 * self.chains.count
    }

    /// The parameters of a gyro with the matrix `first`.
    fn start(&self, first: &Matrix3<f64>) -> DVector<f64> {
        DVector::from_fn(self.parameters(), |k, _| match k {
            0..9 => first[(k / 3, k % 3)] / self.scale[k],
            _ => 0.0,
        })
    }

    /// The gyro with these parameters: `ω = C (u - at_rest) + o`.
    fn model(&self, p: &DVector<f64>) -> Affine<f64> {
        affine(&ByTriad::from_fn(|k, _| self.scale[k] * p[k]))
    }

    fn errors(&self, model: &Affine<f64>) -> Vec<TurnError> {
        let turned = self.rotations.at(&model.matrix, &model.offset);
        let each = self.turns.iter().zip(&turned);
        each.map(|(turn, turned)| TurnError::of(turn, turned))
            .collect()
    }

    /// How well the turns determine C.
    fn shape(&self, found: &Minimum) -> Observability {
        let turns = self.rows()[0];
        Observability::of(&found.at.jacobian.rows(0, turns).columns(0, 9).into_owned())
    }

    /// What a unit of each of the accelerometer's parameters adds to those of `found`.
    fn gain(&self, found: &Minimum, covariance: &DMatrix<f64>) -> DMatrix<f64> {
        let mut weighted = self.by_accelerometer(&found.parameters);
        for (mut row, weight) in weighted.row_iter_mut().zip(&found.weights) {
            row *= *weight;
        }
        let by_turns = found.at.jacobian.rows(0, self.rows()[0]);
        covariance * by_turns.transpose() * weighted
    }

    /// Derivatives of the turns' residuals by C and o of the accelerometer.
    fn by_accelerometer(&self, p: &DVector<f64>) -> DMatrix<f64> {
        let mut by = DMatrix::zeros(self.rows()[0], 12);
        let errors = self.errors(&self.model(p));
        for (t, (turn, error)) in self.turns.iter().zip(errors).enumerate() {
            for (k, columns) in error.by_accel(&turn.raw).iter().enumerate() {
                by.row_mut(2 * t + k).copy_from(&columns.transpose());
            }
        }
        by
    }

    /// The gyro at the parameters `p`, raw to rad/s, and what a unit of each of its twelve parameters adds to it.
    fn about_zero(&self, p: &DVector<f64>) -> (Affine<f64>, Covariance) {
        let Affine { matrix, offset } = self.model(p);
        let inverse = Affine {
            matrix,
            offset: offset - matrix * self.at_rest,
        };
        let change = from_centre(&self.at_rest) * SMatrix::from_diagonal(&self.scale);
        (inverse, change)
    }
}

impl Grouped<2> for ByTurns<'_> {
    const SHARE: f64 = 1e-3;
    /// The first weights are a guess.
    const ROUNDS: usize = 2;

    /// Rad, then rad/s.
    fn linearize(&self, p: &DVector<f64>) -> Linearized {
        let model = self.model(p);
        let errors = self.errors(&model);
        let rows = (self.chains).rows(self.turns, &errors, self.rest, &model, &self.at_rest);
        let mut out = Linearized::zeros(rows.len(), self.parameters());
        for (row, found) in rows.iter().enumerate() {
            out.residuals[row] = found.residual;
            let own = found.by.component_mul(&self.scale).transpose();
            out.jacobian.view_mut((row, 0), (1, 12)).copy_from(&own);
            for (place, by) in found.by_level() {
                let column = PARAMETERS + place;
                out.jacobian[(row, column)] = by;
                out.residuals[row] += by * p[column];
            }
        }
        out
    }

    fn variances(&self, p: &DVector<f64>) -> Vec<f64> {
        let c = self.model(p).matrix;
        let squared = c.component_mul(&c);
        let mean = squared.sum() / 3.0;
        // In a chain the Earth's level rate is among the parameters.
        let unknown = |chain: &Option<usize>| f64::from(u8::from(chain.is_none()));
        let turns = self.turns.iter().zip(&self.chains.of_turn);
        let turns =
            turns.flat_map(|(t, chain)| [t.variance(mean) + unknown(chain) * t.earth_variance; 2]);
        let rest = self.rest.iter().zip(&self.chains.of_rest);
        let rest = rest.flat_map(|(o, chain)| {
            let v = squared * o.variance + o.rate_variance * unknown(chain) + o.vertical_variance;
            <[f64; 3]>::from(v)
        });
        turns.chain(rest).map(|v| v.max(1e-20)).collect()
    }

    /// Errors of the accelerometer's calibration are common to all turns. They go into the parameters in full, and into the size that residuals
    /// may have, but not into the weights.
    fn allowed(&self, found: &Minimum, mut variances: Vec<f64>) -> Vec<f64> {
        let by_accel = self.by_accelerometer(&found.parameters);
        let common = (&by_accel * self.of_accel)
            .component_mul(&by_accel)
            .column_sum();
        for (allowed, common) in variances.iter_mut().zip(&common) {
            *allowed += common;
        }
        variances
    }

    fn check(&self, found: &Minimum) -> Result<(), Failure> {
        let shape = self.shape(found);
        match shape.is_complete() {
            true => Ok(()),
            false => Err(undetermined(&shape)),
        }
    }

    fn lost(&self) -> Failure {
        Failure::NoSolution("the fit of the gyro to the turns does not converge".into())
    }
}

fn undetermined(shape: &Observability) -> Failure {
    let names: Vec<String> = shape
        .undetermined
        .iter()
        .map(|(k, _)| format!("C_{}{}", AXES[k / 3], AXES[k % 3]))
        .collect();
    Failure::Undetermined {
        parameters: names.join(", "),
        add: "add turns about every axis, with that axis level and slanted: gravity does not show a turn about the vertical".into(),
    }
}

/// Fits `ω = C u + o` to the turns and to the dwells (`rest`) together.
///
/// The directions of gravity come from `accel`. Its errors are common to all turns, so its covariance is propagated into that of the gyro. (Without
/// this, the intervals of a quiet gyro beside a noisy accelerometer contained the truth in 75 to 81 % of the cases.) `motions` give the first guess
/// unless `start` does; `gravity` in m/s².
pub fn estimate(
    turns: &[Turn],
    rest: &[Rest],
    accel: &Triad,
    motions: &[Motion],
    start: Option<&Affine<f64>>,
    gravity: f64,
) -> Result<Estimated, Failure> {
    if rest.is_empty() || 2 * turns.len() + 3 < PARAMETERS {
        return Err(Failure::Undetermined {
            parameters: "C of the gyro".into(),
            add: format!(
                "{} turns between dwells can be used; at least 5 about different axes are needed: turn the unit about each axis, and hold it still in between",
                turns.len()
            )
            .into(),
        });
    }
    let at_rest = rest.iter().map(|o| o.raw).sum::<Vector3<f64>>() / rest.len() as f64;
    let first = match start {
        Some(start) => start.matrix,
        None => guess(motions, &at_rest, gravity).ok_or_else(|| {
            Failure::NoSolution(
                "no scale factor of the gyro makes its turns agree with those of gravity".into(),
            )
        })?,
    };
    let of_accel = Covariance::from_fn(|i, j| accel.inverse_covariance[(i, j)]);
    let size = first.norm() / 3f64.sqrt();
    let by = ByTurns::of(turns, rest, at_rest, size, of_accel);
    let [n_turns, n_rest] = by.rows();
    let p = by.start(&first);
    // The first weights: half a degree, and the scatter of the dwells.
    let residuals = by.linearize(&p).residuals;
    let of_rest = residuals.rows(n_turns, n_rest).norm_squared() / n_rest as f64;
    let mut groups = Reweighted::new(
        [0..n_turns, n_turns..n_turns + n_rest],
        [0.5f64.to_radians().powi(2), of_rest],
    );
    let Solved {
        found, covariance, ..
    } = groups.solve(&by, p)?;
    let (inverse, change) = by.about_zero(&found.parameters);
    let own = groups.rows.iter().zip(&groups.scatter);
    let own = own.map(|(rows, group)| {
        let own = found.at.part(&covariance, rows);
        Part {
            covariance: Covariance::from_fn(|i, j| own[(i, j)]),
            dof: group.variance_dof(),
        }
    });
    let gain = by.gain(&found, &covariance);
    let gain = Covariance::from_fn(|i, j| gain[(i, j)]);
    let of_accelerometer = accel.inverse_parts();
    let shared = of_accelerometer.iter().map(|part| part.seen_by(&gain));
    let parts = own.chain(shared).map(|part| part.seen_by(&change));
    let triad = Triad::from_inverse(inverse, parts.collect()).ok_or_else(|| {
        Failure::NoSolution(
            "C is singular: the gyro does not respond to turns about some axis".into(),
        )
    })?;
    Ok(Estimated {
        triad,
        scatter: [Observable::Turns, Observable::Rest]
            .into_iter()
            .zip(groups.scatter)
            .collect(),
        condition: by.shape(&found).condition,
        delays: None,
        earth: Vec::new(),
        notes: Vec::new(),
    })
}
