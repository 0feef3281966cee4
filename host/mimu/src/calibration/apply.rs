//! A recording compensated by a calibration, sample by sample.
//!
//! It uses the compensator of `core`, in double precision, so it writes what the device streams. Further triads of a body get C and o, and are rotated into
//! the frame of their reference. Their times stay; the crate `mimu-body` moves them by their delays.

use std::path::Path;

use mimu_core::compensation::{Affine, Compensation, Sample};
use mimu_core::compensator::{Compensator, State};
use mimu_core::stored::NODES;
use nalgebra::Vector3;
use serde::Serialize;

use crate::calibration::die_temperature::outside;
use crate::calibration::verify::check_unit;
use crate::calibration::{Calibration, compensator};
use crate::effects::quantity::Need;
use crate::judgement::Judgement;
use crate::quantity::{PerSensor, Sensor, present};
use crate::signal::blocks::{Condensed, Rails};
use crate::signal::rails::find;
use crate::warning::Warning;
use mimu_recording::error::{Error, Result};
use mimu_recording::{
    Batch, Column, Columns, Manifest, RawUnit, Recording, SampleFormat, Source, TriadName, Writer,
};

/// Room for effects of a triad, more than any calibration has.
const ROOM: usize = 32;
/// An interval of so many periods is a gap, as for blocks.
const GAP_PERIODS: f64 = 1.5;

/// Result of compensating a recording.
#[derive(Debug, Clone, Serialize)]
pub struct Applied {
    /// `mimu-apply/1`.
    pub format: &'static str,
    /// Directory of the compensated recording.
    pub recording: String,
    /// The judgement of the calibration; null if its file contains none.
    pub judgement: Option<Judgement>,
    /// Rows written: as many as the recording has.
    pub rows: u64,
    /// Sensors that were compensated.
    #[serde(serialize_with = "present")]
    pub sensors: PerSensor<Option<AppliedSensor>>,
    /// Further triads that were compensated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub body: Vec<AppliedTriad>,
    /// Gaps, which are kept as they are.
    pub gaps: u64,
    /// Time missing in them, s.
    pub missing_s: f64,
    /// Effects that were removed, by id.
    pub effects: Vec<String>,
    /// What a person should know.
    pub warnings: Vec<Warning>,
}

/// Samples of a sensor that are empty in the compensated recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct AppliedSensor {
    /// An axis has no reading.
    pub empty: u64,
    /// An axis is at its rail.
    pub clipped: u64,
}

/// A further triad of a body in the compensated recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AppliedTriad {
    /// Its name.
    pub triad: TriadName,
    /// Unit of its columns.
    pub unit: String,
    /// The triad in whose frame its columns are; null for its own frame, if its rotation is not known.
    pub frame: Option<TriadName>,
    /// By how much its readings were moved to be at the instants of its reference, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_ms: Option<f64>,
    /// Samples that are empty because an axis has no reading.
    pub empty: u64,
}

/// Writes `recording`, compensated by `calibration`, to `out`: rad/s and m/s², magnetometers in the unit of their calibration. Known inputs are kept.
///
/// ```no_run
/// use mimu::{Calibration, Recording, SampleFormat, apply};
///
/// let calibration = Calibration::read("cal.toml".as_ref())?;
/// let recording = Recording::open("flight".as_ref())?;
/// let done = apply(&recording, &calibration, "flight-si".as_ref(), SampleFormat::Parquet, false, |_| ())?;
/// println!("{} rows, {} gaps", done.rows, done.gaps);
/// # Ok::<(), mimu::Error>(())
/// ```
///
/// If one axis has no reading in a sample, or is at its rail, the input of no axis is known: the three cells are empty. A calibration for another raw
/// unit is refused, and so is one with effects for which the recording lacks a channel or a temperature.
pub fn apply(
    recording: &Recording,
    calibration: &Calibration,
    out: &Path,
    format: SampleFormat,
    replace: bool,
    progress: impl Fn(f64),
) -> Result<Applied> {
    let compensated = Compensated::new(recording, calibration, |share| progress(0.5 * share))?;
    let columns = compensated.columns;
    let to = (out, format, replace);
    compensated.write(to, columns, |_| (), |share| progress(0.5 + 0.5 * share))
}

/// A recording with its compensation, to be run through once.
pub struct Compensated<'a> {
    recording: &'a Recording,
    columns: Columns,
    judgement: Option<Judgement>,
    condensed: Condensed,
    batches: Batches,
    warnings: Vec<Warning>,
}

impl<'a> Compensated<'a> {
    /// Prepares `recording` for compensation by `calibration`; `progress` receives the finished share of a first pass, for rails and temperatures.
    ///
    /// # Errors
    /// Those of [`apply`], except for its output.
    pub fn new(
        recording: &'a Recording,
        calibration: &Calibration,
        progress: impl Fn(f64),
    ) -> Result<Self> {
        let place = recording.place.clone();
        let manifest = &recording.manifest;
        let mut warnings: Vec<Warning> = check_unit(calibration, manifest, &place)?
            .into_iter()
            .collect();
        let body = further(recording, calibration, &mut warnings)?;
        let columns = Columns {
            gyro: recording.columns.gyro && calibration.gyro.is_some(),
            accel: recording.columns.accel && calibration.accel.is_some(),
            more: body.iter().map(|(_, applied)| applied.triad).collect(),
            ..recording.columns
        };
        let has = PerSensor {
            gyro: columns.gyro,
            accel: columns.accel,
        };
        if has == PerSensor::both(false) {
            let problem = "the calibration is for none of its sensors";
            return Err(Error::new(
                place,
                problem,
                "use a calibration of the sensor that it has",
            ));
        }
        let recorded = PerSensor {
            gyro: recording.columns.gyro,
            accel: recording.columns.accel,
        };
        for (sensor, (recorded, has)) in recorded.zip(has) {
            if recorded && !has {
                warnings.push(Warning::NotCalibrated { sensor });
            }
        }
        // First pass: rails and the first temperature are only known at the end.
        let condensed = Condensed::read(recording, false, progress)?;
        warnings.extend(condensed.warnings.iter().cloned());
        warnings.extend(outside(calibration, &condensed.blocks));
        let mut batches = Batches::new(
            calibration,
            &condensed,
            manifest,
            has,
            &place,
            &mut warnings,
        )?;
        batches.body = body;
        Ok(Self {
            recording,
            columns,
            judgement: calibration.judgement.clone(),
            condensed,
            batches,
            warnings,
        })
    }

    /// The columns of the compensated samples.
    pub fn columns(&self) -> Columns {
        self.columns
    }

    /// Writes a recording with these `columns` in this format to a directory, which may be replaced or not; `change` has each batch of compensated samples before.
    ///
    /// # Errors
    /// Those of [`apply`].
    pub fn write(
        mut self,
        (out, format, replace): (&Path, SampleFormat, bool),
        columns: Columns,
        mut change: impl FnMut(&mut Batch),
        progress: impl Fn(f64),
    ) -> Result<Applied> {
        if let (Ok(from), Ok(to)) = (self.recording.directory.canonicalize(), out.canonicalize())
            && from.starts_with(&to)
        {
            let problem = "this is the recording to compensate; its raw readings would be lost";
            return Err(Error::new(out.display(), problem, "choose another name"));
        }
        let mut writer = Writer::create(out, columns, format, replace)?;
        self.for_each(progress, |_, clean| {
            change(clean);
            writer.write(clean)
        })?;
        let rows = writer.rows();
        let manifest = compensated_manifest(self.recording, &self.condensed.sha256);
        let written = writer.finish(&manifest)?;
        Ok(self.into_applied(&written, rows))
    }

    /// The result, after `rows` were written to `out`.
    pub fn into_applied(self, out: &Path, rows: u64) -> Applied {
        let (counts, has) = (self.batches.counts, self.batches.has);
        let body = self.batches.body.into_iter();
        Applied {
            format: "mimu-apply/1",
            recording: out.display().to_string(),
            judgement: self.judgement,
            rows,
            sensors: PerSensor::from_fn(|sensor| has[sensor].then_some(counts[sensor])),
            body: body.map(|(_, applied)| applied).collect(),
            gaps: self.condensed.gaps.0,
            missing_s: self.condensed.gaps.1,
            effects: self.batches.ids,
            warnings: self.warnings,
        }
    }

    /// The triads that it compensates, and the units of their columns.
    pub fn units(&self) -> impl Iterator<Item = (TriadName, &str)> {
        let first = [
            (TriadName::GYRO, Sensor::Gyro),
            (TriadName::ACCEL, Sensor::Accel),
        ];
        let first = first.into_iter().filter(|(_, s)| self.batches.has[*s]);
        let further = self.batches.body.iter();
        let further = further.map(|(_, of)| (of.triad, of.unit.as_str()));
        first.map(|(triad, s)| (triad, s.unit())).chain(further)
    }

    /// What a person should know.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Passes each batch of raw samples to `consume`, with the same samples compensated.
    ///
    /// # Errors
    /// The recording cannot be read; those of `consume`.
    pub fn for_each(
        &mut self,
        progress: impl Fn(f64),
        mut consume: impl FnMut(&Batch, &mut Batch) -> Result<()>,
    ) -> Result<()> {
        let batches = &mut self.batches;
        let each = |batch: &Batch| consume(batch, &mut batches.batch(batch));
        self.recording.for_each_batch(progress, each)?;
        Ok(())
    }
}

/// The models of the further triads, into the frame of their reference. A triad that the calibration lacks is left out, with a warning.
fn further(
    recording: &Recording,
    calibration: &Calibration,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<(Affine<f64>, AppliedTriad)>> {
    let mut all = Vec::new();
    for name in recording.columns.more.iter() {
        let Some(triad) = calibration.body.iter().find(|of| of.triad == name) else {
            warnings.push(Warning::TriadNotCalibrated { triad: name });
            continue;
        };
        let (ours, theirs) = (triad.raw_unit, recording.manifest.raw_unit);
        if ours != theirs {
            let problem = format!(
                "its readings of {name} are in {theirs}, and the calibration is for readings in {ours}"
            );
            let remedy = "use a calibration of such readings";
            return Err(Error::new(&recording.place, problem, remedy));
        }
        let applied = AppliedTriad {
            triad: name,
            unit: triad.unit.clone(),
            frame: triad.rotation_deg.map(|_| triad.reference),
            delay_ms: None,
            empty: 0,
        };
        all.push((triad.in_reference(), applied));
    }
    Ok(all)
}

/// Compensates a further triad in `out`, a copy of the raw samples.
fn compensate(model: &Affine<f64>, of: &mut AppliedTriad, out: &mut Batch) {
    let columns = [0, 1, 2].map(|axis| Column::of(of.triad, axis));
    for row in 0..out.len() {
        let cell = |axis: usize| out.values(columns[axis]).and_then(|v| v.get(row));
        let raw = Vector3::from_fn(|axis, _| cell(axis).copied().unwrap_or(f64::NAN));
        let whole = raw.iter().all(|u| u.is_finite());
        of.empty += u64::from(!whole);
        let input = match whole {
            true => model.apply(&raw),
            false => Vector3::repeat(f64::NAN),
        };
        for (axis, column) in columns.iter().enumerate() {
            if let Some(cell) = out.values_mut(*column).and_then(|v| v.get_mut(row)) {
                *cell = input[axis];
            }
        }
    }
}

/// The manifest of the compensated recording, without the rails, which are those of raw readings.
fn compensated_manifest(recording: &Recording, sha256: &str) -> Manifest {
    let mut out = recording.manifest.clone();
    out.raw_unit = RawUnit::Si;
    out.rails = None;
    out.unfinished = false;
    out.imported_with = Vec::new();
    let name = recording.samples.file_name().unwrap_or_default();
    out.sources = vec![Source {
        file: name.to_string_lossy().into_owned(),
        sha256: sha256.to_owned(),
    }];
    out
}

/// A segment of samples in which the calibration treats temperature and time as constant.
struct SlowSegment {
    first_row: u64,
    middle_s: f64,
    temp_c: Option<f64>,
}

/// Compensates batches of samples in their order.
struct Batches {
    compensator: Compensator<f64, NODES, ROOM>,
    state: State<f64, ROOM>,
    has: PerSensor<bool>,
    ids: Vec<String>,
    rails: [Rails; 6],
    period_s: f64,
    /// In order of time; the first `reached` have been applied.
    slow: Vec<SlowSegment>,
    reached: usize,
    /// Time to which the compensator has followed, s; at first that of power-on.
    followed_to_s: f64,
    last_s: f64,
    /// Last whole reading of each triad. The other triad's effects depend on it while this triad has none.
    held: Sample<f64>,
    counts: PerSensor<AppliedSensor>,
    /// Further triads with their models.
    body: Vec<(Affine<f64>, AppliedTriad)>,
}

impl Batches {
    fn new(
        calibration: &Calibration,
        condensed: &Condensed,
        manifest: &Manifest,
        has: PerSensor<bool>,
        place: &str,
        warnings: &mut Vec<Warning>,
    ) -> Result<Self> {
        let blocks = &condensed.blocks;
        let first_temp_c = blocks.iter().map(|b| b.temp_c.mean).find(|t| t.is_finite());
        for effect in calibration.effects() {
            let needs = |need| effect.candidate.needs(need);
            let lacks = match has[effect.candidate.sensor] {
                false => continue,
                _ if needs(Need::Rate) && !has.gyro => "a calibrated gyro",
                _ if needs(Need::Force) && !has.accel => "a calibrated accelerometer",
                _ if needs(Need::Temperature) && first_temp_c.is_none() => "temp_c",
                _ => continue,
            };
            let problem = format!(
                "{} cannot be removed without {lacks}",
                effect.candidate.id()
            );
            let remedy = "record what is missing, or use a calibration without this effect";
            return Err(Error::new(place, problem, remedy));
        }
        // Before the first temperature that one is used, as in a fit.
        let mut temp_c = first_temp_c.unwrap_or(f64::NAN);
        let slow = blocks.iter().map(|block| {
            if block.temp_c.mean.is_finite() {
                temp_c = block.temp_c.mean;
            }
            SlowSegment {
                first_row: block.first_row,
                middle_s: 0.5 * (block.start_s + block.last_s),
                temp_c: Some(temp_c).filter(|c| c.is_finite()),
            }
        });
        let slow = slow.collect();
        let curves = calibration.curves();
        if curves.is_some() && first_temp_c.is_none() {
            warnings.push(Warning::NoTemperature);
        }
        let curves = curves.filter(|_| first_temp_c.is_some());
        let first_s = blocks.first().map_or(0.0, |block| block.start_s);
        let models =
            Compensation::from_fn(|s| calibration.inverse(s).unwrap_or_else(Affine::identity));
        let effects = calibration.effects_of_models(&models)?;
        let compensator = compensator(calibration, models, curves, effects);
        let first = |channel: usize| {
            let means = blocks.iter().map(|block| block.raw[channel]);
            means
                .filter(|m| m.n > 0)
                .map(|m| m.mean)
                .next()
                .unwrap_or(0.0)
        };
        Ok(Self {
            state: compensator.state(1.0 / condensed.period_s),
            compensator,
            has,
            ids: calibration
                .effects()
                .iter()
                .filter(|e| has[e.candidate.sensor])
                .map(|e| e.candidate.id())
                .collect(),
            rails: find(condensed, manifest, warnings),
            period_s: condensed.period_s,
            slow,
            reached: 0,
            followed_to_s: manifest.power_on_s.unwrap_or(first_s),
            last_s: first_s,
            held: Sample::from_fn(|s| Vector3::from_fn(|i, _| first(s.channels().start + i))),
            counts: Default::default(),
            body: Vec::new(),
        })
    }

    fn batch(&mut self, batch: &Batch) -> Batch {
        let mut out = batch.clone();
        for sensor in Sensor::BOTH {
            if !self.has[sensor] {
                sensor.channels().for_each(|c| out.raw[c].clear());
            }
        }
        let kept = |triad| self.body.iter().any(|(_, of)| of.triad == triad);
        out.more.retain(|(triad, _)| kept(*triad));
        for (model, of) in &mut self.body {
            compensate(model, of, &mut out);
        }
        for row in 0..batch.len() {
            let t_s = batch.t_s[row];
            self.follow(batch.first_row + row as u64);
            if t_s - self.last_s > GAP_PERIODS * self.period_s {
                self.state.gap();
            }
            self.last_s = t_s;
            let whole = PerSensor::from_fn(|sensor| self.take(sensor, batch, row));
            let clean = self.compensator.apply(&mut self.state, &self.held);
            if whole != PerSensor::both(true) {
                // A held reading must not enter a difference.
                self.state.gap();
            }
            for (sensor, input) in clean {
                for (axis, c) in sensor.channels().enumerate() {
                    if let Some(cell) = out.raw[c].get_mut(row) {
                        let known = whole[sensor];
                        *cell = if known { input[axis] } else { f64::NAN };
                    }
                }
            }
        }
        out
    }

    /// Follows time and temperature to the block that `row` is in.
    fn follow(&mut self, row: u64) {
        while let Some(slow) = self.slow.get(self.reached).filter(|s| s.first_row <= row) {
            let dt_s = slow.middle_s - self.followed_to_s;
            self.compensator.follow(&mut self.state, dt_s, slow.temp_c);
            self.followed_to_s = slow.middle_s;
            self.reached += 1;
        }
    }

    /// Takes in the reading of a triad; returns whether all of it is there.
    fn take(&mut self, sensor: Sensor, batch: &Batch, row: usize) -> bool {
        if !self.has[sensor] {
            return true;
        }
        let from = sensor.channels().start;
        let raw = Vector3::from_fn(|i, _| batch.raw[from + i][row]);
        let clipped = |i: usize| {
            let Rails { low, high } = self.rails[from + i];
            low.is_some_and(|rail| raw[i] <= rail) || high.is_some_and(|rail| raw[i] >= rail)
        };
        let clipped = (0..3).any(clipped);
        let counts = &mut self.counts[sensor];
        if raw.iter().any(|u| !u.is_finite()) {
            counts.empty += 1;
            return false;
        }
        if clipped {
            counts.clipped += 1;
            return false;
        }
        self.held[sensor] = raw;
        true
    }
}
