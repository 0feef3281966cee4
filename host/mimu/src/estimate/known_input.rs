//! Estimators for dwells whose input is known: a rate table, or a levelled cube.

use mimu_core::compensation::Affine;
use mimu_core::kalman::Filter;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector3};

use super::inputs::{design, span};
use super::least_squares::{
    Errors, Group, Observability, Scatter, extra_variance, extra_variance_of, solve_groups,
};
use super::{Addition, Estimated, Failure, Observation, earth_shared};
use crate::observable::Observable;
use crate::quantity::AXES;
use crate::triad::{Covariance, Forward, Part, Triad};
use crate::warning::Warning;

/// Two inputs are opposite if their sum is below this share of their size: a table's repeatability.
const OPPOSITE_SHARE: f64 = 0.01;
/// An input below this share of the largest is rest.
const REST_SHARE: f64 = 1e-3;

/// Whether the inputs determine `[b, P1, P2, P3]`, fang (29), (30). The same for all three sensors.
pub fn observability(observations: &[Observation]) -> Result<Observability, Failure> {
    let without: Vec<Observation> = observations
        .iter()
        .map(Observation::without_earth)
        .collect();
    let found = Observability::of(&design(&without, span(&without)));
    complete(found, observations.len())
}

/// The observability `found` for a design `[b, P1, P2, P3]` of so many dwells, or the parameters that it leaves undetermined.
pub(super) fn complete(found: Observability, dwells: usize) -> Result<Observability, Failure> {
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

/// Least squares in the forward form, fang (15), (17): `u = P x + b`, sensor by sensor.
///
/// The noisy reading is regressed on the known input, so nothing is attenuated. With the `wander` that the means share, this is generalized least
/// squares: it uses the differences of neighbouring dwells, in which the wander cancels.
pub fn least_squares(
    observations: &[Observation],
    wander: Option<&[DMatrix<f64>; 3]>,
) -> Result<Estimated, Failure> {
    let observability = observability(observations)?;
    let span = span(observations);
    let design = design(observations, span);
    let forward_matrix = earth_shared::rough_forward(observations);
    let mut axes = Vec::new();
    for axis in 0..3 {
        let raw = DVector::from_fn(observations.len(), |i, _| observations[i].raw[axis]);
        let errors = errors(observations, axis, wander, &forward_matrix);
        let group = Group {
            design: design.clone(),
            observations: raw,
            errors,
        };
        let (solution, scatter) = solve_groups(&[group])
            .ok_or_else(|| Failure::NoSolution("the design is singular".into()))?;
        axes.push(AxisEstimate {
            parameters: solution.parameters,
            covariance: solution.covariance,
            scatter: vec![(Observable::Axis(axis), scatter[0])],
        });
    }
    let estimated = forward(&axes, span, observability.condition)?;
    Ok(earth_shared::found(estimated, observations))
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

/// One scalar measurement of a filter: `raw = b + P x + noise`.
struct Measurement {
    input: Vector3<f64>,
    raw: f64,
    variance: f64,
}

/// The readings of sensor `axis` as measurements with independent noise: each minus the part that the errors of those before predict, divided by the
/// remaining factor of the bias. Independent readings stay as they are.
fn innovations(
    observations: &[Observation],
    span: f64,
    axis: usize,
    errors: &Errors,
    extra: f64,
) -> Option<Vec<Measurement>> {
    let covariance = match errors {
        Errors::Independent(variances) => {
            let own = observations.iter().zip(variances.iter());
            return Some(
                own.map(|(o, v)| Measurement {
                    input: o.input / span,
                    raw: o.raw[axis],
                    variance: v + extra,
                })
                .collect(),
            );
        }
        Errors::Correlated(_) | Errors::Shared(..) => errors.covariance(),
    };
    let n = observations.len();
    let root = (covariance + DMatrix::identity(n, n) * extra).cholesky()?;
    let rows = DMatrix::from_fn(n, 5, |i, j| match j {
        0 => 1.0,
        4 => observations[i].raw[axis],
        _ => observations[i].input[j - 1] / span,
    });
    let white = root.l_dirty().solve_lower_triangular(&rows)?;
    let measurement = |i: usize| {
        let bias = white[(i, 0)];
        Measurement {
            input: Vector3::new(white[(i, 1)], white[(i, 2)], white[(i, 3)]) / bias,
            raw: white[(i, 4)] / bias,
            variance: 1.0 / (bias * bias),
        }
    };
    Some((0..n).map(measurement).collect())
}

/// The Kalman bank of fang (23)-(28), fed the dwell means one scalar at a time with a diffuse prior.
///
/// Its noise is that of the dwell means. If the residuals show more, the bank runs again with the extra variance added, as in [`least_squares`], with which
/// it agrees to rounding. With a `wander`, the errors of the means are correlated: from each measurement the error that those before predict is
/// subtracted.
pub fn kalman(
    observations: &[Observation],
    wander: Option<&[DMatrix<f64>; 3]>,
) -> Result<Estimated, Failure> {
    let observability = observability(observations)?;
    let span = span(observations);
    let dof = observations.len() as f64 - 4.0;
    let forward_matrix = earth_shared::rough_forward(observations);
    let axis = |axis: usize| {
        let errors = errors(observations, axis, wander, &forward_matrix);
        let known = DVector::from_fn(observations.len(), |i, _| observations[i].variance[axis]);
        let floor = positive(known).max();
        let mut scatter = Scatter::of_noise(dof);
        let mut round = 0;
        loop {
            let mut filter = Filter::<f64>::diffuse(floor + scatter.extra_variance, 1.0);
            let measurements =
                innovations(observations, span, axis, &errors, scatter.extra_variance)
                    .ok_or_else(|| Failure::NoSolution("the noise of the dwells is zero".into()))?;
            for (m, o) in measurements.iter().zip(observations) {
                filter
                    .update(&m.input, m.raw, m.variance)
                    .map_err(|e| Failure::NoSolution(format!("dwell {}: {e}", o.dwell)))?;
            }
            let mean = DVector::from_column_slice(filter.mean().as_slice());
            let residuals = DVector::from_fn(observations.len(), |i, _| {
                let o = &observations[i];
                o.raw[axis] - mean[0] - mean.fixed_rows::<3>(1).dot(&(o.input / span))
            });
            let found = extra_variance_of(&residuals, &errors, dof);
            let settled = (found.extra_variance - scatter.extra_variance).abs()
                <= 1e-6 * scatter.extra_variance;
            scatter = Scatter {
                chi2: if round == 0 { found.chi2 } else { scatter.chi2 },
                ..found
            };
            round += 1;
            if settled || round == 30 {
                let covariance = DMatrix::from_column_slice(4, 4, filter.covariance().as_slice());
                return Ok(AxisEstimate {
                    parameters: mean,
                    covariance,
                    scatter: vec![(Observable::Axis(axis), scatter)],
                });
            }
        }
    };
    let axes = (0..3).map(axis).collect::<Result<Vec<_>, _>>()?;
    let estimated = forward(&axes, span, observability.condition)?;
    Ok(earth_shared::found(estimated, observations))
}

/// The estimate of one sensor.
pub(super) struct AxisEstimate {
    /// `[b, P1, P2, P3]`, inputs in units of the span.
    pub parameters: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Scatter by group of observations; the variance of the parameters comes from all groups.
    pub scatter: Vec<(Observable, Scatter)>,
}

/// Combines `[b, P1, P2, P3]` of the three sensors (inputs in units of `span`).
pub(super) fn forward(
    axes: &[AxisEstimate],
    span: f64,
    condition: f64,
) -> Result<Estimated, Failure> {
    let mut model = Forward {
        matrix: Matrix3::zeros(),
        bias: Vector3::zeros(),
    };
    let mut parts = Vec::new();
    for (axis, found) in axes.iter().enumerate() {
        let (parameters, of_axis) = (&found.parameters, &found.covariance);
        let dof = found.scatter.iter().map(|s| s.1.variance_dof());
        let known = found.scatter.iter().map(|s| s.1.known);
        let mut covariance = Covariance::zeros();
        // Indices of b, P1, P2, P3 of this sensor among the twelve.
        let places = [9 + axis, 3 * axis, 3 * axis + 1, 3 * axis + 2];
        let unit = [1.0, span, span, span];
        model.bias[axis] = parameters[0];
        for j in 0..3 {
            model.matrix[(axis, j)] = parameters[j + 1] / span;
        }
        for i in 0..4 {
            for j in 0..4 {
                covariance[(places[i], places[j])] = of_axis[(i, j)] / (unit[i] * unit[j]);
            }
        }
        parts.push(Part {
            covariance,
            dof: dof.fold(f64::INFINITY, f64::min),
            known: known.fold(1.0, f64::min),
        });
    }
    let scatter: Vec<_> = axes.iter().flat_map(|a| a.scatter.clone()).collect();
    let triad = Triad::from_forward(model, parts).ok_or_else(|| {
        Failure::NoSolution(
            "the three sensors measure in one plane only (singular scale-factor matrix)".into(),
        )
    })?;
    Ok(Estimated::new(triad, scatter, condition))
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

/// Dwells of rates in pairs of opposite ones, dwells at rest, and the number of rates without an opposite.
struct Opposite<'a> {
    pairs: Vec<(&'a Observation, &'a Observation)>,
    rest: Vec<&'a Observation>,
    single: usize,
}

impl<'a> Opposite<'a> {
    fn of(observations: &'a [Observation]) -> Result<Self, Failure> {
        let mut free: Vec<&Observation> = observations.iter().collect();
        let (mut pairs, mut rest, mut single) = (Vec::new(), Vec::new(), 0);
        let span = span(observations);
        while let Some(first) = free.pop() {
            let size = first.input.norm();
            if size < REST_SHARE * span {
                rest.push(first);
                continue;
            }
            let opposite = free
                .iter()
                .enumerate()
                .map(|(i, o)| (i, (o.input + first.input).norm()))
                .filter(|(_, sum)| *sum <= OPPOSITE_SHARE * size)
                .min_by(|a, b| a.1.total_cmp(&b.1));
            match opposite {
                Some((i, _)) => pairs.push((first, free.swap_remove(i))),
                None => single += 1,
            }
        }
        if rest.is_empty() {
            return Err(Failure::Undetermined {
                parameters: "o (xu (10))".into(),
                add: "the inverse form needs dwells at rest for the offset: add some, or use least squares".into(),
            });
        }
        Ok(Self {
            pairs,
            rest,
            single,
        })
    }

    /// Observability of C from differences of inputs, which are shares of `span`.
    fn observability(&self, span: f64) -> Result<Observability, Failure> {
        let differences = self.differences(|o| o.input / (2.0 * span));
        let observability = Observability::of(&differences);
        if !observability.is_complete() {
            let undetermined = observability.undetermined.iter();
            let axes: Vec<&str> = undetermined.map(|(k, _)| AXES[*k]).collect();
            return Err(Failure::Undetermined {
                parameters: format!("C (there are no opposite rates about {})", axes.join(", ")),
                add: "add the opposite of each rate, or use least squares".into(),
            });
        }
        Ok(observability)
    }

    fn differences(&self, of: impl Fn(&Observation) -> Vector3<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(self.pairs.len(), 3, |i, j| {
            let (a, b) = self.pairs[i];
            of(a)[j] - of(b)[j]
        })
    }
}

/// Scatter of `values` about zero on `axis`, beyond their known variances.
fn scatter_on(axis: usize, values: Vec<f64>, variances: &[Matrix3<f64>], dof: f64) -> Scatter {
    let variances: Vec<f64> = variances
        .iter()
        .map(|v| v[(axis, axis)].max(f64::MIN_POSITIVE))
        .collect();
    extra_variance(&values, &variances, dof)
}

/// xu's inverse form for rates: C from the differences of opposite rates, (3)-(8), o from the readings at rest, (9)-(11).
///
/// Unweighted, as published. It regresses the known input on the noisy reading, which shrinks C by the
/// ratio of noise variance to signal variance: below 1e-8 for dwell means of seconds, but not for single samples.
/// The covariance is that of this estimator under the noise of the means, and correlates the rows, which share the
/// readings.
pub fn opposite_rates(observations: &[Observation]) -> Result<Estimated, Failure> {
    observability(observations)?;
    let opposite = Opposite::of(observations)?;
    let observability = opposite.observability(span(observations))?;
    let reading = opposite.differences(|o| o.raw);
    let known = opposite.differences(|o| o.input);
    let Opposite {
        pairs,
        rest,
        single,
    } = opposite;
    let pseudo = (reading.transpose() * &reading)
        .try_inverse()
        .ok_or_else(|| Failure::NoSolution("the readings do not change with the rate".into()))?
        * reading.transpose();
    let c_transposed = &pseudo * &known;
    let matrix = Matrix3::from_fn(|i, j| c_transposed[(j, i)]);
    let count = rest.len() as f64;
    let at_rest = rest.iter().map(|o| o.raw).sum::<Vector3<f64>>() / count;
    // (9) instead of (10): a dwell that counts as rest may turn a little, at a known rate.
    let offsets: Vec<Vector3<f64>> = rest.iter().map(|o| o.input - matrix * o.raw).collect();
    let offset = offsets.iter().sum::<Vector3<f64>>() / count;

    // Errors of a difference in SI: C times the error of the readings.
    let si =
        |variance: Vector3<f64>| matrix * Matrix3::from_diagonal(&variance) * matrix.transpose();
    let each = pairs.iter().map(|(a, b)| si(a.variance + b.variance));
    let noise: Vec<Matrix3<f64>> = each.collect();
    let residual = &known - &reading * &c_transposed;
    let dof = pairs.len() as f64 - 3.0;
    let of_pairs = [0, 1, 2].map(|axis| {
        let values = residual.column(axis).iter().copied().collect();
        scatter_on(axis, values, &noise, dof)
    });
    let rest_variance: Vec<Matrix3<f64>> = rest.iter().map(|o| si(o.variance)).collect();
    let deviations: Vec<Vector3<f64>> = offsets.iter().map(|o| o - offset).collect();
    let of_rest = RestNoise::of(&deviations, &rest_variance, &of_pairs);
    let covariance = rows_covariance(&pseudo, |p, r, s| {
        let extra = match r == s {
            true => of_pairs[r].extra_variance,
            false => 0.0,
        };
        noise[p][(r, s)] + extra
    });
    let observables = [0, 1, 2].map(Observable::Axis);
    let mut scatter: Vec<_> = observables.into_iter().zip(of_pairs).collect();
    scatter.extend(of_rest.scatter.iter().copied());
    // o_r = -c_r . G0: its errors come from c_r and from the readings at rest.
    let mut by_c = SMatrix::<f64, 12, 9>::zeros();
    for r in 0..3 {
        for j in 0..3 {
            by_c[(3 * r + j, 3 * r + j)] = 1.0;
            by_c[(9 + r, 3 * r + j)] = -at_rest[j];
        }
    }
    let parts = by_row(
        |a, b| (a / 3 == b / 3).then_some(a / 3),
        &covariance,
        &scatter,
    );
    let parts = parts.into_iter().map(|(covariance, dof, known)| Part {
        covariance: by_c * covariance * by_c.transpose(),
        dof,
        known,
    });
    let inverse = Affine { matrix, offset };
    let triad = Triad::from_inverse(inverse, parts.chain(of_rest.parts()).collect())
        .ok_or_else(|| Failure::NoSolution("C is singular".into()))?;
    let unpaired = (single > 0).then_some(Warning::NoOpposite { rates: single });
    Ok(Estimated {
        notes: unpaired.into_iter().collect(),
        ..Estimated::new(triad, scatter, observability.condition)
    })
}

/// Errors of the mean reading at rest, which are those of the offset. Readings at rest have their own scatter, because that of the pairs may be the
/// table's rate.
struct RestNoise {
    covariance: Matrix3<f64>,
    dof: [f64; 3],
    /// Share of the known noise in each variance.
    known: [f64; 3],
    /// Scatter beyond the known noise, where there is some.
    scatter: Vec<(Observable, Scatter)>,
}

impl RestNoise {
    /// From the deviations of the dwells at rest from their mean, rad/s, and their known variances. If rest shows no extra variance, there may be too
    /// few rests: then that of the pairs counts.
    fn of(
        deviations: &[Vector3<f64>],
        variances: &[Matrix3<f64>],
        of_pairs: &[Scatter; 3],
    ) -> Self {
        let count = deviations.len() as f64;
        let mut covariance = variances.iter().sum::<Matrix3<f64>>() / (count * count);
        let mut dof = [f64::INFINITY; 3];
        let mut known = [1.0; 3];
        let mut scatter = Vec::new();
        for axis in 0..3 {
            let values = deviations.iter().map(|d| d[axis]).collect();
            let of_rest = scatter_on(axis, values, variances, count - 1.0);
            let (extra, of) = match of_rest.extra_variance > 0.0 {
                true => (of_rest.extra_variance, &of_rest),
                false => (0.5 * of_pairs[axis].extra_variance, &of_pairs[axis]),
            };
            dof[axis] = of.variance_dof();
            let by_noise = covariance[(axis, axis)];
            covariance[(axis, axis)] += extra / count;
            if extra > 0.0 {
                known[axis] = by_noise / covariance[(axis, axis)];
            }
            if of_rest.extra_variance > 0.0 {
                scatter.push((Observable::AtRest(axis), of_rest));
            }
        }
        Self {
            covariance,
            dof,
            known,
            scatter,
        }
    }

    /// Its parts of the covariance of the triad: of each axis, and between axes.
    fn parts(&self) -> impl Iterator<Item = Part> {
        let diagonal = self.covariance.diagonal();
        let between = self.covariance - Matrix3::from_diagonal(&diagonal);
        let of_offset = |own: Matrix3<f64>| {
            let mut covariance = Covariance::zeros();
            covariance.fixed_view_mut::<3, 3>(9, 9).copy_from(&own);
            Part::known(covariance)
        };
        let (dof, known) = (self.dof, self.known);
        let each = (0..3).map(move |r| {
            let mut own = Vector3::zeros();
            own[r] = diagonal[r];
            Part {
                dof: dof[r],
                known: known[r],
                ..of_offset(Matrix3::from_diagonal(&own))
            }
        });
        each.chain([of_offset(between)])
    }
}

/// Splits a covariance: one part for each row of the model, whose size the row's scatter determines, and the part that correlates the rows, which is
/// known beforehand; with the degrees of freedom and the known share of each. `row_of` gives the row of an element.
fn by_row<const N: usize>(
    row_of: impl Fn(usize, usize) -> Option<usize>,
    covariance: &SMatrix<f64, N, N>,
    scatter: &[(Observable, Scatter)],
) -> Vec<(SMatrix<f64, N, N>, f64, f64)> {
    let of = |row: Option<usize>| {
        SMatrix::from_fn(|a, b| {
            if row_of(a, b) == row {
                covariance[(a, b)]
            } else {
                0.0
            }
        })
    };
    let rows = (0..3).map(|r| (of(Some(r)), &scatter[r].1));
    let rows = rows.map(|(own, scatter)| (own, scatter.variance_dof(), scatter.known));
    rows.chain([(of(None), f64::INFINITY, 1.0)]).collect()
}

/// Covariance of three rows that are all estimated by `left` (3 or 4 by observations), if the errors of one observation are correlated across the
/// rows by `noise(observation, row, row)`. Row-major order, 3 a row.
fn rows_covariance(
    left: &DMatrix<f64>,
    noise: impl Fn(usize, usize, usize) -> f64,
) -> SMatrix<f64, 9, 9> {
    SMatrix::from_fn(|a, b| {
        let (r, i, s, j) = (a / 3, a % 3, b / 3, b % 3);
        (0..left.ncols())
            .map(|p| left[(i, p)] * noise(p, r, s) * left[(j, p)])
            .sum()
    })
}

/// xu's inverse form for poses, (12)-(16): `f = C u + o` by unweighted least squares over the readings.
///
/// See [`opposite_rates`] for what regressing on the noisy side means.
pub fn inverse_form(observations: &[Observation]) -> Result<Estimated, Failure> {
    let observability = observability(observations)?;
    let n = observations.len();
    // Centred and scaled: otherwise the readings' common offset makes the normal matrix singular to rounding.
    let centre = observations.iter().map(|o| o.raw).sum::<Vector3<f64>>() / n as f64;
    let unit = observations
        .iter()
        .map(|o| (o.raw - centre).norm())
        .fold(0.0, f64::max)
        .max(f64::MIN_POSITIVE);
    let design = DMatrix::from_fn(n, 4, |i, j| {
        if j == 3 {
            1.0
        } else {
            (observations[i].raw[j] - centre[j]) / unit
        }
    });
    let left = (design.transpose() * &design)
        .try_inverse()
        .ok_or_else(|| Failure::NoSolution("the readings lie in one plane".into()))?
        * design.transpose();
    let known = DMatrix::from_fn(n, 3, |i, j| observations[i].input[j]);
    let solution = &left * &known;
    let matrix = Matrix3::from_fn(|i, j| solution[(j, i)] / unit);
    let at_centre = Vector3::from_fn(|i, _| solution[(3, i)]);
    let inverse = Affine {
        matrix,
        offset: at_centre - matrix * centre,
    };
    let noise: Vec<Matrix3<f64>> = observations
        .iter()
        .map(|o| matrix * Matrix3::from_diagonal(&o.variance) * matrix.transpose())
        .collect();
    let residual = &known - &design * &solution;
    let scatter: Vec<_> = (0..3)
        .map(|axis| {
            let r: Vec<f64> = residual.column(axis).iter().copied().collect();
            let v: Vec<f64> = noise
                .iter()
                .map(|m| m[(axis, axis)].max(f64::MIN_POSITIVE))
                .collect();
            (
                Observable::Axis(axis),
                extra_variance(&r, &v, n as f64 - 4.0),
            )
        })
        .collect();
    // Covariance in the centred parameters, [c_r1 c_r2 c_r3 o_r] for each row, then to C and o.
    let mut full = Covariance::zeros();
    let place = |r: usize, i: usize| if i == 3 { 9 + r } else { 3 * r + i };
    for r in 0..3 {
        for s in 0..3 {
            for i in 0..4 {
                for j in 0..4 {
                    full[(place(r, i), place(s, j))] = (0..n)
                        .map(|p| {
                            let extra = if r == s {
                                scatter[r].1.extra_variance
                            } else {
                                0.0
                            };
                            left[(i, p)] * (noise[p][(r, s)] + extra) * left[(j, p)]
                        })
                        .sum();
                }
            }
        }
    }
    let mut change = SMatrix::<f64, 12, 12>::identity();
    for r in 0..3 {
        for j in 0..3 {
            change[(3 * r + j, 3 * r + j)] = 1.0 / unit;
            change[(9 + r, 3 * r + j)] = -centre[j] / unit;
        }
    }
    let row = |a: usize| if a < 9 { a / 3 } else { a - 9 };
    let parts = by_row(|a, b| (row(a) == row(b)).then(|| row(a)), &full, &scatter)
        .into_iter()
        .map(|(covariance, dof, known)| {
            let part = Part {
                covariance,
                dof,
                known,
            };
            part.seen_by(&change)
        })
        .collect();
    let triad = Triad::from_inverse(inverse, parts)
        .ok_or_else(|| Failure::NoSolution("C is singular".into()))?;
    Ok(Estimated::new(triad, scatter, observability.condition))
}
