//! One `[[effect]]` of a rig file: what may be stated, and how a drawn one is written.

use std::collections::BTreeMap;

use super::EffectFile;
use super::check::Bad;
use crate::effects::{EffectTruth, Parameter, Shape, Spec, spec, specs};

impl EffectFile {
    /// Stated numbers by key, as the kind of effect wants them; `i` counts effects from 0.
    pub(super) fn numbers(&self, i: usize) -> Result<BTreeMap<&'static str, Vec<f64>>, Bad> {
        let wrong = |key: &str, problem: String, remedy: String| Bad {
            path: format!("effect.{i}.{key}"),
            problem,
            remedy,
        };
        if self.id == "earth_rate" {
            let problem = "the Earth's rate is no effect here but the truth".to_owned();
            return Err(wrong(
                "id",
                problem,
                "write `earth_rate = true` or false at the top".to_owned(),
            ));
        }
        let Some(spec) = spec(&self.id) else {
            let known: Vec<_> = specs().map(|s| s.id).collect();
            let problem = format!("no effect is called `{}`", self.id);
            return Err(wrong("id", problem, format!("known: {}", known.join(", "))));
        };
        let mut numbers = BTreeMap::new();
        for (key, value) in &self.parameters {
            let Some(parameter) = spec.parameters.iter().find(|p| p.key == key) else {
                let keys: Vec<_> = spec.parameters.iter().map(|p| p.key).collect();
                let remedy = format!("known here: {}", keys.join(", "));
                return Err(wrong(key, format!("`{}` has no `{key}`", self.id), remedy));
            };
            let values = layout(value, parameter.shape).ok_or_else(|| {
                let form = parameter.shape.form();
                wrong(
                    key,
                    format!("`{key}` is not {form}"),
                    format!("give {form}, all finite"),
                )
            })?;
            if let Some(why) = refusal(spec, parameter, &values) {
                return Err(wrong(
                    key,
                    format!("`{key}` of `{}` is impossible", spec.id),
                    why.to_owned(),
                ));
            }
            numbers.insert(parameter.key, values);
        }
        Ok(numbers)
    }
}

/// Why these numbers cannot be, if they cannot: what to give instead.
fn refusal(spec: &Spec, parameter: &Parameter, values: &[f64]) -> Option<&'static str> {
    if parameter.shape == Shape::Cross && values.iter().step_by(4).any(|v| *v != 0.0) {
        return Some("give zeros on the diagonal");
    }
    // The form of an effect is times, frequencies and limits; the size may have any sign.
    if parameter != &spec.parameters[0] && values.iter().any(|v| !(*v > 0.0)) {
        return Some("give a number above 0");
    }
    None
}

/// The numbers of a value, row by row, if it has the shape.
fn layout(value: &toml::Value, shape: Shape) -> Option<Vec<f64>> {
    let number = |v: &toml::Value| {
        let v = v.as_float().or_else(|| v.as_integer().map(|i| i as f64));
        v.filter(|v| v.is_finite())
    };
    let row = |v: &toml::Value, n: usize| {
        let row = v.as_array().filter(|a| a.len() == n)?;
        row.iter().map(number).collect::<Option<Vec<_>>>()
    };
    match shape {
        Shape::Scalar => Some(vec![number(value)?]),
        Shape::List(n) => row(value, n),
        Shape::Matrix | Shape::Cross => {
            let rows = value.as_array().filter(|a| a.len() == 3)?;
            Some(
                rows.iter()
                    .map(|r| row(r, 3))
                    .collect::<Option<Vec<_>>>()?
                    .concat(),
            )
        }
    }
}

impl From<&EffectTruth> for EffectFile {
    fn from(truth: &EffectTruth) -> Self {
        let row = |v: &[f64]| toml::Value::Array(v.iter().map(|x| (*x).into()).collect());
        let parameters = truth.parameters().map(|(p, values)| {
            let value = match p.shape {
                crate::effects::Shape::Scalar => values[0].into(),
                crate::effects::Shape::List(_) => row(values),
                _ => toml::Value::Array(values.chunks(3).map(row).collect()),
            };
            (p.key.to_owned(), value)
        });
        Self {
            id: truth.id.to_owned(),
            parameters: parameters.collect(),
        }
    }
}
