//! A design, as reported: each result is one type, and JSON is that type.

pub mod beside_population;

use std::borrow::Cow;

use serde::Serialize;

use super::TOOL;
use crate::plan::design::Problem;
use crate::plan::design::budget::{Budget, DwellNoise, Shares, Spending};
use crate::plan::design::judgement::Judgement;
use crate::plan::design::model::Setting;
use crate::plan::design::reach::Fixture;
use crate::plan::design::tour::{Motion, RANDOMISED};
use crate::plan::{Plan, Step};
use crate::quantity::{Sensor, minutes, significant};
use beside_population::BesidePopulation;
use mimu_recording::{NORMAL_95, Reference};

/// Sample rate of the recording that a plan asks for, Hz.
const SAMPLE_RATE_HZ: f64 = 1000.0;

/// Conditions under which a design is judged.
#[derive(Debug, Clone)]
pub struct Conditions {
    /// Title, such as `best of 9 dwells found (seed 1)`.
    pub title: String,
    /// Length of a dwell, s.
    pub dwell_s: f64,
    /// Noise that the sigma of a dwell mean follows from; `None` if that was given.
    pub noise: Option<DwellNoise>,
    /// Whose noise that is; `None` if it was given.
    pub assumed_noise: Option<&'static str>,
    /// Moves between the dwells.
    pub motion: Motion,
}

/// A judged design: the result of `mimu design`, `mimu-design/1`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Design {
    /// `mimu-design/1`.
    pub format: &'static str,
    /// This program and its version.
    pub tool: &'static str,
    /// See [`Conditions::title`].
    pub title: String,
    /// Sensor.
    pub sensor: Sensor,
    /// What is known of the input.
    pub reference: Reference,
    /// Fixture, as on the command line.
    pub table: &'static str,
    /// Direction in the body frame that points up, for each dwell in order.
    pub positions: Vec<[f64; 3]>,
    /// Rate about the vertical in each dwell of a gyro, deg/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rates_dps: Option<Vec<f64>>,
    /// D-efficiency against the continuous optimum over the reach: 1 is the best possible, 0 is singular. With a prior not a number, null in JSON, as
    /// is `determinant`: the optimum then depends on the number of dwells and their noise.
    pub d_efficiency: f64,
    /// `det(F'F/n)`, fang (22).
    pub determinant: f64,
    /// Largest over smallest singular value of F; infinite, null in JSON, if singular.
    pub condition: f64,
    /// Sigma of each parameter of the triad.
    pub sigma_per_parameter: Vec<ParameterSigma>,
    /// Geometric mean of the semi-axes of the parameters' one-sigma ellipsoid, normalised: SI unit of the sensor at full input. Infinite
    /// if singular.
    pub mean_sigma: f64,
    /// Names of the parameters that it does not determine.
    pub undetermined: Vec<String>,
    /// Residual degrees of freedom.
    pub dof: Freedom,
    /// Length of a dwell, s.
    pub dwell_s: f64,
    /// Sigma of a dwell mean, SI.
    pub dwell_sigma: Quantity,
    /// Noise that this follows from; `None` if it was given.
    pub noise: Option<DwellNoise>,
    /// Whose noise was assumed, because none was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assumed_noise: Option<&'static str>,
    /// `randomised`.
    pub order: &'static str,
    /// Time of the moves between the dwells, s.
    pub moves_s: f64,
    /// Time of all dwells and moves, s.
    pub time_s: f64,
    /// Ways to spend a budget.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget: Option<Spent>,
    /// The prior that it counts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<BesidePopulation>,
    #[serde(skip)]
    settings: Vec<Setting>,
    #[serde(skip)]
    fixture: Fixture,
}

/// A value and its unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quantity {
    /// Value in that unit.
    pub value: f64,
    /// SI unit.
    pub unit: &'static str,
}

/// How well a parameter is determined.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterSigma {
    /// `b_x`, `P_xy`, `C_yx`, ...
    pub name: String,
    /// Sigma, SI; infinite, null in JSON, if it is not determined.
    pub value: f64,
    /// Unit of that; "1" for a ratio.
    pub unit: &'static str,
    /// Half of the 95 % interval if the noise is known, SI.
    pub half_width_95: f64,
    /// The same before the first dwell, by the prior alone; infinite, null in JSON, if that says nothing. `None` without a prior.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub population_half_width_95: Option<f64>,
    /// The same in the unit of data sheets.
    pub data_sheet: DataSheet,
    /// Sigma over that if all the other parameters were known.
    pub inflation: f64,
}

/// Half of a 95 % interval in the unit of data sheets.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DataSheet {
    /// Half width in that unit.
    pub half_width_95: f64,
    /// The same before the first dwell, by the prior alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub population_half_width_95: Option<f64>,
    /// mg, deg/s, ppm, µrad.
    pub unit: Cow<'static, str>,
}

/// Residual degrees of freedom of a regression.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Freedom {
    /// From different inputs: these reveal a wrong model.
    pub lack_of_fit: usize,
    /// From repeated inputs: these show the noise, whatever the model.
    pub repetition: usize,
}

/// How a budget is spent, and the alternatives.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spent {
    /// The budget, s.
    pub time_s: f64,
    /// The way with the smallest mean sigma.
    pub best: Spending,
    /// The best with each number of dwells in a pass.
    pub ways: Vec<Spending>,
    /// What the variance of a dwell mean consists of.
    pub shares: Shares,
}

impl Design {
    /// Whether a person holds the unit.
    pub fn is_by_hand(&self) -> bool {
        self.fixture == Fixture::Hand
    }

    /// The result of `judgement`.
    pub fn new(problem: &Problem, judgement: Judgement, conditions: Conditions) -> Self {
        let model = &problem.reach.model;
        let sigma = judgement.sigma;
        let alone = problem.population().map(|_| problem.judge(&[], sigma));
        let parameters = judgement.parameters.iter().enumerate().map(|(k, p)| {
            let half = |factor: f64| NORMAL_95 * p.sigma * factor;
            let alone = alone.as_ref().map(|a| NORMAL_95 * a.parameters[k].sigma);
            ParameterSigma {
                name: p.parameter.name.clone(),
                value: p.sigma * p.parameter.si,
                unit: p.parameter.unit,
                half_width_95: half(p.parameter.si),
                population_half_width_95: alone.map(|a| a * p.parameter.si),
                data_sheet: DataSheet {
                    half_width_95: half(p.parameter.shown),
                    population_half_width_95: alone.map(|a| a * p.parameter.shown),
                    unit: p.parameter.shown_unit.clone(),
                },
                inflation: p.inflation,
            }
        });
        let settings = judgement.settings.iter();
        let moves_s = conditions.motion.moves_s(&judgement.settings);
        Self {
            format: "mimu-design/1",
            tool: TOOL,
            title: conditions.title,
            sensor: model.sensor,
            reference: model.reference,
            table: problem.reach.fixture.name(),
            positions: settings.clone().map(|s| s.up.into()).collect(),
            rates_dps: (model.sensor == Sensor::Gyro)
                .then(|| settings.map(|s| s.rate.to_degrees()).collect()),
            d_efficiency: judgement.d_efficiency,
            determinant: judgement.determinant,
            condition: judgement.condition,
            sigma_per_parameter: parameters.collect(),
            mean_sigma: judgement.mean_sigma,
            undetermined: judgement.undetermined(),
            dof: Freedom {
                lack_of_fit: judgement.lack_of_fit_dof,
                repetition: judgement.repetition_dof,
            },
            dwell_s: conditions.dwell_s,
            dwell_sigma: Quantity {
                value: sigma,
                unit: model.sensor.unit(),
            },
            noise: conditions.noise,
            assumed_noise: conditions.assumed_noise,
            order: RANDOMISED,
            moves_s,
            time_s: moves_s + conditions.dwell_s * judgement.settings.len() as f64,
            budget: None,
            prior: None,
            fixture: problem.reach.fixture,
            settings: judgement.settings,
        }
    }

    /// The same, marked as the best way to spend a budget with this noise.
    pub fn within(mut self, time_s: f64, noise: &DwellNoise, budget: &Budget) -> Self {
        self.budget = Some(Spent {
            time_s,
            best: budget.best.clone(),
            ways: budget.by_size.clone(),
            shares: noise.shares(budget.best.dwell_s),
        });
        self
    }

    /// Sensor, model, reference and table in one line.
    pub fn subject(&self) -> String {
        let reference = match self.reference {
            Reference::Table => "known input",
            Reference::Gravity | Reference::TurntableRate => "magnitude of gravity",
        };
        format!("{}, {reference}, {}", self.sensor, self.table)
    }

    /// Plan of the design, `mimu-plan/1`, with moves at `slew` rad/s.
    pub fn plan(&self, slew: f64) -> String {
        let quality = match &self.prior {
            Some(prior) => format!("with a prior of {} units", prior.units),
            None => format!("D-efficiency {:.4}", self.d_efficiency),
        };
        let about = format!(
            "{}: {}\n{quality}, {} in a randomised order with moves at {} deg/s",
            self.subject(),
            self.title,
            minutes(self.time_s),
            significant(slew.to_degrees()),
        );
        let settings = self.settings.iter();
        let steps = settings.map(|s| Step::of(s, self.dwell_s)).collect();
        Plan::new(self.fixture, SAMPLE_RATE_HZ, steps).to_toml(&about)
    }
}
