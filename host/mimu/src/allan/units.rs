//! Units of deviations and coefficients.

use super::model::Term;
use crate::quantity::Sensor;
use crate::readable;
use mimu_recording::RawUnit;

/// Unit of a channel's deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Name: rad/s, m/s^2, V or count.
    pub name: &'static str,
    /// Factor from a raw reading to it.
    pub per_raw: f64,
    /// Unit of the raw readings, where a scale factor made [`Self::name`] of it.
    pub scaled_from: Option<&'static str>,
}

impl Unit {
    /// SI unit of `sensor`, for readings in it.
    pub fn si(sensor: Sensor) -> Self {
        Self {
            name: sensor.unit(),
            per_raw: 1.0,
            scaled_from: None,
        }
    }

    /// SI unit of `sensor`, for readings in `raw` that a calibration with `scale_factor`, raw per SI unit, is given for.
    pub fn scaled(sensor: Sensor, raw: RawUnit, scale_factor: f64) -> Self {
        Self {
            name: sensor.unit(),
            per_raw: 1.0 / scale_factor,
            scaled_from: Some(Self::raw(raw).name),
        }
    }

    /// The raw unit itself.
    pub fn raw(raw: RawUnit) -> Self {
        let name = match raw {
            RawUnit::Volt => "V",
            RawUnit::Count => "count",
            RawUnit::Si => "SI",
        };
        Self {
            name,
            per_raw: 1.0,
            scaled_from: None,
        }
    }

    /// Unit of the coefficient of `term` in JSON and files.
    pub fn coefficient(&self, term: Term) -> String {
        let time = match term {
            Term::Q => " s",
            Term::N => "/sqrt(Hz)",
            Term::B => "",
            Term::K => "/sqrt(s)",
            Term::R => "/s",
        };
        match (self.name, term) {
            ("rad/s", Term::Q) => "rad".into(),
            ("m/s^2", Term::Q) => "m/s".into(),
            ("rad/s", Term::R) => "rad/s^2".into(),
            ("m/s^2", Term::R) => "m/s^3".into(),
            (name, _) => format!("{name}{time}"),
        }
    }

    /// A coefficient as people read it.
    pub fn write(&self, term: Term, value: f64) -> String {
        readable::noise(&self.coefficient(term))[0].write(value)
    }
}
