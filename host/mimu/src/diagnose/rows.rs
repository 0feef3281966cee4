//! Residuals of recordings after the affine model, as the rows of one linear problem: the residuals, their derivatives by the affine parameters, and
//! the columns of effects.
//!
//! | reference, sensor | one row is                                                     | unit   |
//! |-------------------|----------------------------------------------------------------|--------|
//! | table             | a dwell and sensor axis: reading minus prediction, over the scale factor | SI |
//! |                   | if an input moves within a dwell: a [contrast](crate::prepared::Prepared::within_dwells) | SI |
//! | gravity, accel    | a dwell: magnitude of the force minus gravity                  | m/s²   |
//! | gravity, gyro     | a turn and direction across gravity: prediction error of gravity | rad  |
//! |                   | a dwell and axis: rate at rest                                 | rad/s  |
//!
//! Several recordings share one matrix, but each has separate biases: a bias changes at every power-on, which must not be mistaken for an effect.

mod build;
mod factors;
mod forces;
mod join;
mod known;
mod terms;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::OnceLock;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, SMatrix, SymmetricEigen, Vector3};

use crate::diagnose::columns::beside;
use crate::effects::fitted::FittedEffect;
use crate::effects::quantity::Conditions;
use crate::effects::temperature::{Followed, lagged, rank_correlation};
use crate::estimate::earth::poses;
pub use forces::ForceErrors;
use terms::Quantities;

use crate::fit::session_bias;
use crate::observable::{Observable, StratumName};
use crate::prepared::Prepared;
use crate::quantity::Sensor;
use crate::triad::Covariance;

/// Rows with common variance components.
#[derive(Debug, Clone)]
pub struct Stratum {
    /// Quantity of its rows.
    pub name: StratumName,
    /// Index of its recording.
    pub session: usize,
    /// Its rows.
    pub rows: Range<usize>,
    /// Known covariance, unit of the rows squared.
    pub known: DMatrix<f64>,
    /// Part of each row's variance that comes from errors of the reference, which are among [`Self::open`]; `None` if there is none.
    pub by_reference: Option<DVector<f64>>,
    /// Part of the diagonal of [`Self::known`] that comes from the unknown rate of the Earth, whose likeliest value is not in the rows; `None` if there is
    /// none.
    pub by_earth: Option<DVector<f64>>,
    /// Factor of the covariance by errors that all rows share, unit of the rows: this times its transpose is added to the known covariance. They are
    /// the errors of the forces that judge turns, and of a given matrix. `None` if there are none, or if they are negligible.
    pub open: Option<DMatrix<f64>>,
    /// Covariance of a random walk with K = 1 unit/√s between the rows; `None` if the rows are not dwell means.
    pub random_walk: Option<DMatrix<f64>>,
    /// Whether the known covariance includes the wander of the bias.
    pub wander_known: bool,
}

/// Affine parameters that the recordings themselves determine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FreeParameters<'a> {
    /// Matrix and biases.
    Affine,
    /// The biases. The matrix is given, with the covariance of its inverse affine model: C by rows, then o, whose part is not used.
    Bias(Option<&'a Covariance>),
}

/// A recording with the calibration that defines its residuals.
#[derive(Debug, Clone, Copy)]
pub struct Session<'a> {
    /// The recording.
    pub prepared: &'a Prepared,
    /// Gyro, raw to rad/s.
    pub gyro: Option<Affine<f64>>,
    /// Accelerometer, raw to m/s².
    pub accel: Option<Affine<f64>>,
    /// Errors of its forces, if these judge the gyro.
    pub forces: Option<&'a ForceErrors>,
}

/// Most columns of errors that rows share. The cost of a likelihood grows with the square of their number. Without a limit, 1000 dwells by hand, in 300
/// poses of two or three that share the Earth's rate, took a dense factor of all dwells, and a diagnosis of minutes.
const SHARED: usize = 48;

/// The largest columns of the `factor` of a covariance that several rows share; the others are added to the variances of rows `alone`. `None` if there
/// are none.
fn shared_by_several(factor: &DMatrix<f64>, alone: &mut DVector<f64>) -> Option<DMatrix<f64>> {
    let count = |k: usize| factor.column(k).iter().filter(|v| **v != 0.0).count();
    let size = |k: usize| factor.column(k).norm_squared();
    let mut several: Vec<usize> = (0..factor.ncols()).filter(|k| count(*k) > 1).collect();
    several.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
    several.truncate(SHARED);
    for k in (0..factor.ncols()).filter(|k| !several.contains(k)) {
        *alone += factor.column(k).map(|v| v * v);
    }
    (!several.is_empty()).then(|| factor.select_columns(&several))
}

/// Variances of the rows of a covariance with this factor.
fn row_variances(factor: &DMatrix<f64>) -> DVector<f64> {
    DVector::from_iterator(factor.nrows(), factor.row_iter().map(|r| r.norm_squared()))
}

impl Stratum {
    /// Rows with independent errors of these variances.
    fn independent(observable: Observable, rows: Range<usize>, variances: DVector<f64>) -> Self {
        Self {
            name: StratumName(observable, None),
            session: 0,
            rows,
            known: DMatrix::from_diagonal(&variances),
            by_reference: None,
            by_earth: None,
            open: None,
            random_walk: None,
            wander_known: true,
        }
    }

    /// Axis, if all of its rows are means of one.
    pub fn axis(&self) -> Option<usize> {
        match self.name.0 {
            Observable::Axis(axis) | Observable::AtRest(axis) => Some(axis),
            _ => None,
        }
    }

    /// Known variance of its rows, unit of the rows squared.
    pub fn known_variances(&self) -> DVector<f64> {
        let known = self.known.diagonal();
        match &self.open {
            Some(open) => known + row_variances(open),
            None => known,
        }
    }

    /// The known covariance; with that of the errors that all rows share, if there are at most `few` rows.
    pub fn with_open(&self, few: usize) -> Cow<'_, DMatrix<f64>> {
        match &self.open {
            Some(open) if self.rows.len() <= few => {
                Cow::Owned(&self.known + open * open.transpose())
            }
            _ => Cow::Borrowed(&self.known),
        }
    }
}

impl<'a> Session<'a> {
    /// A recording with the calibrations of gyro and accelerometer.
    pub fn of(prepared: &'a Prepared, [gyro, accel]: [Option<Affine<f64>>; 2]) -> Self {
        Self {
            prepared,
            gyro,
            accel,
            forces: None,
        }
    }

    /// A later recording with the calibration of the first: its matrices, and separate biases.
    pub fn later(prepared: &'a Prepared, models: &[Option<Affine<f64>>; 2]) -> Self {
        let own = [0, 1].map(|i| {
            let known = models[i]?;
            let accel = models[1].as_ref();
            let own = session_bias::estimate(prepared, Sensor::BOTH[i], &known, accel);
            Some(own.map_or(known, |e| e.triad.inverse))
        });
        Self::of(prepared, own)
    }

    /// Calibration of `sensor`.
    pub fn model(&self, sensor: Sensor) -> Option<Affine<f64>> {
        sensor.pick(self.gyro, self.accel)
    }
}

/// A row: a weighted sum of the sensor's errors under several conditions.
#[derive(Debug, Clone)]
struct Row {
    /// Indices of its conditions.
    conditions: Range<usize>,
    /// What an error of each axis of the sensor (SI) adds to the row, for each of its conditions.
    weights: Vec<Vector3<f64>>,
    /// Index of the dwell, or of the dwells that a turn begins and ends in; counted through all recordings.
    dwells: [usize; 2],
    /// Whether the input changes between its conditions, so that no single one represents all.
    moving: bool,
}

/// The rows of one sensor.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Sensor.
    pub sensor: Sensor,
    /// Residuals.
    pub y: DVector<f64>,
    /// Derivatives by the parameters of the affine model, as columns of length 1.
    pub nuisance: DMatrix<f64>,
    /// What one unit of each of the first recording's columns, which come first, adds to its inverse affine model: C by rows, then o.
    pub parameters: DMatrix<f64>,
    /// Derivatives of the rows by the elements of C, by rows, without the part that a bias absorbs.
    by_matrix: DMatrix<f64>,
    /// Strata, which cover the rows in order.
    pub strata: Vec<Stratum>,
    /// Whether the vertical component of the Earth's rate is to be found: by hand without a latitude. On a table without one it is in the covariance.
    pub earth_unknown: bool,
    /// What the rows that error figures include observe.
    pub observable: Observable,
    /// Number of rows, from the first on, that the error figures include; and how many of these count as one dwell or turn.
    pub judged: (usize, usize),
    rows: Vec<Row>,
    conditions: Vec<Conditions>,
    /// What the sensor reads under each of the conditions, raw; and its scale factors in each recording, raw/SI.
    readings: Vec<Vector3<f64>>,
    scales: BTreeMap<usize, Vector3<f64>>,
    /// Recording and block of each of the conditions.
    block: Vec<(usize, usize)>,
    /// Of each recording: time of each block, s, and its temperature, °C above the reference.
    temperature: Vec<Vec<(f64, f64)>>,
    /// The same without the thermometer's self-heating, if there is any.
    without_self_heating: Vec<Option<Vec<(f64, f64)>>>,
    /// Index of the first dwell of each recording, then the number of all dwells.
    first: Vec<usize>,
    /// Quantities of the terms, computed when first needed.
    quantities: OnceLock<Quantities>,
}

/// Rank correlation above which temperature and time are not distinguished. A ramp up and half of the way back has 0.5.
const ONE_WAY: f64 = 0.95;

/// Share of the noise variance below which the uncertainty of a given matrix is neglected.
const NEGLIGIBLE: f64 = 1e-4;

impl Rows {
    /// The rows of `sensor` in all of `sessions`, whose calibrations share one matrix.
    ///
    /// The error figures include the recordings of the same kind as the first. `None` if the first has no rows, or its calibration is singular.
    pub fn of(sessions: &[Session], sensor: Sensor, free: FreeParameters) -> Option<Self> {
        let parts: Vec<_> = sessions
            .iter()
            .enumerate()
            .filter_map(|(i, s)| Some((i, build::part(s, sensor, free)?)))
            .collect();
        let mut rows = join::join(sensor, &parts, sessions.len())?;
        if let FreeParameters::Bias(Some(covariance)) = free {
            rows.leave_open(covariance.fixed_view::<9, 9>(0, 0).into_owned());
        }
        Some(rows)
    }

    /// Adds what `effects` contribute to these rows, which are of readings without them. `as_read` are the rows of the recorded readings; `None` if
    /// the two differ in dwells or conditions.
    ///
    /// The magnitude of a force and the angle of a turn are not linear in the errors of the readings, nor are effects linear in the input. Linearised
    /// about the recorded readings, an accelerometer's cubic term of 3 % at 1 g came out 14 %, or 21 standard deviations, too large. About readings
    /// without the effect, the neglected part is as small as their remaining error.
    pub fn about(mut self, effects: &[FittedEffect], as_read: &Self) -> Option<Self> {
        // The error of a converter depends on the code that it put out.
        self.readings.clone_from(&as_read.readings);
        let alike = |a: &Row, b: &Row| a.dwells == b.dwells && a.conditions == b.conditions;
        let same = self.rows.len() == as_read.rows.len()
            && self
                .rows
                .iter()
                .zip(&as_read.rows)
                .all(|(a, b)| alike(a, b));
        for effect in effects {
            let columns = effect.candidate.columns(&self, effect.parameter);
            self.y += columns * DVector::from_column_slice(&effect.values);
        }
        same.then_some(self)
    }

    /// Adds the uncertainty of a given matrix: the `covariance` of C by rows.
    ///
    /// All n recordings share this error, but their strata are treated as independent. The mean of n independent errors has 1/n of their variance, so
    /// each gets n times the variance.
    fn leave_open(&mut self, covariance: SMatrix<f64, 9, 9>) {
        let mut sessions: Vec<usize> = self.strata.iter().map(|s| s.session).collect();
        sessions.sort_unstable();
        sessions.dedup();
        let eigen = SymmetricEigen::new(covariance * sessions.len() as f64);
        let sigmas = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
        let factor = eigen.eigenvectors * SMatrix::from_diagonal(&sigmas);
        let factor = DMatrix::from_fn(9, 9, |i, j| factor[(i, j)]);
        for stratum in &mut self.strata {
            let open = self.by_matrix.rows_range(stratum.rows.clone()) * &factor;
            let most = open
                .row_iter()
                .map(|r| r.norm_squared())
                .fold(0.0, f64::max);
            // If the input is constant, a bias absorbs an error of the matrix.
            if most > NEGLIGIBLE * stratum.known.diagonal().min() {
                stratum.open = Some(match &stratum.open {
                    Some(others) => beside(others, &open),
                    None => open,
                });
            }
        }
    }

    /// Three rows for each pose of a recording: the error of the force that its accelerometer measures.
    pub(super) fn forces(session: &Session) -> Option<Self> {
        let mut part = build::Part::of(session, Sensor::Accel)?;
        part.add_forces();
        join::join(Sensor::Accel, &[(0, part)], 1)
    }

    /// Dwells of row `row`, counted through all recordings: a turn begins in the first and ends in the second; otherwise both are the same.
    pub fn dwells(&self, row: usize) -> [usize; 2] {
        self.rows[row].dwells
    }

    /// For each dwell the first dwell in the same pose of the same recording, by the direction of gravity. If the unit was placed badly, all of these
    /// err alike, so they count as one witness. Each dwell is a separate witness on a table, whose input is known, and if there is only one pose.
    pub fn witnesses(&self) -> Vec<usize> {
        if self.is_of_known_inputs() {
            return (0..self.dwell_count()).collect();
        }
        let mut ups = vec![Vector3::repeat(f64::NAN); self.dwell_count()];
        for row in self.rows.iter().filter(|r| r.dwells[0] == r.dwells[1]) {
            ups[row.dwells[0]] = self.conditions[row.conditions.start].force;
        }
        let sessions = self.first.windows(2).flat_map(|ends| {
            let found = poses(&ups[ends[0]..ends[1]]).into_iter();
            found.map(|pose| ends[0] + pose)
        });
        let witnesses: Vec<usize> = sessions.collect();
        match witnesses.iter().all(|w| *w == 0) {
            true => (0..witnesses.len()).collect(),
            false => witnesses,
        }
    }

    /// Whether the inputs are known.
    pub fn is_of_known_inputs(&self) -> bool {
        matches!(self.observable, Observable::Axis(_))
    }

    /// Number of judged rows that show how the reading follows an input that moves within a dwell.
    pub fn judged_within(&self) -> usize {
        let within = self
            .strata
            .iter()
            .filter(|s| matches!(s.name.0, Observable::Within(_)) && s.rows.end <= self.judged.0);
        within.map(|s| s.rows.len()).sum()
    }

    /// Number of dwells.
    pub fn dwell_count(&self) -> usize {
        self.first.last().copied().unwrap_or(0)
    }

    /// Index of a dwell in its recording, and the number of dwells there.
    pub fn place(&self, dwell: usize) -> (usize, usize) {
        let after = self.first.partition_point(|f| *f <= dwell);
        let [from, to] = [after.saturating_sub(1), after].map(|i| self.first[i]);
        (dwell - from, to - from)
    }

    /// Mean of a quantity over the conditions of row `row`, weighted by their durations. `conditions` are those of all rows, as [`Self::conditions`]
    /// gives them.
    pub fn mean(
        &self,
        row: usize,
        conditions: &[Conditions],
        value: impl Fn(&Conditions) -> f64,
    ) -> f64 {
        let of_row = &conditions[self.rows[row].conditions.clone()];
        let total: f64 = of_row.iter().map(|m| m.duration_s).sum();
        of_row.iter().map(|m| value(m) * m.duration_s / total).sum()
    }

    /// What functions of the reading alone see of each row: the weights of an error of each axis, and the reading that it is a function of. A dwell with
    /// constant input has one reading, whose samples scatter, without the `residuals` of its rows: the noise of a dwell is in its reading and in its row, and
    /// any function of the noisy reading would seem to explain the row.
    pub fn readings(&self, residuals: &DVector<f64>) -> Vec<Vec<[Vector3<f64>; 2]>> {
        let steady = |row: &Row| row.dwells[0] == row.dwells[1] && !row.moving;
        let mut of_dwells: BTreeMap<usize, Vector3<f64>> = BTreeMap::new();
        let rows = self.rows.iter().zip(residuals.iter());
        for (row, residual) in rows.filter(|(row, _)| steady(row)) {
            let of_row = &self.conditions[row.conditions.clone()];
            let mean = of_dwells.entry(row.conditions.start).or_insert_with(|| {
                let total: f64 = of_row.iter().map(|at| at.duration_s).sum();
                let each = of_row.iter().zip(&self.readings[row.conditions.clone()]);
                each.map(|(at, reading)| reading * (at.duration_s / total))
                    .sum()
            });
            let weight: Vector3<f64> = row.weights.iter().sum();
            let error = weight * (residual / weight.norm_squared());
            *mean -= self.scales[&of_row[0].session].component_mul(&error);
        }
        let of_row = |row: &Row| match of_dwells.get(&row.conditions.start) {
            Some(mean) if steady(row) => vec![[row.weights.iter().sum(), *mean]],
            _ => {
                let each = self.readings[row.conditions.clone()].iter();
                let each = row.weights.iter().zip(each);
                each.map(|(weight, reading)| [*weight, *reading]).collect()
            }
        };
        self.rows.iter().map(of_row).collect()
    }

    /// The conditions, with the temperature that an effect follows.
    pub fn conditions(&self, followed: Option<Followed>) -> Cow<'_, [Conditions]> {
        let Some(followed) = followed else {
            return Cow::Borrowed(&self.conditions);
        };
        let each = self.temperature.iter().zip(&self.without_self_heating);
        let temperature_offset: Vec<&[(f64, f64)]> = each
            .map(|(recorded, other)| {
                let other = other.as_deref().filter(|_| followed.without_self_heating);
                other.unwrap_or(recorded)
            })
            .collect();
        let lagged_temperature: Vec<Vec<f64>> = temperature_offset
            .iter()
            .map(|w| match followed.lag_s {
                Some(lag_s) => lagged(w, lag_s),
                None => w.iter().map(|w| w.1).collect(),
            })
            .collect();
        let mut conditions = self.conditions.clone();
        for (at_one, (session, at)) in conditions.iter_mut().zip(&self.block) {
            at_one.temperature_offset = temperature_offset[*session][*at].1;
            at_one.lagged_temperature = lagged_temperature[*session][*at];
        }
        Cow::Owned(conditions)
    }

    /// Whether the thermometer of a recording has self-heating.
    pub fn thermometer_heats_itself(&self) -> bool {
        self.without_self_heating.iter().any(Option::is_some)
    }

    /// Rank correlation of temperature and time, if it is so strong in all recordings that their effects look alike; `None` if the temperature
    /// returns.
    pub fn one_way(&self) -> Option<f64> {
        let correlations: Vec<f64> = self
            .temperature
            .iter()
            .filter_map(|w| rank_correlation(w))
            .collect();
        let least = correlations
            .iter()
            .copied()
            .fold(f64::INFINITY, |a, b| if b.abs() < a.abs() { b } else { a });
        let alike = correlations.iter().all(|c| c.signum() == least.signum());
        (least.is_finite() && alike && least.abs() > ONE_WAY).then_some(least)
    }

    /// Columns of some regressors, each an error of one axis. `values` writes the regressors under one set of conditions.
    pub fn columns(
        &self,
        conditions: &[Conditions],
        axes: &[usize],
        values: impl Fn(&Conditions, &mut [f64]),
    ) -> DMatrix<f64> {
        let p = axes.len();
        let mut at = vec![0.0; p * conditions.len()];
        for (conditions, out) in conditions.iter().zip(at.chunks_mut(p.max(1))) {
            values(conditions, out);
        }
        let mut columns = DMatrix::zeros(self.rows.len(), p);
        for (r, row) in self.rows.iter().enumerate() {
            for (m, weight) in row.conditions.clone().zip(&row.weights) {
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
