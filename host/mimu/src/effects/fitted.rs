//! An effect with its numbers, from the decision on it to the calibration file, the result of a diagnosis and the device.

use mimu_core::effects::FARTHEST_ZERO;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::candidate::{Candidate, Kind};
use super::converter::{Codes, Converter};
use super::effect::NonlinearParameter;
use super::quantity::{Conditions, Need, Quantity};
use super::regressor::Product;
use crate::quantity::{AXES, Sensor, rounded, significant};

/// How the coefficients of an effect are applied: e is the error of the three sensors, S the norms of the rows of P.
const FORMULA: &str = "x = C (u - S e) + o, e_i = sum of coefficient * regressor";
const DIRECTION: &str = "raw to SI";

/// An effect with its numbers.
///
/// In files it is a [table](WrittenEffect) of named numbers with their units.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(into = "WrittenEffect", try_from = "WrittenEffect")]
pub struct FittedEffect {
    /// Which, with the coefficients that are not zero.
    pub candidate: Candidate,
    /// Its nonlinear parameter, 0 if it has none.
    pub parameter: f64,
    /// 95 % interval of its nonlinear parameter; `None` where it has none, or it is not known.
    pub interval: Option<Interval>,
    /// Coefficients, SI, in the order of the candidate's active ones.
    pub values: Vec<f64>,
    /// Their standard deviations, whatever the nonlinear parameter is; empty where they are not known, as on a device.
    pub sigmas: Vec<f64>,
}

/// A 95 % interval of a nonlinear parameter by the profile of its likelihood, in the unit of the parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Lower end; `None` where the smallest value that is looked at is within the interval.
    pub lower: Option<f64>,
    /// Upper end; `None` where the largest is.
    pub upper: Option<f64>,
}

/// An effect as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenEffect {
    /// Public id.
    id: String,
    /// Triad whose readings err.
    sensor: Sensor,
    /// Physics in a line.
    about: String,
    /// How it is applied.
    formula: String,
    /// `raw to SI`.
    direction: String,
    /// Its nonlinear parameter, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    form: Option<WrittenParameter>,
    /// Of errors by the code: the converters, of all axes or one each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    converters: Vec<WrittenConverter>,
    /// Those that the experiment determined; the others are zero.
    coefficients: Vec<WrittenCoefficient>,
}

/// A nonlinear parameter as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WrittenParameter {
    /// Name, with the unit.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Lower end of its 95 % interval; `None` where the smallest value that was tried is within, or it is not known.
    #[serde(default)]
    pub lower: Option<f64>,
    /// Upper end; `None` where the largest is within, or it is not known.
    #[serde(default)]
    pub upper: Option<f64>,
    /// Smallest value that is tried.
    #[serde(default)]
    pub from: f64,
    /// Largest.
    #[serde(default)]
    pub to: f64,
}

/// How the codes of a converter stand behind readings, as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WrittenConverter {
    /// Axes whose readings it gives: x, y or z, or xyz.
    pub axes: String,
    /// Of its first bit, raw.
    pub weight_of_bit_0_raw: f64,
    /// Reading of its code 0, raw.
    pub reading_of_code_0_raw: f64,
    /// The last is known to within so much, raw, with 95 %; 0 where it is taken as given, as every diagnosis does now.
    pub reading_of_code_0_within_raw: f64,
}

/// A coefficient as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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

impl FittedEffect {
    /// One of which nothing but its numbers is known.
    pub fn new(candidate: Candidate, parameter: f64, values: Vec<f64>) -> Self {
        Self {
            candidate,
            parameter,
            interval: None,
            values,
            sigmas: Vec::new(),
        }
    }

    /// Public id.
    pub fn id(&self) -> String {
        self.candidate.id()
    }

    /// Triad whose readings err.
    pub fn sensor(&self) -> Sensor {
        self.candidate.sensor
    }

    /// It without what is of the recording that it was found in alone.
    pub fn lasting(&self) -> Self {
        let (candidate, values) = self.candidate.lasting(&self.values);
        let (_, sigmas) = self.candidate.lasting(&self.sigmas);
        Self {
            candidate,
            values,
            sigmas,
            ..self.clone()
        }
    }

    /// It with its standard deviations to so many digits.
    pub(crate) fn with_digits(mut self, digits: usize) -> Self {
        // Of the two zeros there is one.
        self.values.iter_mut().for_each(|v| *v += 0.0);
        let sigmas = self.sigmas.iter_mut();
        sigmas.for_each(|s| *s = rounded(*s, digits));
        self
    }

    /// Whether it is a function of its sensor's own input alone, other than what the converter makes of it.
    pub fn is_of_own_input(&self) -> bool {
        let sensor = self.candidate.sensor;
        let need = match sensor {
            Sensor::Gyro => Need::Rate,
            Sensor::Accel => Need::Force,
        };
        let regressors = self.candidate.slot_regressors();
        let mut quantities = regressors.iter().flat_map(|r| r.quantities()).peekable();
        let any = quantities.peek().is_some();
        any && quantities.all(|q| q.needs(need, sensor))
    }

    /// Adds its error of the three axes, SI.
    pub(super) fn add(&self, at: &Conditions, error: &mut Vector3<f64>) {
        self.candidate
            .add_error(at, self.parameter, &self.values, error);
    }

    /// Its coefficients by name.
    pub fn coefficients(&self) -> Vec<WrittenCoefficient> {
        let candidate = &self.candidate;
        let typical = |k: usize| match candidate.kind {
            Kind::Effect(e) => e.coefficients.get(k).map(|c| c.typical),
            _ => None,
        };
        let names = candidate.names().into_iter().zip(&candidate.active);
        let each = names.zip(&self.values).enumerate();
        each.map(|(at, (((name, unit), k), value))| WrittenCoefficient {
            name,
            value: *value,
            sigma: self.sigmas.get(at).copied(),
            typical: typical(*k),
            unit,
        })
        .collect()
    }

    /// Its nonlinear parameter by name.
    pub fn form(&self) -> Option<WrittenParameter> {
        let NonlinearParameter { name, from, to, .. } = self.candidate.parameter()?;
        Some(WrittenParameter {
            name: name.into(),
            value: self.parameter,
            lower: self.interval.and_then(|i| i.lower),
            upper: self.interval.and_then(|i| i.upper),
            from,
            to,
        })
    }

    /// Its converters: one of all axes, or one of each.
    pub fn converters(&self) -> Vec<WrittenConverter> {
        WrittenConverter::of(&self.candidate.codes)
    }

    /// Adds it to the effects of a unit. One that is known there was taken out before this was found, so that it is what is left of it:
    /// of the same law the coefficients add up. Another time constant is another effect beside it; of codes an axis has one converter.
    /// Refused is a second one, in words.
    pub fn join(self, all: &mut Vec<Self>) -> Result<(), String> {
        let same = |e: &&mut Self| e.id() == self.id() && e.parameter == self.parameter;
        let Some(known) = all.iter_mut().find(same) else {
            all.push(self);
            return Ok(());
        };
        if self.candidate.reads_code() {
            return Err(format!(
                "[[effect]] {}: what is left of it is of another converter, and an axis has one",
                self.id()
            ));
        }
        let sigmas =
            known.sigmas.len() == known.values.len() && self.sigmas.len() == self.values.len();
        for (at, (k, value)) in self.candidate.active.iter().zip(&self.values).enumerate() {
            let active = &mut known.candidate.active;
            let place = active.iter().position(|a| a == k).unwrap_or_else(|| {
                active.push(*k);
                known.values.push(0.0);
                known.sigmas.push(0.0);
                active.len() - 1
            });
            known.values[place] += value;
            if sigmas {
                known.sigmas[place] = known.sigmas[place].hypot(self.sigmas[at]);
            }
        }
        if !sigmas {
            known.sigmas.clear();
        }
        Ok(())
    }
}

/// What is written of both is the same.
impl PartialEq for FittedEffect {
    fn eq(&self, other: &Self) -> bool {
        WrittenEffect::from(self.clone()) == WrittenEffect::from(other.clone())
    }
}

impl From<FittedEffect> for WrittenEffect {
    fn from(effect: FittedEffect) -> Self {
        Self {
            id: effect.id(),
            sensor: effect.sensor(),
            about: effect.candidate.about().into(),
            formula: FORMULA.into(),
            direction: DIRECTION.into(),
            form: effect.form(),
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
            [None, None] => "any that was tried".into(),
        }
    }
}

impl WrittenConverter {
    /// Those of some axes, one for each unless all are the same.
    fn of(codes: &Codes) -> Vec<Self> {
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

    /// Those of the axes, or what is wrong.
    fn codes(all: &[Self]) -> Result<Codes, String> {
        let mut codes: Codes = [None; 3];
        for one in all {
            let ours: Vec<usize> = match one.axes.as_str() {
                "xyz" => (0..3).collect(),
                axes => AXES.iter().position(|a| *a == axes).into_iter().collect(),
            };
            if ours.is_empty() {
                return Err(format!(
                    "a converter: axes is {:?}, and has to be x, y, z or xyz",
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
                    "has to be from {:e} to {farthest:e}: farther, readings of single precision do not tell codes apart",
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
    /// What it states, or what is wrong.
    fn read(self) -> Result<FittedEffect, String> {
        let candidate = candidate(&self.id);
        let mut candidate = candidate.ok_or("this program knows no effect of this id")?;
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
        let parameter = match (candidate.parameter().map(|p| p.name), &self.form) {
            (None, None) => 0.0,
            (Some(name), Some(f)) if f.name == name && f.value > 0.0 && f.value.is_finite() => {
                f.value
            }
            (Some(name), _) => return Err(format!("form has to be {name}, a positive number")),
            (None, Some(f)) => {
                return Err(format!(
                    "form {:?} is there, and an effect of this id has none now",
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
                    "coefficient {:?} is none of its: {}",
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
                return Err(format!("coefficient {:?} is there twice", c.name));
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
                return Err("it has converters, and is no effect of their codes".into());
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
        let interval = self.form.filter(|f| f.lower.is_some() || f.upper.is_some());
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

/// The candidate of an id that a calibration may hold, with all of its coefficients.
pub(crate) fn candidate(id: &str) -> Option<Candidate> {
    let Some(term) = id.strip_prefix("term:") else {
        let effect = super::by_id(id).filter(|e| e.is_error() && !e.is_of_session())?;
        return Some(Candidate::new(effect.sensor, Kind::Effect(effect)));
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
    // One spelling for each.
    let term = Product::term(&quantities).filter(|p| p.name() == product)?;
    Some(Candidate::new(sensor, Kind::Term(axis, term)))
}

#[cfg(test)]
mod tests;
