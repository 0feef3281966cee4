//! `mimu-fit/1`: a calibration of both triads, how it was found, and how well it does.

use std::collections::BTreeMap;

use mimu_recording::{ClockRate, RawUnit, Reference};
use serde::Serialize;

use super::TOOL;
use super::budget::{BudgetRow, budget};
use crate::fit::change::Change;
use crate::fit::{Fit, SensorFit, Split};
use crate::judgement::Judgement;
use crate::observable::Observable;
use crate::parameter::{ParameterKind, TriadParameter, parameters};
use crate::prepared::Prepared;
use crate::quantity::{Figure, PerSensor, Sensor, present, raw_unit};
use crate::recording_problem::OfRecording;
use crate::signal::dwell::Dwell;
use crate::signal::stillness::Detection;
use crate::unseen::Test;
use crate::warning::Warning;

/// Result of a fit.
#[derive(Debug, Clone, Serialize)]
pub struct FitResult {
    /// `mimu-fit/1`.
    pub format: &'static str,
    /// Program and version.
    pub tool: &'static str,
    /// Unit under test.
    pub device: String,
    /// The judgement.
    pub judgement: Judgement,
    /// SHA-256 of the samples file.
    pub sha256: String,
    /// What is known of the input.
    pub reference: Reference,
    /// Unit of the raw readings.
    pub raw_unit: RawUnit,
    /// Local gravity, m/s².
    pub gravity_mps2: f64,
    /// How fast the clock of the samples runs, if it was compared with a better one; absent otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock: Option<ClockRate>,
    /// Whether it was a table of means, one row for each pose, instead of samples.
    pub means: bool,
    /// Samples, or rows of the table of means.
    pub rows: u64,
    /// Time between samples, s.
    pub period_s: f64,
    /// Times without samples.
    pub gaps: Gaps,
    /// Samples whose time stamp repeats the one before.
    pub duplicates: u64,
    /// Contiguous blocks that were left out in turn.
    pub holdout_blocks: usize,
    /// Its triads.
    #[serde(serialize_with = "present")]
    pub sensors: PerSensor<Option<SensorFitResult>>,
    /// How the dwells were detected; null if the `step` column gives them.
    pub detection: Option<Detection>,
    /// All dwells, used or not.
    pub dwells: Vec<DwellResult>,
    /// Dwells and turns that were left out because they err by far more than the others predict.
    pub left_out: Vec<LeftOutResult>,
    /// How that changes every parameter: fitted with everything, and as fitted.
    pub left_out_changes: Vec<Change>,
    /// Problems of the recording, one for each kind; most are among the warnings too.
    pub recording_problems: Vec<OfRecording>,
    /// Warnings.
    pub warnings: Vec<Warning>,
}

/// Times without samples.
#[derive(Debug, Clone, Serialize)]
pub struct Gaps {
    /// How many.
    pub count: u64,
    /// How long in all, s.
    pub missing_s: f64,
}

/// A dwell, or a turn, that was left out because it errs by far more than the others predict.
#[derive(Debug, Clone, Serialize)]
pub struct LeftOutResult {
    /// Sensor.
    pub sensor: Sensor,
    /// Step of the dwell, or of that in which the turn begins.
    pub from_step: i32,
    /// Step of the dwell, or of that in which the turn ends.
    pub to_step: i32,
    /// Its error against the prediction of the others, in [`Self::unit`].
    pub error: f64,
    /// SI unit of it.
    pub unit: &'static str,
    /// The same in standard deviations.
    pub sigmas: f64,
}

/// One dwell.
#[derive(Debug, Clone, Serialize)]
pub struct DwellResult {
    /// Number by the `step` column, or in order of time.
    pub step: i32,
    /// Its name in the manifest; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub label: Option<String>,
    /// Data row of its first sample, from 0.
    pub first_row: u64,
    /// Samples.
    pub rows: u64,
    /// Time of the first, s.
    pub start_s: f64,
    /// Length, s.
    pub duration_s: f64,
    /// Mean temperature, °C; null where unknown.
    pub temp_c: f64,
    /// Mean readings, gyro x, y, z, accelerometer x, y, z; raw.
    pub raw_mean: [f64; 6],
    /// Samples that each is the mean of.
    pub averaged: [u64; 6],
    /// Samples at a rail.
    pub clipped: [u64; 6],
    /// Why it is not used for the gyro; null if it is.
    pub gyro_not_used: Option<String>,
    /// Why it is not used for the accelerometer; null if it is.
    pub accel_not_used: Option<String>,
}

/// Fit of one triad.
#[derive(Debug, Clone, Serialize)]
pub struct SensorFitResult {
    /// How it was estimated.
    pub estimator: &'static str,
    /// `C_xx` to `o_z` (raw to SI, `x = C u + o`), then as physical quantities: `scale_`, `bias_`, `misalignment_` of x, y, z and
    /// `non_orthogonality_` of yz, zy, zx. Without `o_` and `bias_` of a gyro whose bias the firmware removes.
    pub parameters: Vec<Parameter>,
    /// What their variances consist of, if errors of the reference are stated; absent otherwise.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub budget: Vec<BudgetRow>,
    /// Root mean square of the residuals, in [`Self::unit`].
    pub rms: f64,
    /// The same of those that were held out; null if none were.
    pub held_out_rms: Option<f64>,
    /// What noise alone would give, in [`Self::unit`]; null where the noise is not known.
    pub noise_floor: f64,
    /// How the errors of data that were held out compare with what is predicted of them; null if the noise is not known.
    pub test: Option<Test>,
    /// Error of the readings before calibration, in [`Self::unit`]; absent if they are not in SI.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncalibrated_rms: Option<f64>,
    /// SI unit of the figures.
    pub unit: &'static str,
    /// Quantity of the figures.
    pub figure: Figure,
    /// Dwells used.
    pub dwells: usize,
    /// Condition of the experiment.
    pub condition: f64,
    /// Delay of the readings of x, y, z behind the reference, s, corrected in the fit; absent if no input moves within a dwell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_s: Option<Triple>,
    /// By group of observations, whether noise explains their residuals.
    pub scatter: BTreeMap<String, ScatterResult>,
    /// How the dwells were held out: contiguous `blocks`, or `interleaved` if the rest without one of these does not determine the
    /// calibration.
    pub held_out: Split,
    /// Parts that were held out in turn.
    pub held_out_parts: usize,
    /// Why not in blocks, or why some parts were not held out.
    pub not_held_out: Vec<Warning>,
    /// One for every dwell or turn that was used, and those within the dwells whose input moves.
    pub residuals: Vec<ResidualResult>,
    /// Rms of the compensated gyro dwell means without a table, rad/s; absent with one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub static_rms: Option<f64>,
    /// The same held out; null if none were held out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub static_held_out_rms: Option<Option<f64>>,
}

/// A parameter with its uncertainty.
#[derive(Debug, Clone, Serialize)]
pub struct Parameter {
    /// The parameter.
    #[serde(skip)]
    pub of: TriadParameter,
    /// Name.
    pub name: String,
    /// Estimate.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// Lower end of the 95 % interval.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
    /// Unit of all four.
    pub unit: String,
}

/// Values with their standard deviations.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Triple {
    /// Estimates.
    pub value: [f64; 3],
    /// Standard deviations.
    pub sigma: [f64; 3],
}

/// Whether noise explains residuals.
#[derive(Debug, Clone, Serialize)]
pub struct ScatterResult {
    /// Sum of the squared residuals over their noise variances.
    pub chi2: f64,
    /// Degrees of freedom.
    pub dof: f64,
    /// Standard deviation of the scatter beyond noise, in [`Self::unit`].
    pub excess_sigma: f64,
    /// Its unit: SI, or the raw unit.
    pub unit: String,
    /// Whether noise does not explain them. The intervals then include the scatter beyond noise.
    pub significant: bool,
}

/// Residual of a dwell or a turn.
#[derive(Debug, Clone, Serialize)]
pub struct ResidualResult {
    /// Dwell, or that which the turn ends in.
    pub step: i32,
    /// Whether it shows how the reading follows an input that moves within the dwell, instead of the dwell mean; absent if not.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub within: bool,
    /// Residual, SI; that of a magnitude is the first element.
    pub value: [f64; 3],
    /// The same by a fit without this row; null if there is none.
    pub held_out: Option<[f64; 3]>,
    /// Standard deviation by noise alone, SI.
    pub floor: f64,
}

impl FitResult {
    /// The result of `fit`.
    pub fn of(fit: &Fit) -> Self {
        let (condensed, manifest) = (&fit.prepared.condensed, &fit.prepared.manifest);
        let of = |sensor: Sensor| Some(SensorFitResult::of(fit, fit.sensor(sensor)?));
        Self {
            format: "mimu-fit/1",
            tool: TOOL,
            device: manifest.device.clone(),
            judgement: Judgement::of_fit(fit),
            sha256: condensed.sha256.clone(),
            reference: manifest.reference,
            raw_unit: manifest.raw_unit,
            gravity_mps2: manifest.gravity_mps2,
            clock: manifest.clock,
            means: manifest.means,
            rows: condensed.rows,
            period_s: condensed.period_s,
            gaps: Gaps {
                count: condensed.gaps.0,
                missing_s: condensed.gaps.1,
            },
            duplicates: condensed.duplicates,
            holdout_blocks: fit.options.holdout_blocks,
            sensors: PerSensor::from_fn(of),
            detection: fit.prepared.dwells.detection,
            dwells: DwellResult::list(&fit.prepared),
            left_out: LeftOutResult::list(&fit.prepared),
            left_out_changes: fit.changes.clone(),
            recording_problems: OfRecording::fitted(fit),
            warnings: fit.all_warnings().cloned().collect(),
        }
    }
}

impl LeftOutResult {
    fn list(prepared: &Prepared) -> Vec<Self> {
        let dwells = &prepared.dwells;
        let left_out = dwells.left_out.iter().map(|l| Self {
            sensor: l.sensor,
            from_step: dwells.list[l.from].step,
            to_step: dwells.list[l.to].step,
            error: l.error,
            unit: l.sensor.pick("rad", "m/s^2"),
            sigmas: l.sigmas,
        });
        left_out.collect()
    }
}

impl DwellResult {
    /// All dwells of a recording, used or not.
    pub fn list(prepared: &Prepared) -> Vec<Self> {
        let dwells = prepared.dwells.list.iter();
        dwells
            .map(|d| Self::of(d, &prepared.manifest.step_labels))
            .collect()
    }

    fn of(dwell: &Dwell, labels: &[String]) -> Self {
        let fault = |sensor| dwell.faults[sensor].map(|f| f.to_string());
        let label = usize::try_from(dwell.step).ok().and_then(|s| labels.get(s));
        Self {
            step: dwell.step,
            label: label.cloned(),
            first_row: dwell.first_row,
            rows: dwell.rows,
            start_s: dwell.start_s,
            duration_s: dwell.duration_s,
            temp_c: dwell.temp_c,
            raw_mean: dwell.raw.map(|m| m.mean),
            averaged: dwell.raw.map(|m| m.n),
            clipped: dwell.raw.map(|m| m.clipped),
            gyro_not_used: fault(Sensor::Gyro),
            accel_not_used: fault(Sensor::Accel),
        }
    }
}

impl SensorFitResult {
    fn of(fit: &Fit, found: &SensorFit) -> Self {
        let scatter = found.estimated.scatter.iter().map(|(group, s)| {
            let result = ScatterResult {
                chi2: s.chi2,
                dof: s.dof,
                excess_sigma: s.extra_variance.sqrt(),
                unit: extra_sigma_unit(fit, found, *group),
                // An unknown noise neither explains an error nor leaves one unexplained.
                significant: s.is_significant() && fit.prepared.noise.is_known(found.sensor),
            };
            (group.to_string(), result)
        });
        let residuals = found.residuals.iter().map(|r| ResidualResult {
            step: fit.prepared.dwells.list[r.dwell].step,
            within: r.within,
            value: r.value.into(),
            held_out: r.held_out.map(Into::into),
            floor: r.floor,
        });
        Self {
            estimator: fit.estimator(found.sensor),
            parameters: Parameter::list(fit, found),
            budget: budget(found, fit.prepared.manifest.raw_unit),
            rms: found.rms(),
            held_out_rms: found.held_out_rms(),
            noise_floor: found.noise_floor(),
            test: found.test,
            uncalibrated_rms: found.uncalibrated_rms,
            unit: found.figure.unit(found.sensor),
            figure: found.figure,
            dwells: found.dwells,
            condition: found.estimated.condition,
            delay_s: found.estimated.delays.map(|d| Triple {
                value: d.value.into(),
                sigma: d.sigma.into(),
            }),
            scatter: scatter.collect(),
            held_out: found.held_out.split,
            held_out_parts: found.held_out.count,
            not_held_out: found.held_out.reasons.clone(),
            residuals: residuals.collect(),
            static_rms: found.static_rms.map(|(rms, _)| rms),
            static_held_out_rms: found.static_rms.map(|(_, held_out)| held_out),
        }
    }

    /// The parameters of a kind.
    pub fn of_kind(&self, kind: ParameterKind) -> impl Iterator<Item = &Parameter> {
        self.parameters.iter().filter(move |p| p.of.0 == kind)
    }
}

impl Parameter {
    fn list(fit: &Fit, found: &SensorFit) -> Vec<Self> {
        let raw = fit.prepared.manifest.raw_unit;
        let all = parameters(&found.estimated.triad, found.sensor, raw).into_iter();
        // What is left of a bias that firmware removed belongs to the firmware.
        let removed = found.sensor == Sensor::Gyro && fit.prepared.bias_removal.is_some();
        all.filter(|(of, ..)| !(removed && of.is_bias()))
            .map(|(of, e, unit)| Self {
                of,
                name: of.to_string(),
                value: e.value,
                sigma: e.sigma,
                lower: e.value - e.interval,
                upper: e.value + e.interval,
                unit,
            })
            .collect()
    }
}

/// Unit of the extra sigma of a group of observations.
fn extra_sigma_unit(fit: &Fit, found: &SensorFit, group: Observable) -> String {
    let si = found.sensor.unit();
    match found.figure {
        Figure::Direction if group == Observable::Rest => si.into(),
        Figure::Direction | Figure::GravityMagnitude | Figure::RateMagnitude => {
            found.figure.unit(found.sensor).into()
        }
        Figure::Input => raw_unit(fit.prepared.manifest.raw_unit, si),
    }
}
