//! Rows of a recording whose only known input is the magnitude of gravity.

use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::build::{Builder, Part};
use super::{ForceErrors, Row, RowFigure, Stratum, row_variances, shared_by_several};
use crate::effects::quantity::Conditions;
use crate::estimate::earth::poses;
use crate::factor::chains::Chains;
use crate::factor::{Factors, Linearized};
use crate::observable::{Observable, StratumName};
use crate::observation::closure::{ClosureError, Closures};
use crate::observation::magnitude::Magnitude;
use crate::observation::turn::{Rest, Turn, TurnError};
use crate::observation::{ByTriad, LOWER, about, from_centre, vector};
use crate::prepared::si_covariance;
use crate::quantity::Sensor;

/// Derivatives of rows by the affine parameters of an accelerometer.
struct Shapes {
    /// By the parameters that the magnitude of gravity determines, about the mean reading.
    nuisance: DMatrix<f64>,
    /// See [`Part::parameters`].
    parameters: DMatrix<f64>,
    /// By all nine elements of C, about the mean reading.
    by_matrix: DMatrix<f64>,
}

impl Shapes {
    /// Of rows with the derivatives `by`.
    fn of(by: &[ByTriad], centre: &Vector3<f64>) -> Self {
        let by: Vec<ByTriad> = by.iter().map(|by| about(by, centre)).collect();
        let (n, change) = (by.len(), from_centre(centre));
        Self {
            nuisance: DMatrix::from_fn(n, LOWER.len(), |i, k| by[i][LOWER[k]]),
            parameters: DMatrix::from_fn(12, LOWER.len(), |i, k| change[(i, LOWER[k])]),
            by_matrix: DMatrix::from_fn(n, 9, |i, k| by[i][k]),
        }
    }
}

/// Mean of the readings.
fn mean<'a>(readings: impl ExactSizeIterator<Item = &'a Vector3<f64>>) -> Vector3<f64> {
    let count = readings.len().max(1) as f64;
    readings.sum::<Vector3<f64>>() / count
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
        let (mut y, mut by) = (Vec::new(), Vec::new());
        for (i, o) in observations.iter().enumerate() {
            let error = Magnitude::at(inverse, &o.raw, g);
            self.mean_row(o.dwell, &conditions[i], body.tr_mul(&error.up));
            y.push(error.residual());
            by.push(error.block.by(0));
        }
        let shapes = Shapes::of(&by, &mean(observations.iter().map(|o| &o.raw)));
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
        let nuisance = (shapes.nuisance, shapes.parameters, shapes.by_matrix);
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
        let errors = observations
            .iter()
            .map(|o| vector::at(inverse, &o.raw, &Vector3::zeros()));
        let by: Vec<ByTriad> = errors.flat_map(|e| [0, 1, 2].map(|k| e.by(k))).collect();
        let shapes = Shapes::of(&by, &mean(observations.iter().map(|o| &o.raw)));
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
        let nuisance = (shapes.nuisance, shapes.parameters, shapes.by_matrix);
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
        let mut errors = Vec::new();
        let mut of_turns = Vec::new();
        for turn in &turns {
            let (error, conditions) = self.turn(turn, inverse, accel, &body);
            errors.push(error);
            of_turns.push(conditions);
        }
        let by_hand = ByHand::of(&self, *inverse, accel, turns, errors);
        let (m, n) = (by_hand.turn_rows(), by_hand.rest.len());
        let dwells: Vec<usize> = by_hand.rest.iter().map(|o| o.dwell).collect();
        let conditions: Vec<Range<usize>> = dwells
            .iter()
            .map(|d| self.dwell(*d, self.force(*d, accel)))
            .collect();
        let nuisance = by_hand.nuisance();
        let residuals = &by_hand.at.residuals;
        let mut y = residuals.as_slice()[..m].to_vec();
        let mut strata = Vec::new();
        if m > 0 {
            strata.push(by_hand.turn_stratum(forces));
        }
        let random_walk = (n > 0).then(|| self.random_walk(&dwells));
        let wander = prepared.noise.wander(Sensor::Gyro, &prepared.dwells.list);
        for axis in 0..3 {
            for (i, dwell) in dwells.iter().enumerate() {
                self.mean_row(*dwell, &conditions[i], body.row(axis).transpose());
                y.push(residuals[m + 3 * i + axis]);
            }
            strata.push(by_hand.rest_stratum(axis, wander.as_ref(), random_walk.as_ref()));
        }
        for closure in &by_hand.whole.list {
            self.heading(&by_hand, closure.turns.clone(), &of_turns, &body);
            y.push(residuals[y.len()]);
        }
        strata.extend(by_hand.heading_stratum());
        let figure = match m {
            0 => (RowFigure::Rest, 3 * n, 1),
            m => (RowFigure::Direction, m, 2),
        };
        // A bias absorbs the constant part of an error of C.
        let whole = nuisance.columns(0, 12);
        let change = from_centre(&by_hand.at_rest);
        let by_matrix = whole * DMatrix::from_fn(12, 9, |i, k| change[(i, k)]);
        // The direction of Earth rate belongs to the recording, as the biases do.
        let own = 9..nuisance.ncols();
        let nuisance = (nuisance, DMatrix::identity(12, own.end), by_matrix);
        self.finish(y, nuisance, own.collect(), strata, figure)
    }

    /// Adds the row of the heading after the whole turns `own`, whose conditions are among `of_turns`.
    fn heading(
        &mut self,
        by_hand: &ByHand,
        own: Range<usize>,
        of_turns: &[Range<usize>],
        body: &Matrix3<f64>,
    ) {
        let turns = &by_hand.turns[own.clone()];
        let by = ClosureError::by_increments(turns, &by_hand.inverse).unwrap_or_default();
        let pieces = turns.iter().flat_map(|turn| turn.increments);
        let weights = by.iter().flatten().zip(pieces);
        let weights = weights.map(|(by, piece)| body.tr_mul(by) * piece.duration_s);
        self.rows.push(Row {
            // Neighbouring turns have neighbouring conditions.
            conditions: of_turns[own.start].start..of_turns[own.end - 1].end,
            weights: weights.collect(),
            dwells: [turns[0].from, turns[turns.len() - 1].to],
            moving: false,
        });
    }

    /// Adds the two rows of a turn; returns its error and its conditions.
    fn turn(
        &mut self,
        turn: &Turn,
        inverse: &Affine<f64>,
        accel: Option<&Affine<f64>>,
        body: &Matrix3<f64>,
    ) -> (TurnError, Range<usize>) {
        let conditions = self.increments(turn, inverse, accel);
        let (error, by) = TurnError::with_increments(turn, inverse);
        for side in 0..2 {
            let pieces = by.iter().zip(turn.increments);
            let weights = pieces
                .map(|(by, piece)| body.tr_mul(&by[side]) * piece.duration_s)
                .collect();
            self.rows.push(Row {
                conditions: conditions.clone(),
                weights,
                dwells: [turn.from, turn.to],
                moving: false,
            });
        }
        (error, conditions)
    }

    /// The conditions of a turn, increment by increment.
    fn increments(
        &mut self,
        turn: &Turn,
        inverse: &Affine<f64>,
        accel: Option<&Affine<f64>>,
    ) -> Range<usize> {
        let blocks = &self.prepared.condensed.blocks;
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
        first..self.conditions.len()
    }
}

/// What a gyro by hand is judged by: turns, dwells at rest, and headings after whole turns.
struct ByHand<'a> {
    inverse: Affine<f64>,
    turns: Vec<Turn<'a>>,
    errors: Vec<TurnError>,
    /// The whole ones among the turns.
    whole: Closures,
    rest: Vec<Rest>,
    /// Mean reading of all dwells at rest, raw.
    at_rest: Vector3<f64>,
    /// Residuals of the turns, then of the dwells at rest, then of the headings, and their derivatives by the gyro and the level rates of the chains.
    at: Linearized,
    /// Known variances of these.
    variances: Vec<f64>,
    /// The pose of each dwell at rest whose heading is unknown. In one pose a bias absorbs the Earth's rate.
    poses: Vec<Option<usize>>,
}

impl<'a> ByHand<'a> {
    fn of(
        builder: &Builder<'a>,
        inverse: Affine<f64>,
        accel: Option<&Affine<f64>>,
        turns: Vec<Turn<'a>>,
        errors: Vec<TurnError>,
    ) -> Self {
        // Without an accelerometer, as in one pose, the Earth's rate is a part of the bias.
        let nowhere = Affine {
            matrix: Matrix3::zeros(),
            offset: Vector3::zeros(),
        };
        let rest = builder.prepared.rest(accel.unwrap_or(&nowhere));
        let up = |o: &Rest| builder.force(o.dwell, accel);
        let poses = match accel {
            Some(_) => poses(&rest.iter().map(up).collect::<Vec<_>>()),
            None => vec![0; rest.len()],
        };
        let chains = Chains::of(&turns, &rest);
        let in_one_pose = poses.iter().all(|p| *p == 0);
        let of_chains = poses.iter().zip(&chains.of_rest);
        let poses = of_chains
            .map(|(pose, chain)| (!in_one_pose && chain.is_none()).then_some(*pose))
            .collect();
        let mut factors = Factors::among(&turns, chains);
        factors.directions(Observable::Turns, |_| true);
        factors.rests(&rest);
        // A turn that has not ended where it began beyond what the placement allows is none.
        let stated = builder.prepared.whole_turns();
        let found = stated.map(|stated| stated.find(&turns, &inverse, &|_, _| 0.0));
        let whole = found.map(|found| found.closures).unwrap_or_default();
        factors.headings(&whole);
        let values = factors.values(&[(Sensor::Gyro, &inverse)]);
        Self {
            at: factors.at(&values),
            variances: factors.variances(&values),
            inverse,
            turns,
            errors,
            whole,
            at_rest: mean(rest.iter().map(|o| &o.raw)),
            rest,
            poses,
        }
    }

    fn turn_rows(&self) -> usize {
        2 * self.turns.len()
    }

    /// Derivatives of the rows by the gyro and the level rates of the chains. Here the rests are by axes.
    fn nuisance(&self) -> DMatrix<f64> {
        // The mean reading of all dwells at rest instead of each dwell's own, whose noise is in the row too. With the latter, a matrix
        // of zeros would explain that noise wholly, and `rate_x` with coefficient -1 would correct the turns for it.
        let by_rest = vector::at(&self.inverse, &self.at_rest, &Vector3::zeros()).by;
        let (m, n) = (self.turn_rows(), self.rest.len());
        let mut nuisance = self.at.jacobian.clone();
        for (i, axis) in (0..n).flat_map(|i| [0, 1, 2].map(|axis| (i, axis))) {
            let mut row = self.at.jacobian.row(m + 3 * i + axis).into_owned();
            row.columns_mut(0, 12).copy_from(&by_rest.row(axis));
            nuisance.set_row(m + axis * n + i, &row);
        }
        nuisance
    }

    /// `forces` are the errors of those that judge the turns.
    fn turn_stratum(&self, forces: Option<&ForceErrors>) -> Stratum {
        let pairs = self.turns.iter().zip(&self.errors);
        let by_force: Vec<_> = pairs
            .flat_map(|(turn, error)| error.by_force.map(|by| (turn, by)))
            .collect();
        let by_reference = forces.map(|f| f.of_turns(&by_force));
        Stratum {
            name: StratumName(Observable::Turns, None),
            axis: None,
            session: 0,
            rows: 0..self.turn_rows(),
            known: DMatrix::from_diagonal(&DVector::from_column_slice(
                &self.variances[..self.turn_rows()],
            )),
            by_reference: by_reference.as_ref().map(row_variances),
            by_earth: None,
            open: by_reference,
            random_walk: None,
            wander_known: true,
            within: false,
        }
    }

    /// Headings after whole turns, if there are any.
    fn heading_stratum(&self) -> Option<Stratum> {
        let first = self.turn_rows() + 3 * self.rest.len();
        let rows = first..self.variances.len();
        (!rows.is_empty()).then(|| Stratum {
            name: StratumName(Observable::WholeTurns, None),
            axis: None,
            session: 0,
            known: DMatrix::from_diagonal(&DVector::from_column_slice(
                &self.variances[rows.clone()],
            )),
            rows,
            by_reference: None,
            by_earth: None,
            open: None,
            random_walk: None,
            wander_known: true,
            within: false,
        })
    }

    /// With the wander of the biases, if that is known.
    fn rest_stratum(
        &self,
        axis: usize,
        wander: Option<&[DMatrix<f64>; 3]>,
        random_walk: Option<&DMatrix<f64>>,
    ) -> Stratum {
        let (m, n) = (self.turn_rows(), self.rest.len());
        let mut known = self.noise_at_rest(axis, wander);
        // Dwells in one pose share the Earth's level rate if their heading is the same.
        let of_earth = DMatrix::from_fn(n, n, |i, pose| match self.poses[i] == Some(pose) {
            true => self.rest[pose].rate_variance[axis].sqrt(),
            false => 0.0,
        });
        let mut alone = DVector::zeros(n);
        let open = shared_by_several(&of_earth, &mut alone);
        known += DMatrix::from_diagonal(&alone);
        Stratum {
            name: StratumName(Observable::AtRest(axis), None),
            axis: Some(axis),
            session: 0,
            rows: m + axis * n..m + (axis + 1) * n,
            known,
            by_reference: None,
            by_earth: None,
            open,
            random_walk: random_walk.cloned(),
            wander_known: wander.is_some(),
            within: false,
        }
    }

    fn noise_at_rest(&self, axis: usize, wander: Option<&[DMatrix<f64>; 3]>) -> DMatrix<f64> {
        let (c, rest) = (self.inverse.matrix.row(axis), &self.rest);
        let noise = |i: usize, j: usize| match (i == j, wander) {
            (true, _) => si_covariance(&self.inverse.matrix, &rest[i].variance)[(axis, axis)],
            (_, Some(w)) => (0..3)
                .map(|k| c[k] * c[k] * w[k][(rest[i].dwell, rest[j].dwell)])
                .sum(),
            _ => 0.0,
        };
        DMatrix::from_fn(rest.len(), rest.len(), noise)
    }
}
