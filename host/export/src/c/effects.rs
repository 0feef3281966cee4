//! Effects in the header: their regressors as C expressions.

use mimu::effects::quantity::Quantity;
use mimu::effects::regressor::{Product, Regressor};
use mimu::{Calibration, FittedEffect, PerSensor, Sensor};
use mimu_core::die::BEYOND_C;
use mimu_core::effects::{Directions, RATE_LAG_S};
use mimu_recording::error::{Error, Result};
use serde_json::{Value, json};

use super::{number, rows};

/// The effects of a calibration.
pub(super) struct Effects {
    /// Ids of the effects in the header.
    pub written: Vec<String>,
    /// Number of effects that are left out.
    pub left_out: usize,
    /// Lags of the temperatures that the effects need, s.
    lags_s: Vec<f64>,
    /// Summed error of each of the three axes.
    errors: PerSensor<[Vec<String>; 3]>,
    directions: PerSensor<Option<Directions<f64>>>,
    quantities: Vec<Quantity>,
    /// Temperatures that they see, °C.
    seen_c: Option<[f64; 2]>,
}

impl Effects {
    pub fn of(calibration: &Calibration) -> Result<Self> {
        let direction = |sensor| {
            let model = calibration.inverse(sensor)?;
            Directions::of(&model.matrix)
        };
        let mut all = Self {
            written: Vec::new(),
            left_out: 0,
            lags_s: Vec::new(),
            errors: PerSensor::default(),
            directions: PerSensor::from_fn(direction),
            quantities: Vec::new(),
            seen_c: calibration
                .limits()
                .map(|[from, to]| [from - BEYOND_C, to + BEYOND_C]),
        };
        for effect in calibration.effects() {
            if all.directions[effect.sensor()].is_none() {
                let (device, sensor) = (&calibration.device, effect.sensor());
                let place = format!("calibration of {device:?}, [{sensor}]");
                return Err(Error::new(
                    place,
                    "C is singular",
                    "fit the recording again",
                ));
            }
            match all.add(effect) {
                Some(()) => all.written.push(effect.id()),
                None => all.left_out += 1,
            }
        }
        all.quantities.sort_unstable();
        all.quantities.dedup();
        Ok(all)
    }

    /// Whether no effect applies to compensated samples.
    pub fn is_empty(&self) -> bool {
        self.sensors().next().is_none()
    }

    /// Sensors with effects.
    fn sensors(&self) -> impl Iterator<Item = Sensor> + '_ {
        let both = Sensor::BOTH.into_iter();
        both.filter(|s| self.errors[*s].iter().any(|terms| !terms.is_empty()))
    }

    /// Whether some effects depend on temperature or time.
    pub fn is_slow(&self) -> bool {
        self.has(|q| q.is_slow())
    }

    fn has(&self, of: impl Fn(&Quantity) -> bool) -> bool {
        self.quantities.iter().any(of)
    }

    /// Values of the template: of the sensors with effects, of the lags, and of what else the effects depend on.
    pub fn values(&self) -> Value {
        let removed = self.sensors().filter_map(|sensor| {
            let directions = self.directions[sensor].as_ref()?;
            let (own, inputs) =
                sensor.pick(("rate", "clean, read_force"), ("force", "read_rate, clean"));
            let errors = self.errors[sensor].iter().enumerate();
            let errors = errors.map(|(axis, terms)| match terms.is_empty() {
                true => json!({"axis": axis, "sum": "0.0f"}),
                false => json!({"axis": axis, "sum": terms.join("\n         + ")}),
            });
            Some(json!({
                "sensor": sensor.name(),
                "unit": sensor.unit(),
                "D": rows(&directions.sensed),
                "R": rows(&directions.to_body),
                "own": own,
                "inputs": inputs,
                "errors": errors.collect::<Value>(),
            }))
        });
        let lags = self.lags_s.iter().enumerate();
        let lags = lags.map(|(at, lag_s)| json!({"at": at, "lag_s": number(*lag_s)}));
        let [least, most] = self.seen_c.unwrap_or_default().map(number);
        json!({
            "removed": removed.collect::<Value>(),
            "lags": lags.collect::<Value>(),
            "time": self.has(|q| *q == Quantity::Time),
            "thermal": self.has(|q| q.is_thermal()),
            "turns": self.has(|q| matches!(q, Quantity::AngularAcceleration(_))),
            "limited": self.seen_c.is_some(),
            "least": least,
            "most": most,
        })
    }

    fn add(&mut self, effect: &FittedEffect) -> Option<()> {
        let candidate = &effect.candidate;
        let slots = candidate.slots();
        let regressors = candidate.slot_regressors();
        let mut terms = Vec::new();
        for ((coefficient, axis), regressor) in slots.iter().zip(&regressors) {
            let value = effect.values.get(*coefficient)?;
            let written = self.regressor(regressor, effect.parameter, *axis)?;
            terms.push((*axis, format!("{} * {written}", number(*value))));
        }
        for (axis, term) in terms {
            self.errors[effect.sensor()][axis].push(term);
        }
        self.quantities
            .extend(regressors.iter().flat_map(Regressor::quantities));
        Some(())
    }

    fn regressor(&mut self, of: &Regressor, parameter: f64, axis: usize) -> Option<String> {
        let mut quantity = |q: Quantity| self.quantity(q, parameter, axis);
        Some(match of {
            Regressor::Product(product) => written(product, &mut quantity)?,
            Regressor::Sum(a, b) => {
                let (a, b) = (written(a, &mut quantity)?, written(b, &mut quantity)?);
                format!("({a} + {b})")
            }
            Regressor::Absolute(q) => format!("fabsf({})", quantity(*q)?),
            Regressor::Decay(q) => format!("expf(-{} / {})", quantity(*q)?, number(parameter)),
            Regressor::Logarithm(q) => {
                format!("log1pf({} / {})", quantity(*q)?, number(parameter))
            }
            Regressor::Since { .. } => return None,
        })
    }

    /// A quantity as the error functions name it; `None` if a stream of samples does not contain it.
    fn quantity(&mut self, of: Quantity, parameter: f64, axis: usize) -> Option<String> {
        Some(match of {
            Quantity::Rate(i) => format!("rate[{i}]"),
            Quantity::Force(i) => format!("force[{i}]"),
            Quantity::Input => format!("own[{axis}]"),
            Quantity::InputAlong(i) => format!("own[{i}]"),
            Quantity::AngularAcceleration(i) => format!("s->angular_acceleration[{i}]"),
            Quantity::Temperature => "s->offset_c".into(),
            Quantity::TemperatureRate => {
                let lag = self.lag(RATE_LAG_S);
                format!("(s->lag_{lag} / {})", number(-RATE_LAG_S))
            }
            Quantity::TemperatureLag => format!("s->lag_{}", self.lag(parameter)),
            Quantity::Time => "(float)s->time_s".into(),
            Quantity::RateMagnitude => {
                "sqrtf(rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2])".into()
            }
            Quantity::SessionTime | Quantity::RecordingTime | Quantity::Up => return None,
        })
    }

    /// Index of the temperature with this lag, s.
    fn lag(&mut self, lag_s: f64) -> usize {
        let known = self.lags_s.iter().position(|known| *known == lag_s);
        known.unwrap_or_else(|| {
            self.lags_s.push(lag_s);
            self.lags_s.len() - 1
        })
    }
}

fn written(
    product: &Product,
    quantity: &mut impl FnMut(Quantity) -> Option<String>,
) -> Option<String> {
    let mut factors = Vec::new();
    for (q, power) in product.parts() {
        let factor = quantity(q)?;
        factors.extend(std::iter::repeat_n(factor, usize::from(power)));
    }
    let sign = if product.sign < 0.0 { "-" } else { "" };
    Some(format!("{sign}{}", factors.join(" * ")))
}
