//! Least squares with known inputs that move within dwells.
//!
//! To the means of dwells come the other sums over those whose input moves, which know nothing of the bias. A reading is behind its reference, by the
//! filters of the sensor and by the clocks of table and converter: half a millisecond at 200 deg/s is an error of 17 mm/s², a hundred
//! times what the means are known to. So each axis has a delay besides: `u = b + P (x - τ ẋ)`.

use nalgebra::{DMatrix, DVector, RowVector3, Vector3};

use super::known_input::{OfAxis, complete, errors, forward, positive, span};
use super::least_squares::{
    Errors, Group, Observability, POORLY_DETERMINED, Scatter, Solution, solve_groups,
};
use super::{Delays, Estimated, Failure, Observation};
use crate::observable::Observable;
use crate::warning::Warning;

/// Steps of the iteration for the delay: the model is linear but for its product with the scale factor, and the third changes nothing.
const STEPS: usize = 6;
/// Share of its sigma below which a step of a delay changes nothing.
const SETTLED: f64 = 1e-3;

/// Means of dwells, and the other sums.
struct Experiment<'a> {
    parts: [&'a [Observation]; 2],
    span: f64,
}

impl Experiment<'_> {
    /// Design of means (0) or other sums (1): `[b, P1, P2, P3]`, inputs in units of the span and behind by `delay`; and the delay
    /// itself where `forward` says what a change of the input does to the reading, raw/(SI/s).
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

    /// What a change of the input does to the reading, by a solution.
    fn forward(&self, solution: &Solution) -> RowVector3<f64> {
        RowVector3::from_fn(|_, k| solution.parameters[k + 1] / self.span)
    }
}

/// Least squares as [`super::known_input::least_squares`] does it, of means and the other `sums` together, with a delay of each axis as
/// far as the inputs tell it from the matrix.
pub fn least_squares(
    means: &[Observation],
    sums: &[Observation],
    wander: Option<&[DMatrix<f64>; 3]>,
) -> Result<Estimated, Failure> {
    let all = Experiment {
        parts: [means, sums],
        span: span(means.iter().chain(sums)),
    };
    let found = Observability::of(&all.whole(0.0, None));
    let observability = complete(found, means.len())?;
    let singular = || Failure::NoSolution("the design is singular".into());
    let mut axes = Vec::new();
    let mut delays = [Vector3::zeros(); 2];
    let mut told = true;
    for axis in 0..3 {
        let variances = DVector::from_fn(sums.len(), |i, _| sums[i].variance[axis]);
        let errors = [
            errors(means, axis, wander),
            Errors::Independent(positive(variances)),
        ];
        let (mut solution, mut scatter) =
            all.solve(axis, &errors, 0.0, None).ok_or_else(singular)?;
        let by = all.forward(&solution);
        // Columns of one size, as the observability asks for.
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
        axes.push(OfAxis {
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
    Ok(estimated)
}
