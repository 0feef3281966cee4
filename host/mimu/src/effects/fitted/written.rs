//! An effect as written in files: a table of named numbers with their units.

use serde::{Deserialize, Serialize};

use super::{FittedEffect, Interval};
use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::quantity::Quantity;
use crate::effects::regressor::Product;
use crate::quantity::{AXES, Sensor, significant};

/// How the coefficients of an effect are applied: e is the error of the three sensors, S is diagonal with the norms of the rows of P.
const FORMULA: &str = "x = C (u - S e) + o, e_i = sum of coefficient * regressor";
const DIRECTION: &str = "raw to SI";

/// An effect in a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenEffect {
    /// Public id.
    id: String,
    /// Triad whose readings err.
    #[cfg_attr(feature = "schema", schemars(with = "String", extend("enum" = ["gyro", "accel"])))]
    sensor: Sensor,
    /// Physics in a line.
    about: String,
    /// How it is applied.
    formula: String,
    /// `raw to SI`.
    direction: String,
    /// Its nonlinear parameter, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    nonlinear_parameter: Option<WrittenParameter>,
    /// Those that the experiment determined; the others are zero.
    coefficients: Vec<WrittenCoefficient>,
}

/// A nonlinear parameter in a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct WrittenParameter {
    /// Name, with the unit.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Lower end of its 95 % interval; `None` if the interval includes the smallest value that was tried, or is not known.
    #[serde(default)]
    pub lower: Option<f64>,
    /// Upper end; `None` if the interval includes the largest value, or is not known.
    #[serde(default)]
    pub upper: Option<f64>,
    /// Smallest value that is tried.
    #[serde(default)]
    pub from: f64,
    /// Largest.
    #[serde(default)]
    pub to: f64,
}

/// A coefficient in a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct WrittenCoefficient {
    /// Name within the effect.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Standard deviation; a device keeps none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// Size in data sheets; `None` for a product found from the data.
    #[serde(default)]
    pub typical: Option<f64>,
    /// SI unit of all three.
    pub unit: String,
}

impl From<FittedEffect> for WrittenEffect {
    fn from(effect: FittedEffect) -> Self {
        Self {
            id: effect.id(),
            sensor: effect.sensor(),
            about: effect.candidate.about().into(),
            formula: FORMULA.into(),
            direction: DIRECTION.into(),
            nonlinear_parameter: effect.nonlinear_parameter(),
            coefficients: effect.coefficients(),
        }
    }
}

impl TryFrom<WrittenEffect> for FittedEffect {
    type Error = String;

    fn try_from(written: WrittenEffect) -> Result<Self, String> {
        let id = written.id.clone();
        let read = written.read();
        read.map_err(|problem| format!("[[effect]] {id}: {problem}"))
    }
}

impl WrittenParameter {
    /// Its 95 % interval for people: `55.2 to 66.1`, `at most 12`.
    pub fn interval(&self) -> String {
        match [self.lower, self.upper].map(|end| end.map(significant)) {
            [Some(lower), Some(upper)] => format!("{lower} to {upper}"),
            [None, Some(upper)] => format!("at most {upper}"),
            [Some(lower), None] => format!("at least {lower}"),
            [None, None] => "the whole searched range".into(),
        }
    }
}

impl WrittenEffect {
    /// The effect that is written, or what is wrong.
    fn read(self) -> Result<FittedEffect, String> {
        let candidate = candidate(&self.id);
        let mut candidate = candidate.ok_or("this version does not know an effect of this id")?;
        if self.formula != FORMULA || self.direction != DIRECTION {
            return Err(format!(
                "formula {:?}, direction {:?}: only {FORMULA:?}, {DIRECTION}, can be applied",
                self.formula, self.direction
            ));
        }
        if self.sensor != candidate.sensor {
            return Err(format!(
                "sensor is \"{}\", and this is an effect of the {}",
                self.sensor, candidate.sensor
            ));
        }
        let parameter = match (
            candidate.parameter().map(|p| p.name),
            &self.nonlinear_parameter,
        ) {
            (None, None) => 0.0,
            (Some(name), Some(f)) if f.name == name && f.value > 0.0 && f.value.is_finite() => {
                f.value
            }
            (Some(name), _) => {
                return Err(format!(
                    "nonlinear_parameter has to be {name}, a positive number"
                ));
            }
            (None, Some(f)) => {
                return Err(format!(
                    "nonlinear_parameter is {:?}, but this effect has no nonlinear parameter",
                    f.name
                ));
            }
        };
        let known = candidate.names();
        let mut numbers = vec![None; known.len()];
        for c in &self.coefficients {
            let Some(at) = known.iter().position(|(name, _)| *name == c.name) else {
                let names: Vec<&str> = known.iter().map(|(name, _)| name.as_str()).collect();
                return Err(format!(
                    "unknown coefficient {:?}; its coefficients are {}",
                    c.name,
                    names.join(", ")
                ));
            };
            let unit = &known[at].1;
            if c.unit != *unit {
                return Err(format!(
                    "unit of {:?} is {:?}, not {unit:?}",
                    c.name, c.unit
                ));
            }
            let sigma = c.sigma.unwrap_or_default();
            if !c.value.is_finite() || !(sigma >= 0.0) || !sigma.is_finite() {
                return Err(format!("value or sigma of {:?} is not a number", c.name));
            }
            if numbers[at].replace((c.value, c.sigma)).is_some() {
                return Err(format!("coefficient {:?} occurs twice", c.name));
            }
        }
        candidate.active.retain(|k| numbers[*k].is_some());
        if candidate.active.is_empty() {
            return Err("it has no coefficients".into());
        }
        let (values, sigmas): (Vec<f64>, Vec<Option<f64>>) = numbers.into_iter().flatten().unzip();
        let sigmas: Option<Vec<f64>> = sigmas.into_iter().collect();
        let interval = self
            .nonlinear_parameter
            .filter(|f| f.lower.is_some() || f.upper.is_some());
        Ok(FittedEffect {
            candidate,
            parameter,
            interval: interval.map(|f| Interval {
                lower: f.lower,
                upper: f.upper,
            }),
            values,
            sigmas: sigmas.unwrap_or_default(),
        })
    }
}

/// The candidate of an id that a calibration may contain, with all of its coefficients.
pub(crate) fn candidate(id: &str) -> Option<Candidate> {
    let Some(term) = id.strip_prefix("term:") else {
        let effect = crate::effects::by_id(id).filter(|e| e.is_error() && !e.is_of_session())?;
        return Some(Candidate::new(effect.sensor, CandidateKind::Effect(effect)));
    };
    let (of, product) = term.split_once('~')?;
    let (sensor, axis) = of.split_once('_')?;
    let sensor: Sensor = sensor.parse().ok()?;
    let axis = AXES.iter().position(|a| *a == axis)?;
    let mut quantities = Vec::new();
    for factor in product.split('*') {
        let (name, power) = factor.split_once('^').unwrap_or((factor, "1"));
        let power: usize = power.parse().ok().filter(|p| *p <= 3)?;
        let mut all = Quantity::OF_TERMS.into_iter();
        let quantity = all.find(|q| q.name().as_deref() == Some(name))?;
        quantities.extend(std::iter::repeat_n(quantity, power));
    }
    // Each product has one valid spelling.
    let term = Product::term(&quantities).filter(|p| p.name() == product)?;
    Some(Candidate::new(sensor, CandidateKind::Term(axis, term)))
}
