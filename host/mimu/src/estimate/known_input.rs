//! Least squares for dwells whose input is known: a rate table, or a levelled cube.
//!
//! Besides the means of dwells it fits the other sums over dwells whose input moves, in which the bias cancels. A reading lags its reference, because
//! of the filters of the sensor and the clocks of table and converter. Half a millisecond at 200 deg/s is an error of 17 mm/s², a hundred times the
//! uncertainty of the means. So each axis then also has a delay: `u = b + P (x - τ ẋ)`.

use nalgebra::{DMatrix, DVector, Matrix3, RowVector3, Vector3};

use super::inputs::{design, span};
use super::least_squares::{
    Errors, Group, Observability, POORLY_DETERMINED, Scatter, Solution, solve_groups,
};
use super::{Addition, Delays, Estimated, Failure, Observation, earth_shared};
use crate::observable::Observable;
use crate::quantity::AXES;
use crate::triad::{Covariance, Forward, Part, Triad};
use crate::warning::Warning;

/// Iterations for the delay. The model is linear except for the product of delay and scale factor, and the third iteration changes nothing.
const STEPS: usize = 6;
/// A change of a delay by less than this share of its sigma ends the iteration.
const SETTLED: f64 = 1e-3;

/// The observability `found` for a design `[b, P1, P2, P3]` of so many dwells, fang (29), (30), or the parameters that it leaves undetermined.
fn complete(found: Observability, dwells: usize) -> Result<Observability, Failure> {
    if found.is_complete() {
        return Ok(found);
    }
    let inputs: Vec<&str> = (0..3)
        .filter(|axis| found.undetermined.iter().any(|(k, _)| *k == axis + 1))
        .map(|axis| AXES[axis])
        .collect();
    let bias = found.undetermined.iter().any(|(k, _)| *k == 0);
    let mut parameters: Vec<String> = inputs
        .iter()
        .map(|a| {
            format!("P_x{a}, P_y{a}, P_z{a} (scale factor {a} and the misalignments towards {a})")
        })
        .collect();
    if bias {
        parameters.insert(0, "the biases".into());
    }
    let axes = inputs.join(", ");
    let add = if dwells < 4 {
        Addition::Words(format!(
            "only {dwells} dwells can be used; the 4 parameters of each axis need at least 4 different inputs"
        ))
    } else if bias {
        Addition::Words(format!(
            "the dwells do not distinguish the bias from the constant input along {axes}: add dwells with the opposite input, or with zero input, along {axes}"
        ))
    } else {
        Addition::Inputs(axes)
    };
    Err(Failure::Undetermined {
        parameters: parameters.join(", "),
        add,
    })
}

/// Known errors of the readings of sensor `axis`. `wander` is the covariance of errors that the means of all dwells share, by axis
/// ([`crate::noise::Noise::wander`]); their variances contain it. `forward` is the sensor's matrix, raw/SI, to about a per cent: the unknown part of the
/// Earth's rate in the readings is this times that in the inputs.
pub(crate) fn errors(
    observations: &[Observation],
    axis: usize,
    wander: Option<&[DMatrix<f64>; 3]>,
    forward: &Matrix3<f64>,
) -> Errors {
    let n = observations.len();
    let mut variances = positive(DVector::from_fn(n, |i, _| observations[i].variance[axis]));
    let factor = earth_shared::factor(observations, axis, forward, &mut variances);
    let Some(wander) = wander else {
        return match factor.ncols() {
            0 => Errors::Independent(variances),
            _ => Errors::Shared(variances, factor),
        };
    };
    let mut covariance = &factor * factor.transpose();
    for i in 0..n {
        for j in 0..n {
            covariance[(i, j)] += match i == j {
                true => variances[i],
                false => wander[axis][(observations[i].dwell, observations[j].dwell)],
            };
        }
    }
    Errors::Correlated(covariance)
}

/// Known errors of the other `sums` of sensor `axis`. The unknown part of the Earth's rate hardly differs within a dwell, so in a sum it counts as independent.
pub(crate) fn errors_of_sums(
    sums: &[Observation],
    axis: usize,
    forward: &Matrix3<f64>,
) -> DVector<f64> {
    let variance = |o: &Observation| {
        let earth = (forward.row(axis) * o.earth.by).norm_squared();
        o.variance[axis] + earth
    };
    positive(DVector::from_iterator(
        sums.len(),
        sums.iter().map(variance),
    ))
}

/// The means of dwells (0), and the other sums over dwells whose input moves (1).
struct Experiment<'a> {
    parts: [&'a [Observation]; 2],
    span: f64,
}

/// `[b, P1, P2, P3]` of a sensor, inputs in units of the span, and the scatter of means and other sums.
type Solved = (Solution, Vec<Scatter>);

impl<'a> Experiment<'a> {
    fn of(parts: [&'a [Observation]; 2]) -> Self {
        Self {
            parts,
            span: span(parts.into_iter().flatten()),
        }
    }

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
    fn whole(&self, forward: Option<RowVector3<f64>>) -> DMatrix<f64> {
        let [a, b] = [0, 1].map(|part| self.design(part, 0.0, forward));
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
    ) -> Result<Solved, Failure> {
        let there = (0..2).filter(|part| !self.parts[*part].is_empty());
        let group = |part: usize| {
            let all = self.parts[part];
            Group {
                design: self.design(part, delay, forward),
                observations: DVector::from_fn(all.len(), |i, _| all[i].raw[axis]),
                errors: errors[part].clone(),
            }
        };
        solve_groups(&there.map(group).collect::<Vec<_>>())
            .ok_or_else(|| Failure::NoSolution("the design is singular".into()))
    }

    /// The change of the reading with the input by a solution, raw/SI.
    fn forward(&self, solution: &Solution) -> RowVector3<f64> {
        RowVector3::from_fn(|_, k| solution.parameters[k + 1] / self.span)
    }

    /// Known errors of both parts of sensor `axis`, and the solution without a delay.
    fn first(
        &self,
        axis: usize,
        wander: Option<&[DMatrix<f64>; 3]>,
    ) -> Result<([Errors; 2], Solved), Failure> {
        let alone = self.parts.map(|part| {
            let variances = part.iter().map(|o| o.variance[axis]);
            Errors::Independent(positive(DVector::from_iterator(part.len(), variances)))
        });
        let (rough, _) = self.solve(axis, &alone, 0.0, None)?;
        let mut forward = Matrix3::zeros();
        forward.set_row(axis, &self.forward(&rough));
        let [means, sums] = self.parts;
        let errors = [
            errors(means, axis, wander, &forward),
            Errors::Independent(errors_of_sums(sums, axis, &forward)),
        ];
        let solved = self.solve(axis, &errors, 0.0, None)?;
        Ok((errors, solved))
    }

    /// Whether the inputs distinguish a delay from the matrix of a sensor with this `forward`.
    fn shows_delay(&self, forward: RowVector3<f64>) -> bool {
        // The observability needs columns of one size.
        let mut design = self.whole(Some(forward));
        let size = design.column(4).amax().max(f64::MIN_POSITIVE);
        design.column_mut(4).unscale_mut(size);
        let found = Observability::of(&design);
        found.is_complete() && found.condition < POORLY_DETERMINED
    }

    /// The solution with a delay, from that without one, and the delay, s.
    fn delayed(
        &self,
        axis: usize,
        errors: &[Errors; 2],
        mut solved: Solved,
    ) -> Result<(Solved, f64), Failure> {
        let mut delay = 0.0;
        for _ in 0..STEPS {
            let by = self.forward(&solved.0);
            solved = self.solve(axis, errors, delay, Some(by))?;
            let step = solved.0.parameters[4];
            delay += step;
            if step.abs() < SETTLED * solved.0.covariance[(4, 4)].sqrt() {
                break;
            }
        }
        Ok((solved, delay))
    }
}

/// Least squares in the forward form, fang (15), (17): `u = P x + b`, sensor by sensor, of `means` of dwells and of other `sums` over them. If moving inputs
/// distinguish delays from the matrix, each axis has one.
///
/// The noisy reading is regressed on the known input, so nothing is attenuated. With the `wander` that the means share, this is generalized least
/// squares: it uses the differences of neighbouring dwells, in which the wander cancels.
pub fn least_squares(
    means: &[Observation],
    sums: &[Observation],
    wander: Option<&[DMatrix<f64>; 3]>,
) -> Result<Estimated, Failure> {
    let all = Experiment::of([means, sums]);
    // The Earth turns far too slowly to determine a scale factor.
    let [a, b] = all
        .parts
        .map(|part| -> Vec<Observation> { part.iter().map(Observation::without_earth).collect() });
    let found = Observability::of(&Experiment::of([&a, &b]).whole(None));
    let observability = complete(found, means.len())?;
    let mut model = Forward {
        matrix: Matrix3::zeros(),
        bias: Vector3::zeros(),
    };
    let (mut parts, mut scatter) = (Vec::new(), Vec::new());
    let mut delays = Delays {
        value: Vector3::zeros(),
        sigma: Vector3::zeros(),
    };
    let mut told = !sums.is_empty();
    for axis in 0..3 {
        let (errors, mut solved) = all.first(axis, wander)?;
        told &= all.shows_delay(all.forward(&solved.0));
        if told {
            (solved, delays.value[axis]) = all.delayed(axis, &errors, solved)?;
            delays.sigma[axis] = solved.0.covariance[(4, 4)].sqrt();
        }
        let (solution, of_groups) = solved;
        model.bias[axis] = solution.parameters[0];
        model.matrix.set_row(axis, &all.forward(&solution));
        // Indices of b, P1, P2, P3 of this sensor among the twelve.
        let places = [9 + axis, 3 * axis, 3 * axis + 1, 3 * axis + 2];
        let unit = [1.0, all.span, all.span, all.span];
        let mut covariance = Covariance::zeros();
        for i in 0..4 {
            for j in 0..4 {
                covariance[(places[i], places[j])] =
                    solution.covariance[(i, j)] / (unit[i] * unit[j]);
            }
        }
        // The variance of the parameters comes from all groups.
        let dof = of_groups.iter().map(Scatter::variance_dof);
        let known = of_groups.iter().map(|s| s.known);
        parts.push(Part {
            covariance,
            dof: dof.fold(f64::INFINITY, f64::min),
            known: known.fold(1.0, f64::min),
        });
        let names = [Observable::Axis(axis), Observable::Within(axis)];
        scatter.extend(names.into_iter().zip(of_groups));
    }
    let triad = Triad::from_forward(model, parts).ok_or_else(|| {
        Failure::NoSolution(
            "the three sensors measure in one plane only (singular scale-factor matrix)".into(),
        )
    })?;
    let mut estimated = Estimated::new(triad, scatter, observability.condition);
    estimated.delays = told.then_some(delays);
    let untold = !told && !sums.is_empty();
    estimated.notes.extend(untold.then_some(Warning::NoDelay));
    Ok(earth_shared::found(estimated, means))
}

/// What multiplies the mean readings of sensor `axis` in [`least_squares`], with the `extra` variance that their scatter showed: `[b, P1, P2, P3]` by
/// observations. `None` if the design is singular.
pub(crate) fn gain(
    observations: &[Observation],
    axis: usize,
    wander: Option<&[DMatrix<f64>; 3]>,
    forward: &Matrix3<f64>,
    extra: f64,
) -> Option<DMatrix<f64>> {
    let span = span(observations);
    let design = design(observations, span);
    let n = observations.len();
    let covariance = errors(observations, axis, wander, forward).covariance();
    let root = (covariance + DMatrix::identity(n, n) * extra).cholesky()?;
    let weighted = root.solve(&design);
    let mut gain = (design.tr_mul(&weighted)).try_inverse()? * weighted.transpose();
    gain.rows_mut(1, 3).unscale_mut(span);
    Some(gain)
}

/// Variances, with a floor where a noiseless recording has none: 1e-12 of the largest, or of one.
pub(crate) fn positive(variances: DVector<f64>) -> DVector<f64> {
    let floor = 1e-12 * variances.max();
    variances.map(|v| {
        if v > floor {
            v
        } else if floor > 0.0 {
            floor
        } else {
            1e-24
        }
    })
}
