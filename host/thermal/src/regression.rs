//! The readings of a triad as a linear regression, once the temperature of the die is known.
//!
//! `u_j = Σ_i P_ji(T) x_i + b_j(T) + b_js + noise` for the axis j in the session s: every P_ji and b_j is a sum of functions of the die's
//! temperature ([`Basis`]), and the first session has no offset b_js. Readings are scaled by a first affine fit, so that the same curve of
//! any sensor has the same size: biases in SI, the rest as ratios.

use std::ops::Range;

use mimu::quantity::Sensor;
use mimu_allan::model::FLOOR;
use mimu_allan::variance::AllanModel;
use mimu_recording::error::{Error, Result};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, Vector3, Vector4};

use crate::basis::{Basis, Shape};
use crate::excitation;
use crate::session::Session;

/// Most headings of a session whose numbers of the Earth's rate are estimated.
const MOST_HEADINGS: usize = 8;

/// The parameter whose temperature dependence a curve is; smoothness is estimated for each kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CurveKind {
    /// Bias.
    Bias,
    /// Scale factor: diagonal of P.
    Scale,
    /// Cross terms: the rest of P.
    Cross,
}

impl CurveKind {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::Bias, Self::Scale, Self::Cross];
}

/// A row of all sessions.
#[derive(Debug, Clone, Copy)]
pub struct ProblemRow {
    /// Its session.
    pub session: usize,
    /// Number of its bias offset: 0 for the first power-on in its first pose.
    pub offset: usize,
    /// Middle, s of its session.
    pub middle_s: f64,
    /// Number of samples over the largest.
    pub weight: f64,
    /// Known input, SI; zero where only biases are estimated.
    pub input: Vector3<f64>,
    /// The unknown part of the Earth's rate: its heading among those of the problem, and the rate by one standard deviation of its three numbers.
    pub earth: Option<(usize, Matrix3<f64>)>,
    /// Reading minus [`Problem::null`], over [`Problem::gain`], minus the share [`Problem::taken_off`] of the input.
    pub reading: Vector3<f64>,
    /// Number of the dwell in its session.
    pub step: i32,
}

/// What one triad is estimated from.
#[derive(Debug, Clone)]
pub struct Problem {
    /// The triad.
    pub sensor: Sensor,
    /// Rows of all sessions, in order.
    pub rows: Vec<ProblemRow>,
    /// Raw per SI of each axis.
    pub gain: Vector3<f64>,
    /// Raw reading without input.
    pub null: Vector3<f64>,
    /// Functions of temperature of each [`CurveKind`].
    pub bases: [Basis; 3],
    /// Number of bias offsets with the first, which is zero: one for each power-on, and in recordings without a table one for each pose.
    pub offsets: usize,
    /// Number of headings. Each has three unknown numbers of the Earth's rate, whose likeliest values are part of the inputs.
    pub headings: usize,
    /// Whether only biases are estimated: nothing is known of the input, or it does not excite the rest.
    pub biases_only: bool,
    /// Samples of the row of weight 1.
    pub samples: f64,
    /// Share of its input that is subtracted from the reading of an axis beforehand, 1 or 0: scale factors are then estimated relative to
    /// it. With gravity included, the squares of the readings were 1e11 times the noise, and the rounding errors of their difference from
    /// those of the curves made steps of several units in the likelihood of a lag.
    pub taken_off: f64,
}

/// A curve of one axis among the columns of its regression.
#[derive(Debug, Clone, Copy)]
pub struct Part {
    /// Input that multiplies it; none for a bias.
    pub input: Option<usize>,
    /// Its kind.
    pub kind: CurveKind,
    /// Its first column.
    pub from: usize,
}

impl Problem {
    /// From the rows of `sensor` in `sessions`, with curves of `shape` over the temperatures `range`. `biases_only` if the input is not
    /// known.
    ///
    /// # Errors
    /// An experiment whose inputs do not determine every parameter.
    pub fn new(
        sessions: &[Session],
        sensor: Sensor,
        shape: Shape,
        range: [f64; 2],
        biases_only: bool,
    ) -> Result<Self> {
        let (mut rows, mut offsets) = (Vec::new(), 0);
        let mut headings = 0;
        for (k, session) in sessions.iter().enumerate() {
            let unknown = session.rows[sensor].iter().filter(|r| r.earth.is_unknown());
            let own = unknown.map(|r| r.earth.heading + 1).max().unwrap_or(0);
            // More are noise that the residuals show.
            let own = if own > MOST_HEADINGS || biases_only {
                0
            } else {
                own
            };
            let first = headings;
            headings += own;
            rows.extend(session.rows[sensor].iter().map(|r| ProblemRow {
                session: k,
                offset: offsets + session.poses_before(sensor, r.middle_s),
                middle_s: r.middle_s,
                weight: r.samples,
                input: if biases_only {
                    Vector3::zeros()
                } else {
                    r.input
                },
                earth: (r.earth.heading < own).then_some((first + r.earth.heading, r.earth.by)),
                reading: r.raw,
                step: r.step,
            }));
            offsets += 1 + session.moved_s[sensor as usize].len();
        }
        let samples = rows.iter().map(|r| r.weight).fold(1.0, f64::max);
        rows.iter_mut().for_each(|r| r.weight /= samples);
        let mut problem = Self {
            sensor,
            rows,
            gain: Vector3::repeat(1.0),
            null: Vector3::zeros(),
            bases: CurveKind::ALL.map(|_| Basis::new(shape, range)),
            offsets,
            headings,
            biases_only,
            samples,
            taken_off: 0.0,
        };
        if !biases_only {
            // The Earth turns far too slowly to show a scale factor.
            let rows = sessions.iter().flat_map(|s| &s.rows[sensor]);
            let products = rows.map(|r| {
                let x = (r.input - r.earth.known).push(1.0);
                x * x.transpose() * r.samples
            });
            excitation::check(&products.sum(), sensor)?;
        }
        problem.scale()?;
        Ok(problem)
    }

    /// Scales the readings by an affine fit without temperature.
    fn scale(&mut self) -> Result<()> {
        if self.biases_only {
            let n = self.rows.len().max(1) as f64;
            self.null = self.rows.iter().map(|r| r.reading).sum::<Vector3<f64>>() / n;
        } else {
            let mut gram = Matrix4::zeros();
            let mut with: [Vector4<f64>; 3] = [Vector4::zeros(); 3];
            for r in &self.rows {
                let x = r.input.push(1.0);
                gram += x * x.transpose() * r.weight;
                for (k, with) in with.iter_mut().enumerate() {
                    *with += x * r.reading[k] * r.weight;
                }
            }
            let inverse = gram.try_inverse().unwrap_or_else(Matrix4::zeros);
            for k in 0..3 {
                let fitted = inverse * with[k];
                self.gain[k] = fitted.fixed_rows::<3>(0).norm();
                self.null[k] = fitted[3];
            }
            if !self.gain.iter().all(|g| *g > 0.0) {
                return Err(Error::undetermined(
                    self.sensor,
                    "the readings do not follow the known inputs at all",
                    "check the ref_ columns and which columns are the sensor's",
                ));
            }
        }
        self.taken_off = f64::from(!self.biases_only);
        for r in &mut self.rows {
            let scaled = (r.reading - self.null).component_div(&self.gain);
            r.reading = scaled - r.input * self.taken_off;
        }
        Ok(())
    }

    /// Functions of temperature of curves of `kind`.
    pub fn basis(&self, kind: CurveKind) -> &Basis {
        &self.bases[kind as usize]
    }

    /// Curves of `axis`, in the order of its columns.
    pub fn parts(&self, axis: usize) -> Vec<Part> {
        let inputs = (0..3).map(Some).filter(|_| !self.biases_only);
        let mut from = 0;
        let curves = inputs.chain([None]).map(|input| {
            let kind = match input {
                None => CurveKind::Bias,
                Some(i) if i == axis => CurveKind::Scale,
                Some(_) => CurveKind::Cross,
            };
            let part = Part { input, kind, from };
            from += self.basis(kind).functions();
            part
        });
        curves.collect()
    }

    /// Number of columns of `axis`: its curves, the numbers of the Earth's rate, then the bias offsets except the first.
    pub fn columns(&self, axis: usize) -> usize {
        self.earth_columns(axis).end + self.offsets - 1
    }

    /// Columns of the numbers of the Earth's rate.
    pub fn earth_columns(&self, axis: usize) -> Range<usize> {
        let parts = self.parts(axis);
        let curves = parts.iter().map(|p| self.basis(p.kind).functions());
        let from = curves.sum();
        from..from + 3 * self.headings
    }

    /// Writes the entries of `row` of `axis` at the die's temperature `temp_c`, then the reading at [`Self::columns`].
    pub fn entries(
        &self,
        axis: usize,
        row: &ProblemRow,
        temp_c: f64,
        parts: &[Part],
        out: &mut Vec<(usize, f64)>,
    ) {
        out.clear();
        for part in parts {
            let (from, values) = self.basis(part.kind).values(temp_c);
            let factor = part.input.map_or(1.0, |i| row.input[i]);
            if factor != 0.0 {
                let each = values.iter().enumerate().filter(|(_, v)| **v != 0.0);
                out.extend(each.map(|(k, v)| (part.from + from + k, v * factor)));
            }
        }
        let columns = self.columns(axis);
        if let Some((heading, by)) = &row.earth {
            let from = self.earth_columns(axis).start + 3 * heading;
            let each = by.row(axis).into_iter().copied().enumerate();
            out.extend(each.filter(|(_, v)| *v != 0.0).map(|(k, v)| (from + k, v)));
        }
        if row.offset > 0 {
            out.push((columns - self.offsets + row.offset, 1.0));
        }
        out.push((columns, row.reading[axis]));
    }
}

/// Number of processes whose sum is flicker noise: the most of which a wander is the sum.
pub const MOST_PARTS: usize = 4;
/// Longest correlation time of flicker noise, s: beyond most recordings.
pub const LONGEST_S: f64 = 10_000.0;
/// Factor between their correlation times: so small that the sum has the spectrum of flicker noise between the ends, to a few per cent.
const APART: f64 = 5.0;

/// Noise of one axis: white noise of the rows, and a bias that wanders.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisNoise {
    /// Variance of a row of weight 1, SI².
    pub white: f64,
    /// Variance of the wander, SI².
    pub wander: f64,
    /// Its longest correlation time, s.
    pub correlation_s: f64,
    /// Number of processes with exponential correlation that share the variance evenly: one, or four with shorter and shorter times,
    /// which are flicker noise.
    pub parts: usize,
}

impl AxisNoise {
    /// From the density N, the bias instability B and the random walk K of data sheets and Allan curves; a row of weight 1 is `row_s` long.
    pub fn of_densities([n, b, k]: [f64; 3], row_s: f64) -> Self {
        // A process of variance v for each factor r of correlation times has the density v / (f ln r); flicker noise has B² / (π f).
        let of_flicker = b * b * APART.ln() / std::f64::consts::PI;
        Self {
            white: n * n / row_s,
            // The mean variance of a random walk over the longest time.
            wander: MOST_PARTS as f64 * of_flicker + 0.5 * k * k * LONGEST_S,
            correlation_s: LONGEST_S,
            parts: MOST_PARTS,
        }
    }

    /// The bias wander that a record at rest gives, raw, divided by the `gain` of the axis, raw per SI.
    pub fn wander_at_rest(model: &AllanModel, gain: f64) -> Self {
        let (b, k) = ((model.flicker / FLOOR).sqrt(), (3.0 * model.walk).sqrt());
        Self::of_densities([0.0, b / gain, k / gain], 1.0)
    }
}

/// Normal equations of one axis, from rows that were whitened to a variance of one.
#[derive(Debug, Clone)]
pub struct Normal {
    /// Products of the columns.
    pub gram: DMatrix<f64>,
    /// Products of the columns with the reading.
    pub with: DVector<f64>,
    /// Sum of squares of the readings.
    pub squares: f64,
    /// Logarithm of the determinant of the rows' covariance.
    pub log_det: f64,
    /// Number of rows.
    pub rows: f64,
    /// Prior precision of the numbers of the Earth's rate in units of the rows' variance: 1, unless that is relative.
    pub earth_precision: f64,
}

impl Normal {
    /// For `axis` of `problem` with its rows at the die temperatures `dies`, without the rows that `used` refuses.
    pub fn of(
        problem: &Problem,
        axis: usize,
        dies: &[f64],
        noise: &AxisNoise,
        used: impl Fn(usize) -> bool,
    ) -> Self {
        match noise.wander > 0.0 {
            true => Self::correlated(problem, axis, dies, noise, used),
            false => Self::white(problem, axis, dies, noise, used),
        }
    }

    fn white(
        problem: &Problem,
        axis: usize,
        dies: &[f64],
        noise: &AxisNoise,
        used: impl Fn(usize) -> bool,
    ) -> Self {
        let p = problem.columns(axis);
        let parts = problem.parts(axis);
        let mut both = DMatrix::zeros(p + 1, p + 1);
        let mut entries = Vec::new();
        let (mut log_det, mut rows) = (0.0, 0.0);
        for (k, row) in problem.rows.iter().enumerate().filter(|(k, _)| used(*k)) {
            problem.entries(axis, row, dies[k], &parts, &mut entries);
            let variance = noise.white / row.weight;
            log_det += variance.ln();
            rows += 1.0;
            for &(i, a) in &entries {
                for &(j, b) in &entries {
                    both[(i, j)] += a * b / variance;
                }
            }
        }
        Self::split(&both, p, log_det, rows)
    }

    /// A Kalman filter of the wander turns readings and columns alike into innovations, which are white.
    fn correlated(
        problem: &Problem,
        axis: usize,
        dies: &[f64],
        noise: &AxisNoise,
        used: impl Fn(usize) -> bool,
    ) -> Self {
        let p = problem.columns(axis);
        let parts = problem.parts(axis);
        let count = (0..problem.rows.len()).filter(|k| used(*k)).count();
        let mut white = DMatrix::zeros(p + 1, count);
        let mut entries = Vec::new();
        let mut innovation = vec![0.0; p + 1];
        let mut wander = Wander::new(noise, p + 1);
        let mut log_det = 0.0;
        let mut before: Option<&ProblemRow> = None;
        let used_rows = problem.rows.iter().enumerate().filter(|(k, _)| used(*k));
        for (column, (k, row)) in used_rows.enumerate() {
            match before {
                Some(b) if b.session == row.session => {
                    wander.pass((row.middle_s - b.middle_s).abs());
                }
                _ => wander.begin(),
            }
            before = Some(row);
            problem.entries(axis, row, dies[k], &parts, &mut entries);
            wander.expected(&mut innovation);
            for &(i, a) in &entries {
                innovation[i] += a;
            }
            let total = wander.update(&innovation, noise.white / row.weight);
            log_det += total.ln();
            let root = 1.0 / total.sqrt();
            let each = white.column_mut(column).into_iter().zip(&innovation);
            each.for_each(|(out, innovation)| *out = innovation * root);
        }
        let both = &white * white.transpose();
        Self::split(&both, p, log_det, count as f64)
    }

    fn split(both: &DMatrix<f64>, p: usize, log_det: f64, rows: f64) -> Self {
        Self {
            gram: both.view((0, 0), (p, p)).into_owned(),
            with: both.view((0, p), (p, 1)).column(0).into_owned(),
            squares: both[(p, p)],
            log_det,
            rows,
            earth_precision: 1.0,
        }
    }
}

/// Kalman filter of a wander, for the readings and all columns at once.
struct Wander {
    parts: usize,
    /// Variance of each process.
    variance: f64,
    correlation_s: [f64; MOST_PARTS],
    /// State of each process, by column.
    state: [Vec<f64>; MOST_PARTS],
    covariance: [[f64; MOST_PARTS]; MOST_PARTS],
}

impl Wander {
    fn new(noise: &AxisNoise, columns: usize) -> Self {
        let parts = noise.parts.clamp(1, MOST_PARTS);
        Self {
            parts,
            variance: noise.wander / parts as f64,
            correlation_s: std::array::from_fn(|k| noise.correlation_s / APART.powi(k as i32)),
            state: std::array::from_fn(|k| vec![0.0; if k < parts { columns } else { 0 }]),
            covariance: [[0.0; MOST_PARTS]; MOST_PARTS],
        }
    }

    /// Begins another power-on.
    fn begin(&mut self) {
        self.state.iter_mut().for_each(|s| s.fill(0.0));
        self.covariance = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                if i == j && i < self.parts {
                    self.variance
                } else {
                    0.0
                }
            })
        });
    }

    /// Propagates over `dt_s`.
    fn pass(&mut self, dt_s: f64) {
        let keep = self.correlation_s.map(|tau| (-dt_s / tau).exp());
        for (k, state) in self.state.iter_mut().enumerate() {
            state.iter_mut().for_each(|s| *s *= keep[k]);
        }
        for i in 0..self.parts {
            for j in 0..self.parts {
                self.covariance[i][j] *= keep[i] * keep[j];
            }
            self.covariance[i][i] += self.variance * (1.0 - keep[i] * keep[i]);
        }
    }

    /// Writes the expectation of each column, with the opposite sign.
    fn expected(&self, out: &mut [f64]) {
        out.fill(0.0);
        for state in &self.state {
            out.iter_mut().zip(state).for_each(|(o, s)| *o -= s);
        }
    }

    /// Updates with the innovations of a row with this white variance; returns their variance.
    fn update(&mut self, innovation: &[f64], white: f64) -> f64 {
        let seen = self.covariance.map(|row| row.iter().sum::<f64>());
        let total = seen.iter().sum::<f64>() + white;
        for (i, state) in self.state.iter_mut().enumerate() {
            let gain = seen[i] / total;
            let each = state.iter_mut().zip(innovation);
            each.for_each(|(s, innovation)| *s += gain * innovation);
            for j in 0..self.parts {
                self.covariance[i][j] -= gain * seen[j];
            }
        }
        total
    }
}
