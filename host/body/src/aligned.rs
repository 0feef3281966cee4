//! Compensated triads at the instants of their reference, and the mean unit of an array.
//!
//! A row holds what a late triad measured before the row's instant. Its readings at the instant are those a delay later in the file, by the cubic through four samples.
//! A mean accelerometer is that in the place of the first: `a - ω'×r - ω×(ω×r)` of each other one, with the mean rate ω and the arm r to it.

use std::path::Path;

use mimu::calibration::Calibration;
use mimu::calibration::apply::{Applied, Compensated};
use mimu::calibration::body::BodyTriad;
use mimu::quantity::{PerSensor, Sensor, present};
use mimu_recording::error::{Error, Result};
use mimu_recording::{Batch, Column, Columns, Recording, SampleFormat, TriadKind, TriadName};
use nalgebra::Vector3;
use serde::Serialize;

use crate::carrier::read;
use crate::iron::Warmth;
use crate::series::Series;
use crate::standing::Standing;

/// The further triads of a calibration, to be put in the place of their compensated readings in batches of samples.
pub struct Aligned {
    triads: Vec<Further>,
    mean: Option<Mean>,
}

/// A further triad.
struct Further {
    name: TriadName,
    standing: Standing,
    /// Its readings in the frame of the reference.
    series: Series,
    /// Samples that have no reading so much later.
    lost: u64,
    /// Whether it belongs in the mean.
    is_placed: bool,
}

/// The mean unit of an array.
#[derive(Debug, Clone, Serialize)]
pub struct MeanUnit {
    /// The gyros and accelerometers whose mean it is.
    pub triads: Vec<TriadName>,
    /// Those that are left out, because their place on the body is not known.
    pub left_out: Vec<TriadName>,
    /// White noise of a reading, root mean square over the axes, SI: of the first, and of the mean.
    #[serde(serialize_with = "present")]
    pub noise: PerSensor<Option<[f64; 2]>>,
}

/// Sums up the mean unit.
struct Mean {
    unit: MeanUnit,
    /// The first gyro, which the calibration takes to rad/s.
    rate: Option<Series>,
    /// The time, and the readings of the first and of the mean, by kind.
    t: Vec<f64>,
    readings: PerSensor<[Vec<Vector3<f64>>; 2]>,
}

/// Writes `recording`, compensated by `calibration`, to `out`, its further triads at the instants of their reference; with `mean`, the mean unit in the place of the first.
///
/// # Errors
/// Those of [`mimu::apply`]; a mean of one unit.
pub fn apply(
    recording: &Recording,
    calibration: &Calibration,
    out: (&Path, SampleFormat, bool),
    mean: bool,
    progress: impl Fn(f64),
) -> Result<(Applied, Option<MeanUnit>)> {
    let mut aligned = Aligned::of(recording, calibration, mean)?;
    let compensated = Compensated::new(recording, calibration, |share| progress(0.5 * share))?;
    let columns = aligned.columns(compensated.columns());
    let each = |batch: &mut Batch| {
        aligned.place(batch);
        batch
            .more
            .retain(|(triad, _)| columns.more.contains(*triad));
    };
    let applied = compensated.write(out, columns, each, |share| progress(0.5 + 0.5 * share))?;
    Ok(aligned.finish(applied))
}

impl Aligned {
    /// Of the triads that both have; with `mean`, of their mean too.
    ///
    /// # Errors
    /// The samples cannot be read; a mean needs a second gyro or accelerometer.
    pub fn of(recording: &Recording, calibration: &Calibration, mean: bool) -> Result<Self> {
        let there = recording.triads();
        let warmth = Warmth::read(recording)?;
        let own = calibration.body.iter();
        let own = own.filter(|of| there.contains(&of.triad));
        let further = |of: &BodyTriad| {
            let standing = Standing::from(of);
            let raw = read(recording, of.triad)?;
            let raw = match of.triad.kind {
                TriadKind::Mag => raw.without_repeats(),
                _ => raw,
            };
            Ok(Further {
                name: of.triad,
                series: standing.compensated(raw, warmth.as_ref()),
                standing,
                lost: 0,
                is_placed: of.rotation_deg.is_some()
                    && (of.triad.kind == TriadKind::Gyro || of.lever_arm_mm.is_some()),
            })
        };
        let triads: Vec<Further> = own.map(further).collect::<Result<_>>()?;
        let mean = match mean {
            true => Some(Mean::of(recording, calibration, &triads)?),
            false => None,
        };
        Ok(Self { triads, mean })
    }

    /// Which of `all` columns remain: the mean unit replaces those that it is made of.
    pub fn columns(&self, all: Columns) -> Columns {
        let mut columns = all;
        if self.mean.is_some() {
            let kept = all.more.iter().filter(|triad| triad.kind == TriadKind::Mag);
            columns.more = kept.collect();
        }
        columns
    }

    /// Replaces the compensated readings of a batch.
    pub fn place(&mut self, batch: &mut Batch) {
        for of in self
            .triads
            .iter_mut()
            .filter(|of| of.standing.delay_s != 0.0 || of.standing.iron.is_some())
        {
            of.shift(batch);
        }
        if let Some(mean) = &mut self.mean {
            mean.place(&self.triads, batch);
        }
    }

    /// The result, with the samples that were lost, and the mean unit.
    pub fn finish(self, mut applied: Applied) -> (Applied, Option<MeanUnit>) {
        for of in &self.triads {
            let own = applied.body.iter_mut().find(|own| own.triad == of.name);
            if let Some(own) = own.filter(|_| of.standing.delay_s != 0.0) {
                own.empty += of.lost;
                own.delay_ms = Some(1e3 * of.standing.delay_s);
            }
        }
        (applied, self.mean.map(Mean::finish))
    }
}

impl Further {
    /// Its reading at an instant of the reference.
    fn at(&self, t: f64) -> Option<Vector3<f64>> {
        self.series.at(t + self.standing.delay_s)
    }

    /// Writes its readings at the instants of a batch. Cells that are empty stay so.
    fn shift(&mut self, batch: &mut Batch) {
        for row in 0..batch.len() {
            if reading(batch, self.name, row).is_none() {
                continue;
            }
            let now = self.at(batch.t_s[row]);
            self.lost += u64::from(now.is_none());
            write(batch, self.name, row, now);
        }
    }
}

impl Mean {
    fn of(recording: &Recording, calibration: &Calibration, triads: &[Further]) -> Result<Self> {
        let own = triads.iter().filter(|of| of.name.kind != TriadKind::Mag);
        let (used, out): (Vec<&Further>, _) = own.partition(|of| of.is_placed);
        if used.is_empty() {
            let problem = "it has no second gyro or accelerometer whose place on the body the calibration knows, and a mean is asked for";
            let remedy = "leave --mean out, or calibrate a recording of all its triads";
            return Err(Error::new(&recording.place, problem, remedy));
        }
        let gyro = calibration.inverse(Sensor::Gyro);
        let rate = gyro.map(|model| Ok(read(recording, TriadName::GYRO)?.map(|u| model.apply(u))));
        let names = |of: Vec<&Further>| of.iter().map(|of| of.name).collect();
        Ok(Self {
            unit: MeanUnit {
                triads: names(used),
                left_out: names(out),
                noise: PerSensor::default(),
            },
            rate: rate.transpose()?,
            t: Vec::new(),
            readings: PerSensor::default(),
        })
    }

    /// Mean rate of all gyros at an instant.
    fn rate(&self, triads: &[Further], t: f64) -> Option<Vector3<f64>> {
        let first = self.rate.as_ref()?.at(t);
        let gyros = triads.iter();
        let gyros = gyros.filter(|of| of.is_placed && of.name.kind == TriadKind::Gyro);
        mean(gyros.filter_map(|of| of.at(t)).chain(first))
    }

    /// The matrix that takes an arm to the acceleration at its end against that of the first, by the mean rate now and a period before and after.
    fn by_arm(&self, triads: &[Further], t: f64) -> Option<nalgebra::Matrix3<f64>> {
        let period = self.rate.as_ref()?.period;
        let [before, now, after] = [-period, 0.0, period].map(|by| self.rate(triads, t + by));
        let now = now?.cross_matrix();
        Some(((after? - before?) / (2.0 * period)).cross_matrix() + now * now)
    }

    fn place(&mut self, triads: &[Further], batch: &mut Batch) {
        for row in 0..batch.len() {
            let t = batch.t_s[row];
            let by_arm = self.by_arm(triads, t);
            self.t.push(t);
            for (sensor, kind) in [
                (Sensor::Gyro, TriadKind::Gyro),
                (Sensor::Accel, TriadKind::Accel),
            ] {
                let first = reading(batch, TriadName::first(kind), row);
                let others = triads
                    .iter()
                    .filter(|of| of.is_placed && of.name.kind == kind);
                let others = others.filter_map(|of| {
                    let x = reading(batch, of.name, row)?;
                    match kind {
                        TriadKind::Accel => Some(x - by_arm? * of.standing.arm_m),
                        _ => Some(x),
                    }
                });
                let all = mean(others.chain(first));
                write(batch, TriadName::first(kind), row, all);
                let none = Vector3::repeat(f64::NAN);
                let both = self.readings[sensor].iter_mut().zip([first, all]);
                both.for_each(|(list, x)| list.push(x.unwrap_or(none)));
            }
        }
    }

    fn finish(self) -> MeanUnit {
        let noise = |readings: &[Vec<Vector3<f64>>; 2]| {
            let noise = readings.each_ref().map(|x| {
                let axes = [0, 1, 2].map(|axis| x.iter().map(|x| x[axis]).collect::<Vec<f64>>());
                let axes = axes.each_ref().map(Vec::as_slice);
                Series::new(&self.t, axes).noise().sqrt()
            });
            noise[1].is_finite().then_some(noise)
        };
        MeanUnit {
            noise: self.readings.as_ref().map(noise),
            ..self.unit
        }
    }
}

/// Mean of these; `None` without any.
fn mean(all: impl Iterator<Item = Vector3<f64>>) -> Option<Vector3<f64>> {
    let (sum, count) = all.fold((Vector3::zeros(), 0.0), |(sum, n), x| (sum + x, n + 1.0));
    (count > 0.0).then(|| sum / count)
}

/// The reading of a triad in a row; `None` if a cell is empty.
fn reading(batch: &Batch, of: TriadName, row: usize) -> Option<Vector3<f64>> {
    let cell = |axis| batch.values(Column::of(of, axis))?.get(row).copied();
    let x = Vector3::new(cell(0)?, cell(1)?, cell(2)?);
    x.iter().all(|x| x.is_finite()).then_some(x)
}

fn write(batch: &mut Batch, of: TriadName, row: usize, x: Option<Vector3<f64>>) {
    let x = x.unwrap_or(Vector3::repeat(f64::NAN));
    for axis in 0..3 {
        let column = batch.values_mut(Column::of(of, axis));
        if let Some(cell) = column.and_then(|column| column.get_mut(row)) {
            *cell = x[axis];
        }
    }
}
