//! The nonlinear fit of a list of factors: Gauss and Newton's steps with Levenberg's and Marquardt's damping, and groups whose scatter is estimated by
//! iterative reweighting.

use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Vector3};

use super::Failure;
use super::least_squares::{Scatter, degrees_of_freedom, extra_variance, minimize};
use crate::factor::{Factors, Linearized, ParameterBlock, Values};
use crate::observable::Observable;
use crate::observation::from_centre;
use crate::quantity::Sensor;
use crate::signal::power_ons::PowerOns;
use crate::triad::{Covariance, Part, Triad, vector};

/// How a fit moves a block: its values are `about + by * p`, for parameters p of order one.
pub struct Coordinates {
    block: ParameterBlock,
    about: DVector<f64>,
    by: DMatrix<f64>,
    /// Parameters to start from.
    start: DVector<f64>,
    /// Whether residuals are linear in the block, or taken to be.
    linear: bool,
}

impl Coordinates {
    /// Of a triad whose parameters `free` change, from `first` on: C in units of its size, o about the reading `centre` in units of `o`.
    pub fn triad(
        sensor: Sensor,
        first: &Affine<f64>,
        free: &[usize],
        centre: &Vector3<f64>,
        o: f64,
    ) -> Self {
        let size = first.matrix.norm() / 3f64.sqrt();
        let unit = |k: usize| if k < 9 { size } else { o };
        let change = from_centre(centre);
        let start = vector(&first.matrix, &first.apply(centre));
        Self {
            block: ParameterBlock::Triad(sensor),
            about: DVector::zeros(12),
            by: DMatrix::from_fn(12, free.len(), |i, k| change[(i, free[k])] * unit(free[k])),
            start: DVector::from_fn(free.len(), |k, _| start[free[k]] / unit(free[k])),
            linear: false,
        }
    }

    /// Of a block that moves from `about` along the columns of `by`. Residuals are linear in it, or taken to be.
    pub fn linear(block: ParameterBlock, about: DVector<f64>, by: DMatrix<f64>) -> Self {
        Self {
            block,
            about,
            start: DVector::zeros(by.ncols()),
            by,
            linear: true,
        }
    }

    /// The same with the residuals evaluated where the block has moved to, for errors too large to be taken for linear.
    pub fn evaluated(self) -> Self {
        Self {
            linear: false,
            ..self
        }
    }

    /// Of a triad that is known without error.
    pub fn fixed(sensor: Sensor, known: &Affine<f64>) -> Self {
        let about = vector(&known.matrix, &known.offset);
        let about = DVector::from_column_slice(about.as_slice());
        Self::linear(ParameterBlock::Triad(sensor), about, DMatrix::zeros(12, 0))
    }

    /// Of a block of numbers around zero.
    pub fn around_zero(block: ParameterBlock) -> Self {
        let n = block.size();
        Self::linear(block, DVector::zeros(n), DMatrix::identity(n, n))
    }
}

/// A list of factors, and the blocks that are fitted to it.
pub struct FactorFit<'a> {
    factors: Factors<'a>,
    blocks: Vec<ParameterBlock>,
    about: DVector<f64>,
    by: DMatrix<f64>,
    start: DVector<f64>,
    linear: Vec<bool>,
    /// The extra variances have converged when none changes by this share any more.
    share: f64,
    /// Fewest rounds.
    rounds: usize,
    /// Why there is no result if a round does not converge.
    pub lost: String,
    /// Covariance of an error of a block that is not fitted. It is common to all residuals: it goes into the size that these may have, but not into the
    /// weights.
    pub common: Option<(ParameterBlock, Covariance)>,
}

/// Rows that share one extra variance, if one is estimated.
pub struct Group {
    /// What they are; `None` if their known variance is all.
    pub observable: Option<Observable>,
    rows: Range<usize>,
    /// Their scatter so far.
    scatter: Scatter,
    /// Chi-square of the first round, under the first weights.
    first_chi2: Option<f64>,
}

/// A minimum under given weights.
pub struct Minimum {
    /// Parameters.
    pub parameters: DVector<f64>,
    /// Weighted residuals and their derivatives there.
    pub at: Linearized,
    weights: Vec<f64>,
}

/// The last round of a fit.
pub struct Solved<'a> {
    fit: &'a FactorFit<'a>,
    /// The minimum, under the weights of the round before.
    pub found: Minimum,
    /// Covariance of its parameters.
    pub covariance: DMatrix<f64>,
    /// The groups in the order of their rows.
    pub groups: Vec<Group>,
    /// Values of the blocks.
    pub values: Values,
}

/// First extra variance of a direction, rad²: half a degree.
pub const HALF_DEGREE: f64 = 7.6154e-5;

/// Most rounds of a fit.
const MOST_ROUNDS: usize = 30;

impl<'a> FactorFit<'a> {
    /// Of these `factors`, with the blocks moved so; see the fields for the others.
    pub fn new(
        factors: Factors<'a>,
        coordinates: Vec<Coordinates>,
        (share, rounds): (f64, usize),
        lost: impl Into<String>,
    ) -> Self {
        let size = |of: fn(&Coordinates) -> usize| coordinates.iter().map(of).sum::<usize>();
        let [values, parameters] = [size(|c| c.about.len()), size(|c| c.start.len())];
        let mut fit = Self {
            factors,
            blocks: coordinates.iter().map(|c| c.block).collect(),
            about: DVector::zeros(values),
            by: DMatrix::zeros(values, parameters),
            start: DVector::zeros(parameters),
            linear: Vec::new(),
            share,
            rounds,
            lost: lost.into(),
            common: None,
        };
        let mut at = (0, 0);
        for own in coordinates {
            let (n, m) = own.by.shape();
            fit.about.rows_mut(at.0, n).copy_from(&own.about);
            fit.by.view_mut(at, (n, m)).copy_from(&own.by);
            fit.start.rows_mut(at.1, m).copy_from(&own.start);
            fit.linear.extend(std::iter::repeat_n(own.linear, n));
            at = (at.0 + n, at.1 + m);
        }
        fit
    }

    /// Values of the blocks at the parameters `p`.
    pub fn values(&self, p: &DVector<f64>) -> Values {
        Values::new(self.blocks.clone(), &self.about + &self.by * p)
    }

    /// Parameters to start from.
    pub fn start(&self) -> DVector<f64> {
        self.start.clone()
    }

    /// Unweighted residuals and derivatives by the parameters.
    pub fn linearize(&self, p: &DVector<f64>) -> Linearized {
        let all = self.by_values(p);
        Linearized {
            residuals: all.residuals,
            jacobian: all.jacobian * &self.by,
        }
    }

    /// Unweighted residuals and derivatives by the values of the blocks.
    fn by_values(&self, p: &DVector<f64>) -> Linearized {
        let mut values = self.values(p);
        let moved = DVector::from_fn(self.about.len(), |k, _| match self.linear[k] {
            true => values.all[k] - self.about[k],
            false => 0.0,
        });
        values.all -= &moved;
        let mut all = self.factors.at(&values);
        all.residuals += &all.jacobian * moved;
        all
    }

    /// Minimizes from `start` on and estimates the extra variances from the residuals, in turn. `first` gives the first extra variance of a group by its
    /// first residuals; `check` refuses a minimum that the rows do not determine.
    ///
    /// # Errors
    /// No convergence; a singular covariance; those of `check`.
    pub fn solve(
        &'a self,
        mut p: DVector<f64>,
        first: &dyn Fn(Observable, &[f64]) -> f64,
        check: &dyn Fn(&Minimum) -> Result<(), Failure>,
    ) -> Result<Solved<'a>, Failure> {
        let residuals = self.linearize(&p).residuals;
        let group = |(observable, rows): (Option<Observable>, Range<usize>)| {
            let own = &residuals.as_slice()[rows.clone()];
            let extra_variance = observable.map_or(0.0, |of| first(of, own));
            Group {
                observable,
                rows,
                scatter: Scatter {
                    extra_variance,
                    ..Scatter::of_noise(1.0)
                },
                first_chi2: None,
            }
        };
        let mut groups: Vec<Group> = self.factors.groups().map(group).collect();
        let mut round = 0;
        loop {
            let mut variances = self.factors.variances(&self.values(&p));
            let weights = weights(&groups, &variances);
            let minimum = minimize(p, |p| self.linearize(p).weighted(&weights));
            let (parameters, at) = minimum.ok_or_else(|| self.failure())?;
            let found = Minimum {
                parameters,
                at,
                weights,
            };
            check(&found)?;
            let singular = || Failure::NoSolution("the normal matrix is singular".into());
            let covariance = found.at.covariance().ok_or_else(singular)?;
            if let Some((block, covariance)) = &self.common {
                let by = self.by_block(*block, &found.parameters);
                let common = (&by * covariance).component_mul(&by).column_sum();
                variances.iter_mut().zip(&common).for_each(|(v, c)| *v += c);
            }
            let converged = update(&mut groups, &found, &covariance, &variances, self.share);
            round += 1;
            if converged && round >= self.rounds || round == MOST_ROUNDS {
                return Ok(Solved {
                    values: self.values(&found.parameters),
                    fit: self,
                    found,
                    covariance,
                    groups,
                });
            }
            p = found.parameters;
        }
    }

    /// No convergence.
    pub fn failure(&self) -> Failure {
        Failure::NoSolution(self.lost.clone())
    }

    /// Unweighted derivatives by a block, whether it is fitted or not.
    fn by_block(&self, block: ParameterBlock, p: &DVector<f64>) -> DMatrix<f64> {
        let all = self.by_values(p).jacobian;
        let columns = self.values(p).range(block).unwrap_or_default();
        all.columns_range(columns).into_owned()
    }
}

/// Mean of the squares.
pub fn mean_square(residuals: &[f64]) -> f64 {
    residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len() as f64
}

/// Weights of rows with these known variances.
fn weights(groups: &[Group], variances: &[f64]) -> Vec<f64> {
    let mut total = variances.to_vec();
    for group in groups {
        let own = &mut total[group.rows.clone()];
        own.iter_mut()
            .for_each(|v| *v += group.scatter.extra_variance);
    }
    total.iter().map(|v| v.sqrt().recip()).collect()
}

/// Estimates the extra variances again beside these known ones, for parameters with this covariance. Returns whether all have changed by less than this
/// share.
fn update(
    groups: &mut [Group],
    found: &Minimum,
    covariance: &DMatrix<f64>,
    variances: &[f64],
    share: f64,
) -> bool {
    let mut converged = true;
    for group in groups.iter_mut().filter(|g| g.observable.is_some()) {
        let rows = group.rows.clone();
        let j = found.at.jacobian.rows(rows.start, rows.len());
        // The trace of J C J' without that matrix, which would fill the memory for thousands of dwells.
        let taken = (j * covariance).component_mul(&j).sum();
        let residual = |k: usize| found.at.residuals[k] / found.weights[k];
        let residuals: Vec<f64> = rows.clone().map(residual).collect();
        let dof = degrees_of_freedom(rows.len(), taken);
        let before = group.scatter.extra_variance;
        group.scatter = extra_variance(&residuals, &variances[rows], dof);
        group.first_chi2.get_or_insert(group.scatter.chi2);
        converged &= (group.scatter.extra_variance - before).abs() <= share * before;
    }
    converged
}

impl Solved<'_> {
    /// Derivatives of the values of a block by the parameters.
    fn change(&self, block: ParameterBlock) -> DMatrix<f64> {
        let rows = self.values.range(block).unwrap_or_default();
        self.fit.by.rows_range(rows).into_owned()
    }

    /// What each group adds to the covariance of a triad.
    pub fn parts(&self, sensor: Sensor) -> Vec<Part> {
        let change = self.change(ParameterBlock::Triad(sensor));
        let part = |group: &Group| {
            let own = self.found.at.part(&self.covariance, &group.rows);
            let own = &change * own * change.transpose();
            Part {
                covariance: Covariance::from_fn(|i, j| own[(i, j)]),
                dof: group.scatter.variance_dof(),
                known: group.scatter.known,
            }
        };
        self.groups.iter().map(part).collect()
    }

    /// What a unit of error of each parameter of the accelerometer adds to those of the gyro.
    ///
    /// If the accelerometer is fitted too, beside what was known of it, it is the covariance of both times that `information`.
    pub fn gain(&self, information: Option<&DMatrix<f64>>) -> Covariance {
        let [gyro, accel] =
            [Sensor::Gyro, Sensor::Accel].map(|sensor| self.change(ParameterBlock::Triad(sensor)));
        let gain = match information {
            Some(information) => gyro * &self.covariance * accel.transpose() * information,
            None => {
                let p = &self.found.parameters;
                let mut by = self.fit.by_block(ParameterBlock::Triad(Sensor::Accel), p);
                for (mut row, weight) in by.row_iter_mut().zip(&self.found.weights) {
                    row *= *weight;
                }
                -(gyro * &self.covariance * self.found.at.jacobian.tr_mul(&by))
            }
        };
        Covariance::from_fn(|i, j| gain[(i, j)])
    }

    /// Condition of the first `count` parameters, by their covariance.
    pub fn condition(&self, count: usize) -> f64 {
        let own = self.covariance.view((0, 0), (count, count)).into_owned();
        let eigen = own.symmetric_eigenvalues();
        (eigen.max() / eigen.min()).sqrt()
    }

    /// The scatter of the groups in which it was estimated. `first`: with the chi-square of the first round.
    pub fn scatter(&self, first: bool) -> impl Iterator<Item = (Observable, Scatter)> {
        self.groups.iter().filter_map(move |group| {
            let mut scatter = group.scatter;
            if first {
                scatter.chi2 = group.first_chi2?;
            }
            Some((group.observable?, scatter))
        })
    }

    /// By what the bias o of a triad differs in the other power-ons, and the standard deviation, SI; zeros for a power-on without factors.
    pub fn bias_steps(&self, sensor: Sensor, power_ons: &PowerOns) -> Vec<[Vector3<f64>; 2]> {
        let step = |number| {
            let block = ParameterBlock::BiasStep(sensor, number);
            let range = self.values.range(block)?;
            let change = self.change(block);
            let covariance = &change * &self.covariance * change.transpose();
            let sigma = |k: usize, _| covariance[(k, k)].sqrt();
            Some([
                self.values.all.fixed_rows::<3>(range.start).into_owned(),
                Vector3::from_fn(sigma),
            ])
        };
        let each = (1..=power_ons.others()).map(step);
        each.map(|step| step.unwrap_or_else(|| [Vector3::zeros(); 2]))
            .collect()
    }

    /// The triad with these parts of its covariance.
    ///
    /// # Errors
    /// C is `singular`.
    pub fn triad(
        &self,
        sensor: Sensor,
        parts: Vec<Part>,
        singular: &str,
    ) -> Result<Triad, Failure> {
        let inverse = self.values.triad(sensor);
        let triad = inverse.and_then(|inverse| Triad::from_inverse(inverse, parts));
        triad.ok_or_else(|| Failure::NoSolution(singular.into()))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;
    use crate::factor::Kind;
    use crate::factor::chains::Chains;
    use crate::observation::closure::{Closure, Closures};
    use crate::observation::turn::{Path, Rest, Turn, TurnError};
    use crate::observation::{ALL, LOWER};
    use crate::signal::increment::Increment;

    /// A turn by `angle`, rad, in a second, read in SI by a gyro with the bias `bias`.
    fn increment(angle: [f64; 3], bias: &Vector3<f64>) -> Increment {
        let mut one = Increment::EMPTY;
        one.duration_s = 1.0;
        one.integral = (Vector3::from(angle) + bias).into();
        one
    }

    #[test]
    fn derivatives_by_every_parameter_are_those_of_differences() {
        let bias = Vector3::new(5.0, -3.0, 4.0);
        let (gyro, accel) = (
            Affine {
                matrix: Matrix3::identity(),
                offset: -bias,
            },
            Affine::identity(),
        );
        let angles = [
            [1.2, 0.3, -0.2],
            [-0.4, 1.1, 0.5],
            [0.2, -0.7, 1.0],
            [-1.3, 0.2, 0.4],
            [0.6, 0.8, -0.9],
        ];
        let pieces = angles.map(|angle| [increment(angle, &bias)]);
        let mut force = Vector3::new(1.0, -2.0, 9.5);
        let mut turns: Vec<Turn> = Vec::new();
        for (from, increments) in pieces.iter().enumerate() {
            let mut turn = Turn {
                from,
                to: from + 1,
                steps: [0; 2],
                increments,
                before: force,
                after: force,
                raw: [force; 2],
                direction_variance: 0.0,
                earth_variance: 0.0,
                integral_variance: 0.0,
                duration_s: 1.0,
            };
            force = TurnError::at(&turn, &gyro).rotation * force;
            (turn.after, turn.raw[1]) = (force, force);
            turns.push(turn);
        }
        let rest = [0, 1, 2, 3, 4, 5].map(|dwell| Rest {
            dwell,
            raw: bias,
            variance: Vector3::zeros(),
            rate: Vector3::zeros(),
            rate_variance: Vector3::zeros(),
            vertical_variance: Vector3::zeros(),
        });
        let whole = Closures {
            list: vec![Closure {
                turns: 1..3,
                path: Path::of(&turns[1..3], &gyro),
            }],
            ..Closures::default()
        };
        let mut factors = Factors::among(&turns, Chains::of(&turns, &rest));
        factors.directions(Observable::Turns, |_| true);
        factors.headings(&whole);
        factors.rests(&rest);
        let given = ParameterBlock::GivenMagnitude(0);
        factors.magnitude(Sensor::Accel, (0, force), (9.7, Some(0)), 1.0);
        let one = DMatrix::identity(1, 1);
        factors.known(Kind::Stated(given, DVector::zeros(1), one, 1.0), None);
        let coordinates = vec![
            Coordinates::triad(Sensor::Gyro, &gyro, &ALL, &bias, 0.1),
            Coordinates::triad(Sensor::Accel, &accel, &LOWER, &Vector3::zeros(), 9.8),
            Coordinates::around_zero(ParameterBlock::LevelRate(0)),
            Coordinates::around_zero(given),
        ];
        let fit = FactorFit::new(factors, coordinates, (1e-3, 1), "lost");
        // The derivatives of directions are those of small errors.
        let p = fit.start() + DVector::from_fn(24, |k, _| 1e-4 * (k as f64).sin());
        let jacobian = fit.linearize(&p).jacobian;
        for k in 0..p.len() {
            let at = |step: f64| {
                let mut moved = p.clone();
                moved[k] += step;
                fit.linearize(&moved).residuals
            };
            let column = (at(1e-5) - at(-1e-5)) / 2e-5;
            let (off, size) = ((&column - jacobian.column(k)).norm(), column.norm());
            assert!(size > 0.0 && off < 1e-3 * size, "{k}: {off:e} of {size:e}");
        }
    }
}
