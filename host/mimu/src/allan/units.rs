//! Units of deviations and coefficients, as people write them.

use super::model::Term;
use crate::quantity::Sensor;
use crate::quantity::significant;
use mimu_recording::RawUnit;

/// Standard gravity, for mg and µg, m/s².
pub const STANDARD_GRAVITY: f64 = 9.80665;

/// Unit of a channel's deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Name: rad/s, m/s^2, V or count.
    pub name: &'static str,
    /// Whether it is SI.
    pub si: bool,
    /// Factor from a raw reading to it.
    pub per_raw: f64,
}

/// A coefficient's unit and the factor that converts it there from that of the channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Usual {
    /// Factor.
    pub factor: f64,
    /// Name.
    pub name: String,
}

impl Unit {
    /// SI unit of `sensor`, `per_raw` of which are one raw reading.
    pub fn si(sensor: Sensor, per_raw: f64) -> Self {
        Self {
            name: sensor.unit(),
            si: true,
            per_raw,
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
            si: false,
            per_raw: 1.0,
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

    /// Units in which people read the coefficient of `term`, the usual one first.
    pub fn usual(&self, sensor: Sensor, term: Term) -> Vec<Usual> {
        let unit = |factor: f64, name: &str| Usual {
            factor,
            name: name.into(),
        };
        let (deg, hour, mg) = (1f64.to_degrees(), 3600.0, 1e-3 * STANDARD_GRAVITY);
        let root = 60.0;
        match (self.si, sensor, term) {
            (false, _, _) => vec![unit(
                1.0,
                &self
                    .coefficient(term)
                    .replace("sqrt(Hz)", "√Hz")
                    .replace("sqrt(s)", "√s"),
            )],
            (_, Sensor::Gyro, Term::Q) => vec![unit(deg * hour, "arcsec")],
            (_, Sensor::Gyro, Term::N) => vec![unit(deg * root, "deg/√h"), unit(deg, "deg/s/√Hz")],
            (_, Sensor::Gyro, Term::B) => vec![unit(deg * hour, "deg/h")],
            (_, Sensor::Gyro, Term::K) => vec![unit(deg * hour * root, "deg/h/√h")],
            (_, Sensor::Gyro, Term::R) => vec![unit(deg * hour * hour, "deg/h/h")],
            (_, Sensor::Accel, Term::Q) => vec![unit(1e3, "mm/s")],
            (_, Sensor::Accel, Term::N) => vec![unit(root, "m/s/√h"), unit(1e3 / mg, "µg/√Hz")],
            (_, Sensor::Accel, Term::B) => vec![unit(1.0 / mg, "mg")],
            (_, Sensor::Accel, Term::K) => vec![unit(root / mg, "mg/√h")],
            (_, Sensor::Accel, Term::R) => vec![unit(hour / mg, "mg/h")],
        }
    }

    /// A coefficient with its usual unit.
    pub fn words(&self, sensor: Sensor, term: Term, value: f64) -> String {
        let usual = &self.usual(sensor, term)[0];
        format!("{} {}", number(value * usual.factor), usual.name)
    }

    /// Unit in which people read a deviation.
    pub fn deviation(&self, sensor: Sensor) -> Usual {
        self.usual(sensor, Term::B).swap_remove(0)
    }
}

/// Three digits. Rounded first: 0.0099998, which time stamps make of 0.01, would have one more.
pub fn number(value: f64) -> String {
    significant(format!("{value:.2e}").parse().unwrap_or(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_degree_per_root_hour_is_a_sixtieth_of_a_degree_per_second_per_root_hertz() {
        let unit = Unit::si(Sensor::Gyro, 1.0);
        let [hours, hertz] = [0, 1].map(|i| unit.usual(Sensor::Gyro, Term::N)[i].factor);
        assert!((hours / hertz - 60.0).abs() < 1e-12);
        let n = 1f64.to_radians() / 60.0;
        assert_eq!(unit.words(Sensor::Gyro, Term::N, n), "1.00 deg/√h");
        // A random walk of 1 deg/h in an hour.
        let k = (1.0 / 3600f64).to_radians() / 60.0;
        assert_eq!(unit.words(Sensor::Gyro, Term::K, k), "1.00 deg/h/√h");
        let g = Unit::si(Sensor::Accel, 1.0);
        assert!((9.80665e-6 * g.usual(Sensor::Accel, Term::N)[1].factor - 1.0).abs() < 1e-12);
    }
}
