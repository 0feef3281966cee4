//! Abscissa of an effect's plot: what its regressors are functions of.

use serde::Serialize;

use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::quantity::{Quantity, REFERENCE_C};
use crate::effects::regressor::Regressor;

/// What a regressor is a function of.
#[derive(Debug, Clone, PartialEq)]
pub enum Dependence {
    /// Of one quantity.
    Alone(Quantity),
    /// The product of powers of some.
    Product(Vec<(Quantity, u8)>),
    /// Of several, or of none that can be drawn: it is drawn against itself.
    Itself(Vec<Quantity>),
}

/// Abscissa of a drawing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Abscissa {
    /// Name.
    pub name: String,
    /// Unit for display.
    pub unit: String,
    /// From SI to this unit: `factor * x + offset`.
    pub factor: f64,
    /// See `factor`.
    pub offset: f64,
}

/// What regressor `slot` of the active ones of `candidate` is a function of.
pub fn dependence(candidate: &Candidate, slot: usize) -> Dependence {
    let all = candidate.slot_regressors();
    let Some(regressor) = all.get(slot) else {
        return Dependence::Itself(Vec::new());
    };
    match (&regressor.quantities()[..], regressor) {
        // It is infinite in all recordings but the first.
        ([Quantity::RecordingTime], _) => Dependence::Itself(Vec::new()),
        ([Quantity::Up | Quantity::RateMagnitude], _) => Dependence::Itself(regressor.quantities()),
        ([alone], _) => Dependence::Alone(*alone),
        (_, Regressor::Product(product)) => Dependence::Product(product.parts().collect()),
        (several, _) => Dependence::Itself(several.to_vec()),
    }
}

/// Name and unit of the abscissa of coefficient `k` of the active ones of `candidate`, in the error of `axis`.
pub fn abscissa(on: &Dependence, candidate: &Candidate, k: usize, axis: usize) -> Abscissa {
    let sensor = candidate.sensor;
    let plain = |name: String, unit: String, factor: f64| Abscissa {
        name,
        unit,
        factor,
        offset: 0.0,
    };
    match on {
        Dependence::Alone(Quantity::Temperature) => Abscissa {
            name: "temperature".into(),
            unit: "°C".into(),
            factor: 1.0,
            offset: REFERENCE_C,
        },
        Dependence::Alone(field) => {
            let (factor, unit) = field.readable(sensor);
            plain(field.in_words(sensor, axis), unit.into(), factor)
        }
        Dependence::Product(powers) => {
            let written = |text: String, p: u8| match p {
                2 => format!("{text}²"),
                3 => format!("{text}³"),
                _ => text,
            };
            let (mut names, mut units, mut by) = (Vec::new(), Vec::new(), 1.0);
            for &(field, p) in powers {
                let (factor, unit) = field.readable(sensor);
                let name = match field {
                    Quantity::Temperature => format!("(temperature − {REFERENCE_C} °C)"),
                    field => field.in_words(sensor, axis),
                };
                names.push(written(name, p));
                units.push(written(unit.into(), p));
                by *= factor.powi(i32::from(p));
            }
            plain(names.join(" × "), units.join("·"), by)
        }
        Dependence::Itself(fields) => {
            let (coefficient, unit) = &candidate.names()[k];
            let unit = unit
                .strip_prefix(sensor.unit())
                .and_then(|u| u.strip_prefix('/'))
                .map_or_else(|| format!("({})/({unit})", sensor.unit()), String::from);
            let name = match (&candidate.kind, fields[..].is_empty()) {
                (CandidateKind::Term(_, product), _) => product.name(),
                (_, true) => format!("regressor of {coefficient}"),
                _ => {
                    // With many quantities, their axes make the name too long.
                    let of_axes = fields.len() <= 2;
                    let mut names: Vec<String> = Vec::new();
                    for field in fields {
                        let name = field.in_words(sensor, axis);
                        let name = match name.strip_suffix([' ', 'x', 'y', 'z']) {
                            Some(short) if !of_axes => short.trim_end().to_string(),
                            _ => name,
                        };
                        if !names.contains(&name) {
                            names.push(name);
                        }
                    }
                    format!("regressor of {coefficient}, by {}", names.join(" and "))
                }
            };
            plain(name, unit.replace("^2", "²"), 1.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects;

    fn on(id: &str, k: usize) -> (Dependence, Abscissa) {
        let effect = effects::by_id(id).unwrap();
        let candidate = Candidate::new(effect.sensor, CandidateKind::Effect(effect));
        let on = dependence(&candidate, k);
        let axis = effect.coefficients[k].axis.unwrap();
        let abscissa = abscissa(&on, &candidate, k, axis);
        (on, abscissa)
    }

    #[test]
    fn regressors_tell_what_they_are_functions_of() {
        let cases = [
            ("gyro_g_sensitivity", 5, "force z", "g"),
            ("gyro_scale_asymmetry", 1, "rate along gyro y", "deg/s"),
            ("accel_scale_cubic", 2, "force along accel z", "g"),
            ("gyro_warm_up", 0, "time", "min"),
            ("accel_thermal_bias", 4, "temperature", "°C"),
        ];
        for (id, k, name, unit) in cases {
            let (on, abscissa) = on(id, k);
            assert!(matches!(on, Dependence::Alone(_)), "{id}: {on:?}");
            assert_eq!(
                (abscissa.name.as_str(), abscissa.unit.as_str()),
                (name, unit)
            );
        }
        let (_, product) = on("gyro_thermal_scale", 0);
        assert_eq!(product.name, "(temperature − 25 °C) × rate along gyro x");
        assert_eq!(product.unit, "K·deg/s");
        let (_, lag) = on("accel_thermal_lag", 0);
        assert_eq!(lag.unit, "K");
        let (arm, _) = on("accel_size_effect", 0);
        assert!(
            matches!(arm, Dependence::Itself(ref q) if q.len() == 2),
            "{arm:?}"
        );
    }
}
