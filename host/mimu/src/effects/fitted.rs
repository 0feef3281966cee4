//! An effect with its numbers, used from the decision on it to the calibration file, the result of a diagnosis and the device.

mod on_device;
mod written;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::candidate::{Candidate, CandidateKind};
use super::effect::NonlinearParameter;
use super::quantity::{Conditions, Need};
use crate::quantity::{Sensor, rounded};
use written::WrittenEffect;

pub use on_device::NotOnDevice;
pub(crate) use written::candidate;
pub use written::{WrittenCoefficient, WrittenParameter};

/// An effect with its numbers.
///
/// In files it is a table of named numbers with their units.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(into = "WrittenEffect", try_from = "WrittenEffect")]
pub struct FittedEffect {
    /// The effect, with the coefficients that are not zero.
    pub candidate: Candidate,
    /// Its nonlinear parameter, 0 if it has none.
    pub parameter: f64,
    /// 95 % interval of its nonlinear parameter; `None` if it has none, or if it is not known.
    pub interval: Option<Interval>,
    /// Coefficients, SI, in the order of the candidate's active ones.
    pub values: Vec<f64>,
    /// Their standard deviations, which include the uncertainty of the nonlinear parameter; empty if unknown, as on a device.
    pub sigmas: Vec<f64>,
}

/// A 95 % interval of a nonlinear parameter by the profile of its likelihood, in the unit of the parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Lower end; `None` if the interval includes the smallest value that is searched.
    pub lower: Option<f64>,
    /// Upper end; `None` if it includes the largest.
    pub upper: Option<f64>,
}

impl FittedEffect {
    /// An effect without interval and standard deviations.
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

    /// The effect without the coefficients that are specific to its recording.
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

    /// The effect with its standard deviations rounded to this many digits.
    pub(crate) fn with_digits(mut self, digits: usize) -> Self {
        // -0.0 becomes 0.0.
        self.values.iter_mut().for_each(|v| *v += 0.0);
        let sigmas = self.sigmas.iter_mut();
        sigmas.for_each(|s| *s = rounded(*s, digits));
        self
    }

    /// Whether it depends only on the input of its own sensor. Errors that depend on the converter's code do not count.
    pub fn is_of_own_input(&self) -> bool {
        let sensor = self.candidate.sensor;
        let need = sensor.pick(Need::Rate, Need::Force);
        let regressors = self.candidate.slot_regressors();
        let mut quantities = regressors.iter().flat_map(|r| r.quantities()).peekable();
        let any = quantities.peek().is_some();
        any && quantities.all(|q| q.needs(need, sensor))
    }

    /// Adds its errors of the three axes, SI.
    pub(super) fn add(&self, at: &Conditions, error: &mut Vector3<f64>) {
        self.candidate
            .add_error(at, self.parameter, &self.values, error);
    }

    /// Its coefficients by name.
    pub fn coefficients(&self) -> Vec<WrittenCoefficient> {
        let candidate = &self.candidate;
        let typical = |k: usize| match candidate.kind {
            CandidateKind::Effect(e) => e.coefficients.get(k).map(|c| c.typical),
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
    pub fn nonlinear_parameter(&self) -> Option<WrittenParameter> {
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

    /// Adds it to the effects of a unit. Known effects were removed before this one was found, so coefficients of the same law add up. The same law
    /// with another time constant is a separate effect.
    pub fn join(self, all: &mut Vec<Self>) {
        let same = |e: &&mut Self| e.id() == self.id() && e.parameter == self.parameter;
        let Some(known) = all.iter_mut().find(same) else {
            all.push(self);
            return;
        };
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
    }
}

/// Equal if both are written alike.
impl PartialEq for FittedEffect {
    fn eq(&self, other: &Self) -> bool {
        WrittenEffect::from(self.clone()) == WrittenEffect::from(other.clone())
    }
}

#[cfg(test)]
mod tests;
