//! The rows of one recording.

use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, Matrix3, Vector3};

use super::{FreeParameters, Row, RowFigure, Session, Stratum};
use crate::effects::quantity::{Conditions, Reading};
use crate::effects::temperature::offsets;
use crate::noise::wander::{Slow, Span};
use crate::prepared::Prepared;
use crate::quantity::Sensor;
use crate::triad::directions;
use mimu_recording::Reference;

/// The rows of one recording, not yet joined with those of others.
pub(super) struct Part {
    /// Reference of the recording. Recordings with the same reference share the parameters of the matrix.
    pub reference: Reference,
    /// Residuals.
    pub y: Vec<f64>,
    /// Derivatives by the affine parameters.
    pub nuisance: DMatrix<f64>,
    /// What a unit of each adds to the inverse affine model, C by rows and then o.
    pub parameters: DMatrix<f64>,
    /// As in [`super::Rows`].
    pub by_matrix: DMatrix<f64>,
    /// Which columns of the derivatives are biases.
    pub biases: Vec<usize>,
    /// Strata.
    pub strata: Vec<Stratum>,
    /// As in [`super::Rows`], of this recording.
    pub earth_unknown: bool,
    /// What the judged rows are about.
    pub figure: RowFigure,
    /// As in [`super::Rows`].
    pub judged: (usize, usize),
    pub rows: Vec<Row>,
    pub conditions: Vec<Conditions>,
    pub block: Vec<usize>,
    pub temperature_offset: Vec<(f64, f64)>,
}

pub(super) struct Builder<'a> {
    pub prepared: &'a Prepared,
    pub sensor: Sensor,
    /// Whether the recording has the other sensor too. A table may know that input, but without the sensor no device could
    /// remove an effect that depends on it.
    pub other_measured: bool,
    pub t0_s: f64,
    pub middle_s: f64,
    pub temperature_offset: Vec<(f64, f64)>,
    pub rows: Vec<Row>,
    pub conditions: Vec<Conditions>,
    pub block: Vec<usize>,
    pub direction: Matrix3<f64>,
    pub scale: Vector3<f64>,
}

/// The rows of `sensor` in a recording; `None` if it has none, or if the calibration is singular.
pub(super) fn part(session: &Session, sensor: Sensor, free: FreeParameters) -> Option<Part> {
    let inverse = session.model(sensor)?;
    let accel = session.accel.as_ref();
    let builder = Builder::of(session, sensor)?;
    let reference = session.prepared.manifest.reference;
    let mut part = match (reference, sensor) {
        (Reference::Table, _) => builder.known(&inverse, accel),
        (Reference::Gravity | Reference::TurntableRate, Sensor::Accel) => {
            builder.magnitudes(&inverse)
        }
        // A diagnosis of a recording from a turntable is refused before.
        (Reference::TurntableRate, Sensor::Gyro) => return None,
        (Reference::Gravity, Sensor::Gyro) => builder.turns(&inverse, accel, session.forces),
    }?;
    if let FreeParameters::Bias(_) = free {
        part.nuisance = part.nuisance.select_columns(&part.biases);
        part.parameters = part.parameters.select_columns(&part.biases);
        part.biases = (0..part.biases.len()).collect();
    }
    Some(part)
}

/// The forces of a recording; see [`Builder::forces`].
pub(super) fn forces(session: &Session) -> Option<Part> {
    let inverse = session.model(Sensor::Accel)?;
    Builder::of(session, Sensor::Accel)?.forces(&inverse)
}

impl<'a> Builder<'a> {
    /// `None` if the recording lacks the sensor, or its calibration is singular.
    fn of(session: &Session<'a>, sensor: Sensor) -> Option<Self> {
        let prepared = session.prepared;
        if !prepared.has(sensor) {
            return None;
        }
        let (direction, scale, _) = directions(&session.model(sensor)?)?;
        let blocks = &prepared.condensed.blocks;
        Some(Self {
            prepared,
            sensor,
            other_measured: match sensor {
                Sensor::Gyro => session.accel.is_some(),
                Sensor::Accel => session.gyro.is_some(),
            },
            t0_s: blocks.first()?.start_s,
            middle_s: prepared.middle_s(),
            temperature_offset: offsets(blocks),
            rows: Vec::new(),
            conditions: Vec::new(),
            block: Vec::new(),
            direction,
            scale,
        })
    }
}

impl Builder<'_> {
    pub(super) fn conditions(
        &self,
        at: usize,
        t_s: f64,
        duration_s: f64,
        rate: Vector3<f64>,
        force: Vector3<f64>,
    ) -> Conditions {
        let input = match self.sensor {
            Sensor::Gyro => rate,
            Sensor::Accel => force,
        };
        Conditions {
            session: 0,
            t_s: t_s - self.t0_s,
            on_s: t_s - self.prepared.power_on_s(),
            from_middle_s: t_s - self.middle_s,
            duration_s,
            rate,
            force,
            angular_acceleration: Vector3::zeros(),
            sensed: self.direction * input,
            temperature_offset: self.temperature_offset[at].1,
            lagged_temperature: self.temperature_offset[at].1,
            reading: Reading::of(
                &self.prepared.condensed.blocks[at].raw[self.sensor.channels()],
                &self.scale,
            ),
        }
    }

    /// The conditions of a dwell, block by block: the input that the table gives, or rest under `force`.
    pub(super) fn dwell(&mut self, index: usize, force: Vector3<f64>) -> Range<usize> {
        let prepared = self.prepared;
        let first = self.conditions.len();
        let dwell = &prepared.dwells.list[index];
        for at in dwell.blocks.clone() {
            let block = &prepared.condensed.blocks[at];
            let known = |from: usize| Vector3::from_fn(|i, _| block.reference[from + i].mean);
            let (rate, given) = match prepared.manifest.reference {
                Reference::Table => (known(0).map(f64::to_radians), known(3)),
                Reference::Gravity | Reference::TurntableRate => (Vector3::zeros(), force),
            };
            // The list of a rate table may lack the force. At a constant rate the accelerometer measures it.
            let given = if given.iter().all(|f| f.is_finite()) {
                given
            } else {
                force
            };
            let unknown = Vector3::repeat(f64::NAN);
            let table = prepared.manifest.reference == Reference::Table;
            let (rate, given) = match self.sensor {
                Sensor::Gyro if table && !self.other_measured => (rate, unknown),
                Sensor::Accel if table && !self.other_measured => (unknown, given),
                _ => (rate, given),
            };
            let t_s = 0.5 * (block.start_s + block.last_s);
            let duration_s = f64::from(block.rows) * prepared.condensed.period_s;
            let conditions = self.conditions(at, t_s, duration_s, rate, given);
            self.conditions.push(conditions);
            self.block.push(at);
        }
        first..self.conditions.len()
    }

    /// Adds a row: the mean over dwell `index` of the axes' errors, weighted by `by`.
    pub(super) fn mean_row(&mut self, index: usize, conditions: &Range<usize>, by: Vector3<f64>) {
        let total: f64 = self.conditions[conditions.clone()]
            .iter()
            .map(|m| m.duration_s)
            .sum();
        let weights = self.conditions[conditions.clone()]
            .iter()
            .map(|m| by * (m.duration_s / total))
            .collect();
        self.rows.push(Row {
            conditions: conditions.clone(),
            weights,
            dwells: [index, index],
            moving: self.prepared.dwells.list[index].moves.contains(&true),
        });
    }
    pub(super) fn finish(
        self,
        y: Vec<f64>,
        (nuisance, parameters, by_matrix): (DMatrix<f64>, DMatrix<f64>, DMatrix<f64>),
        biases: Vec<usize>,
        strata: Vec<Stratum>,
        figure: (RowFigure, usize, usize),
    ) -> Option<Part> {
        (!y.is_empty()).then(|| Part {
            reference: self.prepared.manifest.reference,
            y,
            nuisance,
            parameters,
            by_matrix,
            biases,
            strata,
            earth_unknown: self.prepared.manifest.latitude_deg.is_none()
                && self.prepared.manifest.reference != Reference::Table,
            figure: figure.0,
            judged: (figure.1, figure.2),
            rows: self.rows,
            conditions: self.conditions,
            block: self.block,
            temperature_offset: self.temperature_offset,
        })
    }

    /// Force in dwell `index` by the accelerometer; NaN if there is none.
    pub(super) fn force(&self, index: usize, accel: Option<&Affine<f64>>) -> Vector3<f64> {
        let raw = self.prepared.dwells.list[index].raw_mean(Sensor::Accel);
        accel.map_or(Vector3::repeat(f64::NAN), |a| a.apply(&raw))
    }

    pub(super) fn spans(&self, dwells: &[usize]) -> (Vec<Span>, Span) {
        let list = &self.prepared.dwells.list;
        let span = |d: usize| [list[d].start_s, list[d].start_s + list[d].duration_s];
        let spans: Vec<Span> = dwells.iter().map(|d| span(*d)).collect();
        let session = [span(0)[0], span(list.len() - 1)[1]];
        (spans, session)
    }

    pub(super) fn random_walk(&self, dwells: &[usize]) -> DMatrix<f64> {
        let (spans, session) = self.spans(dwells);
        let unit = Slow {
            instability: 0.0,
            walk: 1.0,
        };
        unit.covariance(&spans, session)
    }
}
