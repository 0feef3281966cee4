//! The rows of one recording.

use std::collections::BTreeMap;
use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, Matrix3, Vector3};

use super::{FreeParameters, Row, Session, Stratum};
use crate::effects::quantity::Conditions;
use crate::effects::temperature::offsets;
use crate::noise::wander::{Slow, Span};
use crate::observation::turn::Turn;
use crate::observation::{ByTriad, about};
use crate::quantity::Sensor;
use crate::triad::directions;
use mimu_recording::Reference;

/// A row with its residual and derivatives.
pub(super) struct Line {
    pub y: f64,
    /// By C, by rows, and o of the inverse model `x = C (u - centre) + o`: a bias absorbs the constant part of an error of C.
    pub by: ByTriad,
    /// By what belongs to the recording alone, as its biases do.
    pub own: Vec<f64>,
    pub row: Row,
}

/// The rows of one recording, not yet joined with those of others.
pub(super) struct Part<'a> {
    pub session: Session<'a>,
    pub sensor: Sensor,
    /// Calibration of the sensor.
    pub model: Affine<f64>,
    /// Sensitive directions by rows, and scale factors, raw/SI.
    pub direction: Matrix3<f64>,
    pub scale: Vector3<f64>,
    /// Matrix from errors along the sensitive axes to errors in the body frame.
    pub to_body: Matrix3<f64>,
    /// The reading about which the derivatives are.
    pub centre: Vector3<f64>,
    /// The elements of C that the rows determine. Recordings with the same reference share them.
    pub free: &'static [usize],
    pub lines: Vec<Line>,
    pub strata: Vec<Stratum>,
    pub conditions: Vec<Conditions>,
    /// What the sensor reads under them, raw.
    pub readings: Vec<Vector3<f64>>,
    pub block: Vec<usize>,
    pub temperature_offset: Vec<(f64, f64)>,
    /// The conditions of each dwell, and of each turn.
    dwells: BTreeMap<usize, Range<usize>>,
    pub turns: Vec<Range<usize>>,
    t0_s: f64,
    middle_s: f64,
}

/// The rows of `sensor` in a recording; `None` if it has none, or if the calibration is singular.
pub(super) fn part<'a>(
    session: &Session<'a>,
    sensor: Sensor,
    free: FreeParameters,
) -> Option<Part<'a>> {
    let mut part = Part::of(session, sensor)?;
    match (part.reference(), sensor) {
        (Reference::Table, _) => part.add_known()?,
        (Reference::Gravity | Reference::TurntableRate, Sensor::Accel) => part.add_magnitudes(),
        // A diagnosis of a recording from a turntable is refused before.
        (Reference::TurntableRate, Sensor::Gyro) => return None,
        (Reference::Gravity, Sensor::Gyro) => part.add_turns(),
    }
    if let FreeParameters::Bias(_) = free {
        part.free = &[];
    }
    (!part.lines.is_empty()).then_some(part)
}

impl<'a> Part<'a> {
    /// Without rows yet. `None` if the recording lacks the sensor, or its calibration is singular.
    pub(super) fn of(session: &Session<'a>, sensor: Sensor) -> Option<Self> {
        let prepared = session.prepared;
        let model = session.model(sensor).filter(|_| prepared.has(sensor))?;
        let (direction, scale, _) = directions(&model)?;
        let blocks = &prepared.condensed.blocks;
        Some(Self {
            session: *session,
            sensor,
            model,
            to_body: direction.try_inverse()?,
            direction,
            scale,
            centre: Vector3::zeros(),
            free: &[],
            lines: Vec::new(),
            strata: Vec::new(),
            conditions: Vec::new(),
            readings: Vec::new(),
            block: Vec::new(),
            temperature_offset: offsets(blocks),
            dwells: BTreeMap::new(),
            turns: Vec::new(),
            t0_s: blocks.first()?.start_s,
            middle_s: prepared.middle_s(),
        })
    }

    pub(super) fn reference(&self) -> Reference {
        self.session.prepared.manifest.reference
    }

    /// Number of rows, from the first on, that error figures include: those of the first strata, as far as they are about the same quantity.
    pub(super) fn judged(&self) -> usize {
        let figure = |s: &Stratum| s.name.0.figure();
        let first = self.strata.first().map(figure);
        let alike = self.strata.iter();
        let alike = alike.take_while(|s| Some(figure(s)) == first);
        alike.last().map_or(0, |s| s.rows.end)
    }

    fn add_conditions(
        &mut self,
        at: usize,
        (t_s, duration_s): (f64, f64),
        rate: Vector3<f64>,
        force: Vector3<f64>,
    ) {
        let input = self.sensor.pick(rate, force);
        let prepared = self.session.prepared;
        self.block.push(at);
        self.conditions.push(Conditions {
            session: 0,
            t_s: t_s - self.t0_s,
            on_s: t_s - prepared.power_on_s(),
            from_middle_s: t_s - self.middle_s,
            duration_s,
            rate,
            force,
            angular_acceleration: Vector3::zeros(),
            sensed: self.direction * input,
            temperature_offset: self.temperature_offset[at].1,
            lagged_temperature: self.temperature_offset[at].1,
        });
        let raw = &prepared.condensed.blocks[at].raw[self.sensor.channels()];
        self.readings.push(Vector3::from_fn(|i, _| raw[i].mean));
    }

    /// The conditions of a dwell, block by block: the input that the table gives, or rest under the force that the accelerometer measures.
    pub(super) fn dwell(&mut self, index: usize) -> Range<usize> {
        if let Some(known) = self.dwells.get(&index) {
            return known.clone();
        }
        let prepared = self.session.prepared;
        let table = self.reference() == Reference::Table;
        let force = self.force(index);
        // A table may know the input of the other sensor. But without that sensor no device could remove an effect that depends on it.
        let lacks_other = table
            && self
                .sensor
                .pick(self.session.accel.is_none(), self.session.gyro.is_none());
        let first = self.conditions.len();
        for at in prepared.dwells.list[index].blocks.clone() {
            let block = &prepared.condensed.blocks[at];
            let known = |from: usize| Vector3::from_fn(|i, _| block.reference[from + i].mean);
            let (mut rate, mut given) = match table {
                true => (known(0).map(f64::to_radians), known(3)),
                false => (Vector3::zeros(), force),
            };
            // The list of a rate table may lack the force. At a constant rate the accelerometer measures it.
            if !given.iter().all(|f| f.is_finite()) {
                given = force;
            }
            match self.sensor {
                Sensor::Gyro if lacks_other => given.fill(f64::NAN),
                Sensor::Accel if lacks_other => rate.fill(f64::NAN),
                _ => {}
            }
            let t_s = 0.5 * (block.start_s + block.last_s);
            let duration_s = f64::from(block.rows) * prepared.condensed.period_s;
            self.add_conditions(at, (t_s, duration_s), rate, given);
        }
        let range = first..self.conditions.len();
        self.dwells.insert(index, range.clone());
        range
    }

    /// The conditions of a turn, increment by increment.
    pub(super) fn turn(&mut self, turn: &Turn) -> Range<usize> {
        let blocks = &self.session.prepared.condensed.blocks;
        let first = self.conditions.len();
        for (k, piece) in turn.increments.iter().enumerate() {
            let t_s = piece.end_s - 0.5 * piece.duration_s;
            let at = blocks
                .partition_point(|b| b.last_s < t_s)
                .min(blocks.len() - 1);
            let raw = Vector3::from(piece.integral) / piece.duration_s;
            let rate = self.model.apply(&raw);
            let force = self.measured_force(&Vector3::from_fn(|i, _| blocks[at].raw[3 + i].mean));
            self.add_conditions(at, (t_s, piece.duration_s), rate, force);
            let last = self.conditions.len() - 1;
            self.readings[last] = raw;
            if k > 0 {
                let before = self.conditions[last - 1];
                let now = &mut self.conditions[last];
                now.angular_acceleration = (rate - before.rate) / (now.t_s - before.t_s);
            }
        }
        first..self.conditions.len()
    }

    /// Mean over dwell `index` of the axes' errors, weighted by `by`.
    pub(super) fn mean_over(&mut self, index: usize, by: Vector3<f64>) -> Row {
        let conditions = self.dwell(index);
        let of_row = &self.conditions[conditions.clone()];
        let total: f64 = of_row.iter().map(|m| m.duration_s).sum();
        Row {
            weights: of_row.iter().map(|m| by * (m.duration_s / total)).collect(),
            conditions,
            dwells: [index, index],
            moving: self.session.prepared.dwells.list[index]
                .moves
                .contains(&true),
        }
    }

    /// Sum over the increments of neighbouring `turns` of errors in the body frame, weighted by `by` and their lengths.
    pub(super) fn sum_over(
        &self,
        turns: Range<usize>,
        by: &[Vector3<f64>],
        dwells: [usize; 2],
    ) -> Row {
        // Neighbouring turns have neighbouring conditions.
        let own = &self.turns[turns];
        let conditions = own[0].start..own[own.len() - 1].end;
        let each = by.iter().zip(&self.conditions[conditions.clone()]);
        let weights = each.map(|(by, at)| self.to_body.tr_mul(by) * at.duration_s);
        Row {
            weights: weights.collect(),
            conditions,
            dwells,
            moving: false,
        }
    }

    /// Adds a row with the derivatives `by` about zero.
    pub(super) fn add(&mut self, y: f64, by: &ByTriad, own: Vec<f64>, row: Row) {
        self.lines.push(Line {
            y,
            by: about(by, &self.centre),
            own,
            row,
        });
    }

    /// Force at a mean reading of the accelerometer; NaN if there is none.
    fn measured_force(&self, raw: &Vector3<f64>) -> Vector3<f64> {
        let accel = self.session.accel;
        accel.map_or(Vector3::repeat(f64::NAN), |a| a.apply(raw))
    }

    /// Force in dwell `index` by the accelerometer.
    pub(super) fn force(&self, index: usize) -> Vector3<f64> {
        self.measured_force(&self.session.prepared.dwells.list[index].raw_mean(Sensor::Accel))
    }

    /// Covariance of a walk of 1 unit/√s between the means of `dwells`.
    pub(super) fn random_walk(&self, dwells: &[usize]) -> DMatrix<f64> {
        let list = &self.session.prepared.dwells.list;
        let span = |d: usize| [list[d].start_s, list[d].start_s + list[d].duration_s];
        let spans: Vec<Span> = dwells.iter().map(|d| span(*d)).collect();
        let unit = Slow {
            instability: 0.0,
            walk: 1.0,
        };
        unit.covariance(&spans, [span(0)[0], span(list.len() - 1)[1]])
    }
}

/// Mean of the readings.
pub(super) fn mean<'a>(readings: impl ExactSizeIterator<Item = &'a Vector3<f64>>) -> Vector3<f64> {
    let count = readings.len().max(1) as f64;
    readings.sum::<Vector3<f64>>() / count
}
