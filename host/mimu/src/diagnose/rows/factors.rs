//! Rows of a list of factors, where gravity is the only reference.

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::build::{Part, mean};
use super::{Stratum, row_variances, shared_by_several};
use crate::estimate::earth::poses;
use crate::factor::chains::Chains;
use crate::factor::{Factors, Kind};
use crate::observable::Observable;
use crate::observation::turn::{Rest, TurnError};
use crate::observation::{ALL, LOWER, vector};
use crate::prepared::si_covariance;
use crate::quantity::Sensor;

impl Part<'_> {
    /// Adds a row for each residual of `factors`. A group is a stratum, and of vectors each axis is one.
    ///
    /// Residuals, derivatives and variances are those of the factors. An error along the sensitive axes is one of o in a dwell, and one of each increment
    /// in a turn.
    fn add_factors(&mut self, factors: &Factors) {
        let values = factors.values(&[(self.sensor, &self.model)]);
        let (at, variances) = (factors.at(&values), factors.variances(&values));
        let all: Vec<_> = factors.list.iter().zip(factors.ranges()).collect();
        for group in all.chunk_by(|a, b| a.0.group == b.0.group) {
            let Some((observable, first)) = group[0].0.group.zip(group[0].0.dwells) else {
                continue;
            };
            let starts = group.iter().filter_map(|(factor, _)| factor.dwells);
            let dwells: Vec<usize> = starts.map(|of| of[0]).collect();
            let random_walk = (first[0] == first[1]).then(|| self.random_walk(&dwells));
            let axes = match group[0].0.kind {
                Kind::Input { .. } => [0, 1, 2].map(Some).to_vec(),
                _ => vec![None],
            };
            for axis in axes {
                let (from, mut known) = (self.lines.len(), Vec::new());
                for (factor, rows) in group {
                    let of_turns = factors.by_increments(&factor.kind, &self.model);
                    let dwells_of = factor.dwells.unwrap_or_default();
                    let rows = rows.clone().enumerate();
                    for (k, r) in rows.filter(|(k, _)| axis.is_none_or(|a| a == *k)) {
                        let mut by = at.jacobian.fixed_view::<1, 12>(r, 0).transpose();
                        let along: Vector3<f64> = by.fixed_rows::<3>(9).into_owned();
                        let row = match &of_turns {
                            Some((turns, by)) => self.sum_over(turns.clone(), &by[k], dwells_of),
                            None => self.mean_over(dwells_of[0], self.to_body.tr_mul(&along)),
                        };
                        // The mean reading of all dwells at rest instead of each dwell's own, whose noise is in the row too. With the latter, a matrix
                        // of zeros would explain that noise wholly, and `rate_x` with coefficient -1 would correct the turns for it.
                        if axis.is_some() {
                            by = vector::at(&self.model, &self.centre, &Vector3::zeros()).by(k);
                        }
                        let own = at.jacobian.row(r).iter().skip(12).copied().collect();
                        self.add(at.residuals[r], &by, own, row);
                        known.push(variances[r]);
                    }
                }
                self.strata.push(Stratum {
                    random_walk: random_walk.clone(),
                    wander_known: random_walk.is_none()
                        || self.session.prepared.noise.has_noise_at_rest(self.sensor),
                    ..Stratum::independent(
                        axis.map_or(observable, Observable::AtRest),
                        from..self.lines.len(),
                        known.into(),
                    )
                });
            }
        }
    }

    /// A row for each pose.
    pub(super) fn add_magnitudes(&mut self) {
        let prepared = self.session.prepared;
        let poses = prepared.observations(Sensor::Accel);
        self.centre = mean(poses.iter().map(|o| &o.raw));
        self.free = &LOWER[..6];
        self.add_factors(&prepared.magnitudes(&self.model).0);
    }

    /// Three rows for each pose: the error of the force as a vector. [`Self::add_magnitudes`] contain only its part along the force. The rest
    /// enters the directions that judge a gyro.
    pub(super) fn add_forces(&mut self) {
        let poses = self.session.prepared.observations(Sensor::Accel);
        self.centre = mean(poses.iter().map(|o| &o.raw));
        self.free = &LOWER[..6];
        for o in &poses {
            let error = vector::at(&self.model, &o.raw, &Vector3::zeros());
            for k in 0..3 {
                let row = self.mean_over(o.dwell, self.to_body.row(k).transpose());
                self.add(0.0, &error.by(k), Vec::new(), row);
            }
        }
        let n = self.lines.len();
        let one = DVector::repeat(n, 1.0);
        self.strata
            .push(Stratum::independent(Observable::Force, 0..n, one));
    }

    /// Two rows for each turn, one for each dwell and axis at rest, and one for each heading after whole turns.
    pub(super) fn add_turns(&mut self) {
        let prepared = self.session.prepared;
        let accel = self.session.accel;
        let turns = accel.map_or(Vec::new(), |a| prepared.turns(&a).0);
        self.turns = turns.iter().map(|turn| self.turn(turn)).collect();
        // Without an accelerometer, as in one pose, the Earth's rate is a part of the bias.
        let nowhere = Affine {
            matrix: Matrix3::zeros(),
            offset: Vector3::zeros(),
        };
        let rest = prepared.rest(&accel.unwrap_or(nowhere));
        self.centre = mean(rest.iter().map(|o| &o.raw));
        self.free = &ALL[..9];
        let chains = Chains::of(&turns, &rest);
        let poses = self.poses(&rest, &chains);
        // The direction of the Earth's rate along a chain belongs to the recording, as the biases do.
        let mut factors = Factors::among(&turns, chains);
        factors.directions(Observable::Turns, |_| true);
        factors.rests(&rest);
        // A turn that has not ended where it began beyond what the placement allows is none.
        let stated = prepared.whole_turns();
        let found = stated.map(|stated| stated.find(&turns, &self.model, &|_, _| 0.0));
        factors.headings(&found.map(|found| found.closures).unwrap_or_default());
        self.add_factors(&factors);
        let wander = prepared.noise.wander(Sensor::Gyro, &prepared.dwells.list);
        for stratum in &mut self.strata {
            match stratum.name.0 {
                Observable::AtRest(axis) => {
                    let matrix = self.model.matrix;
                    stratum.known = noise_at_rest(&matrix, &rest, axis, wander.as_ref());
                    stratum.wander_known = wander.is_some();
                    share_earth(stratum, &rest, &poses, axis);
                }
                Observable::Turns => {
                    let each = turns.iter().flat_map(|turn| {
                        let error = TurnError::at(turn, &self.model);
                        error.by_force.map(|by| (turn, by))
                    });
                    let each: Vec<_> = each.collect();
                    stratum.open = self.session.forces.map(|f| f.of_turns(&each));
                    stratum.by_reference = stratum.open.as_ref().map(row_variances);
                }
                _ => {}
            }
        }
    }

    /// The pose of each dwell at rest whose heading is unknown. In one pose a bias absorbs the Earth's rate.
    fn poses(&self, rest: &[Rest], chains: &Chains) -> Vec<Option<usize>> {
        let up = |o: &Rest| self.force(o.dwell);
        let poses = match self.session.accel {
            Some(_) => poses(&rest.iter().map(up).collect::<Vec<_>>()),
            None => vec![0; rest.len()],
        };
        let in_one_pose = poses.iter().all(|p| *p == 0);
        let of_chains = poses.iter().zip(&chains.of_rest);
        of_chains
            .map(|(pose, chain)| (!in_one_pose && chain.is_none()).then_some(*pose))
            .collect()
    }
}

/// Covariance of the rates at rest about an axis by noise and, if that is known, by the wander of the biases, rad²/s².
fn noise_at_rest(
    matrix: &Matrix3<f64>,
    rest: &[Rest],
    axis: usize,
    wander: Option<&[DMatrix<f64>; 3]>,
) -> DMatrix<f64> {
    let c = matrix.row(axis);
    let noise = |i: usize, j: usize| match (i == j, wander) {
        (true, _) => si_covariance(matrix, &rest[i].variance)[(axis, axis)],
        (_, Some(w)) => (0..3)
            .map(|k| c[k] * c[k] * w[k][(rest[i].dwell, rest[j].dwell)])
            .sum(),
        _ => 0.0,
    };
    DMatrix::from_fn(rest.len(), rest.len(), noise)
}

/// Adds the Earth's level rate, which dwells in one pose share if their heading is the same.
fn share_earth(stratum: &mut Stratum, rest: &[Rest], poses: &[Option<usize>], axis: usize) {
    let n = rest.len();
    let of_earth = DMatrix::from_fn(n, n, |i, pose| match poses[i] == Some(pose) {
        true => rest[pose].rate_variance[axis].sqrt(),
        false => 0.0,
    });
    let mut alone = DVector::zeros(n);
    stratum.open = shared_by_several(&of_earth, &mut alone);
    stratum.known += DMatrix::from_diagonal(&alone);
}
