//! What is wrong when a calibrated unit still errs: the effect behind the residual, found, added and proved on data that was
//! not used for it, or the statement that nothing explains it.
//!
//! | module        | what                                                                            |
//! |---------------|---------------------------------------------------------------------------------|
//! | [`effect`], [`library`] | effects by name: physics, regressors, what excites them                   |
//! | [`candidate`] | what is tried: effects, terms found from the data, jumps                         |
//! | [`rows`]      | what the affine model leaves of dwells and turns, as one linear problem          |
//! | [`spread`]    | how that scatters: known noise, more of it, a bias that walks                    |
//! | [`search`]    | which effects the rows ask for                                                   |
//! | [`decision`]  | which of them are accepted, and what is left                                     |
//! | [`removal`]   | taking them out of readings                                                      |

pub mod candidate;
pub mod decision;
pub mod effect;
pub mod library;
pub mod removal;
pub mod rows;
pub mod search;
pub mod spread;

use decision::{Decision, decide};
use removal::{Removed, remove};
use rows::Rows;

use crate::dwell::Sensor;
use crate::error::{Error, Result};
use crate::fit::{Fit, Options, fit};
use crate::prepared::Prepared;

/// What a diagnosis says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Noise explains what the affine model leaves.
    Clean,
    /// The effects found explain it.
    Explained,
    /// Something is left that nothing explains.
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
    /// What its rows led to.
    pub decision: Decision,
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
}

/// Times between the dwells, s since the recording began.
fn dwell_ends(prepared: &Prepared) -> Vec<f64> {
    let t0_s = prepared.condensed.blocks.first().map_or(0.0, |b| b.start_s);
    let ends = prepared.dwells.list.windows(2);
    ends.map(|d| 0.5 * (d[0].last_s + d[1].start_s) - t0_s)
        .collect()
}

/// Diagnoses a recording.
///
/// The accelerometer comes first: without a table it is what the gyro is judged by.
pub fn diagnose(prepared: Prepared, options: Options) -> Result<Diagnosis> {
    let place = prepared.place.clone();
    let singular = || {
        Error::new(
            &place,
            "the calibration is singular",
            "look at the columns of the recording",
        )
    };
    let before = fit(prepared, options)?;
    let mut now = before.clone();
    let mut effects: Vec<Removed> = Vec::new();
    let mut sensors = Vec::new();
    for sensor in [Sensor::Accel, Sensor::Gyro] {
        let Some(fitted) = now.sensor(sensor) else {
            continue;
        };
        let model = |s: Sensor| now.sensor(s).map(|f| f.estimated.triad.inverse);
        let (inverse, accel) = (fitted.estimated.triad.inverse, model(Sensor::Accel));
        let rows =
            Rows::new(&now.prepared, sensor, &inverse, accel.as_ref()).ok_or_else(singular)?;
        let decision = decide(&rows, &dwell_ends(&now.prepared)).ok_or_else(singular)?;
        let found: Vec<Removed> = decision
            .accepted
            .iter()
            .map(|a| Removed {
                candidate: a.chosen.candidate.clone(),
                form: a.chosen.form,
                values: a.values.iter().copied().collect(),
            })
            .collect();
        if !found.is_empty() {
            let cleaned = remove(
                &now.prepared,
                model(Sensor::Gyro).as_ref(),
                accel.as_ref(),
                &found,
            )
            .ok_or_else(singular)?;
            effects.extend(found);
            now = fit(cleaned, options)?;
        }
        sensors.push(SensorDiagnosis { sensor, decision });
    }
    sensors.reverse();
    let left = sensors.iter().any(|s| !s.decision.leftover.is_empty());
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
    })
}
