//! A complete diagnosis: judged on another recording, with the effects for a new calibration and what to record next.

use mimu_recording::error::{Error, Result};

use crate::calibration::verify::verify;
use crate::calibration::{Calibration, FIGURE_DIGITS};
use crate::diagnose::{Diagnosis, Heard, Recordings, diagnose_heard};
use crate::effects::fitted::FittedEffect;
use crate::fit::Options;
use crate::plan::next_experiment::{self, Next};
use crate::quantity::{PerSensor, rounded};
use crate::result::diagnosis::DiagnosisResult;
use crate::warning::Warning;

/// A diagnosis, and what follows from it.
pub struct Diagnosed {
    /// What was found.
    pub diagnosis: Diagnosis,
    /// The effects of the unit: those of the given calibration, and those that were found.
    pub effects: Vec<FittedEffect>,
    /// The experiments that would show what the recordings could not.
    pub next: Next,
    /// The whole result, as written to JSON.
    pub result: DiagnosisResult,
    unit_id: Option<String>,
}

/// Finds the effects in `recordings`, and judges the calibration without and with them by the second recording, whose name is `second`.
/// `given_name` is the name of the calibration that the recordings are diagnosed with; `created` is the time, RFC 3339.
/// `heard` is told the share that is done.
///
/// # Errors
/// Those of [`diagnose_heard`]; a given calibration with curves over temperature, or with an effect that was found anew.
pub fn diagnosed(
    recordings: Recordings,
    [second, given_name]: [Option<&str>; 2],
    created: &str,
    heard: Heard,
) -> Result<Diagnosed> {
    let options = Options {
        holdout_blocks: 0,
        only: None,
    };
    let given = recordings.given;
    let given_name = given_name.unwrap_or_default();
    if given.is_some_and(|given| given.temperature.is_some()) {
        return Err(Error::new(
            format!("{given_name}, [temperature]"),
            "a diagnosis uses one model for all temperatures and would ignore these curves",
            "compensate the recording first (`mimu apply`), and diagnose the result",
        ));
    }
    let other = recordings.second.clone();
    let mut diagnosis = diagnose_heard(recordings, options, heard)?;
    let known = known(given, &mut diagnosis);
    let found = diagnosis.sensors.iter().flat_map(|s| &s.decision.accepted);
    let found = found.filter(|a| a.of_unit).map(|a| a.effect.lasting());
    let mut effects = known.clone();
    for effect in found {
        effect.join(&mut effects);
    }
    let mut judged = None;
    if let (Some(other), Some(name)) = (other, second) {
        let by = |fit, effects: &[FittedEffect]| {
            verify(&other, &Calibration::of(fit, effects, created)?)
        };
        let before = by(&diagnosis.before, &known);
        let after = by(&diagnosis.after, &effects);
        match (before, after) {
            (Ok(before), Ok(after)) => judged = Some([before, after]),
            (Err(refusal), _) | (_, Err(refusal)) => {
                let warning = Warning::NotJudged {
                    recording: Some(name.to_owned()),
                    why: refusal,
                };
                diagnosis.after.warnings.push(warning);
            }
        }
    }
    let next = next_experiment::next(&diagnosis);
    let judged = second.zip(judged.as_ref());
    Ok(Diagnosed {
        result: DiagnosisResult::of(&diagnosis, &next, judged),
        diagnosis,
        effects,
        next,
        unit_id: given.and_then(|given| given.unit_id.clone()),
    })
}

impl Diagnosed {
    /// The calibration with the effects, made at `created` (RFC 3339).
    ///
    /// # Errors
    /// Those of [`Calibration::of`].
    pub fn calibration(&self, created: &str) -> Result<Calibration> {
        let mut made = Calibration::of(&self.diagnosis.after, &self.effects, created)?;
        made.judgement = Some(self.result.judgement.clone());
        let tables = PerSensor {
            gyro: &mut made.gyro,
            accel: &mut made.accel,
        };
        for (_, (table, figures)) in tables.zip(self.result.sensors.as_ref()) {
            let held_out = figures.as_ref().map(|f| f.held_out_rms_after);
            let held_out = held_out.filter(|rms| rms.is_finite());
            if let Some(judged) = table.as_mut().and_then(|t| t.judged.as_mut()) {
                judged.held_out_rms = held_out.map(|rms| rounded(rms, FIGURE_DIGITS));
            }
        }
        // An imported recording lacks the unit's number, but it was checked to be of the same unit.
        made.unit_id = made.unit_id.or(self.unit_id.clone());
        Ok(made)
    }
}

/// The effects that the unit is known to have. Those of a sensor that the recordings lack are dropped with a warning: the new file has no
/// matrix for them.
fn known(given: Option<&Calibration>, diagnosis: &mut Diagnosis) -> Vec<FittedEffect> {
    let Some(given) = given else {
        return Vec::new();
    };
    let after = &mut diagnosis.after;
    let all = given.effects().iter().cloned();
    let (kept, lost): (Vec<FittedEffect>, Vec<FittedEffect>) =
        all.partition(|effect| after.sensor(effect.sensor()).is_some());
    for effect in lost {
        let warning = Warning::EffectLost {
            effect: effect.id(),
            sensor: effect.sensor(),
        };
        after.warnings.push(warning);
    }
    kept
}
