//! What a fleet's calibrations say: `mimu-fleet/1`. Values are in SI: scale factors relative to the median of the fleet (unit `1`), biases divided by the scale factor.

use std::collections::BTreeMap;

use mimu::{Judgement, PerSensor, Sensor};
use serde::Serialize;

use crate::capability::Capability;
use crate::tree::LeftOut;

/// The result.
#[derive(Debug, Clone, Serialize)]
pub struct Fleet {
    /// `mimu-fleet/1`.
    pub format: &'static str,
    /// Program and version.
    pub tool: String,
    /// Judgement: `good` if nothing contradicts one population.
    pub judgement: Judgement,
    /// Units.
    pub units: usize,
    /// Calibrations of them that were used.
    pub measurements: usize,
    /// Calibrations that were left out.
    pub left_out: Vec<LeftOut>,
    /// TOML files that are no calibrations.
    pub other_files: usize,
    /// Calibrations without a row in the table of labels.
    pub unlabelled: usize,
    /// Unit of the readings.
    pub raw_unit: String,
    /// What was known of the input.
    pub reference: String,
    /// Labels, with the number of their levels.
    pub labels: BTreeMap<String, usize>,
    /// First and last day.
    pub days: Option<[String; 2]>,
    /// Populations.
    #[serde(serialize_with = "mimu::quantity::present")]
    pub sensors: PerSensor<Option<TriadOfFleet>>,
    /// Units that do not belong to the population, the least probable first.
    pub strangers: Vec<Stranger>,
    /// Calibrations that contradict the others of their unit.
    pub contradicting: Vec<Stranger>,
    /// Units that are measured on many days and change, with the charts of the parameters that do.
    pub changed_units: Vec<ChangedUnit>,
    /// Labels whose units differ from the others.
    pub different: Vec<DifferentLevel>,
    /// Labels that differ from the others since a day.
    pub changed: Vec<ChangedLevel>,
    /// Control charts of all units.
    pub drift: Option<Drift>,
    /// Part whose limits are compared; null without.
    pub part: Option<String>,
    /// Capability against its limits.
    pub capability: Vec<Capability>,
}

/// The population of a triad.
#[derive(Debug, Clone, Serialize)]
pub struct TriadOfFleet {
    /// Units with this triad.
    pub units: usize,
    /// Those that belong, of which mean and covariance are.
    pub used: usize,
    /// Whether covariances between parameters were estimated.
    pub jointly: bool,
    /// Median scale factors, raw/SI.
    pub scale: [f64; 3],
    /// Parameters.
    pub parameters: Vec<ParameterOfFleet>,
    /// Covariance between units, by rows in the order of the parameters, the uncertainty of the fits removed.
    pub covariance: Vec<Vec<f64>>,
    /// Covariance of the error of the means.
    pub mean_covariance: Vec<Vec<f64>>,
}

/// A parameter over the units.
#[derive(Debug, Clone, Serialize)]
pub struct ParameterOfFleet {
    /// Name in files: `scale_x`.
    pub name: String,
    /// SI unit; `1` for scale factors, which are relative to the median.
    pub unit: &'static str,
    /// Mean.
    pub mean: f64,
    /// Half of its 95 % interval.
    pub half_width: f64,
    /// Standard deviation between units, the uncertainty of the fits removed.
    pub sigma: f64,
    /// Typical standard deviation of a fit.
    pub fit_sigma: f64,
    /// Standard deviation between measurements of one unit beyond that of their fits; null if no unit shows it.
    pub within_sigma: Option<f64>,
    /// How many units have which value: the histogram's lower end, the width of a bin, counts.
    pub histogram: Histogram,
}

/// Counts of values.
#[derive(Debug, Clone, Serialize)]
pub struct Histogram {
    /// Lower end of the first bin.
    pub from: f64,
    /// Width of a bin.
    pub width: f64,
    /// Counts. Values beyond the ends are in none.
    pub counts: Vec<usize>,
}

/// A unit that does not belong to the population, or a calibration that contradicts the others of its unit.
#[derive(Debug, Clone, Serialize)]
pub struct Stranger {
    /// Unit.
    pub unit: String,
    /// Its files.
    pub files: Vec<String>,
    /// Labels of the first.
    pub labels: BTreeMap<String, String>,
    /// Sensor that shows it most.
    pub sensor: Sensor,
    /// Mahalanobis distance; of one parameter if they are not judged jointly.
    pub distance: f64,
    /// Probability that any unit of such a population is so far away, all units considered.
    pub p: f64,
    /// Parameter that is farthest: its name in files.
    pub parameter: String,
    /// Its SI unit.
    pub parameter_unit: &'static str,
    /// Value minus mean.
    pub change: f64,
    /// The same in standard deviations of units and fit.
    pub sigmas: f64,
}

/// A level of a label that differs from the others.
#[derive(Debug, Clone, Serialize)]
pub struct DifferentLevel {
    /// Label.
    pub label: String,
    /// Level.
    pub level: String,
    /// Measurements.
    pub count: usize,
    /// How many of these are of units that do not belong.
    pub strangers: usize,
    /// Sensor.
    pub sensor: Sensor,
    /// Probability of such a difference among equal levels, all levels considered.
    pub p: f64,
    /// Parameter that shows it most.
    pub parameter: String,
    /// Its SI unit.
    pub parameter_unit: &'static str,
    /// Difference from the other levels.
    pub change: f64,
    /// The same in standard deviations of the population.
    pub sigmas: f64,
}

/// A level of a label that differs from the others since a day.
#[derive(Debug, Clone, Serialize)]
pub struct ChangedLevel {
    /// Label.
    pub label: String,
    /// Level.
    pub level: String,
    /// Chart of its difference from the other levels of the same days.
    pub chart: ChartOfParameter,
}

/// A parameter of a unit that is measured on many days and changes: a golden unit that ages, or a station.
#[derive(Debug, Clone, Serialize)]
pub struct ChangedUnit {
    /// Unit.
    pub unit: String,
    /// Its measurements. Only the first is used for the population.
    pub measurements: usize,
    /// Chart of the parameter against its own mean before the change.
    pub chart: ChartOfParameter,
}

/// Control charts of all units.
#[derive(Debug, Clone, Serialize)]
pub struct Drift {
    /// Weight of the newest day.
    pub lambda: f64,
    /// Limit, in standard deviations of the average.
    pub limit: f64,
    /// Measurements without a day.
    pub undated: usize,
    /// Charts of the parameters.
    pub charts: Vec<ChartOfParameter>,
}

/// A control chart.
#[derive(Debug, Clone, Serialize)]
pub struct ChartOfParameter {
    /// Sensor.
    pub sensor: Sensor,
    /// Parameter.
    pub parameter: String,
    /// Its SI unit.
    pub unit: &'static str,
    /// Standard deviation of days beyond the scatter of their units.
    pub between_days: f64,
    /// Standard deviation of the population.
    pub sigma: f64,
    /// First day beyond the limits; null if there is none.
    pub signal: Option<String>,
    /// When the drift began, if there is one.
    pub since: Option<String>,
    /// Largest distance of the average from the centre after the signal, with sign; of a label the step against the others.
    pub change: Option<f64>,
    /// Days.
    pub days: Vec<String>,
    /// Mean of each day, minus the centre.
    pub means: Vec<f64>,
    /// Moving average.
    pub averages: Vec<f64>,
    /// Its limit.
    pub limits: Vec<f64>,
}
