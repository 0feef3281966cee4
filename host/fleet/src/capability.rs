//! Process capability against the limits of a part: Cp, Cpk, and units beyond.
//!
//! Sensitivities and offsets have a limit on both sides of zero; the other properties are magnitudes with an upper limit. Units are the sample. The standard deviation is that of the measured
//! values (AIAG, Statistical Process Control, 2nd edition, calls Cpk by the overall deviation Ppk); beside it stands the index of the process
//! itself, with the uncertainty of the fits removed. Intervals: Bissell (1990), Applied Statistics 39, 331.

use std::collections::BTreeMap;

use mimu::data_sheet::{Property, Row};
use mimu::quantity::Sensor;
use mimu_recording::NORMAL_95;
use mimu_recording::statistics::mean_and_variance;
use serde::Serialize;

/// A property of an axis over the fleet.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Capability {
    /// Sensor.
    pub sensor: Sensor,
    /// Axis.
    pub axis: &'static str,
    /// Property.
    pub property: Property,
    /// Unit of all figures but the indices.
    pub unit: &'static str,
    /// Largest magnitude.
    pub at_most: f64,
    /// Whether the data sheet only calls the limit typical.
    pub typical: bool,
    /// Units.
    pub count: usize,
    /// Mean of the units; of magnitudes for a property with an upper limit only.
    pub mean: f64,
    /// Their standard deviation.
    pub sigma: f64,
    /// Cp; null for a property with an upper limit only.
    pub cp: Option<f64>,
    /// Cpk.
    pub cpk: f64,
    /// Half of its 95 % interval.
    pub cpk_half_width: f64,
    /// Cpk with the uncertainty of the fits removed from the standard deviation; null if it exceeds it.
    pub cpk_of_process: Option<f64>,
    /// Units beyond the limit.
    pub beyond: usize,
}

/// Fewest units with an index.
const FEWEST: usize = 5;

type Key = (bool, &'static str, &'static str);

/// Properties of an axis, of all units: values with the half-widths of their intervals, and a row with its limit.
pub type Collected = BTreeMap<Key, (Row, Vec<(f64, Option<f64>)>)>;

fn key(row: &Row) -> Key {
    (
        row.sensor == Sensor::Accel,
        row.property.name(row.sensor),
        row.axis,
    )
}

/// The means of each unit's measurements of each property; `units` has the measurements of each unit.
pub fn collect<'a>(units: impl Iterator<Item = Vec<&'a [Row]>>) -> Collected {
    let mut all = Collected::new();
    for unit in units {
        let mut own: BTreeMap<Key, (&Row, f64, f64, f64)> = BTreeMap::new();
        for row in unit.iter().copied().flatten() {
            let entry = own.entry(key(row)).or_insert((row, 0.0, 0.0, 0.0));
            entry.1 += 1.0;
            entry.2 += row.value;
            entry.3 += row.half_width.unwrap_or(f64::NAN).powi(2);
        }
        for (key, (row, count, sum, squares)) in own {
            let half = (squares.sqrt() / count).abs();
            let value = (sum / count, Some(half).filter(|h| h.is_finite()));
            all.entry(key)
                .or_insert_with(|| (row.clone(), Vec::new()))
                .1
                .push(value);
        }
    }
    all
}

/// Whether a property has a limit on both sides.
fn is_two_sided(property: Property) -> bool {
    matches!(property, Property::Sensitivity | Property::Offset)
}

/// Indices of all properties.
pub fn indices(all: &Collected) -> Vec<Capability> {
    all.values()
        .filter_map(|(row, values)| index(row, values))
        .collect()
}

fn index(row: &Row, values: &[(f64, Option<f64>)]) -> Option<Capability> {
    let two_sided = is_two_sided(row.property);
    let values: Vec<(f64, Option<f64>)> = values
        .iter()
        .filter(|v| v.0.is_finite())
        .map(|(v, h)| (if two_sided { *v } else { v.abs() }, *h))
        .collect();
    let count = values.len() as f64;
    if values.len() < FEWEST {
        return None;
    }
    let (mean, variance) = mean_and_variance(values.iter().map(|v| v.0));
    let halves: Option<f64> = values
        .iter()
        .map(|v| v.1.map(|h| (h / NORMAL_95).powi(2)))
        .sum();
    let room = match two_sided {
        true => row.at_most - mean.abs(),
        false => row.at_most - mean,
    };
    let index = |variance: f64| room / (3.0 * variance.sqrt());
    let cpk = index(variance);
    let of_process = halves
        .map(|sum| variance - sum / count)
        .filter(|v| *v > 0.0);
    Some(Capability {
        sensor: row.sensor,
        axis: row.axis,
        property: row.property,
        unit: row.unit,
        at_most: row.at_most,
        typical: row.typical,
        count: values.len(),
        mean,
        sigma: variance.sqrt(),
        cp: two_sided.then(|| row.at_most / (3.0 * variance.sqrt())),
        cpk,
        cpk_half_width: NORMAL_95
            * (1.0 / (9.0 * count) + cpk * cpk / (2.0 * (count - 1.0))).sqrt(),
        cpk_of_process: of_process.map(index),
        beyond: values.iter().filter(|v| v.0.abs() > row.at_most).count(),
    })
}
