//! One calibration from several recordings of a unit, each by its trajectory.
//!
//! What an instrument errs by in all of a recording is alike in all of its pieces, so that no recording shows it. It differs between recordings, and is in the intervals as their
//! scatter ([`Body::combined`]). Each recording is judged by the calibration of the others.

use std::collections::BTreeMap;

use mimu::calibration::verify::nominal;
use mimu::in_use::Trajectory;
use mimu::one_unit::{RAW_UNIT, refuse_unlike};
use mimu::quantity::{PerSensor, Sensor};
use mimu_core::compensation::Affine;
use mimu_recording::error::{Error, Result};
use mimu_recording::statistics::root_mean_square;
use mimu_recording::{RawUnit, Recording};
use serde::Serialize;

use super::{Beside, ByTrajectory, TrajectoryResult};
use crate::carrier::first;
use crate::result::{BodyResult, Refused, TriadResult};
use crate::{Body, FittedTriad, TriadVerification, judge};

/// Several recordings of one unit, each by its trajectory.
#[derive(Debug, Clone)]
pub struct ByTrajectories {
    /// Each alone, in the order in which they were given.
    pub each: Vec<ByTrajectory>,
    /// The calibration of all. Rotation, delay and arm differ from recording to recording: those of [`Self::each`] count.
    pub body: Body,
    /// Errors of each recording by the calibration of the others.
    pub held_out: Vec<PerSensor<Option<HeldOut>>>,
}

/// Errors of a recording that a calibration was not made from.
#[derive(Debug, Clone)]
pub struct HeldOut {
    /// By the calibration of the other recordings.
    pub by_others: TriadVerification,
    /// The same without a calibration: of readings in SI as they are, or else with one scale factor and no angles, SI.
    pub rms_without: f64,
    signal: f64,
}

/// What several recordings give, as JSON.
#[derive(Debug, Clone, Serialize)]
pub struct TrajectoriesResult {
    /// Gyro and accelerometer: `rms` is that of each recording by its own fit, `held_out_rms` by the calibration of the others.
    pub sensors: BTreeMap<String, TriadResult>,
    /// Those that no recording determines.
    pub refused: Vec<Refused>,
    /// Each recording.
    pub recordings: Vec<RecordingResult>,
}

/// One of several recordings.
#[derive(Debug, Clone, Serialize)]
pub struct RecordingResult {
    /// Its place.
    pub recording: String,
    /// The instrument.
    pub trajectory: TrajectoryResult,
    /// Its own fit.
    #[serde(flatten)]
    pub own: BodyResult,
    /// Errors of each triad by the calibration of the other recordings.
    pub held_out: BTreeMap<String, HeldOutResult>,
}

/// Errors of a recording by the calibration of the others, SI.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct HeldOutResult {
    /// Rms error.
    pub rms: f64,
    /// The same of readings in SI as they are, or else with one scale factor and no angles.
    pub rms_uncalibrated: f64,
    /// The same by white noise.
    pub noise_floor: f64,
}

impl TrajectoriesResult {
    /// Of a fit of these recordings.
    pub fn of(of: &ByTrajectories, all: &[(Recording, Trajectory)]) -> Self {
        let raw = all[0].0.manifest.raw_unit;
        let BodyResult {
            sensors, refused, ..
        } = BodyResult::of(&of.body, raw);
        let each = of.each.iter().zip(&of.held_out).zip(all);
        let recordings = each.map(|((own, held_out), (recording, by))| RecordingResult {
            recording: recording.place.clone(),
            trajectory: TrajectoryResult::of(own, by.place.clone()),
            own: BodyResult::of(&own.body, raw),
            held_out: held_out
                .present()
                .map(|(sensor, of)| (sensor.to_string(), of.result()))
                .collect(),
        });
        Self {
            sensors,
            refused,
            recordings: recordings.collect(),
        }
    }
}

impl HeldOut {
    fn result(&self) -> HeldOutResult {
        HeldOutResult {
            rms: self.by_others.rms,
            rms_uncalibrated: self.rms_without,
            noise_floor: self.by_others.noise_floor,
        }
    }
}

impl ByTrajectories {
    /// The calibration of recordings, each with its trajectory.
    ///
    /// # Errors
    /// Those of [`ByTrajectory::of`]; recordings of two units, or one twice; an accelerometer that some recordings do not determine.
    pub fn of(all: &[(Recording, Trajectory)]) -> Result<Self> {
        let named = all.iter().map(|(of, _)| (of.place.as_str(), &of.manifest));
        refuse_unlike(&named.collect::<Vec<_>>(), &[RAW_UNIT])?;
        let read = all
            .iter()
            .map(|(recording, by)| Beside::read(recording, by));
        let read: Vec<Beside> = read.collect::<Result<_>>()?;
        refuse_twice(&read)?;
        let each: Vec<ByTrajectory> = read.iter().map(Beside::fitted).collect::<Result<_>>()?;
        refuse_two_frames(&read, &each)?;
        let bodies: Vec<Body> = each.iter().map(|of| of.body.clone()).collect();
        let held_out = read.iter().enumerate().map(|(k, beside)| {
            let others = [&bodies[..k], &bodies[k + 1..]].concat();
            beside.held_out(&Body::combined(&others), each[k].up)
        });
        let held_out: Vec<_> = held_out.collect();
        let mut body = Body::combined(&bodies);
        for triad in &mut body.triads {
            judge_across(triad, &held_out, all[0].0.manifest.raw_unit);
        }
        Ok(Self {
            each,
            body,
            held_out,
        })
    }
}

impl Beside<'_> {
    /// Errors by the calibration of other recordings.
    fn held_out(&self, others: &Body, up: Option<&str>) -> PerSensor<Option<HeldOut>> {
        let triad = |sensor| others.triads.iter().find(|of| of.name == first(sensor));
        let models = PerSensor::from_fn(|sensor| Some(triad(sensor)?.triad.inverse));
        let mut by_others = self.judged(&models, up);
        let without = models.map(|own| match self.recording.manifest.raw_unit {
            RawUnit::Si => own.map(|_| Affine::identity()),
            _ => nominal(&own?),
        });
        let without = self.judged(&without, up);
        PerSensor::from_fn(|sensor| {
            let (by_others, signal) = by_others[sensor].take()?;
            Some(HeldOut {
                by_others,
                rms_without: without[sensor].as_ref()?.0.rms,
                signal,
            })
        })
    }
}

/// Judges a triad of all recordings by what each errs by with the calibration of the others.
fn judge_across(triad: &mut FittedTriad, held_out: &[PerSensor<Option<HeldOut>>], raw: RawUnit) {
    let sensor = Sensor::BOTH.into_iter().find(|of| first(*of) == triad.name);
    let found = held_out.iter().filter_map(|of| of[sensor?].as_ref());
    let found: Vec<&HeldOut> = found.collect();
    let rms = |of: fn(&HeldOut) -> f64| root_mean_square(found.iter().map(|held| of(held)));
    triad.held_out_rms = rms(|held| held.by_others.rms);
    triad.noise_floor = rms(|held| held.by_others.noise_floor);
    let signal = rms(|held| held.signal);
    let without = (rms(|held| held.rms_without), raw == RawUnit::Si);
    let errors = [triad.held_out_rms, triad.noise_floor];
    triad.judgement = judge::across(errors, signal, without, triad.unit);
}

/// Refuses a recording that is given twice: its errors would count as independent.
fn refuse_twice(all: &[Beside]) -> Result<()> {
    for (k, own) in all.iter().enumerate() {
        if let Some(first) = all[..k].iter().find(|of| of.gyro.x == own.gyro.x) {
            return Err(Error::new(
                &own.recording.place,
                format!("it has the samples of {}", first.recording.place),
                "give each recording once, with its own trajectory",
            ));
        }
    }
    Ok(())
}

/// Refuses recordings of which some do not determine the accelerometer: it gives the gyro its frame, and angles in two frames have no mean.
fn refuse_two_frames(all: &[Beside], each: &[ByTrajectory]) -> Result<()> {
    let accel = first(Sensor::Accel);
    let has = |of: &&ByTrajectory| of.body.triads.iter().any(|triad| triad.name == accel);
    let with = each.iter().position(|of| has(&of));
    let without = each.iter().position(|of| !has(&of));
    let Some((with, without)) = with.zip(without) else {
        return Ok(());
    };
    let mut refused = each[without].body.refused.iter();
    let why = refused.find(|(name, _)| *name == accel);
    let why = why.map_or("it has none".to_owned(), |(_, why)| why.reason.clone());
    let place = |k: usize| &all[k].recording.place;
    Err(Error::new(
        place(without),
        format!(
            "its accelerometer is not calibrated, as that of {} is: {why}",
            place(with)
        ),
        "leave this recording out",
    ))
}
