//! What is left of a recording after the affine model, as the rows of one linear problem: residuals, what the affine
//! parameters could still do to them, and what an effect would.
//!
//! | reference, sensor | one row is                                                     | unit   |
//! |-------------------|----------------------------------------------------------------|--------|
//! | table             | a dwell and sensor axis: reading less prediction, over the scale factor | SI |
//! | gravity, accel    | a dwell: size of the force less gravity                        | m/s²   |
//! | gravity, gyro     | a turn and direction across gravity: prediction error of gravity | rad  |
//! |                   | a dwell and axis: rate at rest                                 | rad/s  |

use std::borrow::Cow;
use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::effect::{Moment, REFERENCE_C};
use crate::dwell::Sensor;
use crate::estimate::rotation::sensitivity;
use crate::noise::wander::{Slow, Span};
use crate::prepared::{Prepared, si_covariance};
use crate::recording::Reference;
use crate::triad::Forward;

/// Rows that share their noise.
#[derive(Debug, Clone)]
pub struct Stratum {
    /// Name: an axis, `turns`, `rest x`.
    pub name: String,
    /// Axis, where all of its rows are of one.
    pub axis: Option<usize>,
    /// Its rows.
    pub rows: Range<usize>,
    /// Known covariance, unit of the rows squared.
    pub known: DMatrix<f64>,
    /// Covariance of a random walk with K = 1 unit/√s between the rows; `None` where rows are no means of dwells.
    pub walk: Option<DMatrix<f64>>,
    /// Whether the known covariance holds what the bias wanders.
    pub wander_known: bool,
}

/// The moments that a row is made of.
#[derive(Debug, Clone)]
struct Row {
    /// Indices of its moments.
    moments: Range<usize>,
    /// What an error of each axis of the sensor (SI) at a moment adds to the row: one for all, or one each.
    weights: Vec<Vector3<f64>>,
    /// Index of the dwell, or of the dwells that a turn begins and ends in.
    dwells: [usize; 2],
}

/// The rows of one sensor.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Sensor.
    pub sensor: Sensor,
    /// Residuals.
    pub y: DVector<f64>,
    /// Derivatives by the parameters of the affine model, scaled to columns of one size.
    pub nuisance: DMatrix<f64>,
    /// Strata, which cover the rows in order.
    pub strata: Vec<Stratum>,
    /// How many of the rows, from the first on, the error figures are about, and how many of these make one dwell or turn.
    pub judged: (usize, usize),
    rows: Vec<Row>,
    moments: Vec<Moment>,
    /// Block of each moment.
    block: Vec<usize>,
    /// Temperature of each block, °C above the reference, and its time, s.
    warm: Vec<(f64, f64)>,
}

/// Behind a first-order lag: `(time in s, value)` in, the lagged value out.
pub(super) fn late(signal: &[(f64, f64)], lag_s: f64) -> Vec<f64> {
    let mut state = signal
        .iter()
        .map(|s| s.1)
        .find(|v| v.is_finite())
        .unwrap_or(f64::NAN);
    let mut before = signal.first().copied().unwrap_or_default();
    let mut out = Vec::with_capacity(signal.len());
    for &(t, v) in signal {
        let dt = (t - before.0).max(0.0);
        let keep = (-dt / lag_s).exp();
        if v.is_finite() && before.1.is_finite() {
            // The input runs straight from one to the next: exact for ramps.
            let slope = if dt > 0.0 { (v - before.1) / dt } else { 0.0 };
            state = v - slope * lag_s + (state - before.1 + slope * lag_s) * keep;
        }
        before = (t, if v.is_finite() { v } else { before.1 });
        out.push(state);
    }
    out
}

/// Sensitive directions of the sensors, by rows, unit vectors; and the scale factors, raw/SI.
pub(super) fn directions(inverse: &Affine<f64>) -> Option<(Matrix3<f64>, Vector3<f64>, Forward)> {
    let forward = Forward::of(inverse)?;
    let scale = Vector3::from_fn(|i, _| forward.matrix.row(i).norm());
    let unit = Matrix3::from_fn(|i, j| forward.matrix[(i, j)] / scale[i]);
    Some((unit, scale, forward))
}

struct Builder<'a> {
    prepared: &'a Prepared,
    sensor: Sensor,
    t0_s: f64,
    warm: Vec<(f64, f64)>,
    late: Vec<f64>,
    rows: Vec<Row>,
    moments: Vec<Moment>,
    block: Vec<usize>,
    direction: Matrix3<f64>,
}

impl Builder<'_> {
    fn moment(
        &self,
        at: usize,
        t_s: f64,
        duration_s: f64,
        rate: Vector3<f64>,
        force: Vector3<f64>,
    ) -> Moment {
        let input = match self.sensor {
            Sensor::Gyro => rate,
            Sensor::Accel => force,
        };
        Moment {
            t_s: t_s - self.t0_s,
            duration_s,
            rate,
            force,
            angular_acceleration: Vector3::zeros(),
            sensed: self.direction * input,
            warm_c: self.warm[at].1,
            late_c: self.late[at],
        }
    }

    /// The moments of a dwell, block by block: what is known of the input, or rest under `force`.
    fn dwell(&mut self, index: usize, force: Vector3<f64>) -> Range<usize> {
        let prepared = self.prepared;
        let first = self.moments.len();
        let dwell = &prepared.dwells.list[index];
        for at in dwell.blocks.clone() {
            let block = &prepared.condensed.blocks[at];
            let known = |from: usize| Vector3::from_fn(|i, _| block.reference[from + i].mean);
            let (rate, given) = match prepared.manifest.reference {
                Reference::Table => (known(0).map(f64::to_radians), known(3)),
                Reference::Gravity => (Vector3::zeros(), force),
            };
            // A rate table's list of rates may leave the force out: at a constant rate the accelerometer has it.
            let given = if given.iter().all(|f| f.is_finite()) {
                given
            } else {
                force
            };
            let t_s = 0.5 * (block.start_s + block.last_s);
            let duration_s = f64::from(block.rows) * prepared.condensed.period_s;
            let moment = self.moment(at, t_s, duration_s, rate, given);
            self.moments.push(moment);
            self.block.push(at);
        }
        first..self.moments.len()
    }

    /// Mean over dwell `index` of an error of axis `axis` weighted by `by`.
    fn mean_row(&mut self, index: usize, moments: &Range<usize>, by: Vector3<f64>) {
        let total: f64 = self.moments[moments.clone()]
            .iter()
            .map(|m| m.duration_s)
            .sum();
        let weights = self.moments[moments.clone()]
            .iter()
            .map(|m| by * (m.duration_s / total))
            .collect();
        self.rows.push(Row {
            moments: moments.clone(),
            weights,
            dwells: [index, index],
        });
    }
}

impl Rows {
    /// The rows of `sensor`, after its calibration `inverse`; `accel` is the calibrated
    /// accelerometer, for what forces act on a gyro.
    ///
    /// `None` if there are none, or the calibration is singular.
    pub fn new(
        prepared: &Prepared,
        sensor: Sensor,
        inverse: &Affine<f64>,
        accel: Option<&Affine<f64>>,
    ) -> Option<Self> {
        let (direction, scale, forward) = directions(inverse)?;
        let blocks = &prepared.condensed.blocks;
        let warm: Vec<(f64, f64)> = blocks
            .iter()
            .map(|b| (0.5 * (b.start_s + b.last_s), b.temp_c.mean - REFERENCE_C))
            .collect();
        let builder = Builder {
            prepared,
            sensor,
            t0_s: blocks.first()?.start_s,
            late: warm.iter().map(|w| w.1).collect(),
            warm,
            rows: Vec::new(),
            moments: Vec::new(),
            block: Vec::new(),
            direction,
        };
        match (prepared.manifest.reference, sensor) {
            (Reference::Table, _) => builder.known(&scale, &forward, accel),
            (Reference::Gravity, Sensor::Accel) => builder.sizes(inverse),
            (Reference::Gravity, Sensor::Gyro) => builder.turns(inverse, accel?),
        }
    }
}

/// Columns of size 1, those of zero left.
fn scaled(mut nuisance: DMatrix<f64>) -> DMatrix<f64> {
    for mut column in nuisance.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column /= norm;
        }
    }
    nuisance
}

impl Builder<'_> {
    fn finish(
        self,
        y: Vec<f64>,
        nuisance: DMatrix<f64>,
        strata: Vec<Stratum>,
        judged: (usize, usize),
    ) -> Option<Rows> {
        (!y.is_empty()).then(|| Rows {
            sensor: self.sensor,
            y: DVector::from_vec(y),
            nuisance: scaled(nuisance),
            strata,
            judged,
            rows: self.rows,
            moments: self.moments,
            block: self.block,
            warm: self.warm,
        })
    }

    /// Force on dwell `index` by the accelerometer, not a number where there is none.
    fn force(&self, index: usize, accel: Option<&Affine<f64>>) -> Vector3<f64> {
        let raw = self.prepared.dwells.list[index].raw_mean(Sensor::Accel);
        accel.map_or(Vector3::repeat(f64::NAN), |a| a.apply(&raw))
    }

    fn spans(&self, dwells: &[usize]) -> (Vec<Span>, Span) {
        let list = &self.prepared.dwells.list;
        let span = |d: usize| [list[d].start_s, list[d].start_s + list[d].duration_s];
        let spans: Vec<Span> = dwells.iter().map(|d| span(*d)).collect();
        let session = [span(0)[0], span(list.len() - 1)[1]];
        (spans, session)
    }

    fn walk(&self, dwells: &[usize]) -> DMatrix<f64> {
        let (spans, session) = self.spans(dwells);
        let unit = Slow {
            instability: 0.0,
            walk: 1.0,
        };
        unit.covariance(&spans, session)
    }

    fn known(
        mut self,
        scale: &Vector3<f64>,
        forward: &Forward,
        accel: Option<&Affine<f64>>,
    ) -> Option<Rows> {
        let prepared = self.prepared;
        let observations = prepared.observations(self.sensor);
        let n = observations.len();
        let dwells: Vec<usize> = observations.iter().map(|o| o.dwell).collect();
        let wander = prepared.noise.wander(self.sensor, &prepared.dwells.list);
        let moments: Vec<Range<usize>> = dwells
            .iter()
            .map(|d| self.dwell(*d, self.force(*d, accel)))
            .collect();
        let walk = self.walk(&dwells);
        let mut y = Vec::new();
        let mut nuisance = DMatrix::zeros(3 * n, 12);
        let mut strata = Vec::new();
        for axis in 0..3 {
            for (i, o) in observations.iter().enumerate() {
                let row = y.len();
                let predicted = forward.apply(&o.input)[axis];
                self.mean_row(o.dwell, &moments[i], Vector3::ith(axis, 1.0));
                y.push((o.raw[axis] - predicted) / scale[axis]);
                nuisance[(row, 4 * axis)] = 1.0;
                for k in 0..3 {
                    nuisance[(row, 4 * axis + 1 + k)] = o.input[k];
                }
            }
            let s2 = scale[axis] * scale[axis];
            let known = DMatrix::from_fn(n, n, |i, j| match (i == j, &wander) {
                (true, _) => observations[i].variance[axis] / s2,
                (_, Some(w)) => w[axis][(dwells[i], dwells[j])] / s2,
                _ => 0.0,
            });
            strata.push(Stratum {
                name: crate::estimate::AXES[axis].into(),
                axis: Some(axis),
                rows: axis * n..(axis + 1) * n,
                known,
                walk: Some(walk.clone()),
                wander_known: wander.is_some(),
            });
        }
        let judged = (3 * n, 1);
        self.finish(y, nuisance, strata, judged)
    }

    /// Errors along the sensors as errors in the body frame: inverse of the sensitive directions.
    fn to_body(&self) -> Option<Matrix3<f64>> {
        self.direction.try_inverse()
    }

    fn sizes(mut self, inverse: &Affine<f64>) -> Option<Rows> {
        let prepared = self.prepared;
        let g = prepared.manifest.gravity_mps2;
        let observations = prepared.observations(Sensor::Accel);
        let n = observations.len();
        let dwells: Vec<usize> = observations.iter().map(|o| o.dwell).collect();
        let body = self.to_body()?;
        let moments: Vec<Range<usize>> = observations
            .iter()
            .map(|o| self.dwell(o.dwell, inverse.apply(&o.raw)))
            .collect();
        let mut y = Vec::new();
        let mut nuisance = DMatrix::zeros(n, 9);
        let lower = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];
        let centre = observations.iter().map(|o| o.raw).sum::<Vector3<f64>>() / n.max(1) as f64;
        for (i, o) in observations.iter().enumerate() {
            let force = inverse.apply(&o.raw);
            let up = force.normalize();
            self.mean_row(o.dwell, &moments[i], body.tr_mul(&up));
            y.push(force.norm() - g);
            for (k, (r, c)) in lower.into_iter().enumerate() {
                nuisance[(i, k)] = up[r] * (o.raw[c] - centre[c]);
            }
            for k in 0..3 {
                nuisance[(i, 6 + k)] = up[k];
            }
        }
        let variances = prepared.size_variances(inverse, &observations);
        let strata = vec![Stratum {
            name: "size of gravity".into(),
            axis: None,
            rows: 0..n,
            known: DMatrix::from_diagonal(&DVector::from_vec(variances)),
            walk: Some(self.walk(&dwells)),
            wander_known: prepared.noise.is_stated(Sensor::Accel),
        }];
        self.finish(y, nuisance, strata, (n, 1))
    }

    fn turns(mut self, inverse: &Affine<f64>, accel: &Affine<f64>) -> Option<Rows> {
        let prepared = self.prepared;
        let body = self.to_body()?;
        let (turns, _) = prepared.turns(accel);
        let rest = prepared.observations(Sensor::Gyro);
        let mean_square = inverse.matrix.norm_squared() / 3.0;
        let mut y = Vec::new();
        let mut turn_rows: Vec<[f64; 12]> = Vec::new();
        let blocks = &prepared.condensed.blocks;
        for turn in &turns {
            let first = self.moments.len();
            for (k, piece) in turn.increments.iter().enumerate() {
                let t_s = piece.end_s - 0.5 * piece.duration_s;
                let at = blocks
                    .partition_point(|b| b.last_s < t_s)
                    .min(blocks.len() - 1);
                let raw = Vector3::from(piece.integral) / piece.duration_s;
                let rate = inverse.apply(&raw);
                let force = accel.apply(&Vector3::from_fn(|i, _| blocks[at].raw[3 + i].mean));
                let mut moment = self.moment(at, t_s, piece.duration_s, rate, force);
                if k > 0 {
                    let before: &Moment = &self.moments[first + k - 1];
                    moment.angular_acceleration = (rate - before.rate) / (moment.t_s - before.t_s);
                }
                self.moments.push(moment);
                self.block.push(at);
            }
            let moments = first..self.moments.len();
            let found = sensitivity(turn, inverse);
            for side in 0..2 {
                let mut columns = [0.0; 12];
                let mut weights = Vec::with_capacity(moments.len());
                for (by, piece) in found.by.iter().zip(turn.increments) {
                    for i in 0..3 {
                        for j in 0..3 {
                            columns[3 * i + j] += by[side][i] * piece.integral[j];
                        }
                        columns[9 + i] += by[side][i] * piece.duration_s;
                    }
                    weights.push(body.tr_mul(&by[side]) * piece.duration_s);
                }
                y.push(found.error[side]);
                turn_rows.push(columns);
                self.rows.push(Row {
                    moments: moments.clone(),
                    weights,
                    dwells: [turn.from, turn.to],
                });
            }
        }
        let (m, n) = (y.len(), rest.len());
        let dwells: Vec<usize> = rest.iter().map(|o| o.dwell).collect();
        let moments: Vec<Range<usize>> = dwells
            .iter()
            .map(|d| self.dwell(*d, self.force(*d, Some(accel))))
            .collect();
        let mut nuisance = DMatrix::zeros(m + 3 * n, 12);
        for (row, columns) in turn_rows.iter().enumerate() {
            for (k, v) in columns.iter().enumerate() {
                nuisance[(row, k)] = *v;
            }
        }
        let walk = self.walk(&dwells);
        let wander = prepared.noise.wander(Sensor::Gyro, &prepared.dwells.list);
        // The reading that rest should have, and not that of each dwell: its noise is what the row is about, and a matrix of
        // zeros would explain it wholly, with `rate_x` of coefficient -1 beside for the turns.
        let at_rest = rest.iter().map(|o| o.raw).sum::<Vector3<f64>>() / n.max(1) as f64;
        let turn_variances: Vec<f64> = turns
            .iter()
            .flat_map(|t| [0.5 * t.floor(mean_square).powi(2); 2])
            .collect();
        let mut strata = vec![Stratum {
            name: "turns".into(),
            axis: None,
            rows: 0..m,
            known: DMatrix::from_diagonal(&DVector::from_vec(turn_variances)),
            walk: None,
            wander_known: true,
        }];
        for axis in 0..3 {
            for (i, o) in rest.iter().enumerate() {
                let row = y.len();
                self.mean_row(o.dwell, &moments[i], body.row(axis).transpose());
                y.push(inverse.apply(&o.raw)[axis]);
                for k in 0..3 {
                    nuisance[(row, 3 * axis + k)] = at_rest[k];
                }
                nuisance[(row, 9 + axis)] = 1.0;
            }
            let c = inverse.matrix.row(axis);
            let known = DMatrix::from_fn(n, n, |i, j| match (i == j, &wander) {
                (true, _) => si_covariance(&inverse.matrix, &rest[i].variance)[(axis, axis)],
                (_, Some(w)) => (0..3)
                    .map(|k| c[k] * c[k] * w[k][(dwells[i], dwells[j])])
                    .sum(),
                _ => 0.0,
            });
            strata.push(Stratum {
                name: format!("rest {}", crate::estimate::AXES[axis]),
                axis: Some(axis),
                rows: m + axis * n..m + (axis + 1) * n,
                known,
                walk: Some(walk.clone()),
                wander_known: wander.is_some(),
            });
        }
        self.finish(y, nuisance, strata, (m, 2))
    }
}

impl Rows {
    /// Dwells that row `row` is about.
    pub fn dwells(&self, row: usize) -> [usize; 2] {
        self.rows[row].dwells
    }

    /// The moments, with the temperature behind a lag of `lag_s` if there is one.
    pub fn moments(&self, lag_s: Option<f64>) -> Cow<'_, [Moment]> {
        let Some(lag_s) = lag_s else {
            return Cow::Borrowed(&self.moments);
        };
        let late = late(&self.warm, lag_s);
        let mut moments = self.moments.clone();
        for (moment, at) in moments.iter_mut().zip(&self.block) {
            moment.late_c = late[*at];
        }
        Cow::Owned(moments)
    }

    /// Columns of some regressors, each the error of one axis: `values` writes those of a moment.
    pub fn columns(
        &self,
        moments: &[Moment],
        axes: &[usize],
        values: impl Fn(&Moment, &mut [f64]),
    ) -> DMatrix<f64> {
        let p = axes.len();
        let mut at = vec![0.0; p * moments.len()];
        for (moment, out) in moments.iter().zip(at.chunks_mut(p.max(1))) {
            values(moment, out);
        }
        let mut columns = DMatrix::zeros(self.rows.len(), p);
        for (r, row) in self.rows.iter().enumerate() {
            for (m, weight) in row.moments.clone().zip(&row.weights) {
                for (k, axis) in axes.iter().enumerate() {
                    let w = weight[*axis];
                    if w != 0.0 {
                        columns[(r, k)] += w * at[p * m + k];
                    }
                }
            }
        }
        columns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn behind_a_lag_a_ramp_is_late_by_the_lag_and_a_step_decays() {
        let ramp: Vec<(f64, f64)> = (0..4000)
            .map(|i| (f64::from(i), 0.5 * f64::from(i)))
            .collect();
        let out = late(&ramp, 60.0);
        assert!((out[3999] - 0.5 * (3999.0 - 60.0)).abs() < 1e-9);
        let step: Vec<(f64, f64)> = (0..100)
            .map(|i| (f64::from(i), f64::from(u8::from(i > 0))))
            .collect();
        // The step is a ramp of a second: exp(-99/20) (exp(1/20) - 1) 20 is left of it.
        let left = 20.0 * (-99.0_f64 / 20.0).exp() * (0.05_f64.exp() - 1.0);
        assert!((1.0 - late(&step, 20.0)[99] - left).abs() < 1e-12);
    }
}
