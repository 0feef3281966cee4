//! Units of deviations and coefficients.

use crate::quantity::{Sensor, duration};
use crate::readable;
use mimu_allan::model::{Reason, Term, Unseen};
use mimu_recording::RawUnit;

/// Unit of a channel's deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Name: rad/s, m/s^2, V or count.
    pub name: &'static str,
    /// Factor from a raw reading to it.
    pub per_raw: f64,
    /// Unit of the raw readings, if a scale factor converted them to [`Self::name`].
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

    /// SI unit of `sensor`, for readings in `raw` and a calibration with `scale_factor`, raw per SI unit.
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

    /// Why `term` has no coefficient, for people.
    pub fn reason(&self, term: Term, unseen: &Unseen) -> String {
        let read = |value| readable::noise(&self.coefficient(term))[0].write(value);
        let at_most = match unseen.at_most {
            Some(value) => format!("at most {}", read(value)),
            None => "the other terms leave no data that show it".into(),
        };
        match &unseen.why {
            Reason::Filtered => {
                "at short times the curve is below white noise, as after a low-pass filter".into()
            }
            Reason::Hidden => {
                "at short times the curve does not have the shape of any term, which would hide this one"
                    .into()
            }
            Reason::NotInSpectrum => {
                format!("not seen, nor in the spectrum: {at_most}")
            }
            Reason::Small { instead, longer_s } => {
                let letters: Vec<&str> = instead.iter().map(|t| t.letter()).collect();
                let mut text = match letters.is_empty() {
                    true => format!("not seen: {at_most}"),
                    false => format!(
                        "this record does not distinguish it from {}: {at_most}",
                        letters.join(" or ")
                    ),
                };
                if let Some(longer) = longer_s {
                    text += &format!(
                        "; to see half of that, record at least {} more",
                        duration(*longer)
                    );
                }
                text
            }
        }
    }
}
