//! Gyro calibration without a table: from the turns between dwells, from the dwells themselves, and from whole turns ([`super::whole_turns`]).
//!
//! Gravity is the reference. The integrated gyro rotates the direction of gravity of one dwell into the frame of the next, where it must agree with
//! the measured direction (references 19 of xu and 12 of fang); at rest the rate is zero. Both are fitted together, because the turns and the
//! readings at rest may need different biases if the model lacks something. The frame is that of the accelerometer, so the full 3x3 matrix contains
//! the alignment of gyro to accelerometer.

use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

use super::chains::Chains;
use super::least_squares::{Grouped, Linearized, Minimum, Observability, Reweighted, Solved, root};
use super::{Estimated, Failure};
use crate::observable::Observable;
use crate::observation::closure::{ClosureError, Closures};
use crate::observation::turn::{Motion, Rest, Rotations, Turn, TurnError};
use crate::observation::{ByTriad, from_centre};
use crate::prior::TriadPrior;
use crate::quantity::AXES;
use crate::triad::{Covariance, Part, Triad, affine};

/// What the rows of each group are. Whole turns are long, and errors of the model grow on the way, so that their directions scatter by themselves.
const GROUPS: [Observable; 6] = [
    Observable::Turns,
    Observable::AfterWholeTurns,
    Observable::WholeTurns,
    Observable::AsDelivered,
    Observable::Force,
    Observable::Rest,
];

/// The group of the accelerometer's errors.
const ERRORS: usize = 4;

/// The elements of C across the axes.
const CROSS: [usize; 6] = [1, 2, 3, 5, 6, 7];

/// Rows of each of [`GROUPS`].
struct Rows([Range<usize>; 6]);

impl Rows {
    /// Of these lengths, one behind the other.
    fn of(lengths: [usize; 6]) -> Self {
        let mut end = 0;
        Self(lengths.map(|length| {
            end += length;
            end - length..end
        }))
    }
}

/// Number of parameters: nine of C, three of o.
pub const PARAMETERS: usize = 12;

/// First guess of C, to within some ten per cent. A direction fixed in the world moves by `f × ω` in the body, so `df = [f]× C (u - u0) dt` is linear
/// in C. It works for any mounting of the gyro and any scale.
///
/// If hands shake, the accelerometer shows more than gravity: a pair has the less weight, the more its magnitude is off.
pub(super) fn guess(motions: &[Motion], rest: &Vector3<f64>, gravity: f64) -> Option<Matrix3<f64>> {
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

/// The turns, whole turns and rests of a gyro about its mean reading at rest. Parameters are of order one: C in units of its own size, o about that reading, and the
/// Earth's level rate in each chain.
struct ByTurns<'a> {
    turns: &'a [Turn<'a>],
    rest: &'a [Rest],
    whole: &'a Closures,
    at_rest: Vector3<f64>,
    /// Units of the twelve parameters.
    scale: ByTriad,
    rotations: Rotations,
    chains: Chains,
    /// First of the two rows of each turn.
    row_of: Vec<usize>,
    rows: Rows,
    /// Errors of the accelerometer, as columns, if they are parameters: each is one standard deviation of it.
    of_errors: Option<DMatrix<f64>>,
    /// Covariance of C and o of the accelerometer.
    of_accel: Covariance,
    /// What is known of the parameters beforehand: rows behind all others.
    prior: Option<&'a TriadPrior>,
}

impl<'a> ByTurns<'a> {
    /// `size` is that of a row of C.
    fn of(
        turns: &'a [Turn<'a>],
        rest: &'a [Rest],
        whole: &'a Closures,
        at_rest: Vector3<f64>,
        size: f64,
        of_accel: Covariance,
        prior: Option<&'a TriadPrior>,
    ) -> Self {
        // Headings do not depend on the accelerometer, and directions do, all of them by the same errors. To weigh one against the other these errors have to be
        // parameters: without them, directions of a tenth of a degree were believed to a fiftieth, and the headings that contradicted them were not.
        let with_errors = !whole.list.is_empty();
        let of_errors =
            with_errors.then(|| root(&DMatrix::from_column_slice(12, 12, of_accel.as_slice())));
        let of_whole = |t: usize| whole.list.iter().any(|c| c.turns.contains(&t));
        let rows = Rows::of([
            2 * (0..turns.len()).filter(|t| !of_whole(*t)).count(),
            2 * (0..turns.len()).filter(|t| of_whole(*t)).count(),
            whole.list.len(),
            whole.delivered.map_or(0, |_| CROSS.len()),
            of_errors.as_ref().map_or(0, DMatrix::ncols),
            3 * rest.len(),
        ]);
        let mut next = [rows.0[0].start, rows.0[1].start];
        let row_of = (0..turns.len()).map(|t| {
            let group = usize::from(of_whole(t));
            next[group] += 2;
            next[group] - 2
        });
        Self {
            row_of: row_of.collect(),
            rows,
            of_errors,
            of_accel,
            prior,
            turns,
            rest,
            whole,
            at_rest,
            scale: ByTriad::from_fn(|k, _| if k < 9 { size } else { 1.0 }),
            rotations: Rotations::new(turns, &at_rest),
            chains: Chains::of(turns, rest),
        }
    }

    /// Number of rows of directions and headings, which depend on the accelerometer.
    fn by_directions(&self) -> usize {
        self.rows.0[2].end
    }

    /// Number of rows of the prior.
    fn prior_rows(&self) -> usize {
        self.prior.map_or(0, TriadPrior::rows)
    }

    /// Number of rows that determine C.
    fn by_matrix(&self) -> usize {
        self.rows.0[3].end
    }

    /// First of the errors of the accelerometer among the parameters.
    fn first_error(&self) -> usize {
        PARAMETERS + 2 * self.chains.count
    }

    /// Number of parameters.
    fn parameters(&self) -> usize {
        let errors = self.of_errors.as_ref().map_or(0, DMatrix::ncols);
        self.first_error() + errors
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

    fn errors(&self, model: &Affine<f64>) -> (Vec<TurnError>, Vec<ClosureError>) {
        let turned = self.rotations.at(&model.matrix, &model.offset);
        let each = self.turns.iter().zip(&turned);
        let errors = each.map(|(turn, turned)| TurnError::of(turn, turned));
        (errors.collect(), self.whole.errors(self.turns, &turned))
    }

    /// How well the turns determine C.
    fn shape(&self, found: &Minimum) -> Observability {
        let turns = self.by_matrix();
        Observability::of(&found.at.jacobian.rows(0, turns).columns(0, 9).into_owned())
    }

    /// What a unit of error of each of the accelerometer's parameters adds to those of `found`.
    ///
    /// If the accelerometer's errors are parameters `e` themselves, in units of a root L of their covariance, the covariance of both is that of `found`
    /// with `e` times L', and the gain is this over `L L'`.
    fn gain(&self, found: &Minimum, covariance: &DMatrix<f64>) -> Covariance {
        let gain = match &self.of_errors {
            Some(root) => {
                let first = self.first_error();
                let with_errors = covariance.view((0, first), (PARAMETERS, root.ncols()));
                // The columns of the root are orthogonal.
                let mut back = root.transpose();
                for mut row in back.row_iter_mut() {
                    row /= row.norm_squared();
                }
                with_errors * back
            }
            None => {
                let mut weighted = self.by_accelerometer(&found.parameters);
                for (mut row, weight) in weighted.row_iter_mut().zip(&found.weights) {
                    row *= *weight;
                }
                let by_turns = found.at.jacobian.rows(0, self.by_directions());
                -(covariance * by_turns.transpose() * weighted)
            }
        };
        Covariance::from_fn(|i, j| gain[(i, j)])
    }

    /// Derivatives of the residuals of turns and whole turns by C and o of the accelerometer.
    fn by_accelerometer(&self, p: &DVector<f64>) -> DMatrix<f64> {
        let (errors, whole) = self.errors(&self.model(p));
        self.by_accelerometer_of(&errors, &whole)
    }

    /// The same for these errors.
    fn by_accelerometer_of(&self, errors: &[TurnError], whole: &[ClosureError]) -> DMatrix<f64> {
        let mut by = DMatrix::zeros(self.by_directions(), 12);
        for (t, (turn, error)) in self.turns.iter().zip(errors).enumerate() {
            for (k, columns) in error.by_accel(&turn.raw).iter().enumerate() {
                by.row_mut(self.row_of[t] + k)
                    .copy_from(&columns.transpose());
            }
        }
        let first = self.rows.0[2].start;
        for (k, (closure, error)) in self.whole.list.iter().zip(whole).enumerate() {
            let columns = error.by_accel(&closure.raw(self.turns));
            by.row_mut(first + k).copy_from(&columns.transpose());
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

impl Grouped<6> for ByTurns<'_> {
    const SHARE: f64 = 1e-3;
    /// The first weights are a guess.
    const ROUNDS: usize = 2;

    /// Rad, and rad/s of the rests.
    fn linearize(&self, p: &DVector<f64>) -> Linearized {
        let model = self.model(p);
        let (errors, whole) = self.errors(&model);
        let rows = (self.chains).rows(self.turns, &errors, self.rest, &model, &self.at_rest);
        let [_, _, headings, delivered, prior, rests] = &self.rows.0;
        let all = rests.end + self.prior_rows();
        let mut out = Linearized::zeros(all, self.parameters());
        for (row, k) in delivered.clone().zip(CROSS) {
            out.residuals[row] = p[k];
            out.jacobian[(row, k)] = 1.0;
        }
        for (k, error) in whole.iter().enumerate() {
            let own = error.block.by(0).component_mul(&self.scale).transpose();
            let row = headings.start + k;
            out.residuals[row] = error.block.residual[0];
            out.jacobian.view_mut((row, 0), (1, 12)).copy_from(&own);
        }
        for (row, found) in rows.iter().enumerate() {
            let row = match self.row_of.get(row / 2) {
                Some(first) => first + row % 2,
                None => rests.start + row - 2 * self.turns.len(),
            };
            out.residuals[row] = found.residual;
            let own = found.by.component_mul(&self.scale).transpose();
            out.jacobian.view_mut((row, 0), (1, 12)).copy_from(&own);
            for (place, by) in found.by_level() {
                let column = PARAMETERS + place;
                out.jacobian[(row, column)] = by;
                out.residuals[row] += by * p[column];
            }
        }
        if let Some(of_errors) = &self.of_errors {
            let first = self.first_error();
            let by = self.by_accelerometer_of(&errors, &whole) * of_errors;
            let moved = &by * p.rows(first, of_errors.ncols());
            for (residual, moved) in out.residuals.iter_mut().zip(&moved) {
                *residual += moved;
            }
            out.jacobian.view_mut((0, first), by.shape()).copy_from(&by);
            for (k, row) in prior.clone().enumerate() {
                out.residuals[row] = p[first + k];
                out.jacobian[(row, first + k)] = 1.0;
            }
        }
        if let Some(prior) = self.prior {
            let count = self.prior_rows();
            let (inverse, change) = self.about_zero(p);
            match prior.residuals(&inverse) {
                Some((residuals, by)) => {
                    out.residuals
                        .rows_mut(rests.end, count)
                        .copy_from(&residuals);
                    let by = by * change;
                    out.jacobian
                        .view_mut((rests.end, 0), (count, PARAMETERS))
                        .copy_from(&by);
                }
                // No unit: a step that leads here is taken back.
                None => out.residuals.rows_mut(rests.end, count).fill(f64::INFINITY),
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
        let rest = self.rest.iter().zip(&self.chains.of_rest);
        let rest = rest.flat_map(|(o, chain)| {
            let v = squared * o.variance + o.rate_variance * unknown(chain) + o.vertical_variance;
            <[f64; 3]>::from(v)
        });
        let [_, _, headings, delivered, prior, rests] = &self.rows.0;
        let mut all = vec![0.0; headings.start];
        all.extend(self.whole.variances(self.turns, mean));
        let cross = self.whole.delivered.unwrap_or_default();
        all.extend(delivered.clone().map(|_| cross * cross));
        all.extend(prior.clone().map(|_| 1.0));
        all.extend(rest);
        debug_assert_eq!(all.len(), rests.end);
        all.resize(rests.end + self.prior_rows(), 1.0);
        let chains = self.chains.of_turn.iter();
        for ((turn, chain), first) in self.turns.iter().zip(chains).zip(&self.row_of) {
            let known = match chain {
                Some(_) => turn.variance_beside_earth(mean),
                None => turn.variance(mean),
            };
            all[*first..first + 2].fill(known);
        }
        all.into_iter().map(|v| v.max(1e-20)).collect()
    }

    /// Errors of the accelerometer's calibration are common to all turns. They go into the parameters in full, and into the size that residuals
    /// may have, but not into the weights.
    fn allowed(&self, found: &Minimum, mut variances: Vec<f64>) -> Vec<f64> {
        if self.of_errors.is_some() {
            return variances;
        }
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
        match shape.is_complete() || self.prior.is_some() {
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
/// unless `start` or a `prior` does; `gravity` in m/s².
pub fn estimate(
    turns: &[Turn],
    rest: &[Rest],
    accel: &Triad,
    motions: &[Motion],
    start: Option<&Affine<f64>>,
    gravity: f64,
    prior: Option<&TriadPrior>,
) -> Result<Estimated, Failure> {
    if prior.is_none() || rest.is_empty() {
        refuse_few(turns, rest, &Closures::default())?;
    }
    let at_rest = mean_at_rest(rest);
    let middle = prior.and_then(TriadPrior::middle);
    let first = match start.or(middle.as_ref()) {
        Some(start) => start.matrix,
        None => guess(motions, &at_rest, gravity).ok_or_else(|| {
            Failure::NoSolution(
                "no scale factor of the gyro makes its turns agree with those of gravity".into(),
            )
        })?,
    };
    fitted(turns, rest, accel, &first, (&Closures::default(), prior))
}

/// Mean reading at rest.
pub(super) fn mean_at_rest(rest: &[Rest]) -> Vector3<f64> {
    rest.iter().map(|o| o.raw).sum::<Vector3<f64>>() / rest.len() as f64
}

/// Refuses turns that are too few for C.
pub(super) fn refuse_few(turns: &[Turn], rest: &[Rest], whole: &Closures) -> Result<(), Failure> {
    if rest.is_empty() || 2 * turns.len() + whole.list.len() + 3 < PARAMETERS {
        return Err(Failure::Undetermined {
            parameters: "C of the gyro".into(),
            add: format!(
                "{} turns between dwells can be used; at least 5 about different axes are needed: turn the unit about each axis, and hold it still in between",
                turns.len()
            )
            .into(),
        });
    }
    Ok(())
}

/// The fit from the matrix `first` on, with the `whole` ones among the turns.
pub(super) fn from(
    turns: &[Turn],
    rest: &[Rest],
    accel: &Triad,
    first: &Matrix3<f64>,
    whole: &Closures,
) -> Result<Estimated, Failure> {
    refuse_few(turns, rest, whole)?;
    fitted(turns, rest, accel, first, (whole, None))
}

fn fitted(
    turns: &[Turn],
    rest: &[Rest],
    accel: &Triad,
    first: &Matrix3<f64>,
    (whole, prior): (&Closures, Option<&TriadPrior>),
) -> Result<Estimated, Failure> {
    let at_rest = mean_at_rest(rest);
    let of_accel = Covariance::from_fn(|i, j| accel.inverse_covariance[(i, j)]);
    let size = first.norm() / 3f64.sqrt();
    let by = ByTurns::of(turns, rest, whole, at_rest, size, of_accel, prior);
    let p = by.start(first);
    // The first weights: half a degree, and the scatter of the dwells.
    let residuals = by.linearize(&p).residuals;
    let rests = by.rows.0[5].clone();
    let of_rest = residuals.rows(rests.start, rests.len());
    let of_rest = of_rest.norm_squared() / rests.len() as f64;
    // Beside a prior they are those of the noise: with half a degree a prior that does not hold was believed, and what then remained of the turns was taken for their scatter.
    let half_degree = match prior {
        None => 0.5f64.to_radians().powi(2),
        Some(_) => 0.0,
    };
    let mut groups = Reweighted::new(
        by.rows.0.clone(),
        [half_degree, half_degree, 0.0, 0.0, 0.0, of_rest],
    );
    let Solved {
        found, covariance, ..
    } = groups.solve(&by, p)?;
    let (inverse, change) = by.about_zero(&found.parameters);
    let of_accelerometer = accel.inverse_parts();
    let accel_dof = of_accelerometer.iter().map(|part| part.dof);
    let accel_dof = accel_dof.fold(f64::INFINITY, f64::min);
    let accel_known = accel.known_covariance().trace() / accel.inverse_covariance.trace();
    let own = groups.rows.iter().zip(&groups.scatter).enumerate();
    let own = own.filter(|(_, (rows, _))| !rows.is_empty());
    let own = own.map(|(group, (rows, scatter))| {
        let own = found.at.part(&covariance, rows);
        let (dof, known) = match group {
            ERRORS => (accel_dof, accel_known),
            _ => (scatter.variance_dof(), scatter.known),
        };
        Part {
            covariance: Covariance::from_fn(|i, j| own[(i, j)]),
            dof,
            known,
        }
    });
    let gain = by.gain(&found, &covariance);
    let shared = of_accelerometer.iter();
    let shared = shared.filter(|_| by.of_errors.is_none());
    let shared = shared.map(|part| part.seen_by(&gain));
    let by_prior = prior.map(|prior| {
        let rows = rests.end..rests.end + prior.rows();
        let own = found.at.part(&covariance, &rows);
        Part::known(Covariance::from_fn(|i, j| own[(i, j)]))
    });
    let parts = own.chain(shared).chain(by_prior);
    let parts = parts.map(|part| part.seen_by(&change));
    let triad = Triad::from_inverse(inverse, parts.collect()).ok_or_else(|| {
        Failure::NoSolution(
            "C is singular: the gyro does not respond to turns about some axis".into(),
        )
    })?;
    Ok(Estimated {
        triad,
        scatter: GROUPS
            .into_iter()
            .zip(groups.scatter)
            .zip(&groups.rows)
            .filter(|((observable, _), rows)| *observable == Observable::Turns || !rows.is_empty())
            .map(|(group, _)| group)
            .collect(),
        condition: match prior {
            None => by.shape(&found).condition,
            // Of data and prior together.
            Some(_) => {
                let of_matrix = covariance.view((0, 0), (9, 9)).into_owned();
                let eigen = of_matrix.symmetric_eigenvalues();
                (eigen.max() / eigen.min()).sqrt()
            }
        },
        delays: None,
        earth: Vec::new(),
        follows_accel: Some(change * gain),
        notes: Vec::new(),
    })
}
