//! Standard deviations of the curves that a procedure gives, from the information matrix of the regression.

use mimu::plan::{Plan, Planned};
use mimu::{Fixture, Sensor};
use mimu_recording::error::Result;
use nalgebra::{DMatrix, DVector, Vector3};
use serde::Serialize;

use super::Request;
use super::procedure::{Procedure, Schedule};
use crate::basis::Basis;
use crate::regression::{AxisNoise, CurveKind, Normal, Part, Problem, ProblemRow};

/// Longest row, s. If the noise wanders over many minutes, shorter rows add no information.
const ROW_S: f64 = 10.0;
/// Standard gravity, m/s²: a prediction does not depend on the local value.
const GRAVITY: f64 = mimu::readable::STANDARD_GRAVITY;

/// Predicted uncertainty of the curves of one triad.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SensorPrediction {
    /// The triad.
    pub sensor: Sensor,
    /// SI unit of the bias.
    pub unit: &'static str,
    /// At the lower end of the range, in its middle and at its upper end.
    pub at: [At; 3],
}

/// Standard deviations at one temperature, of the worst axis; `None` if not determined.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct At {
    /// °C.
    pub temp_c: f64,
    /// Bias, SI.
    pub bias: Option<f64>,
    /// Scale factor, as a ratio.
    pub scale: Option<f64>,
    /// Cross terms, rad.
    pub cross: Option<f64>,
}

/// Predicts both triads.
pub(super) fn predict(request: &Request, schedule: &Schedule) -> Result<Vec<SensorPrediction>> {
    let round = Plan::new(
        Fixture::ThreeAxis,
        request.sample_rate_hz,
        schedule.steps.clone(),
    );
    let steps = round.dwells(GRAVITY, request.procedure.name())?;
    let each = Sensor::BOTH.into_iter();
    Ok(each.map(|s| of(request, schedule, &steps, s)).collect())
}

fn of(
    request: &Request,
    schedule: &Schedule,
    steps: &[Planned],
    sensor: Sensor,
) -> SensorPrediction {
    let (rows, dies) = rows(request, schedule, steps, sensor);
    let samples = rows.iter().map(|r| r.weight).fold(0.0, f64::max);
    let mut problem = Problem {
        headings: 0,
        sensor,
        rows,
        gain: Vector3::repeat(1.0),
        null: Vector3::zeros(),
        bases: CurveKind::ALL.map(|_| Basis::new(request.shape, request.range_c)),
        offsets: 1,
        biases_only: request.procedure == Procedure::RestRamp,
        samples,
        taken_off: 0.0,
    };
    problem.rows.iter_mut().for_each(|r| r.weight /= samples);
    let of = &request.noise[sensor as usize];
    let noise = AxisNoise::of_densities([of.n, of.b, of.k], samples / request.sample_rate_hz);
    let covariances = [0, 1, 2].map(|axis| {
        let normal = Normal::of(&problem, axis, &dies, &noise, |_| true);
        inverse(&normal.gram)
    });
    let [from, to] = request.range_c;
    let at = [from, 0.5 * (from + to), to].map(|temp_c| {
        let worst = |kind| worst(&problem, &covariances, kind, temp_c);
        At {
            temp_c,
            bias: worst(CurveKind::Bias),
            scale: worst(CurveKind::Scale),
            cross: worst(CurveKind::Cross),
        }
    });
    SensorPrediction {
        sensor,
        unit: sensor.unit(),
        at,
    }
}

/// Rows of `sensor`, with their numbers of samples for weights, and the temperatures of the die.
fn rows(
    request: &Request,
    schedule: &Schedule,
    steps: &[Planned],
    sensor: Sensor,
) -> (Vec<ProblemRow>, Vec<f64>) {
    let (mut rows, mut dies) = (Vec::new(), Vec::new());
    for round in 0..schedule.rounds {
        let begin = schedule.lead_in_s + round as f64 * schedule.round_s;
        for (k, (step, [from, to])) in steps.iter().zip(&schedule.times_s).enumerate() {
            // A turn against gravity within a row shows the timing of the table rather than the sensor.
            if sensor == Sensor::Accel && step.turn.is_some() {
                continue;
            }
            let input = input(step, sensor);
            let moves = step.turn.is_some() || step.rate_dps != 0.0;
            let count = if sensor == Sensor::Gyro && moves {
                1.0
            } else {
                ((to - from) / ROW_S).ceil()
            };
            let length_s = (to - from) / count;
            for part in 0..count as usize {
                let middle_s = begin + from + (part as f64 + 0.5) * length_s;
                dies.push(schedule.temp_c(middle_s));
                rows.push(ProblemRow {
                    session: 0,
                    offset: 0,
                    middle_s,
                    weight: length_s * request.sample_rate_hz,
                    input,
                    earth: None,
                    reading: Vector3::zeros(),
                    step: (round * steps.len() + k) as i32,
                });
            }
        }
    }
    (rows, dies)
}

/// Mean input in a step, SI, without the rate of the Earth; in a turn at its rate.
fn input(step: &Planned, sensor: Sensor) -> Vector3<f64> {
    let input = step.input_over(step.length.as_secs_f64());
    sensor.pick(
        Vector3::from_column_slice(&input[..3]).map(f64::to_radians),
        Vector3::from_column_slice(&input[3..]),
    )
}

/// Inverse of an information matrix whose columns have very different sizes; `None` if it is singular.
fn inverse(gram: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let size = gram.diagonal().map(f64::sqrt);
    if size.iter().any(|s| !(*s > 0.0)) {
        return None;
    }
    let scale = size.map(|s| 1.0 / s);
    let alike = DMatrix::from_fn(gram.nrows(), gram.ncols(), |i, j| {
        gram[(i, j)] * scale[i] * scale[j]
    });
    let inverse = alike.cholesky()?.inverse();
    // Rounding may let a singular matrix pass, with variances as large as its condition.
    let determined = inverse.diagonal().iter().all(|v| *v < 1e10);
    determined.then(|| {
        DMatrix::from_fn(gram.nrows(), gram.ncols(), |i, j| {
            inverse[(i, j)] * scale[i] * scale[j]
        })
    })
}

/// Standard deviation of the curves of a kind at `temp_c`, of the axis and the input where it is largest.
fn worst(
    problem: &Problem,
    covariances: &[Option<DMatrix<f64>>; 3],
    kind: CurveKind,
    temp_c: f64,
) -> Option<f64> {
    let mut largest = None;
    for (axis, covariance) in covariances.iter().enumerate() {
        let covariance = covariance.as_ref()?;
        let parts = problem.parts(axis);
        for part in parts.iter().filter(|p| p.kind == kind) {
            let along = row(problem, part, temp_c, covariance.nrows());
            let sigma = along.dot(&(covariance * &along)).sqrt();
            largest = Some(sigma.max(largest.unwrap_or(0.0)));
        }
    }
    largest
}

/// The functions of a curve at `temp_c`, at its columns.
fn row(problem: &Problem, part: &Part, temp_c: f64, columns: usize) -> DVector<f64> {
    let (from, values) = problem.basis(part.kind).values(temp_c);
    let mut row = DVector::zeros(columns);
    for (k, value) in values.iter().enumerate().filter(|(_, v)| **v != 0.0) {
        row[part.from + from + k] = *value;
    }
    row
}
