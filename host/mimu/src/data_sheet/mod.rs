//! A calibrated unit against the data sheet of its part, in the words of IEEE Std 2700.
//!
//! A limit is passed or failed if the whole interval is on one side of it; else it is undecided.

mod measured;
mod part;

pub use part::{Limit, Part, PartSensor, Property, SHIPPED};

use serde::Serialize;

use crate::calibration::Calibration;
use crate::noise::noise_file::NoiseFile;
use crate::quantity::{AXES, Sensor};

/// Whether a unit keeps a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, strum::IntoStaticStr)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Kept {
    /// The whole interval is within the limit.
    Passed,
    /// The whole interval is beyond it.
    Failed,
    /// The interval contains the limit, or is not known.
    Undecided,
}

impl Kept {
    /// Whether a value with the half-width `half` of its 95 % interval keeps the limit `at_most`; signs do not count.
    fn of(value: f64, half: Option<f64>, at_most: f64) -> Self {
        let (Some(half), size) = (half, value.abs()) else {
            return Self::Undecided;
        };
        match (size + half <= at_most, size - half > at_most) {
            (true, _) => Self::Passed,
            (_, true) => Self::Failed,
            _ => Self::Undecided,
        }
    }

    /// In words.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// A property of an axis beside its limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Sensor.
    pub sensor: Sensor,
    /// Axis.
    pub axis: &'static str,
    /// Property.
    pub property: Property,
    /// Unit of all figures.
    pub unit: &'static str,
    /// Measured value.
    pub value: f64,
    /// Half-width of its 95 % interval; null if it is unknown.
    pub half_width: Option<f64>,
    /// Limit.
    pub at_most: f64,
    /// Whether the data sheet only calls the limit typical.
    pub typical: bool,
    /// Whether it is kept.
    pub kept: Kept,
    /// Where the data sheet has the limit.
    pub source: String,
}

/// A unit against the data sheet of its part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DataSheet {
    /// Part.
    pub part: String,
    /// Maker, document and revision.
    pub source: String,
    /// Properties with a limit that were measured.
    pub rows: Vec<Row>,
    /// Limits that nothing was measured for, in words.
    pub not_measured: Vec<String>,
}

impl DataSheet {
    /// `calibration`, and `noise` if it is known, against `part`.
    pub fn of(calibration: &Calibration, noise: Option<&NoiseFile>, part: &Part) -> Self {
        let (mut rows, mut missing) = (Vec::new(), Vec::new());
        for sensor in Sensor::BOTH {
            let Some(own) = part.sensor(sensor) else {
                continue;
            };
            let Some(unit) = measured::Unit::of(calibration, noise, sensor, own) else {
                missing.push(format!("{sensor}: the calibration does not have it"));
                continue;
            };
            for limit in &own.limits {
                let name = format!("{sensor}: {}", limit.quantity.name(sensor));
                for axis in (0..3).filter(|a| limit.is_for(*a, unit.full_scale)) {
                    match unit.value(limit.quantity, axis) {
                        Ok((value, half)) => rows.push(row(sensor, axis, limit, value, half)),
                        Err(why) => missing.push(format!("{name}: {why}")),
                    }
                }
            }
        }
        missing.dedup();
        Self {
            part: part.name.clone(),
            source: part.source.clone(),
            rows,
            not_measured: missing,
        }
    }

    /// How many limits are kept so.
    pub fn count(&self, kept: Kept) -> usize {
        self.rows.iter().filter(|r| r.kept == kept).count()
    }
}

fn row(sensor: Sensor, axis: usize, limit: &Limit, value: f64, half: Option<f64>) -> Row {
    Row {
        sensor,
        axis: AXES[axis],
        property: limit.quantity,
        unit: limit.quantity.unit(sensor),
        value,
        half_width: half,
        at_most: limit.at_most,
        typical: limit.typical,
        kept: Kept::of(value, half, limit.at_most),
        source: limit.source.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_failed_only_if_the_whole_interval_is_beyond_it() {
        assert_eq!(Kept::of(-0.4, Some(0.05), 0.5), Kept::Passed);
        assert_eq!(Kept::of(-0.6, Some(0.05), 0.5), Kept::Failed);
        assert_eq!(Kept::of(0.6, Some(0.2), 0.5), Kept::Undecided);
        assert_eq!(Kept::of(0.1, None, 0.5), Kept::Undecided);
    }

    #[test]
    fn every_shipped_part_is_read_and_says_where_each_limit_is_from() {
        for (name, text) in SHIPPED {
            let part = Part::parse(text, name).unwrap();
            assert!(!part.source.is_empty());
            for sensor in Sensor::BOTH {
                let own = part.sensor(sensor).unwrap();
                assert!(
                    own.limits
                        .iter()
                        .all(|l| l.source.contains(char::is_numeric)),
                    "{name}"
                );
                // A range of twice the size has half the counts.
                for [full_scale, counts] in &own.ranges {
                    let [first, per] = own.ranges[0];
                    assert!(
                        (full_scale * counts / (first * per) - 1.0).abs() < 0.01,
                        "{name}"
                    );
                }
            }
        }
    }
}
