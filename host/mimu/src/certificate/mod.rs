//! A calibration certificate by the headings of ISO/IEC 17025:2017, 7.8: what the fit of one recording determined, with expanded uncertainties.
//!
//! An expanded uncertainty is half of a 95 % interval. Its coverage factor follows from the effective degrees of freedom (JCGM 100:2008, G.4).

mod as_found;
mod particulars;

pub use as_found::{AsFound, AsFoundError, AsFoundRow};
pub use particulars::{Item, Particulars, Party};

use serde::Serialize;

use crate::calibration::{Calibration, TriadTable};
use crate::data_sheet::DataSheet;
use crate::fit::Fit;
use crate::judgement::{Judgement, JudgementKind};
use crate::parameter::TriadParameter;
use crate::quantity::{PerSensor, Sensor, present};
use crate::result::budget::BudgetRow;
use crate::result::fit::{FitResult, SensorFitResult};
use crate::triad::effective_dof;
use mimu_core::table::is_temperature;
use mimu_recording::error::{Error, Result};
use mimu_recording::{Reference, ReferenceError, SensorSettings};

/// Contents of a certificate.
#[derive(Debug, Clone, Serialize)]
pub struct Certificate {
    /// What its file states.
    pub particulars: Particulars,
    /// The unit by its recording.
    pub device: String,
    /// Its own number, if the recording has it.
    pub unit_id: Option<String>,
    /// Its sensors as they were set, if the recording has it.
    pub settings: Option<SensorSettings>,
    /// Under which conditions it was calibrated.
    pub conditions: Conditions,
    /// What is known of the true input.
    pub reference: Reference,
    /// How well, if that is stated.
    pub reference_error: Option<ReferenceError>,
    /// The chain of calibrations to the SI.
    pub traceability: String,
    /// The judgement of the fit.
    pub judgement: Judgement,
    /// SHA-256 of the samples.
    pub sha256: String,
    /// Program and version.
    pub tool: &'static str,
    /// The triads.
    #[serde(serialize_with = "present")]
    pub sensors: PerSensor<Option<SensorResults>>,
    /// The calibration that the unit had, beside the new one.
    pub as_found: Option<AsFound>,
    /// Limits of the part.
    pub conformity: Option<DataSheet>,
    /// What a person should know of the recording and of the fit.
    pub warnings: Vec<String>,
}

/// Conditions of a calibration, as the recording shows them.
#[derive(Debug, Clone, Serialize)]
pub struct Conditions {
    /// Temperatures of the coldest and the warmest dwell by the unit's thermometer, °C; null without one.
    pub temp_range_c: Option<[f64; 2]>,
    /// Samples a second; null for means of poses.
    pub sample_rate_hz: Option<f64>,
    /// Shortest and longest dwell that was used, s.
    pub dwell_s: Option<[f64; 2]>,
    /// Dwells that were used, by sensor.
    #[serde(serialize_with = "present")]
    pub dwells: PerSensor<Option<usize>>,
    /// Largest rate of the reference, rad/s; null if it has none.
    pub largest_rate: Option<f64>,
    /// Local gravity, m/s².
    pub gravity_mps2: f64,
    /// Latitude, degrees, if the Earth's rate was subtracted.
    pub latitude_deg: Option<f64>,
}

/// Results of one triad.
#[derive(Debug, Clone, Serialize)]
pub struct SensorResults {
    /// How it was estimated.
    pub estimator: &'static str,
    /// Root mean square error, in [`Self::unit`]: in sample.
    pub rms: f64,
    /// The same of dwells that the fit did not use.
    pub held_out_rms: Option<f64>,
    /// SI unit of the two.
    pub unit: &'static str,
    /// The quantity that the two describe.
    pub figure: String,
    /// The physical parameters.
    pub parameters: Vec<ResultRow>,
    /// What their variances consist of; empty if no error of the reference is stated.
    pub budget: Vec<BudgetRow>,
    /// The same calibration as a matrix, as the calibration file has it.
    pub table: TriadTable,
}

/// A parameter with its uncertainty.
#[derive(Debug, Clone, Serialize)]
pub struct ResultRow {
    /// The parameter.
    pub of: TriadParameter,
    /// Estimate, in [`Self::unit`].
    pub value: f64,
    /// Standard uncertainty; 0 if the parameter defines the frame.
    pub sigma: f64,
    /// Effective degrees of freedom; infinite if all contributions were known beforehand.
    pub dof: f64,
    /// Expanded uncertainty for a coverage probability of 95 %.
    pub expanded: f64,
    /// Unit of all but [`Self::dof`].
    pub unit: String,
}

impl ResultRow {
    /// Coverage factor: expanded over standard uncertainty. `None` if the parameter defines the frame.
    pub fn coverage_factor(&self) -> Option<f64> {
        (self.sigma > 0.0).then(|| self.expanded / self.sigma)
    }
}

impl Certificate {
    /// The certificate of `fit`, whose calibration is `made`.
    ///
    /// # Errors
    /// A fit that is judged a misfit.
    pub fn of(
        fit: &Fit,
        made: &Calibration,
        particulars: Particulars,
        as_found: Option<AsFound>,
        conformity: Option<DataSheet>,
    ) -> Result<Self> {
        let result = FitResult::of(fit);
        let manifest = &fit.prepared.manifest;
        if result.judgement.kind == JudgementKind::Misfit {
            return Err(Error::new(
                &fit.prepared.place,
                format!(
                    "no certificate is written, because it is a {}",
                    result.judgement
                ),
                "check range, columns and unit of the readings and record again",
            ));
        }
        let reference_error = fit.prepared.reference_error().cloned();
        let stated = reference_error.as_ref().map(|e| e.traceability.clone());
        let traceability = stated.filter(|text| !text.is_empty());
        let sensors = PerSensor::from_fn(|sensor| {
            let found = result.sensors[sensor].as_ref()?;
            SensorResults::of(fit, sensor, found, made)
        });
        Ok(Self {
            traceability: traceability.unwrap_or_else(|| particulars.traceability.clone()),
            particulars,
            device: manifest.device.clone(),
            unit_id: manifest.unit_id().map(str::to_owned),
            settings: manifest.sensors().cloned(),
            conditions: Conditions::of(fit, &result),
            reference: manifest.reference,
            reference_error,
            judgement: result.judgement,
            sha256: result.sha256,
            tool: result.tool,
            sensors,
            as_found,
            conformity,
            warnings: result.warnings.iter().map(ToString::to_string).collect(),
        })
    }
}

impl Conditions {
    fn of(fit: &Fit, result: &FitResult) -> Self {
        let manifest = &fit.prepared.manifest;
        let dwells = &fit.prepared.dwells.list;
        let used = dwells
            .iter()
            .filter(|d| Sensor::BOTH.iter().any(|s| d.faults[*s].is_none()));
        let temperatures = used.clone().map(|d| d.temp_c);
        let rates = used.clone().filter_map(|d| d.input(Sensor::Gyro));
        Self {
            temp_range_c: range(temperatures.filter(|t| is_temperature(*t))),
            sample_rate_hz: Some(1.0 / result.period_s).filter(|r| r.is_finite() && !result.means),
            dwell_s: range(used.map(|d| d.duration_s).filter(|_| !result.means)),
            dwells: PerSensor::from_fn(|sensor| Some(result.sensors[sensor].as_ref()?.dwells)),
            largest_rate: rates
                .map(|r| r.norm())
                .reduce(f64::max)
                .filter(|r| *r > 0.0),
            gravity_mps2: manifest.gravity_mps2,
            latitude_deg: manifest.latitude_deg,
        }
    }
}

/// The smallest and the largest.
fn range(all: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    all.map(|x| [x; 2])
        .reduce(|[a, b], [x, _]| [a.min(x), b.max(x)])
}

impl SensorResults {
    fn of(fit: &Fit, sensor: Sensor, found: &SensorFitResult, made: &Calibration) -> Option<Self> {
        let (_, parts) = fit.sensor(sensor)?.estimated.triad.physical_parts();
        let physical = TriadParameter::physical();
        let row = |p: &crate::result::fit::Parameter| {
            let k = physical.iter().position(|of| *of == p.of)?;
            let contributions = parts.iter().map(|p| (p.covariance[(k, k)], p.dof));
            Some(ResultRow {
                of: p.of,
                value: p.value,
                sigma: p.sigma,
                dof: effective_dof(contributions).1,
                expanded: p.upper - p.value,
                unit: p.unit.clone(),
            })
        };
        Some(Self {
            estimator: found.estimator,
            rms: found.rms,
            held_out_rms: found.held_out_rms,
            unit: found.unit,
            figure: found.figure.description().to_owned(),
            parameters: found.parameters.iter().filter_map(row).collect(),
            budget: found.budget.clone(),
            table: made.table(sensor)?.clone(),
        })
    }
}
