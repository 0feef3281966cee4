//! Finds out why a calibrated unit still errs. The effect behind the residual is found, added to the model, and proved on data that was
//! not used to find it; or the diagnosis reports that nothing explains the residual.
//!
//! | module          | what                                                                             |
//! |-----------------|----------------------------------------------------------------------------------|
//! | `as_written`    | whether the calibration file with the effects errs more, by any kind of observation |
//! | `candidate`     | which coefficients of an [effect](crate::effects) are tried, and their columns   |
//! | [`rows`]        | residuals of dwells and turns after the affine model, as one linear problem      |
//! | [`variance`]    | variance of the residuals: known noise, extra white variance, rate random walk   |
//! | [`search`]      | search for the effects that explain the residuals                                |
//! | `judged`        | the judgement                                                                    |
//! | [`decision`]    | accepted effects, and residual errors                                            |
//! | `passes`        | repeats the search with the affine model fitted beside strong effects            |
//! | [`uncertainty`] | uncertainty that effects add to the calibration and to the forces of a gyro's turns |
//! | [`picture`]     | data for the plots                                                               |

mod as_written;
mod candidate;
pub mod columns;
pub mod decision;
mod judged;
mod passes;
pub mod picture;
pub mod rejected;
pub mod rows;
pub mod search;
pub mod uncertainty;
pub mod variance;

use std::cell::Cell;

use decision::Decision;
use mimu_core::compensation::Affine;
use passes::{Pass, Passes};
use picture::Picture;
use rows::{ForceErrors, FreeParameters, Rows, Session};
use serde::{Deserialize, Serialize};

use crate::calibration::Calibration;
use crate::effects::fitted::FittedEffect;
use crate::effects::removal::{removable, remove_within};
use crate::estimate::least_squares::POORLY_DETERMINED;
use crate::fit::{Fit, Options, fit, fit_biases};
use crate::one_unit::{RAW_UNIT, refuse_unlike};
use crate::prepared::Prepared;
use crate::quantity::{Sensor, plural, significant};
use crate::recording_problem::OfRecording;
use crate::triad::{Covariance, Part, Triad};
use crate::warning::Warning;
use mimu_recording::{Error, RawUnit, Reference, Result};

/// Result of a diagnosis in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, strum::IntoStaticStr)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Verdict {
    /// Noise explains the residuals of the affine model.
    Clean,
    /// The effects found explain the residuals.
    Explained,
    /// A residual has no explanation, or an unlisted alternative model explains it as well as the effect found.
    Unexplained,
    /// No effect was found, and a sensor has too little data to judge it: see [`Diagnosis::untestable`].
    Untestable,
}

impl Verdict {
    /// Name.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Why a recording cannot show whether a sensor errs.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Untestable {
    /// Too few residuals: their number, and the number of affine parameters.
    #[error(
        "too few for a judgement: {} for {}; record more poses", plural(*.0 as u64, "residual"), plural(*.1 as u64, "affine parameter")
    )]
    Residuals(usize, usize),
    /// Whichever part is held out, the rest of the recording does not determine the calibration.
    #[error(
        "whichever part of the recording is held out, the rest does not determine the calibration; record each pose twice"
    )]
    NothingHeldOut,
    /// The poses hardly determine some combinations of parameters: the condition of the fit.
    #[error(
        "the poses hardly determine some parameters (condition {0:.0}); record poses that differ more"
    )]
    Condition(f64),
    /// The directions of gravity that judge the turns are too uncertain: their error over the noise of the turns.
    #[error("its turns are judged by the accelerometer's directions of gravity, whose uncertainty is {} times the noise of the turns; record more poses", significant(*.0))]
    Reference(f64),
    /// The turns determine the accelerometer too, so its directions agree with them.
    #[error(
        "the poses alone hardly determine the accelerometer, so the turns determine it too, and nothing else judges them; record more poses"
    )]
    WithTurns,
}

/// Whether the turns helped to determine the accelerometer of `fit`.
fn by_turns(fit: &Fit) -> bool {
    let accel = fit.sensor(Sensor::Accel);
    accel.is_some_and(|a| a.estimated.notes.contains(&Warning::WithTurns))
}

/// How the model without effects is judged, as by a fit.
const HELD_OUT: Options = Options {
    holdout_blocks: 4,
    ..Options::IN_SAMPLE
};

/// A judgement needs at least this many residuals more than affine parameters.
const FEWEST: usize = 3;
/// Ratio of the reference's error to the noise above which turns cannot show an effect. A published session of 38 poses by hand has 1.1.
const HIDDEN: f64 = 10.0;

impl SensorDiagnosis {
    /// Why the recording cannot show whether the sensor errs; `None` if it can. `fit` is the affine fit without effects.
    fn untestable(&self, fit: &Fit, matrix_given: bool) -> Option<Untestable> {
        let decision = &self.decision;
        let [rows, parameters] = decision.rows;
        let condition = fit
            .sensor(self.sensor)
            .map_or(1.0, |f| f.estimated.condition);
        let reference = decision.reference_rms / decision.noise_floor;
        match () {
            () if rows < parameters + FEWEST => Some(Untestable::Residuals(rows, parameters)),
            () if !decision.held_out_rms[1].is_finite() => Some(Untestable::NothingHeldOut),
            () if condition > POORLY_DETERMINED && !matrix_given => {
                Some(Untestable::Condition(condition))
            }
            () if reference > HIDDEN => Some(Untestable::Reference(reference)),
            () if by_turns(fit) && !matrix_given => Some(Untestable::WithTurns),
            () => None,
        }
    }
}

/// What was found on one sensor.
#[derive(Debug, Clone)]
pub struct SensorDiagnosis {
    /// Sensor.
    pub sensor: Sensor,
    /// Its residuals after the affine model. Those of the gyro are without the effects of the accelerometer.
    pub rows: Rows,
    /// Decision on these rows.
    pub decision: Decision,
    /// Data for its plots.
    pub picture: Picture,
}

/// What was found in a recording.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    /// The affine fit before effects were sought.
    pub before: Fit,
    /// The affine fit of the readings after removal of the effects.
    pub after: Fit,
    /// Gyro, then accelerometer, if recorded.
    pub sensors: Vec<SensorDiagnosis>,
    /// Accepted effects of all sensors.
    pub effects: Vec<FittedEffect>,
    /// Verdict.
    pub verdict: Verdict,
    /// Sensors that the recordings cannot judge, with the reason.
    pub untestable: Vec<(Sensor, Untestable)>,
    /// The recordings in which effects were sought, in the order given.
    pub sources: Vec<Source>,
    /// Problems of these recordings and of the one that judges the effects. Those of later recordings are found without a fit.
    pub problems: Vec<OfRecording>,
}

/// A recording, identified by its file and samples.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Source {
    /// Its file of samples.
    #[serde(rename = "samples")]
    pub place: String,
    /// Number of samples.
    pub rows: u64,
    /// Time between samples, s.
    pub period_s: f64,
    /// SHA-256 of the samples file.
    pub sha256: String,
}

impl From<&Prepared> for Source {
    fn from(prepared: &Prepared) -> Self {
        let condensed = &prepared.condensed;
        Self {
            place: prepared.place.clone(),
            rows: condensed.rows,
            period_s: condensed.period_s,
            sha256: condensed.sha256.clone(),
        }
    }
}

/// Recordings and calibration that a diagnosis uses.
#[derive(Debug, Clone)]
pub struct Recordings<'a> {
    /// The recording that the calibration is made from.
    pub first: Prepared,
    /// More recordings of the same unit. Effects are sought in all of them together; each has separate biases.
    pub more: Vec<Prepared>,
    /// A recording in which no effects are sought: it judges those found in the others.
    pub second: Option<Prepared>,
    /// A calibration of the unit, if the first recording cannot determine one. Its matrices are kept, and its effects are removed.
    pub given: Option<&'a Calibration>,
}

impl From<Prepared> for Recordings<'_> {
    fn from(first: Prepared) -> Self {
        Self {
            first,
            more: Vec::new(),
            second: None,
            given: None,
        }
    }
}

impl Recordings<'_> {
    fn later(&self) -> impl Iterator<Item = &Prepared> {
        self.more.iter().chain(&self.second)
    }

    /// Refuses recordings that differ in unit or raw unit, or that a diagnosis cannot use.
    fn check(&self) -> Result<()> {
        let all = || std::iter::once(&self.first).chain(self.later());
        if let Some(turned) = all().find(|r| r.manifest.reference == Reference::TurntableRate) {
            return Err(Error::new(
                &turned.place,
                "only the magnitude of the rate is known, but a diagnosis needs known inputs or gravity",
                "give a recording from a rate table or by hand; a fit and a verification take this one",
            ));
        }
        let raw_unit = self.first.manifest.raw_unit;
        let named: Vec<_> = all().map(|r| (r.place.as_str(), &r.manifest)).collect();
        refuse_unlike(&named, &[RAW_UNIT])?;
        for sensor in Sensor::BOTH {
            let table = self.given.and_then(|c| c.table(sensor));
            if let Some(table) = table.filter(|t| t.raw_unit != raw_unit) {
                return Err(Error::new(
                    &self.first.place,
                    format!(
                        "raw_unit is {raw_unit}, but [{sensor}] of the calibration is for {}",
                        table.raw_unit
                    ),
                    "give a calibration from recordings with the same raw unit",
                ));
            }
        }
        if let Some(given) = self.given {
            for recording in all() {
                removable(recording, given.effects())?;
            }
        }
        if let Some(problem) = self.given.and_then(|c| c.other_unit(&self.first.manifest)) {
            return Err(Error::new(
                &self.first.place,
                problem,
                "effects belong to one unit: give the calibration of this unit; if it is the same unit, write the same name as device in both files",
            ));
        }
        Ok(())
    }
}

/// Fixed calibrations of gyro and accelerometer, raw to SI, if only the biases are to be fitted; else `None`.
///
/// They come from the given calibration. Without one, readings in SI of a unit that was never turned get the identity.
fn matrices(recordings: &Recordings) -> Option<[Option<Affine<f64>>; 2]> {
    if let Some(given) = recordings.given {
        return Some(Sensor::BOTH.map(|s| given.inverse(s)));
    }
    let first = &recordings.first;
    let unit = Affine::identity();
    let never_turned = match first.manifest.reference {
        Reference::Gravity | Reference::TurntableRate => !first.has(Sensor::Accel),
        Reference::Table => Sensor::BOTH.iter().all(|s| {
            let dwells = first.dwells.list.iter();
            let inputs: Vec<_> = dwells.filter_map(|d| d.input(*s)).collect();
            inputs.windows(2).all(|w| w[0] == w[1])
        }),
    };
    (first.manifest.raw_unit == RawUnit::Si && never_turned).then_some([Some(unit); 2])
}

/// Restricts the warning that the model of the fit has no temperature to the sensors without an accepted thermal effect.
fn with_temperature(now: &mut Fit, sensors: &[SensorDiagnosis]) {
    let thermal = |s: &&SensorDiagnosis| {
        let mut accepted = s.decision.accepted.iter();
        accepted.any(|a| a.chosen.candidate.is_thermal())
    };
    let (with, without): (Vec<_>, Vec<_>) = sensors.iter().partition(thermal);
    if with.is_empty() {
        return;
    }
    now.warnings.retain_mut(|warning| {
        if let Warning::WithoutTemperature { sensor: whose, .. } = warning {
            *whose = without.first().map(|s| s.sensor);
            return whose.is_some();
        }
        true
    });
}

/// Who is told the share of a diagnosis that is done, from 0 to 1. It never falls.
pub type Heard<'a> = &'a dyn Fn(f64);

/// How the recordings of a diagnosis are calibrated.
struct Calibrator<'a> {
    recordings: &'a Recordings<'a>,
    options: Options,
    /// See [`matrices`].
    held: Option<[Option<Affine<f64>>; 2]>,
    /// Those of the given calibration. For readings in SI of a unit that is never turned, the uncertainty of the matrix is unknown.
    covariances: [Option<Covariance>; 2],
}

impl<'a> Calibrator<'a> {
    fn of(recordings: &'a Recordings<'a>, options: Options) -> Self {
        Self {
            recordings,
            options,
            held: matrices(recordings),
            covariances: Sensor::BOTH.map(|s| recordings.given.and_then(|c| c.covariance(s))),
        }
    }

    fn singular(&self) -> Error {
        let (place, remedy) = (
            &self.recordings.first.place,
            "check the columns of the recording",
        );
        Error::new(place, "the calibration is singular", remedy)
    }

    fn free(&self, sensor: Sensor) -> FreeParameters<'_> {
        match self.held {
            Some(_) => FreeParameters::Bias(self.covariances[sensor as usize].as_ref()),
            None => FreeParameters::Affine,
        }
    }

    fn calibrate(&self, prepared: Prepared) -> Result<Fit> {
        match self.held {
            Some(matrices) => fit_biases(prepared, self.options, matrices, &self.covariances),
            None => fit(prepared, self.options),
        }
    }

    /// The fit that judges the model without effects.
    fn judged(&self, prepared: Prepared) -> Result<Fit> {
        match self.held {
            // A given matrix is judged by the rows alone: its biases are all that a part could be held out of.
            Some(_) => self.calibrate(prepared),
            None => fit(prepared, HELD_OUT),
        }
    }

    fn without_given_effects(&self, prepared: &Prepared) -> Result<Prepared> {
        let (Some(given), Some([gyro, accel])) = (self.recordings.given, &self.held) else {
            return Ok(prepared.clone());
        };
        let (gyro, accel) = (gyro.as_ref(), accel.as_ref());
        remove_within(prepared, gyro, accel, given.effects(), given.limits())
            .ok_or_else(|| self.singular())
    }
}

/// What was found on the sensors so far.
struct Found<'a> {
    calibrator: &'a Calibrator<'a>,
    /// The affine fit before effects were sought.
    before: &'a Fit,
    /// The affine fit without the effects found, and the later recordings without them.
    now: Fit,
    later: Vec<Prepared>,
    sensors: Vec<SensorDiagnosis>,
    effects: Vec<FittedEffect>,
    /// Errors of the forces that judge the gyro.
    forces: Option<ForceErrors>,
    /// Uncertainty that the coefficients of effects add to the calibration.
    open: Vec<(Sensor, Part)>,
}

impl Found<'_> {
    /// Seeks the effects of `sensor`, and removes them.
    fn seek(&mut self, sensor: Sensor, heard: Heard) -> Result<()> {
        let Pass {
            rows,
            mut decision,
            after,
        } = self.best_pass(sensor, heard)?;
        let affine = match self.effects.is_empty() {
            true => self.before.clone(),
            false => self.calibrator.judged(self.now.prepared.clone())?,
        };
        let with_effects = after.is_some();
        if let Some(after) = after {
            self.effects.extend(decision.effects());
            (self.now, self.later) = after;
        }
        if self.calibrator.held.is_none()
            && self.calibrator.recordings.more.is_empty()
            && let Some(affine) = affine.sensor(sensor)
        {
            let with_effects = self.now.sensor(sensor).filter(|_| with_effects);
            decision.take_figures(affine, with_effects);
        }
        let part = uncertainty::of_affine(&rows, &decision);
        self.open.extend(part.map(|part| (sensor, part)));
        let reference = self.calibrator.recordings.first.manifest.reference;
        if sensor == Sensor::Accel && reference == Reference::Gravity {
            self.forces = self.forces_by(&rows, &decision);
        }
        let picture = Picture::of(sensor, &rows, &decision);
        self.sensors.push(SensorDiagnosis {
            sensor,
            rows,
            decision,
            picture,
        });
        Ok(())
    }

    fn best_pass(&self, sensor: Sensor, heard: Heard) -> Result<Pass> {
        let passes = Passes {
            sensor,
            now: &self.now,
            later: &self.later,
            forces: self.forces.as_ref(),
            calibrator: self.calibrator,
            heard,
            done: Cell::new(0),
        };
        passes.best()
    }

    /// Errors of the forces that the accelerometer measures; `rows` are those of its magnitudes.
    fn forces_by(&self, rows: &Rows, decision: &Decision) -> Option<ForceErrors> {
        let models = Sensor::BOTH.map(|s| self.now.sensor(s).map(|f| f.estimated.triad.inverse));
        let head = Session::of(&self.now.prepared, models);
        match self.calibrator.held {
            None if !by_turns(&self.now) => uncertainty::of_forces(&head, rows, decision),
            // With the turns the fit knows the directions better than the poses alone do.
            _ => self.now.sensor(Sensor::Accel).map(|f| {
                let covariance = &f.estimated.triad.inverse_covariance;
                uncertainty::of_given_forces(&self.now.prepared, covariance)
            }),
        }
    }

    fn add_uncertainty(&mut self) -> Result<()> {
        for (sensor, part) in std::mem::take(&mut self.open) {
            let fit = self.now.sensors.iter_mut().find(|f| f.sensor == sensor);
            if let Some(triad) = fit.map(|f| &mut f.estimated.triad) {
                let mut parts = triad.inverse_parts();
                parts.push(part);
                *triad = Triad::from_inverse(triad.inverse, parts)
                    .ok_or_else(|| self.calibrator.singular())?;
            }
        }
        let given = self.calibrator.recordings.given;
        if given.is_some_and(|given| !given.is_uncertain()) {
            self.now.warnings.push(Warning::Uncertain);
        }
        Ok(())
    }

    fn untestable(&self) -> Vec<(Sensor, Untestable)> {
        let matrix_given = self.calibrator.held.is_some();
        let why = |s: &SensorDiagnosis| Some((s.sensor, s.untestable(self.before, matrix_given)?));
        self.sensors.iter().filter_map(why).collect()
    }

    fn verdict(&self, all_testable: bool) -> Verdict {
        let open = |d: &Decision| d.unexplained().next().is_some() || !d.undecided.is_empty();
        let left = self.sensors.iter().any(|s| open(&s.decision));
        match (left, self.effects.is_empty()) {
            (true, _) => Verdict::Unexplained,
            (false, true) if !all_testable => Verdict::Untestable,
            (false, true) => Verdict::Clean,
            (false, false) => Verdict::Explained,
        }
    }
}

/// Finds the physical effects behind what a calibration leaves, with their coefficients in SI.
///
/// ```no_run
/// use mimu::{DwellSearch, Options, Prepared, Recording, Recordings, Verdict, diagnose};
///
/// let recording = Recording::open("by-hand".as_ref())?;
/// let prepared = Prepared::read(&recording, DwellSearch::default(), |_| ())?;
/// let found = diagnose(Recordings::from(prepared), Options::default())?;
/// if found.verdict == Verdict::Explained {
///     for effect in &found.effects {
///         println!("{}: {:?} ± {:?} in SI (one sigma)", effect.id(), effect.values, effect.sigmas);
///     }
/// }
/// # Ok::<(), mimu::Error>(())
/// ```
///
/// The accelerometer comes first: without a table, its directions of gravity judge the gyro.
pub fn diagnose(recordings: Recordings, options: Options) -> Result<Diagnosis> {
    diagnose_heard(recordings, options, &|_| ())
}

/// [`diagnose`], with `heard` told the share that is done.
pub fn diagnose_heard(recordings: Recordings, options: Options, heard: Heard) -> Result<Diagnosis> {
    recordings.check()?;
    let calibrator = Calibrator::of(&recordings, options);
    let before = calibrator.judged(calibrator.without_given_effects(&recordings.first)?)?;
    let of_later = recordings.later().flat_map(OfRecording::prepared);
    let problems = OfRecording::fitted(&before).into_iter().chain(of_later);
    let problems = problems.collect();
    let later = recordings.later();
    let later = later.map(|prepared| calibrator.without_given_effects(prepared));
    let sources = std::iter::once(&recordings.first).chain(&recordings.more);
    let mut found = Found {
        calibrator: &calibrator,
        before: &before,
        now: before.clone(),
        later: later.collect::<Result<_>>()?,
        sensors: Vec::new(),
        effects: Vec::new(),
        forces: None,
        open: Vec::new(),
    };
    // Fits and file take little beside the searches.
    for (sensor, from) in [(Sensor::Accel, 0.0), (Sensor::Gyro, 0.5)] {
        heard(from);
        if found.now.sensor(sensor).is_some() {
            found.seek(sensor, &|share| heard(from + 0.5 * share))?;
        }
    }
    found.add_uncertainty()?;
    found.sensors.reverse();
    with_temperature(&mut found.now, &found.sensors);
    let untestable = found.untestable();
    let verdict = found.verdict(untestable.is_empty());
    let Found {
        now,
        sensors,
        effects,
        ..
    } = found;
    Ok(Diagnosis {
        before,
        after: now,
        sensors,
        effects,
        verdict,
        untestable,
        sources: sources.map(Source::from).collect(),
        problems,
    })
}
