//! Repeatability and reproducibility of all parameters, and of the properties with limits.

use mimu::data_sheet::Row;
use mimu_recording::NORMAL_95;
use rayon::prelude::*;

use crate::capability::tolerance;
use crate::gage::{Gage, Study};
use crate::labels::DATE;
use crate::result::{GageOfParameter, GageStudy};
use crate::tree::Measurement;
use crate::triad::Triad;

/// What to compute.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Labels that are factors of repeatability and reproducibility.
    pub factors: Vec<String>,
}

/// The factors of [`Options`] that a plant usually has. The day is one too.
pub const FACTORS: [&str; 4] = ["operator", "fixture", "station", DATE];

/// Most units of a study, and most levels of a factor: the time grows with them, and what is known hardly does.
const MOST_UNITS: usize = 300;
const MOST_LEVELS: usize = 40;
/// Widths of a distribution that count as all of it (AIAG).
const ALL: f64 = 6.0;

/// What is studied: names, values in the order of the measurements, typical error of a fit, tolerance.
struct Value {
    sensor: mimu::quantity::Sensor,
    name: String,
    unit: String,
    values: Vec<Option<f64>>,
    fit_sigma: f64,
    tolerance: Option<f64>,
}

/// The study of all units that were measured repeatedly; `None` if there are fewer than two.
pub fn study(
    all: &[Measurement],
    units: &[Vec<usize>],
    triads: &[Triad],
    options: &Options,
) -> Option<GageStudy> {
    let names: Vec<String> = match options.factors.is_empty() {
        true => FACTORS.map(String::from).to_vec(),
        false => options.factors.clone(),
    };
    let level = |m: &Measurement, name: &str| match name {
        DATE => m
            .labels
            .get(DATE)
            .cloned()
            .or_else(|| m.day.map(|d| d.to_string())),
        _ => m.labels.get(name).cloned(),
    };
    let factors: Vec<(String, Vec<Option<String>>)> = names
        .into_iter()
        .map(|name| {
            let levels = all.iter().map(|m| level(m, &name)).collect();
            (name, levels)
        })
        .collect();
    let (mut study, members) = Study::of(units, &factors, MOST_UNITS)?;
    study
        .factors
        .retain(|f| f.1.iter().max().is_none_or(|m| *m < MOST_LEVELS));
    let mut values = of_triads(triads);
    values.extend(of_properties(all));
    let each = values.par_iter().filter_map(|value| {
        let own: Option<Vec<f64>> = members.iter().map(|m| value.values[*m]).collect();
        // A constant has no variance: a bias that firmware has removed.
        let gage = study.fit(&own?)?;
        Some(result(value, &gage))
    });
    Some(GageStudy {
        units: [units.iter().filter(|u| u.len() > 1).count(), study.units()],
        measurements: members.len(),
        factors: study.factors.iter().map(|f| f.0.clone()).collect(),
        parameters: each.collect(),
    })
}

fn of_triads(triads: &[Triad]) -> Vec<Value> {
    let of = |triad: &Triad, i: usize| Value {
        sensor: triad.basis.sensor,
        name: triad.basis.parameter(i).to_string(),
        unit: triad.basis.unit(i).to_string(),
        values: triad
            .estimates
            .iter()
            .map(|e| e.as_ref().map(|e| e.values[i]))
            .collect(),
        fit_sigma: triad.fit[(i, i)].sqrt(),
        tolerance: None,
    };
    triads
        .iter()
        .flat_map(|t| (0..t.n()).map(move |i| of(t, i)))
        .collect()
}

fn of_properties(all: &[Measurement]) -> Vec<Value> {
    let Some(first) = all.iter().map(|m| &m.properties).max_by_key(|p| p.len()) else {
        return Vec::new();
    };
    let of = |row: &Row| {
        let same = |m: &Measurement| {
            let found = m.properties.iter().find(|r| {
                r.sensor == row.sensor && r.property == row.property && r.axis == row.axis
            });
            found.map(|r| (r.value, r.half_width))
        };
        let mut halves: Vec<f64> = all.iter().filter_map(|m| same(m)?.1).collect();
        Value {
            sensor: row.sensor,
            name: format!("{} {}", row.property.name(row.sensor), row.axis),
            unit: row.unit.to_string(),
            values: all.iter().map(|m| same(m).map(|s| s.0)).collect(),
            fit_sigma: crate::robust::median(&mut halves) / NORMAL_95,
            tolerance: Some(tolerance(row)),
        }
    };
    first.iter().map(of).collect()
}

fn result(value: &Value, gage: &Gage) -> GageOfParameter {
    let [measurement, units] = [gage.measurement.value, gage.units.value];
    GageOfParameter {
        sensor: value.sensor,
        name: value.name.clone(),
        unit: value.unit.clone(),
        repeatability: gage.repeatability,
        fit_sigma: value.fit_sigma,
        reproducibility: gage.reproducibility,
        measurement: gage.measurement,
        between_units: gage.units,
        components: gage
            .components
            .iter()
            .map(|c| (c.name.clone(), c.variance.sqrt()))
            .collect(),
        share_of_variation: measurement / measurement.hypot(units),
        share_of_tolerance: value.tolerance.map(|t| ALL * measurement / t),
        categories: (2f64.sqrt() * units / measurement).floor(),
    }
}
