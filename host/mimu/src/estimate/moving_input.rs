//! Least squares with known inputs that move within dwells.
//!
//! Besides the means of dwells it fits the other sums over dwells whose input moves, in which the bias cancels. A reading lags its reference, because
//! of the filters of the sensor and the clocks of table and converter. Half a millisecond at 200 deg/s is an error of 17 mm/s², a hundred times the
//! uncertainty of the means. So each axis also has a delay: `u = b + P (x - τ ẋ)`.

use nalgebra::{DMatrix, DVector, Matrix3, RowVector3, Vector3};

use super::inputs::span;
use super::known_input::{AxisEstimate, complete, errors, forward, positive};
use super::least_squares::{
    Errors, Group, Observability, POORLY_DETERMINED, Scatter, Solution, solve_groups,
};
use super::{Delays, Estimated, Failure, Observation, earth_shared};
use crate::observable::Observable;
use crate::warning::Warning;

/// Iterations for the delay. The model is linear except for the product of delay and scale factor, and the third iteration changes nothing.
const STEPS: usize = 6;
/// A change of a delay by less than this share of its sigma ends the iteration.
const SETTLED: f64 = 1e-3;

/// The means of dwells (0) and the other sums (1).
struct Experiment<'a> {
    parts: [&'a [Observation]; 2],
    span: f64,
}

impl Experiment<'_> {
    /// Design of means (0) or other sums (1): `[b, P1, P2, P3]`, inputs in units of the span and delayed by `delay`. With `forward`, the change of
    /// the reading with the input, raw/SI, it has a column for the delay too.
    fn design(&self, part: usize, delay: f64, forward: Option<RowVector3<f64>>) -> DMatrix<f64> {
        let all = self.parts[part];
        DMatrix::from_fn(all.len(), 4 + usize::from(forward.is_some()), |i, j| {
            let o = &all[i];
            match (j, forward) {
                (0, _) => [1.0, 0.0][part],
                (4, Some(forward)) => -(forward * o.change)[(0, 0)],
                _ => (o.input[j - 1] - delay * o.change[j - 1]) / self.span,
            }
        })
    }

    /// Both parts of the design, one below the other.
    fn whole(&self, delay: f64, forward: Option<RowVector3<f64>>) -> DMatrix<f64> {
        let [a, b] = [0, 1].map(|part| self.design(part, delay, forward));
        let mut all = a.clone().resize_vertically(a.nrows() + b.nrows(), 0.0);
        all.rows_mut(a.nrows(), b.nrows()).copy_from(&b);
        all
    }

    /// Solution of sensor `axis`.
    fn solve(
        &self,
        axis: usize,
        errors: &[Errors; 2],
        delay: f64,
        forward: Option<RowVector3<f64>>,
    ) -> Option<(Solution, Vec<Scatter>)> {
        let groups = [0, 1].map(|part| {
            let all = self.parts[part];
            Group {
                design: self.design(part, delay, forward),
                observations: DVector::from_fn(all.len(), |i, _| all[i].raw[axis]),
                errors: errors[part].clone(),
            }
        });
        solve_groups(&groups)
    }

    /// The change of the reading with the input by a solution, raw/SI.
    fn forward(&self, solution: &Solution) -> RowVector3<f64> {
        RowVector3::from_fn(|_, k| solution.parameters[k + 1] / self.span)
    }
}

/// Least squares as in [`super::known_input::least_squares`], of means and the other `sums` together. If the inputs distinguish delays from the
/// matrix, each axis has one.
pub fn least_squares(
    means: &[Observation],
    sums: &[Observation],
    wander: Option<&[DMatrix<f64>; 3]>,
) -> Result<Estimated, Failure> {
    let all = Experiment {
        parts: [means, sums],
        span: span(means.iter().chain(sums)),
    };
    let [a, b] = all
        .parts
        .map(|part| -> Vec<Observation> { part.iter().map(Observation::without_earth).collect() });
    let without = Experiment {
        parts: [&a[..], &b[..]],
        span: all.span,
    };
    let found = Observability::of(&without.whole(0.0, None));
    let observability = complete(found, means.len())?;
    let singular = || Failure::NoSolution("the design is singular".into());
    let mut axes = Vec::new();
    let mut delays = [Vector3::zeros(); 2];
    let mut told = true;
    for axis in 0..3 {
        let first = [means, sums].map(|part| {
            let variances = DVector::from_fn(part.len(), |i, _| part[i].variance[axis]);
            Errors::Independent(positive(variances))
        });
        let (solution, _) = all.solve(axis, &first, 0.0, None).ok_or_else(singular)?;
        let mut forward_matrix = Matrix3::zeros();
        forward_matrix.set_row(axis, &all.forward(&solution));
        // The unknown part of the Earth's rate hardly differs within a dwell, so in a sum it counts as independent.
        let earth = |o: &Observation| (forward_matrix.row(axis) * o.earth.by).norm_squared();
        let variance = |i: usize, _| sums[i].variance[axis] + earth(&sums[i]);
        let errors = [
            errors(means, axis, wander, &forward_matrix),
            Errors::Independent(positive(DVector::from_fn(sums.len(), variance))),
        ];
        let (mut solution, mut scatter) =
            all.solve(axis, &errors, 0.0, None).ok_or_else(singular)?;
        let by = all.forward(&solution);
        // The observability needs columns of one size.
        let mut design = all.whole(0.0, Some(by));
        let size = design.column(4).amax().max(f64::MIN_POSITIVE);
        design.column_mut(4).unscale_mut(size);
        let with_delay = Observability::of(&design);
        told &= with_delay.is_complete() && with_delay.condition < POORLY_DETERMINED;
        if told {
            let mut delay = 0.0;
            for _ in 0..STEPS {
                let by = all.forward(&solution);
                (solution, scatter) = all
                    .solve(axis, &errors, delay, Some(by))
                    .ok_or_else(singular)?;
                let step = solution.parameters[4];
                delay += step;
                if step.abs() < SETTLED * solution.covariance[(4, 4)].sqrt() {
                    break;
                }
            }
            delays[0][axis] = delay;
            delays[1][axis] = solution.covariance[(4, 4)].sqrt();
        }
        let names = [Observable::Axis(axis), Observable::Within(axis)];
        axes.push(AxisEstimate {
            parameters: solution.parameters.rows(0, 4).into_owned(),
            covariance: solution.covariance.view((0, 0), (4, 4)).into_owned(),
            scatter: names.into_iter().zip(scatter).collect(),
        });
    }
    let mut estimated = forward(&axes, all.span, observability.condition)?;
    if told {
        let [value, sigma] = delays;
        estimated.delays = Some(Delays { value, sigma });
    } else {
        estimated.notes.push(Warning::NoDelay);
    }
    Ok(earth_shared::found(estimated, means))
}
