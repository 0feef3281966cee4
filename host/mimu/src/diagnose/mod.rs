//! What is wrong when a calibrated unit still errs: the effect behind the residual, found, added and proved on data that was
//! not used for it, or the statement that nothing explains it.
//!
//! | module        | what                                                                            |
//! |---------------|---------------------------------------------------------------------------------|
//! | `candidate`   | what is tried of the [effects](crate::effects), and its columns                  |
//! | [`rows`]      | what the affine model leaves of dwells and turns, as one linear problem          |
//! | [`variance`]    | how that scatters: known noise, more of it, a bias that walks                    |
//! | [`search`]    | which effects the rows ask for                                                   |
//! | [`decision`]  | which of them are accepted, and what is left                                     |
//! | [`uncertainty`] | what the coefficients of effects leave open of what stands on them               |
//! | [`picture`]   | what of it can be drawn                                                          |

mod candidate;
pub mod decision;
pub mod picture;
pub mod rows;
pub mod search;
pub mod uncertainty;
pub mod variance;

use decision::{Decision, decide, noisier};
use mimu_core::compensation::Affine;
use nalgebra::{Matrix3, Vector3};
use picture::Picture;
use rows::{ForceErrors, Free, Rows, Session};
use serde::Serialize;

use crate::calibration::Calibration;
use crate::effects::removal::{Removed, removable, remove};
use crate::fit::session_bias;
use crate::fit::{Fit, Options, fit, fit_biases};
use crate::prepared::Prepared;
use crate::quantity::Sensor;
use crate::triad::{Part, Triad};
use mimu_recording::error::{Error, Result};
use mimu_recording::{RawUnit, Reference};

/// What a diagnosis says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Noise explains what the affine model leaves.
    Clean,
    /// The effects found explain it.
    Explained,
    /// Something is left that nothing explains, or a law that is on no list explains it as well as the effect found.
    Unexplained,
}

impl Verdict {
    /// Name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clean => "clean",
            Self::Explained => "explained",
            Self::Unexplained => "unexplained",
        }
    }
}

/// What was found on one sensor.
#[derive(Debug, Clone)]
pub struct SensorDiagnosis {
    /// Which.
    pub sensor: Sensor,
    /// What the affine model leaves of it, the effects of the other sensor taken out.
    pub rows: Rows,
    /// What its rows led to.
    pub decision: Decision,
    /// What of it is drawn; `None` where a model of it is singular.
    pub picture: Option<Picture>,
}

/// What was found in a recording.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    /// The affine fit before.
    pub before: Fit,
    /// The affine fit of the readings without the effects.
    pub after: Fit,
    /// Gyro, then accelerometer, as far as there are any.
    pub sensors: Vec<SensorDiagnosis>,
    /// The effects, as they are taken out.
    pub effects: Vec<Removed>,
    /// What it amounts to.
    pub verdict: Verdict,
    /// The recordings that effects were found in, the first first.
    pub sources: Vec<Source>,
}

/// A recording, told apart from others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Source {
    /// Its file of samples.
    #[serde(rename = "samples")]
    pub place: String,
    /// Samples.
    pub rows: u64,
    /// Between samples, s.
    pub period_s: f64,
    /// Of the samples.
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

/// What a diagnosis is made from.
#[derive(Debug, Clone)]
pub struct Recordings<'a> {
    /// The recording that the calibration is made from.
    pub first: Prepared,
    /// More of the same unit: effects are found in all of them together; each has biases of its own.
    pub more: Vec<Prepared>,
    /// One that nothing is found in, and that effects are judged by.
    pub second: Option<Prepared>,
    /// The calibration of the unit, where the first recording cannot make one: its matrices are kept, and its effects taken out.
    pub given: Option<&'a Calibration>,
    /// Ids of terms without known physics that are taken though no second recording confirms them.
    pub accept: Vec<String>,
}

impl From<Prepared> for Recordings<'_> {
    fn from(first: Prepared) -> Self {
        Self {
            first,
            more: Vec::new(),
            second: None,
            given: None,
            accept: Vec::new(),
        }
    }
}

impl Recordings<'_> {
    fn later(&self) -> impl Iterator<Item = &Prepared> {
        self.more.iter().chain(&self.second)
    }

    /// Refuses recordings that cannot be of one unit.
    fn check(&self) -> Result<()> {
        let (unit, raw_unit) = (&self.first.manifest.device, self.first.manifest.raw_unit);
        for other in self.later() {
            if other.manifest.raw_unit != raw_unit {
                return Err(Error::new(
                    &other.place,
                    format!(
                        "raw_unit is {}, and that of the first recording {raw_unit}",
                        other.manifest.raw_unit
                    ),
                    "give recordings that the same converter wrote",
                ));
            }
        }
        for sensor in Sensor::BOTH {
            let table = self.given.and_then(|c| c.table(sensor));
            if let Some(table) = table.filter(|t| t.raw_unit != raw_unit) {
                return Err(Error::new(
                    &self.first.place,
                    format!(
                        "raw_unit is {raw_unit}, and [{sensor}] of the calibration is for {}",
                        table.raw_unit
                    ),
                    "give a calibration from recordings that the same converter wrote",
                ));
            }
        }
        if let Some(given) = self.given {
            for recording in std::iter::once(&self.first).chain(self.later()) {
                removable(recording, given.effects())?;
            }
        }
        let given = self.given.map(|c| (c.device.as_str(), "the calibration"));
        let recordings = self
            .later()
            .map(|r| (r.manifest.device.as_str(), r.place.as_str()));
        if let Some((device, place)) = recordings.chain(given).find(|(d, _)| d != unit) {
            return Err(Error::new(
                place,
                format!("device is {device:?}, and that of the first recording {unit:?}"),
                "effects are a unit's own: give recordings of one unit; if they are, import both with the same name of the device, or mend it in recording.toml",
            ));
        }
        Ok(())
    }
}

/// Whether nothing but the biases can be found: matrices for the gyro and the accelerometer, raw to SI.
///
/// They are those of the given calibration. Without one, readings in SI of a unit that was never turned are what they say.
fn matrices(recordings: &Recordings) -> Option<[Option<Affine<f64>>; 2]> {
    if let Some(given) = recordings.given {
        return Some(Sensor::BOTH.map(|s| given.inverse(s)));
    }
    let first = &recordings.first;
    let unit = Affine {
        matrix: Matrix3::identity(),
        offset: Vector3::zeros(),
    };
    let never_turned = match first.manifest.reference {
        Reference::Gravity => !first.has(Sensor::Accel),
        Reference::Table => Sensor::BOTH.iter().all(|s| {
            let inputs: Vec<_> = first.observations(*s).iter().map(|o| o.input).collect();
            inputs.windows(2).all(|w| w[0] == w[1])
        }),
    };
    (first.manifest.raw_unit == RawUnit::Si && never_turned).then_some([Some(unit); 2])
}

/// Times between the dwells, s since the recording began, and which recording.
fn dwell_ends(recordings: &[&Prepared]) -> Vec<(usize, f64)> {
    let mut all = Vec::new();
    for (session, prepared) in recordings.iter().enumerate() {
        let t0_s = prepared.condensed.blocks.first().map_or(0.0, |b| b.start_s);
        let ends = prepared.dwells.list.windows(2);
        all.extend(ends.map(|d| (session, 0.5 * (d[0].last_s + d[1].start_s) - t0_s)));
    }
    all
}

/// A recording with the calibrations of gyro and accelerometer.
fn session(prepared: &Prepared, [gyro, accel]: [Option<Affine<f64>>; 2]) -> Session<'_> {
    Session {
        prepared,
        gyro,
        accel,
        forces: None,
    }
}

/// A later recording beside the calibration of the first: its matrices, and biases of its own.
fn later_session<'a>(prepared: &'a Prepared, models: &[Option<Affine<f64>>; 2]) -> Session<'a> {
    let own = [0, 1].map(|i| {
        let known = models[i]?;
        let own = session_bias::estimate(prepared, Sensor::BOTH[i], &known);
        Some(own.map_or(known, |e| e.triad.inverse))
    });
    session(prepared, own)
}

/// What was accepted, as it is removed.
fn removed(decision: &Decision) -> Vec<Removed> {
    let each = decision.accepted.iter().map(|a| Removed {
        candidate: a.chosen.candidate.clone(),
        parameter: a.chosen.parameter,
        values: a.values.iter().copied().collect(),
    });
    each.collect()
}

/// How often the rows of a sensor are made at most, each time with the affine model beside the effects found before.
const PASSES: usize = 3;
/// Error of an effect's columns by the affine model, over the noise, from which on they are made again. With an accelerometer quadratic of 5 % at
/// 1 g on a table that shows some attitudes more often than their opposites, the affine model alone errs by 1 % of scale and 0.3 degrees, and
/// the quadratic came out 1 % small with `accel_cross_axis_product` beside it.
const BENT: f64 = 0.1;

/// By what share one affine model differs from another in scale and direction.
fn bent(was: &Affine<f64>, is: &Affine<f64>) -> f64 {
    let inverse = was.matrix.try_inverse().unwrap_or_else(Matrix3::zeros);
    (is.matrix * inverse - Matrix3::identity()).amax()
}

/// What the effects take out of the rows, in sample, unit of the rows.
fn explained_rms(decision: &Decision) -> f64 {
    let [before, after] = decision.rms.map(|rms| rms * rms);
    (before - after).max(0.0).sqrt()
}

/// Diagnoses a unit.
///
/// The accelerometer comes first: without a table it is what the gyro is judged by.
pub fn diagnose(recordings: Recordings, options: Options) -> Result<Diagnosis> {
    recordings.check()?;
    let place = recordings.first.place.clone();
    let singular = || {
        Error::new(
            &place,
            "the calibration is singular",
            "look at the columns of the recording",
        )
    };
    let held = matrices(&recordings);
    // Of readings in SI that were never turned nobody knows how well their matrix is known.
    let covariances = Sensor::BOTH.map(|s| recordings.given.and_then(|c| c.covariance(s)));
    let free = |sensor: Sensor| match (held, &covariances) {
        (Some(_), [gyro, accel]) => Free::Bias(match sensor {
            Sensor::Gyro => gyro.as_ref(),
            Sensor::Accel => accel.as_ref(),
        }),
        (None, _) => Free::Affine,
    };
    let calibrate = |prepared: Prepared| match held {
        Some(matrices) => fit_biases(prepared, options, matrices, &covariances),
        None => fit(prepared, options),
    };
    let without = |prepared: &Prepared| match (recordings.given, held) {
        (Some(given), Some([gyro, accel])) => {
            remove(prepared, gyro.as_ref(), accel.as_ref(), given.effects())
        }
        _ => Some(prepared.clone()),
    };
    let before = calibrate(without(&recordings.first).ok_or_else(singular)?)?;
    let mut later: Vec<Prepared> = Vec::new();
    for prepared in recordings.later() {
        later.push(without(prepared).ok_or_else(singular)?);
    }
    let found_in = 1 + recordings.more.len();
    let sources = std::iter::once(&recordings.first).chain(&recordings.more);
    let sources = sources.map(Source::from).collect();
    let mut now = before.clone();
    let mut effects: Vec<Removed> = Vec::new();
    let mut sensors = Vec::new();
    let mut forces: Option<ForceErrors> = None;
    // What the coefficients of effects leave open of the calibration without them.
    let mut open: Vec<(Sensor, Part)> = Vec::new();
    let by_gravity = recordings.first.manifest.reference == Reference::Gravity;
    for sensor in [Sensor::Accel, Sensor::Gyro] {
        if now.sensor(sensor).is_none() {
            continue;
        }
        let mut models = Sensor::BOTH.map(|s| now.sensor(s).map(|f| f.estimated.triad.inverse));
        let mut passes = 1;
        let (rows, decision, found, after) = loop {
            let head = Session {
                forces: forces.as_ref(),
                ..session(&now.prepared, models)
            };
            let others = later.iter().map(|p| later_session(p, &models));
            let sessions: Vec<Session> = std::iter::once(head).chain(others).collect();
            let (ours, unseen) = sessions.split_at(found_in);
            let rows = Rows::of(ours, sensor, free(sensor)).ok_or_else(singular)?;
            let unseen = Rows::of(unseen, sensor, free(sensor));
            let all: Vec<&Prepared> = ours.iter().map(|s| s.prepared).collect();
            let decide = |without: &[(String, String)]| {
                let accept = &recordings.accept;
                decide(&rows, &dwell_ends(&all), unseen.as_ref(), without, accept)
                    .ok_or_else(singular)
            };
            let clean = |found: &[Removed]| -> Result<(Fit, Vec<Prepared>)> {
                let lasting: Vec<Removed> = found.iter().map(Removed::lasting).collect();
                let clean = |(k, s): (usize, &Session)| {
                    let effects = if k == 0 { found } else { &lasting };
                    remove(s.prepared, s.gyro.as_ref(), s.accel.as_ref(), effects)
                        .ok_or_else(singular)
                };
                let cleaned = sessions.iter().enumerate().map(clean);
                let mut cleaned: Vec<Prepared> = cleaned.collect::<Result<_>>()?;
                let first = cleaned.remove(0);
                Ok((calibrate(first)?, cleaned))
            };
            let mut decision = decide(&[])?;
            let mut found = removed(&decision);
            let mut after = (!found.is_empty()).then(|| clean(&found));
            // Bits of a code that are nearly one another's sum can lead the readings away: such a code is no explanation, and no reason to
            // refuse the recording either.
            let codes = found.iter().filter(|f| f.candidate.reads_code());
            let codes: Vec<String> = codes.map(|f| f.candidate.id()).collect();
            if let Some(Err(error)) = &after
                && !codes.is_empty()
            {
                let problem = &error.refused().problem;
                let why = format!("readings without it cannot be calibrated: {problem}");
                let without: Vec<_> = codes.into_iter().map(|id| (id, why.clone())).collect();
                decision = decide(&without)?;
                found = removed(&decision);
                after = (!found.is_empty()).then(|| clean(&found));
            }
            // A strong effect bends the affine model that its own columns are made with.
            let better = after
                .as_ref()
                .and_then(|a| a.as_ref().ok()?.0.sensor(sensor));
            let better = better.map(|f| f.estimated.triad.inverse);
            if let (Some(was), Some(is)) = (&mut models[sensor as usize], better)
                && passes < PASSES
                && bent(was, &is) * explained_rms(&decision) > BENT * decision.noise_floor
            {
                *was = is;
                passes += 1;
                continue;
            }
            let noisier = ours.iter().enumerate().flat_map(|(k, s)| {
                let mut all = noisier(s, sensor);
                for one in all.iter_mut().filter(|_| ours.len() > 1) {
                    one.stratum = format!("{} of recording {}", one.stratum, k + 1);
                }
                all
            });
            decision.leftover.extend(noisier);
            let mut starts = all.iter().map(|p| p.manifest.start_without_power_on());
            if let Some(start) = starts.find_map(|s| s) {
                decision.without_power_on(start);
            }
            break (rows, decision, found, after);
        };
        if let Some(after) = after {
            effects.extend(found);
            (now, later) = after?;
        }
        open.extend(uncertainty::of_affine(&rows, &decision).map(|part| (sensor, part)));
        if sensor == Sensor::Accel && by_gravity {
            let models = Sensor::BOTH.map(|s| now.sensor(s).map(|f| f.estimated.triad.inverse));
            let head = session(&now.prepared, models);
            forces = match held {
                None => uncertainty::of_forces(&head, &rows, &decision),
                Some(_) => now.sensor(sensor).map(|f| {
                    let covariance = &f.estimated.triad.inverse_covariance;
                    uncertainty::of_given_forces(&now.prepared, covariance)
                }),
            };
        }
        let picture = Picture::of(sensor, &rows, &decision);
        sensors.push(SensorDiagnosis {
            sensor,
            rows,
            decision,
            picture,
        });
    }
    for (sensor, part) in open {
        let fit = now.sensors.iter_mut().find(|f| f.sensor == sensor);
        if let Some(triad) = fit.map(|f| &mut f.estimated.triad) {
            let mut parts = triad.inverse_parts();
            parts.push(part);
            *triad = Triad::from_inverse(triad.inverse, parts).ok_or_else(singular)?;
        }
    }
    sensors.reverse();
    let open = |d: &Decision| d.unexplained().next().is_some() || !d.undecided.is_empty();
    let left = sensors.iter().any(|s| open(&s.decision));
    let verdict = match (left, effects.is_empty()) {
        (true, _) => Verdict::Unexplained,
        (false, true) => Verdict::Clean,
        (false, false) => Verdict::Explained,
    };
    Ok(Diagnosis {
        before,
        after: now,
        sensors,
        effects,
        verdict,
        sources,
    })
}
