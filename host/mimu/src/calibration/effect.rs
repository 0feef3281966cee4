//! Effects in a calibration file.

use mimu_core::effects::FARTHEST_ZERO;
use serde::{Deserialize, Serialize};

use super::Calibration;
use crate::effects;
use crate::effects::candidate::{Candidate, Kind};
use crate::effects::converter::{Codes, Converter};
use crate::effects::quantity::{Need, Quantity};
use crate::effects::regressor::Product;
use crate::effects::removal::Removed;
use crate::quantity::AXES;
use crate::quantity::Sensor;
use mimu_recording::error::{Error, Result};

/// How the coefficients of an effect are applied: e is the error of the three sensors, S the norms of the rows of P.
pub(super) const FORMULA: &str = "x = C (u - S e) + o, e_i = sum of coefficient * regressor";
pub(super) const DIRECTION: &str = "raw to SI";

/// An effect in a calibration file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EffectTable {
    /// Public id.
    pub id: String,
    /// Sensor whose readings err.
    pub sensor: String,
    /// Physics in a line.
    pub about: String,
    /// How it is applied.
    pub formula: String,
    /// `raw to SI`.
    pub direction: String,
    /// Its nonlinear constant, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub form: Option<FormTable>,
    /// Of errors by the code: the converters, of all axes or one each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub converters: Vec<ConverterTable>,
    /// Those that the experiment determined; the others are zero.
    pub coefficients: Vec<CoefficientTable>,
}

/// Nonlinear constant of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FormTable {
    /// Name, with the unit.
    pub name: String,
    /// Value.
    pub value: f64,
}

/// How the codes of a converter stand behind readings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConverterTable {
    /// Axes whose readings it gives: x, y or z, or xyz.
    pub axes: String,
    /// Of its first bit, raw.
    pub weight_of_bit_0_raw: f64,
    /// Reading of its code 0, raw.
    pub reading_of_code_0_raw: f64,
    /// The last is known to within so much, raw, with 95 %; 0 where it is taken as given, as every diagnosis does now.
    pub reading_of_code_0_within_raw: f64,
}

impl ConverterTable {
    /// Those of some axes, in a table of its own for each unless all are the same.
    pub fn of(codes: &Codes) -> Vec<Self> {
        let table = |axes: &str, converter: &Converter| Self {
            axes: axes.into(),
            weight_of_bit_0_raw: converter.weight,
            reading_of_code_0_raw: converter.zero,
            reading_of_code_0_within_raw: 0.0,
        };
        match codes {
            [Some(x), Some(y), Some(z)] if x == y && y == z => vec![table("xyz", x)],
            _ => {
                let each = AXES.iter().zip(codes);
                each.filter_map(|(axis, c)| Some(table(axis, c.as_ref()?)))
                    .collect()
            }
        }
    }

    /// Those of the axes, or what is wrong.
    fn codes(all: &[Self]) -> std::result::Result<Codes, String> {
        let mut codes: Codes = [None; 3];
        for table in all {
            let ours: Vec<usize> = match table.axes.as_str() {
                "xyz" => (0..3).collect(),
                one => AXES.iter().position(|a| *a == one).into_iter().collect(),
            };
            if ours.is_empty() {
                return Err(format!(
                    "a converter: axes is {:?}, and has to be x, y, z or xyz",
                    table.axes
                ));
            }
            let (weight, zero) = (table.weight_of_bit_0_raw, table.reading_of_code_0_raw);
            let within = table.reading_of_code_0_within_raw;
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
                    table.axes
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

/// Coefficient of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoefficientTable {
    /// Name within the effect.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Standard deviation; a device keeps none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// Unit of both.
    pub unit: String,
}

impl EffectTable {
    /// The table of an effect whose coefficients have these standard deviations.
    ///
    /// What is of the recording alone stays out.
    pub fn new(removed: &Removed, sigmas: &[f64]) -> Self {
        let (_, sigmas) = removed.candidate.lasting(sigmas);
        let removed = &removed.lasting();
        let candidate = &removed.candidate;
        let (about, form) = match &candidate.kind {
            Kind::Effect(e) => (e.about, e.parameter),
            Kind::Term(..) => ("found from the data: the product in its id", None),
            Kind::Jump { .. } => ("the bias is another from then on", None),
        };
        let numbers = removed.values.iter().zip(sigmas);
        let coefficients = candidate.names().into_iter().zip(numbers);
        Self {
            id: candidate.id(),
            sensor: candidate.sensor.name().into(),
            about: about.into(),
            formula: FORMULA.into(),
            direction: DIRECTION.into(),
            form: form.map(|f| FormTable {
                name: f.name.into(),
                value: removed.parameter,
            }),
            converters: ConverterTable::of(&candidate.codes),
            coefficients: coefficients
                .map(|((name, unit), (value, sigma))| CoefficientTable {
                    name,
                    value: *value,
                    sigma: Some(sigma),
                    unit,
                })
                .collect(),
        }
    }

    /// Adds it to the effects of a unit. One that is known there was taken out before this was found, so that it is what is left of it:
    /// of the same law the coefficients add up. Another time constant is another effect beside it; of codes an axis has one converter.
    /// Refused is a second one, in words.
    pub fn join(self, all: &mut Vec<Self>) -> std::result::Result<(), String> {
        let form = |t: &Self| t.form.as_ref().map(|f| f.value.to_bits());
        let same = |t: &&mut Self| t.id == self.id && form(t) == form(&self);
        let Some(known) = all.iter_mut().find(same) else {
            all.push(self);
            return Ok(());
        };
        if !self.converters.is_empty() {
            return Err(format!(
                "[[effect]] {}: what is left of it is of another converter, and an axis has one",
                self.id
            ));
        }
        for more in self.coefficients {
            match known.coefficients.iter_mut().find(|c| c.name == more.name) {
                Some(c) => {
                    c.value += more.value;
                    c.sigma = c.sigma.zip(more.sigma).map(|(a, b)| a.hypot(b));
                }
                None => known.coefficients.push(more),
            }
        }
        Ok(())
    }

    /// The effect that the table states, or what is wrong and what to do.
    fn removed(&self) -> std::result::Result<Removed, (String, &'static str)> {
        const OTHER_VERSION: &str = "use the version of mimu that wrote it";
        const EDITED: &str = "diagnose the recording again";
        let mut candidate = candidate(&self.id).ok_or_else(|| {
            let problem = "this program knows no effect of this id".to_string();
            (problem, OTHER_VERSION)
        })?;
        if self.formula != FORMULA || self.direction != DIRECTION {
            let problem = format!(
                "formula {:?}, direction {:?}: only {FORMULA:?}, {DIRECTION}, can be applied",
                self.formula, self.direction
            );
            return Err((problem, OTHER_VERSION));
        }
        if self.sensor != candidate.sensor.name() {
            let problem = format!(
                "sensor is {:?}, and this is an effect of the {}",
                self.sensor, candidate.sensor
            );
            return Err((problem, EDITED));
        }
        let wanted = candidate.parameter().map(|p| p.name);
        let form = match (wanted, &self.form) {
            (None, None) => 0.0,
            (Some(name), Some(f)) if f.name == name && f.value > 0.0 && f.value.is_finite() => {
                f.value
            }
            (Some(name), _) => {
                let problem = format!("form has to be {name}, a positive number");
                return Err((problem, EDITED));
            }
            (None, Some(f)) => {
                let problem = format!(
                    "form {:?} is there, and an effect of this id has none now",
                    f.name
                );
                return Err((problem, EDITED));
            }
        };
        let known = candidate.names();
        let mut values = vec![None; known.len()];
        for c in &self.coefficients {
            let Some(at) = known.iter().position(|(name, _)| *name == c.name) else {
                let names: Vec<&str> = known.iter().map(|(name, _)| name.as_str()).collect();
                let problem = format!(
                    "coefficient {:?} is none of its: {}",
                    c.name,
                    names.join(", ")
                );
                return Err((problem, EDITED));
            };
            let unit = &known[at].1;
            if c.unit != *unit {
                let problem = format!("unit of {:?} is {:?}, not {unit:?}", c.name, c.unit);
                return Err((problem, EDITED));
            }
            let sigma = c.sigma.unwrap_or_default();
            if !c.value.is_finite() || !(sigma >= 0.0) || !sigma.is_finite() {
                let problem = format!("value or sigma of {:?} is not a number", c.name);
                return Err((problem, EDITED));
            }
            if values[at].replace(c.value).is_some() {
                return Err((format!("coefficient {:?} is there twice", c.name), EDITED));
            }
        }
        candidate.active.retain(|k| values[*k].is_some());
        if candidate.active.is_empty() {
            return Err(("it has no coefficients".into(), EDITED));
        }
        candidate.codes = ConverterTable::codes(&self.converters).map_err(|e| (e, EDITED))?;
        if candidate.reads_code() != !self.converters.is_empty() {
            let problem = match candidate.reads_code() {
                true => "it has no converters",
                false => "it has converters, and is no effect of their codes",
            };
            return Err((problem.into(), EDITED));
        }
        if candidate.reads_code() {
            let axes = candidate.axes();
            for (axis, name) in AXES.iter().enumerate() {
                let problem = match (axes.contains(&axis), candidate.codes[axis]) {
                    (true, None) => format!("{name} has coefficients and no converter"),
                    (false, Some(_)) => format!("{name} has a converter and no coefficients"),
                    _ => continue,
                };
                return Err((problem, EDITED));
            }
        }
        Ok(Removed {
            candidate,
            parameter: form,
            values: values.into_iter().flatten().collect(),
        })
    }
}

/// The candidate of an id, with all of its coefficients.
pub(super) fn candidate(id: &str) -> Option<Candidate> {
    let Some(term) = id.strip_prefix("term:") else {
        let effect = effects::by_id(id).filter(|e| e.is_error() && !e.is_of_session())?;
        return Some(Candidate::new(effect.sensor, Kind::Effect(effect)));
    };
    let (of, product) = term.split_once('~')?;
    let (sensor, axis) = of.split_once('_')?;
    let sensor = Sensor::BOTH.into_iter().find(|s| s.name() == sensor)?;
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

/// Checks the effect tables of a calibration and gives what they state; `place` is its path.
pub(super) fn read(calibration: &Calibration, place: &str) -> Result<Vec<Removed>> {
    let mut all: Vec<Removed> = Vec::new();
    for table in &calibration.effect_tables {
        let refuse = |problem: String, remedy: &str| {
            Error::new(format!("{place}, [[effect]] {}", table.id), problem, remedy)
        };
        let removed = table
            .removed()
            .map_err(|(problem, remedy)| refuse(problem, remedy))?;
        if all
            .iter()
            .any(|r| r.candidate.id() == table.id && r.parameter == removed.parameter)
        {
            return Err(refuse(
                "it is there twice".into(),
                "diagnose the recording again",
            ));
        }
        for (sensor, need) in [(Sensor::Gyro, Need::Rate), (Sensor::Accel, Need::Force)] {
            let needed = removed.candidate.sensor == sensor || removed.candidate.needs(need);
            if needed && calibration.table(sensor).is_none() {
                let problem =
                    format!("it cannot be removed without [{sensor}], which is not there");
                return Err(refuse(problem, "diagnose a recording of both sensors"));
            }
        }
        all.push(removed);
    }
    Ok(all)
}

#[cfg(test)]
mod tests;
