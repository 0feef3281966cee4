//! An effect as written in files: a table of named numbers with their units.

use mimu_core::effects::FARTHEST_ZERO;
use serde::{Deserialize, Serialize};

use super::{FittedEffect, Interval};
use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::converter::{Converter, Converters};
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
    /// For errors that depend on the code: one converter for all axes, or one for each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    converters: Vec<WrittenConverter>,
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

/// Relation between a converter's codes and readings, as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct WrittenConverter {
    /// Axes whose readings it gives: x, y or z, or xyz.
    pub axes: String,
    /// Weight of its first bit, raw.
    pub weight_of_bit_0_raw: f64,
    /// Reading of its code 0, raw.
    pub reading_of_code_0_raw: f64,
    /// 95 % uncertainty of `reading_of_code_0_raw`, raw; 0 if that is taken as given, as every diagnosis does now.
    pub reading_of_code_0_within_raw: f64,
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
            converters: effect.converters(),
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

impl WrittenConverter {
    /// Converters of the axes: one for each, or one if all are the same.
    pub(super) fn of(codes: &Converters) -> Vec<Self> {
        let one = |axes: &str, converter: &Converter| Self {
            axes: axes.into(),
            weight_of_bit_0_raw: converter.weight,
            reading_of_code_0_raw: converter.zero,
            reading_of_code_0_within_raw: 0.0,
        };
        match codes {
            [Some(x), Some(y), Some(z)] if x == y && y == z => vec![one("xyz", x)],
            _ => {
                let each = AXES.iter().zip(codes);
                each.filter_map(|(axis, c)| Some(one(axis, c.as_ref()?)))
                    .collect()
            }
        }
    }

    /// The converters of the axes, or what is wrong.
    fn codes(all: &[Self]) -> Result<Converters, String> {
        let mut codes: Converters = [None; 3];
        for one in all {
            let ours: Vec<usize> = match one.axes.as_str() {
                "xyz" => (0..3).collect(),
                axes => AXES.iter().position(|a| *a == axes).into_iter().collect(),
            };
            if ours.is_empty() {
                return Err(format!(
                    "a converter: axes is {:?}; write x, y, z or xyz",
                    one.axes
                ));
            }
            let (weight, zero) = (one.weight_of_bit_0_raw, one.reading_of_code_0_raw);
            let within = one.reading_of_code_0_within_raw;
            let farthest = FARTHEST_ZERO * weight;
            let wrong = if !(weight > 0.0 && weight.is_finite()) {
                Some((
                    "weight_of_bit_0_raw",
                    weight,
                    "has to be a positive number".into(),
                ))
            } else if !(zero.abs() <= farthest) {
                let why = format!(
                    "has to be from {:e} to {farthest:e}: beyond, single precision does not distinguish the codes",
                    -farthest
                );
                Some(("reading_of_code_0_raw", zero, why))
            } else if !(within >= 0.0 && within.is_finite()) {
                Some((
                    "reading_of_code_0_within_raw",
                    within,
                    "has to be a number that is not negative".into(),
                ))
            } else {
                None
            };
            if let Some((key, value, why)) = wrong {
                return Err(format!(
                    "converter of {}: {key} is {value:?}, and {why}",
                    one.axes
                ));
            }
            for axis in ours {
                let converter = Converter::of(weight, zero);
                if codes[axis].replace(converter).is_some() {
                    return Err(format!("there are two converters of {}", AXES[axis]));
                }
            }
        }
        Ok(codes)
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
        candidate.codes = WrittenConverter::codes(&self.converters)?;
        match (candidate.reads_code(), self.converters.is_empty()) {
            (true, true) => return Err("it has no converters".into()),
            (false, false) => {
                return Err(
                    "it has converters, although the effect does not depend on their codes".into(),
                );
            }
            _ => {}
        }
        if candidate.reads_code() {
            let axes = candidate.axes();
            for (axis, name) in AXES.iter().enumerate() {
                match (axes.contains(&axis), candidate.codes[axis]) {
                    (true, None) => {
                        return Err(format!("{name} has coefficients and no converter"));
                    }
                    (false, Some(_)) => {
                        return Err(format!("{name} has a converter and no coefficients"));
                    }
                    _ => {}
                }
            }
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
