//! What an effect is drawn against: found by asking its regressors, so that an effect says it nowhere but in its physics.

use serde::Serialize;

use crate::diagnose::candidate::{Candidate, Kind};
use crate::diagnose::effect::{Moment, REFERENCE_C};
use crate::quantity::AXES;
use crate::quantity::Sensor;

/// A quantity of a [`Moment`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Field {
    /// Time since the recording began.
    Time,
    /// Rate about a body axis.
    Rate(usize),
    /// Specific force along a body axis.
    Force(usize),
    /// Angular acceleration about a body axis.
    AngularAcceleration(usize),
    /// Input along a sensitive direction.
    Sensed(usize),
    /// Temperature.
    Temperature,
    /// Temperature behind a lag.
    Lagged,
}

impl Field {
    fn all() -> impl Iterator<Item = Self> {
        let vectors = [
            Self::Rate,
            Self::Force,
            Self::AngularAcceleration,
            Self::Sensed,
        ];
        let axes = vectors.into_iter().flat_map(|v| (0..3).map(v));
        [Self::Time, Self::Temperature, Self::Lagged]
            .into_iter()
            .chain(axes)
    }

    /// Its value, SI; of temperatures above [`REFERENCE_C`].
    pub fn of(self, at: &Moment) -> f64 {
        match self {
            Self::Time => at.on_s,
            Self::Rate(i) => at.rate[i],
            Self::Force(i) => at.force[i],
            Self::AngularAcceleration(i) => at.angular_acceleration[i],
            Self::Sensed(i) => at.sensed[i],
            Self::Temperature => at.warm_c,
            Self::Lagged => at.late_c,
        }
    }

    /// `at` with another value of it.
    pub fn with(self, mut at: Moment, value: f64) -> Moment {
        match self {
            Self::Time => at.on_s = value,
            Self::Rate(i) => at.rate[i] = value,
            Self::Force(i) => at.force[i] = value,
            Self::AngularAcceleration(i) => at.angular_acceleration[i] = value,
            Self::Sensed(i) => at.sensed[i] = value,
            Self::Temperature => at.warm_c = value,
            Self::Lagged => at.late_c = value,
        }
        at
    }

    fn name(self, sensor: Sensor) -> String {
        match self {
            Self::Time => "time".into(),
            Self::Rate(i) => format!("rate {}", AXES[i]),
            Self::Force(i) => format!("force {}", AXES[i]),
            Self::AngularAcceleration(i) => format!("angular acceleration {}", AXES[i]),
            Self::Sensed(i) => match sensor {
                Sensor::Gyro => format!("rate along gyro {}", AXES[i]),
                Sensor::Accel => format!("force along accel {}", AXES[i]),
            },
            Self::Temperature => "temperature".into(),
            Self::Lagged => "lagged temperature".into(),
        }
    }

    /// Factor to the unit in which a person reads it, and that unit.
    fn readable(self, sensor: Sensor) -> (f64, &'static str) {
        match (self, sensor) {
            (Self::Time, _) => (1.0 / 60.0, "min"),
            (Self::Rate(_), _) | (Self::Sensed(_), Sensor::Gyro) => (1f64.to_degrees(), "deg/s"),
            (Self::Force(_), _) | (Self::Sensed(_), Sensor::Accel) => (1.0 / 9.80665, "g"),
            (Self::AngularAcceleration(_), _) => (1f64.to_degrees(), "deg/s²"),
            (Self::Temperature | Self::Lagged, _) => (1.0, "K"),
        }
    }
}

/// What a regressor is a function of.
#[derive(Debug, Clone, PartialEq)]
pub enum Dependence {
    /// Of one quantity.
    Alone(Field),
    /// The product of powers of some.
    Product(Vec<(Field, i32)>),
    /// Of several, or of none of [`Field`]: it is drawn against itself.
    Itself(Vec<Field>),
}

/// Abscissa of a drawing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Abscissa {
    /// Name.
    pub name: String,
    /// Unit that a person reads it in.
    pub unit: String,
    /// From SI to this unit: `factor * x + offset`.
    pub factor: f64,
    /// See `factor`.
    pub offset: f64,
}

/// Every quantity another number that is no simple fraction of the others.
fn generic(like: &Moment) -> Moment {
    let mut at = *like;
    for (k, field) in Field::all().enumerate() {
        at = field.with(at, 0.731 + 0.2173 * k as f64);
    }
    at
}

/// What regressor `k` of the active ones of `candidate` depends on; `like` is any moment.
pub fn dependence(candidate: &Candidate, form: f64, k: usize, like: &Moment) -> Dependence {
    let base = generic(like);
    let count = candidate.axes().len();
    let value = |at: &Moment| {
        let mut out = vec![0.0; count];
        candidate.regressors(at, form, &mut out);
        out[k]
    };
    let here = value(&base);
    // What it becomes where a quantity is half as large again, and where it is of the other sign.
    let ratios = |f: Field| [1.5, -1.0].map(|by| value(&f.with(base, by * f.of(&base))) / here);
    let on: Vec<Field> = Field::all()
        .filter(|f| ratios(*f).iter().any(|r| (r - 1.0).abs() > 1e-12))
        .collect();
    if let [alone] = on[..] {
        return Dependence::Alone(alone);
    }
    let power = |f: Field| {
        let [more, other] = ratios(f);
        (1..=3).find(|p| {
            (more - 1.5f64.powi(*p)).abs() < 1e-9 && (other - (-1f64).powi(*p)).abs() < 1e-9
        })
    };
    let powers: Option<Vec<(Field, i32)>> = on.iter().map(|f| power(*f).map(|p| (*f, p))).collect();
    match powers {
        Some(powers)
            if !on.is_empty() && {
                let product: f64 = powers.iter().map(|(f, p)| f.of(&base).powi(*p)).product();
                (here / product - 1.0).abs() < 1e-9
            } =>
        {
            Dependence::Product(powers)
        }
        _ => Dependence::Itself(on),
    }
}

/// What a person reads on the abscissa of regressor `k` of `candidate`.
pub fn abscissa(on: &Dependence, candidate: &Candidate, k: usize) -> Abscissa {
    let sensor = candidate.sensor;
    let plain = |name: String, unit: String, factor: f64| Abscissa {
        name,
        unit,
        factor,
        offset: 0.0,
    };
    match on {
        Dependence::Alone(Field::Temperature) => Abscissa {
            name: "temperature".into(),
            unit: "°C".into(),
            factor: 1.0,
            offset: REFERENCE_C,
        },
        Dependence::Alone(field) => {
            let (factor, unit) = field.readable(sensor);
            plain(field.name(sensor), unit.into(), factor)
        }
        Dependence::Product(powers) => {
            let written = |text: String, p: i32| match p {
                2 => format!("{text}²"),
                3 => format!("{text}³"),
                _ => text,
            };
            let (mut names, mut units, mut by) = (Vec::new(), Vec::new(), 1.0);
            for &(field, p) in powers {
                let (factor, unit) = field.readable(sensor);
                let name = match field {
                    Field::Temperature => format!("(temperature − {REFERENCE_C} °C)"),
                    field => field.name(sensor),
                };
                names.push(written(name, p));
                units.push(written(unit.into(), p));
                by *= factor.powi(p);
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
                (Kind::Term(_, monomial), _) => monomial.name(),
                (_, true) => format!("regressor of {coefficient}"),
                _ => {
                    // Of many the axes are too long to tell.
                    let of_axes = fields.len() <= 2;
                    let mut names: Vec<String> = Vec::new();
                    for field in fields {
                        let name = field.name(sensor);
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
    use nalgebra::Vector3;

    use super::*;
    use crate::diagnose::library;

    fn moment() -> Moment {
        Moment {
            session: 0,
            reading: crate::diagnose::effect::Reading::NONE,
            t_s: 0.0,
            on_s: 0.0,
            duration_s: 1.0,
            rate: Vector3::zeros(),
            force: Vector3::zeros(),
            angular_acceleration: Vector3::zeros(),
            sensed: Vector3::zeros(),
            warm_c: f64::NAN,
            late_c: f64::NAN,
        }
    }

    fn on(id: &str, form: f64, k: usize) -> (Dependence, Abscissa) {
        let effect = library::by_id(id).unwrap();
        let candidate = Candidate::new(effect.sensor, Kind::Effect(effect));
        let on = dependence(&candidate, form, k, &moment());
        let abscissa = abscissa(&on, &candidate, k);
        (on, abscissa)
    }

    #[test]
    fn regressors_tell_what_they_are_functions_of() {
        let cases = [
            ("gyro_g_sensitivity", 0.0, 5, "force z", "g"),
            ("gyro_scale_asymmetry", 0.0, 1, "rate along gyro y", "deg/s"),
            ("accel_scale_cubic", 0.0, 2, "force along accel z", "g"),
            ("gyro_warm_up", 100.0, 0, "time", "min"),
            ("accel_thermal_bias", 0.0, 4, "temperature", "°C"),
        ];
        for (id, form, k, name, unit) in cases {
            let (on, abscissa) = on(id, form, k);
            assert!(matches!(on, Dependence::Alone(_)), "{id}: {on:?}");
            assert_eq!(
                (abscissa.name.as_str(), abscissa.unit.as_str()),
                (name, unit)
            );
        }
        let (_, product) = on("gyro_thermal_scale", 0.0, 0);
        assert_eq!(product.name, "(temperature − 25 °C) × rate along gyro x");
        assert_eq!(product.unit, "K·deg/s");
        let (lag, abscissa) = on("accel_thermal_lag", 60.0, 0);
        assert!(
            matches!(lag, Dependence::Itself(ref f) if f.len() == 2),
            "{lag:?}"
        );
        assert_eq!(abscissa.unit, "K");
    }
}
