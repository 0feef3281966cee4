//! `mimu-diagnosis/1`: the effect behind a residual, with everything that was tried and everything that is drawn.

use mimu_recording::Reference;
use serde::Serialize;

use super::TOOL;
use crate::calibration::verify::Verification;
use crate::diagnose::decision::{Accepted, Decision, Leftover, Undecided};
use crate::diagnose::picture::Picture;
use crate::diagnose::rejected::Rejected;
use crate::diagnose::{Diagnosis, SensorDiagnosis, Source, Untestable, Verdict};
use crate::fit::Split;
use crate::judgement::Judgement;
use crate::plan::next_experiment::{Confused, Next, NotExcited, NotInPlan};
use crate::quantity::{Figure, PerSensor, Sensor, present};
use crate::recording_problem::OfRecording;
use crate::warning::Warning;

/// Result of a diagnosis.
#[derive(Debug, Clone, Serialize)]
pub struct DiagnosisResult {
    /// `mimu-diagnosis/1`.
    pub format: &'static str,
    /// Program and version.
    pub tool: &'static str,
    /// Unit.
    pub device: String,
    /// What is known of the input.
    pub reference: Reference,
    /// Local gravity, m/s².
    pub gravity_mps2: f64,
    /// Recordings in which effects were sought, in the order given.
    pub recordings: Vec<Source>,
    /// Verdict.
    pub verdict: Verdict,
    /// The judgement.
    pub judgement: Judgement,
    /// Sensors that the recordings cannot judge.
    pub untestable: Vec<UntestableResult>,
    /// Accepted effects.
    pub effects: Vec<Accepted>,
    /// Effects that were tried and not accepted.
    pub rejected: Vec<Rejected>,
    /// Effects that the recordings could not show.
    pub not_excited: Vec<NotExcited>,
    /// Candidates that the recordings do not distinguish.
    pub confused: Vec<Confused>,
    /// Entries of `not_excited` and `confused` that the plan of the next experiment does not show.
    pub not_in_plan: Vec<NotInPlan>,
    /// Error figures.
    #[serde(serialize_with = "present")]
    pub sensors: PerSensor<Option<SensorDiagnosisResult>>,
    /// Accepted effects whose physics the recordings do not decide.
    pub undecided: Vec<Undecided>,
    /// Scatter beyond the known noise that nothing explains.
    pub leftover: Vec<Leftover>,
    /// Samples that were left out.
    pub left_out: LeftOutResult,
    /// Problems of the recordings, one for each kind; most are among the warnings too.
    pub recording_problems: Vec<OfRecording>,
    /// Warnings.
    pub warnings: Vec<Warning>,
    /// The calibration without and with the effects, verified on a recording that nothing was fitted to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second: Option<SecondResult>,
}

/// Samples that were left out.
#[derive(Debug, Clone, Serialize)]
pub struct LeftOutResult {
    /// Gaps.
    pub gaps: u64,
    /// Time missing in all of them, s.
    pub missing_s: f64,
    /// Rows that repeat the row before.
    pub repeated_rows: u64,
    /// Samples that are empty or not a number.
    pub empty_samples: u64,
    /// Samples at a rail within dwells.
    pub clipped_samples: u64,
}

/// The calibration without and with the effects, verified on another recording.
#[derive(Debug, Clone, Serialize)]
pub struct SecondResult {
    /// Its name.
    pub recording: String,
    /// Whether it is the recording that the calibration was fitted to, so that its figures prove nothing.
    pub fitted_to: bool,
    /// By the calibration without the effects.
    pub before: Verification,
    /// By the calibration with them.
    pub after: Verification,
}

/// Error figures of one sensor.
#[derive(Debug, Clone, Serialize)]
pub struct SensorDiagnosisResult {
    /// SI unit of the figures.
    pub unit: &'static str,
    /// What they are about.
    pub figure: Figure,
    /// In sample, without effects.
    pub rms_before: f64,
    /// With them.
    pub rms_after: f64,
    /// Held out, without effects.
    pub held_out_rms_before: f64,
    /// With them.
    pub held_out_rms_after: f64,
    /// How they were held out.
    pub held_out: Split,
    /// With effects, every fourth dwell held out.
    pub interleaved_rms_after: f64,
    /// Error that noise alone would cause.
    pub noise_floor: f64,
    /// Error that the accelerometer may add, whose directions of gravity judge the turns.
    pub reference_rms: f64,
    /// Share of the held-out mean square beyond these two that the effects remove; null without effects, or if nothing exceeds these
    /// two.
    pub explained: Option<f64>,
    /// Notes on the accepted effects for the user.
    pub notes: Vec<String>,
    /// Number of ends of dwells at which a jump of a bias was sought, and number of all: in a long recording not at every one.
    pub jumps_sought: [usize; 2],
    /// Residuals that the model is fitted to.
    pub rows: usize,
    /// Affine parameters that they determine first.
    pub affine_parameters: usize,
    /// Probability by chance that the residuals scatter as they do without effects, by the known noise alone.
    pub omnibus_chance: f64,
    /// Number of dwells or turns that the figures include.
    pub judged: usize,
    /// Number of dwells that were used.
    pub dwells_used: usize,
    /// Number of all dwells.
    pub dwells: usize,
    /// Why the others were not used, as a remark.
    pub not_used: String,
    /// Data for its plots.
    pub picture: Picture,
}

/// A sensor that the recordings cannot judge.
#[derive(Debug, Clone, Serialize)]
pub struct UntestableResult {
    /// Sensor.
    pub sensor: Sensor,
    /// Why, and what to record.
    pub reason: String,
}

impl From<&(Sensor, Untestable)> for UntestableResult {
    fn from((sensor, reason): &(Sensor, Untestable)) -> Self {
        Self {
            sensor: *sensor,
            reason: reason.to_string(),
        }
    }
}

impl SensorDiagnosisResult {
    /// Whether there are more residuals than affine parameters; otherwise the residuals are rounding.
    pub fn says_anything(&self) -> bool {
        self.rows > self.affine_parameters
    }
}

impl DiagnosisResult {
    /// The result of a diagnosis, with what to record next, and the name and the figures of another recording without and with
    /// the effects.
    pub fn of(d: &Diagnosis, next: &Next, second: Option<(&str, &[Verification; 2])>) -> Self {
        let prepared = &d.before.prepared;
        let condensed = &prepared.condensed;
        let clipped = prepared.dwells.list.iter().flat_map(|dwell| dwell.raw);
        let mut warnings = d.after.warnings.clone();
        warnings.extend(d.after.sensors.iter().flat_map(|s| s.warnings.clone()));
        warnings.extend(
            second
                .iter()
                .flat_map(|(_, [_, after])| after.warnings.clone()),
        );
        let of_sensor = |sensor: Sensor| {
            let found = d.sensors.iter().find(|s| s.sensor == sensor)?;
            Some(figures(d, found))
        };
        let mut result = Self {
            format: "mimu-diagnosis/1",
            tool: TOOL,
            device: prepared.manifest.device.clone(),
            reference: prepared.manifest.reference,
            gravity_mps2: prepared.manifest.gravity_mps2,
            recordings: d.sources.clone(),
            verdict: d.verdict,
            judgement: d.judgement(),
            untestable: d.untestable.iter().map(UntestableResult::from).collect(),
            effects: Vec::new(),
            rejected: Vec::new(),
            not_excited: next.not_excited.clone(),
            confused: next.confused.clone(),
            not_in_plan: next.not_in_plan.clone(),
            sensors: PerSensor::from_fn(of_sensor),
            undecided: Vec::new(),
            leftover: Vec::new(),
            left_out: LeftOutResult {
                gaps: condensed.gaps.0,
                missing_s: condensed.gaps.1,
                repeated_rows: condensed.duplicates,
                empty_samples: condensed.missing.iter().sum(),
                clipped_samples: clipped.map(|m| m.clipped).sum(),
            },
            recording_problems: d.problems.clone(),
            warnings,
            second: second.map(|(name, [before, after])| SecondResult {
                recording: name.into(),
                fitted_to: before.same_recording,
                before: before.clone(),
                after: after.clone(),
            }),
        };
        for s in &d.sensors {
            result.add(&s.decision);
        }
        result
    }

    fn add(&mut self, decision: &Decision) {
        self.effects.extend(decision.accepted.iter().cloned());
        self.rejected.extend(decision.rejected.iter().cloned());
        self.undecided.extend(decision.undecided.iter().cloned());
        self.leftover.extend(decision.leftover.iter().cloned());
    }

    /// Whether the command was given more than one recording, so that a problem has to say which has it.
    pub fn has_several(&self) -> bool {
        let first = self.recordings.first().map(|r| r.place.as_str());
        let other = |p: &OfRecording| Some(p.recording.as_str()) != first;
        self.recordings.len() > 1
            || self.second.is_some()
            || self.recording_problems.iter().any(other)
    }

    /// Residual structure beyond that of usual sensors.
    pub fn unexplained(&self) -> impl Iterator<Item = &Leftover> {
        self.leftover.iter().filter(|l| !l.usual)
    }
}

fn figures(d: &Diagnosis, found: &SensorDiagnosis) -> SensorDiagnosisResult {
    let decision = &found.decision;
    let fit = d.before.sensor(found.sensor);
    let figure = fit.map_or(Figure::Input, |f| f.figure);
    let (count, together) = found.rows.judged;
    let of_one = match found.rows.observable.figure() {
        Figure::Input => 3 * together,
        _ => together,
    };
    let dwells = &d.before.prepared.dwells;
    SensorDiagnosisResult {
        unit: figure.unit(found.sensor),
        figure,
        rms_before: decision.rms[0],
        rms_after: decision.rms[1],
        held_out_rms_before: decision.held_out_rms[0],
        held_out_rms_after: decision.held_out_rms[1],
        held_out: decision.split,
        interleaved_rms_after: decision.interleaved_rms,
        noise_floor: decision.noise_floor,
        reference_rms: decision.reference_rms,
        explained: decision.explained(),
        notes: decision.notes.clone(),
        jumps_sought: decision.jumps_sought,
        rows: decision.rows[0],
        affine_parameters: decision.rows[1],
        omnibus_chance: decision.omnibus_p,
        judged: (count - found.rows.judged_within()) / of_one,
        dwells_used: fit.map_or(0, |f| f.dwells),
        dwells: dwells.list.len(),
        not_used: dwells.unused(found.sensor),
        picture: found.picture.clone(),
    }
}
