//! One `[[effect]]` of a rig file: its possible parameters, and the text of a drawn one.

use std::collections::BTreeMap;

use super::EffectFile;
use crate::effects::{Draw, EffectTruth, Parameter, Shape, spec, specs};
use crate::refusal::{Refusal, within};

impl EffectFile {
    /// Given numbers by key, in the layout of the kind of effect; `i` counts effects from 0.
    pub(super) fn numbers(&self, i: usize) -> Result<BTreeMap<&'static str, Vec<f64>>, Refusal> {
        let wrong = |key: &str, problem: String, remedy: String| Refusal {
            path: format!("effect.{i}.{key}"),
            problem,
            remedy,
        };
        if self.id == "earth_rate" {
            let problem = "Earth rate is a true input here, not an effect".to_owned();
            return Err(wrong(
                "id",
                problem,
                "write `earth_rate = true` or false at the top".to_owned(),
            ));
        }
        let Some(spec) = spec(&self.id) else {
            let known: Vec<_> = specs().map(|s| s.id).collect();
            let problem = format!("no effect has the id `{}`", self.id);
            return Err(wrong("id", problem, format!("known: {}", known.join(", "))));
        };
        let mut numbers = BTreeMap::new();
        for (key, value) in &self.parameters {
            let Some(parameter) = spec.parameters.iter().find(|p| p.key == key) else {
                let keys: Vec<_> = spec.parameters.iter().map(|p| p.key).collect();
                let remedy = format!("known are: {}", keys.join(", "));
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
            if parameter.shape == Shape::Cross && values.iter().step_by(4).any(|v| *v != 0.0) {
                let problem = format!("`{key}` has a diagonal, which is a scale factor's part");
                return Err(wrong(key, problem, "give zeros there".to_owned()));
            }
            within(&format!("effect.{i}.{key}"), &values, range(parameter))?;
            numbers.insert(parameter.key, values);
        }
        Ok(numbers)
    }
}

/// A size may have any sign; times, frequencies and limits are positive. Both ranges are far wider than usual values.
fn range(parameter: &Parameter) -> [f64; 2] {
    match parameter.draw {
        Draw::Size(size) => [-1e6 * size, 1e6 * size],
        Draw::Between(low, high) => [1e-3 * low, 1e3 * high],
    }
}

/// The numbers of a value, row by row, if its layout is right.
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
