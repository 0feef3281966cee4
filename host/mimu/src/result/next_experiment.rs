//! The next experiment, as reported: JSON is this type.

use serde::Serialize;

use super::TOOL;
use crate::plan::design::tour::RANDOMISED;
use crate::plan::next_experiment::recipe::Course;
use crate::plan::next_experiment::{Answer, Setup};
use crate::plan::round;
use crate::quantity::Sensor;
use mimu_recording::Reference;

/// An experiment that shows effects: the result of `mimu design --effects`, `mimu-design/1`. It is judged by what it shows of the effects,
/// instead of by D-efficiency.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NextExperiment {
    /// `mimu-design/1`.
    pub format: &'static str,
    /// This program and its version.
    pub tool: &'static str,
    /// Title, such as `to show gyro_g_sensitivity`.
    pub title: String,
    /// What to do, in the order of doing it.
    pub experiment: String,
    /// What will be known of the input.
    pub reference: Reference,
    /// Fixture, as on the command line.
    pub table: &'static str,
    /// What it will show.
    pub effects: Vec<Shown>,
    /// Direction in the body frame that points up, for each dwell in order.
    pub positions: Vec<[f64; 3]>,
    /// Rate about the vertical in each dwell, deg/s.
    pub rates_dps: Vec<f64>,
    /// When each dwell begins, s.
    pub begin_s: Vec<f64>,
    /// Chamber, s and °C; empty where it does not matter.
    pub chamber_c: Vec<[f64; 2]>,
    /// Whether the unit is switched on as the recording begins.
    pub cold_start: bool,
    /// Always null in JSON: every result of `mimu-design/1` has this key.
    pub d_efficiency: (),
    /// Sigma of each coefficient of the effects.
    pub sigma_per_parameter: Vec<CoefficientSigma>,
    /// Length of a dwell, s.
    pub dwell_s: f64,
    /// Sigma of a dwell mean of each sensor.
    pub dwell_sigma: Vec<DwellSigma>,
    /// `randomised`.
    pub order: &'static str,
    /// Time of the whole, s.
    pub time_s: f64,
}

/// What an experiment shows of an effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Shown {
    /// Its id.
    pub id: String,
    /// Typical size over sigma of the coefficient that is seen worst, or of the whole effect beside its rivals.
    pub sigmas: f64,
    /// Wanted value of that.
    pub wanted: f64,
    /// Whether it is reached.
    pub settled: bool,
}

/// Sigma of a coefficient.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CoefficientSigma {
    /// Id of the effect, and name of the coefficient.
    pub name: String,
    /// Sigma.
    pub value: f64,
    /// SI unit of that.
    pub unit: String,
}

/// Sigma of a dwell mean.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DwellSigma {
    /// Sensor.
    pub sensor: Sensor,
    /// Sigma, SI.
    pub value: f64,
    /// rad/s or m/s^2.
    pub unit: &'static str,
}

impl NextExperiment {
    /// The result of `answer` for `setup`.
    pub fn new(setup: &Setup, answer: &Answer) -> Self {
        let experiment = &answer.experiment;
        let settings = experiment.settings.iter();
        let predictions = answer.predictions.iter();
        let ids: Vec<&str> = predictions.clone().map(|p| p.id.as_str()).collect();
        let effects = predictions.clone().map(|p| Shown {
            id: p.id.clone(),
            sigmas: 1.0 / p.share,
            wanted: (1.0 / p.wanted).round(),
            settled: p.done(),
        });
        let sigmas = predictions.flat_map(|p| {
            p.coefficients
                .iter()
                .map(|(name, unit, sigma)| CoefficientSigma {
                    name: format!("{} {name}", p.id),
                    value: *sigma,
                    unit: unit.clone(),
                })
        });
        let dwell_sigma = setup.sensors.iter().map(|sensor| DwellSigma {
            sensor: *sensor,
            value: setup.noise_of(*sensor).sigma(setup.dwell_s),
            unit: sensor.unit(),
        });
        Self {
            format: "mimu-design/1",
            tool: TOOL,
            title: format!("to show {}", ids.join(", ")),
            experiment: answer.words(setup),
            reference: setup.reference,
            table: setup.fixture.name(),
            effects: effects.collect(),
            positions: settings.clone().map(|s| s.up.into()).collect(),
            rates_dps: settings.map(|s| s.rate.to_degrees()).collect(),
            begin_s: experiment.begin_s.iter().map(|t| round(*t, 1e3)).collect(),
            chamber_c: experiment.chamber_c.clone(),
            cold_start: experiment.recipe.course != Course::Dwells,
            d_efficiency: (),
            sigma_per_parameter: sigmas.collect(),
            dwell_s: experiment.dwell_s,
            dwell_sigma: dwell_sigma.collect(),
            order: RANDOMISED,
            time_s: experiment.time_s,
        }
    }
}
