//! Rows of a recording whose only known input is the magnitude of gravity.

use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, SVector, Vector3};

use super::build::{Builder, Part};
use super::{ForceErrors, Row, RowFigure, Stratum, row_variances, shared_by_several};
use crate::effects::quantity::Conditions;
use crate::estimate::Observation;
use crate::estimate::chains::Chains;
use crate::estimate::earth::poses;
use crate::estimate::turn::sensitivity;
use crate::observable::{Observable, StratumName};
use crate::prepared::si_covariance;
use crate::quantity::Sensor;

/// Derivatives of an accelerometer's forces by its affine parameters.
struct Shapes {
    /// Three rows for each observation.
    errors: DMatrix<f64>,
    /// See [`Part::parameters`].
    parameters: DMatrix<f64>,
    /// By all nine elements of C, about the mean reading.
    by_matrix: DMatrix<f64>,
}

/// The nine parameters that the magnitude of gravity determines: C lower triangular, about the mean reading, then o.
fn lower_affine(observations: &[Observation]) -> Shapes {
    let lower = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];
    let n = observations.len();
    let centre = observations.iter().map(|o| o.raw).sum::<Vector3<f64>>() / n.max(1) as f64;
    let mut errors = DMatrix::zeros(3 * n, 9);
    let mut by_matrix = DMatrix::zeros(3 * n, 9);
    for (i, o) in observations.iter().enumerate() {
        for (k, (r, c)) in lower.into_iter().enumerate() {
            errors[(3 * i + r, k)] = o.raw[c] - centre[c];
        }
        for k in 0..3 {
            errors[(3 * i + k, 6 + k)] = 1.0;
            for c in 0..3 {
                by_matrix[(3 * i + k, 3 * k + c)] = o.raw[c] - centre[c];
            }
        }
    }
    let mut parameters = DMatrix::zeros(12, 9);
    for (k, (r, c)) in lower.into_iter().enumerate() {
        parameters[(3 * r + c, k)] = 1.0;
        parameters[(9 + r, k)] = -centre[c];
    }
    for k in 0..3 {
        parameters[(9 + k, 6 + k)] = 1.0;
    }
    Shapes {
        errors,
        parameters,
        by_matrix,
    }
}

impl Builder<'_> {
    /// Matrix from errors along the sensitive axes to errors in the body frame: inverse of the sensitive directions.
    fn to_body(&self) -> Option<Matrix3<f64>> {
        self.direction.try_inverse()
    }

    /// A row for each pose.
    pub(super) fn magnitudes(mut self, inverse: &Affine<f64>) -> Option<Part> {
        let prepared = self.prepared;
        let g = prepared.manifest.gravity_mps2;
        let observations = prepared.observations(Sensor::Accel);
        let n = observations.len();
        let dwells: Vec<usize> = observations.iter().map(|o| o.dwell).collect();
        let body = self.to_body()?;
        let conditions: Vec<Range<usize>> = observations
            .iter()
            .map(|o| self.dwell(o.dwell, inverse.apply(&o.raw)))
            .collect();
        let shapes = lower_affine(&observations);
        let mut y = Vec::new();
        let mut nuisance = DMatrix::zeros(n, 9);
        let mut by_matrix = DMatrix::zeros(n, 9);
        for (i, o) in observations.iter().enumerate() {
            let force = inverse.apply(&o.raw);
            let up = force.normalize();
            self.mean_row(o.dwell, &conditions[i], body.tr_mul(&up));
            y.push(force.norm() - g);
            let by_force = shapes.errors.rows(3 * i, 3);
            nuisance
                .row_mut(i)
                .copy_from(&by_force.tr_mul(&up).transpose());
            let by_force = shapes.by_matrix.rows(3 * i, 3);
            by_matrix
                .row_mut(i)
                .copy_from(&by_force.tr_mul(&up).transpose());
        }
        let variances = prepared.magnitude_variances(inverse, &observations);
        let strata = vec![Stratum {
            name: StratumName(Observable::Magnitude, None),
            axis: None,
            session: 0,
            rows: 0..n,
            known: DMatrix::from_diagonal(&DVector::from_vec(variances)),
            by_reference: None,
            by_earth: None,
            open: None,
            random_walk: Some(self.random_walk(&dwells)),
            wander_known: prepared.noise.has_noise_at_rest(Sensor::Accel),
            within: false,
        }];
        let nuisance = (nuisance, shapes.parameters, by_matrix);
        self.finish(
            y,
            nuisance,
            vec![6, 7, 8],
            strata,
            (RowFigure::Magnitude, n, 1),
        )
    }

    /// Three rows for each pose: the error of the force as a vector. [`Self::magnitudes`] contain only its part along the force. The rest
    /// enters the directions that judge a gyro.
    pub(super) fn forces(mut self, inverse: &Affine<f64>) -> Option<Part> {
        let observations = self.prepared.observations(Sensor::Accel);
        let n = 3 * observations.len();
        let body = self.to_body()?;
        for o in &observations {
            let conditions = self.dwell(o.dwell, inverse.apply(&o.raw));
            for k in 0..3 {
                self.mean_row(o.dwell, &conditions, body.row(k).transpose());
            }
        }
        let shapes = lower_affine(&observations);
        let strata = vec![Stratum {
            name: StratumName(Observable::Force, None),
            axis: None,
            session: 0,
            rows: 0..n,
            known: DMatrix::identity(n, n),
            by_reference: None,
            by_earth: None,
            open: None,
            random_walk: None,
            wander_known: true,
            within: false,
        }];
        let nuisance = (shapes.errors, shapes.parameters, shapes.by_matrix);
        self.finish(
            vec![0.0; n],
            nuisance,
            vec![6, 7, 8],
            strata,
            (RowFigure::Magnitude, n, 3),
        )
    }

    /// Two rows for each turn, which need `accel`, and one for each dwell and axis at rest.
    pub(super) fn turns(
        mut self,
        inverse: &Affine<f64>,
        accel: Option<&Affine<f64>>,
        forces: Option<&ForceErrors>,
    ) -> Option<Part> {
        let prepared = self.prepared;
        let body = self.to_body()?;
        let turns = accel.map_or(Vec::new(), |a| prepared.turns(a).0);
        // Without an accelerometer, as in one pose, the Earth's rate is a part of the bias.
        let nowhere = Affine {
            matrix: Matrix3::zeros(),
            offset: Vector3::zeros(),
        };
        let rest = prepared.rest(accel.unwrap_or(&nowhere));
        let ups: Vec<Vector3<f64>> = rest.iter().map(|o| self.force(o.dwell, accel)).collect();
        let poses = match accel {
            Some(_) => poses(&ups),
            None => vec![0; rest.len()],
        };
        let mean_square = inverse.matrix.norm_squared() / 3.0;
        let mut y = Vec::new();
        let (mut by_force, mut sides, mut rotations) = (Vec::new(), Vec::new(), Vec::new());
        let mut turn_rows: Vec<SVector<f64, 12>> = Vec::new();
        let blocks = &prepared.condensed.blocks;
        for turn in &turns {
            let first = self.conditions.len();
            for (k, piece) in turn.increments.iter().enumerate() {
                let t_s = piece.end_s - 0.5 * piece.duration_s;
                let at = blocks
                    .partition_point(|b| b.last_s < t_s)
                    .min(blocks.len() - 1);
                let raw = Vector3::from(piece.integral) / piece.duration_s;
                let rate = inverse.apply(&raw);
                let reading = Vector3::from_fn(|i, _| blocks[at].raw[3 + i].mean);
                let force = accel.map_or(Vector3::repeat(f64::NAN), |a| a.apply(&reading));
                let mut conditions = self.conditions(at, t_s, piece.duration_s, rate, force);
                conditions.reading.mean = raw;
                if k > 0 {
                    let before: &Conditions = &self.conditions[first + k - 1];
                    conditions.angular_acceleration =
                        (rate - before.rate) / (conditions.t_s - before.t_s);
                }
                self.conditions.push(conditions);
                self.block.push(at);
            }
            let conditions = first..self.conditions.len();
            let found = sensitivity(turn, inverse);
            rotations.push(found.rotation);
            for (side, columns) in found.by_parameters(turn).into_iter().enumerate() {
                let pieces = found.by.iter().zip(turn.increments);
                let weights = pieces
                    .map(|(by, piece)| body.tr_mul(&by[side]) * piece.duration_s)
                    .collect();
                y.push(found.error[side]);
                by_force.push((turn, found.by_force[side]));
                sides.push(found.sides[side]);
                turn_rows.push(columns);
                self.rows.push(Row {
                    conditions: conditions.clone(),
                    weights,
                    dwells: [turn.from, turn.to],
                    moving: false,
                });
            }
        }
        let (m, n) = (y.len(), rest.len());
        let dwells: Vec<usize> = rest.iter().map(|o| o.dwell).collect();
        let conditions: Vec<Range<usize>> = dwells
            .iter()
            .map(|d| self.dwell(*d, self.force(*d, accel)))
            .collect();
        let chains = Chains::of(&turns, &rest);
        let level = chains.level(&turns, rotations.into_iter());
        let mut nuisance = DMatrix::zeros(m + 3 * n, 12 + 2 * chains.count);
        for (row, columns) in turn_rows.iter().enumerate() {
            for (k, v) in columns.iter().enumerate() {
                nuisance[(row, k)] = *v;
            }
            let turn = row / 2;
            if let (Some(chain), Some(level)) = (chains.of_turn[turn], level.get(&turns[turn].to)) {
                for (l, level) in level.iter().enumerate() {
                    let along = sides[row].dot(level);
                    nuisance[(row, 12 + 2 * chain + l)] = turns[turn].duration_s * along;
                }
            }
        }
        let random_walk = (n > 0).then(|| self.random_walk(&dwells));
        let wander = prepared.noise.wander(Sensor::Gyro, &prepared.dwells.list);
        // The mean reading of all dwells at rest instead of each dwell's own, whose noise is in the row too. With the latter, a matrix
        // of zeros would explain that noise wholly, and `rate_x` with coefficient -1 would correct the turns for it.
        let at_rest = rest.iter().map(|o| o.raw).sum::<Vector3<f64>>() / n.max(1) as f64;
        let turn_variances: Vec<f64> = turns
            .iter()
            .zip(&chains.of_turn)
            .flat_map(|(t, chain)| {
                let earth = if chain.is_some() {
                    0.0
                } else {
                    t.earth_variance
                };
                [t.variance(mean_square) + earth; 2]
            })
            .collect();
        // The pose of a dwell whose heading is unknown. In one pose a bias absorbs the Earth's rate.
        let in_one_pose = poses.iter().all(|p| *p == 0);
        let of_pose = |i: usize| (!in_one_pose && chains.of_rest[i].is_none()).then_some(poses[i]);
        let mut strata = Vec::new();
        if m > 0 {
            let by_reference = forces.map(|f| f.of_turns(&by_force));
            strata.push(Stratum {
                name: StratumName(Observable::Turns, None),
                axis: None,
                session: 0,
                rows: 0..m,
                known: DMatrix::from_diagonal(&DVector::from_vec(turn_variances)),
                by_reference: by_reference.as_ref().map(row_variances),
                by_earth: None,
                open: by_reference,
                random_walk: None,
                wander_known: true,
                within: false,
            });
        }
        for axis in 0..3 {
            for (i, o) in rest.iter().enumerate() {
                let row = y.len();
                self.mean_row(o.dwell, &conditions[i], body.row(axis).transpose());
                y.push((inverse.apply(&o.raw) - o.rate)[axis]);
                for k in 0..3 {
                    nuisance[(row, 3 * axis + k)] = at_rest[k];
                }
                nuisance[(row, 9 + axis)] = 1.0;
                if let (Some(chain), Some(level)) = (chains.of_rest[i], level.get(&o.dwell)) {
                    for (l, level) in level.iter().enumerate() {
                        nuisance[(row, 12 + 2 * chain + l)] = level[axis];
                    }
                }
            }
            let c = inverse.matrix.row(axis);
            let noise = |i: usize, j: usize| match (i == j, &wander) {
                (true, _) => si_covariance(&inverse.matrix, &rest[i].variance)[(axis, axis)],
                (_, Some(w)) => (0..3)
                    .map(|k| c[k] * c[k] * w[k][(dwells[i], dwells[j])])
                    .sum(),
                _ => 0.0,
            };
            let mut known = DMatrix::from_fn(n, n, noise);
            // Dwells in one pose share the Earth's level rate if their heading is the same.
            let of_earth = DMatrix::from_fn(n, n, |i, pose| match of_pose(i) == Some(pose) {
                true => rest[pose].rate_variance[axis].sqrt(),
                false => 0.0,
            });
            let mut alone = DVector::zeros(n);
            let open = shared_by_several(&of_earth, &mut alone);
            known += DMatrix::from_diagonal(&alone);
            strata.push(Stratum {
                name: StratumName(Observable::AtRest(axis), None),
                axis: Some(axis),
                session: 0,
                rows: m + axis * n..m + (axis + 1) * n,
                known,
                by_reference: None,
                by_earth: None,
                open,
                random_walk: random_walk.clone(),
                wander_known: wander.is_some(),
                within: false,
            });
        }
        let figure = match m {
            0 => (RowFigure::Rest, 3 * n, 1),
            m => (RowFigure::Direction, m, 2),
        };
        // A bias absorbs the constant part of an error of C.
        let mut by_matrix = nuisance.columns(0, 9).into_owned();
        for (k, mut column) in by_matrix.column_iter_mut().enumerate() {
            column -= nuisance.column(9 + k / 3) * at_rest[k % 3];
        }
        // The direction of Earth rate belongs to the recording, as the biases do.
        let own = 9..nuisance.ncols();
        let nuisance = (nuisance, DMatrix::identity(12, own.end), by_matrix);
        self.finish(y, nuisance, own.collect(), strata, figure)
    }
}
