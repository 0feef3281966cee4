//! A calibration in the words of the device: the bytes that it stores and what the PC compares it with are both made of these.

use std::fmt;

use mimu_core::RealField;
use mimu_core::compensation::Compensation;
use mimu_core::compensator::Compensator;
use mimu_core::die::DieLag;
use mimu_core::effects::{DeviceEffect, Effects, REFERENCE_C, Refused, Variable};
use mimu_core::stored::NODES;
use mimu_core::table::Table;
use mimu_core::wire::EFFECTS;
use nalgebra::convert;

use super::{Calibration, Curves};
use crate::effects::candidate::{Kind, OfConverter};
use crate::effects::quantity::Quantity;
use crate::effects::removal::Removed;
use crate::quantity::{PerSensor, Sensor};
use mimu_recording::error::{Error, Result};

/// Why no device removes an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NotOnDevice {
    /// None has its law.
    NoLaw,
    /// None has a factor of the product.
    NoFactor,
    /// It is over.
    Jump,
    /// One that has its law does not take its numbers.
    Numbers,
}

impl fmt::Display for NotOnDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoLaw => "no device removes this effect",
            Self::NoFactor => "no device knows a factor of it",
            Self::Jump => "a bias that has jumped once says nothing of the time after it",
            Self::Numbers => "its numbers make no sense to the device",
        })
    }
}

/// An effect as the device takes it, in its precision or a better one: of converters of the axes one for each.
///
/// # Errors
/// Why no device removes it.
pub fn on_device<T: RealField + Copy>(
    removed: &Removed,
) -> std::result::Result<Vec<DeviceEffect<T>>, NotOnDevice> {
    let candidate = &removed.candidate;
    let sensor = candidate.sensor;
    let numbers = |made: std::result::Result<_, Refused>| made.map_err(|_| NotOnDevice::Numbers);
    match &candidate.kind {
        Kind::Effect(effect) if !EFFECTS.contains(&effect.id) => Err(NotOnDevice::NoLaw),
        Kind::Effect(_) if candidate.reads_code() => {
            let of = |c: OfConverter| {
                let (weight, zero) = (convert(c.converter.weight), convert(c.converter.zero));
                let errors = c.errors.map(convert);
                numbers(DeviceEffect::code(sensor, c.axis, &errors, weight, zero))
            };
            let all = candidate.by_converter(&removed.values);
            all.into_iter().map(of).collect()
        }
        Kind::Effect(effect) => {
            // Those of a recording stand last; no file has them, and the device takes none.
            let mut coefficients = vec![T::zero(); effect.of_unit().count()];
            for (k, value) in candidate.active.iter().zip(&removed.values) {
                if let Some(slot) = coefficients.get_mut(*k) {
                    *slot = convert(*value);
                }
            }
            let nonlinear = effect.parameter.map(|_| convert(removed.parameter));
            let named = DeviceEffect::named(effect.id, &coefficients, nonlinear);
            Ok(vec![numbers(named)?])
        }
        Kind::Term(axis, product) => {
            let value = removed.values.first().copied().unwrap_or_default();
            let mut variables = Vec::new();
            for (quantity, power) in product.parts() {
                let variable = variable(quantity).ok_or(NotOnDevice::NoFactor)?;
                variables.extend(std::iter::repeat_n(variable, usize::from(power)));
            }
            let term = DeviceEffect::term(sensor, *axis, convert(value), &variables);
            Ok(vec![numbers(term)?])
        }
        Kind::Jump { .. } => Err(NotOnDevice::Jump),
    }
}

/// A variable of a term.
fn variable(of: Quantity) -> Option<Variable> {
    Some(match of {
        Quantity::Rate(i) => [Variable::RateX, Variable::RateY, Variable::RateZ][i],
        Quantity::Force(i) => [Variable::ForceX, Variable::ForceY, Variable::ForceZ][i],
        Quantity::Temperature => Variable::Temperature,
        Quantity::TemperatureRate => Variable::TemperatureRate,
        Quantity::Time => Variable::Time,
        _ => return None,
    })
}

/// A calibration as `core` runs it: on these curves, or with this model at all temperatures.
pub fn compensator<const N: usize>(
    calibration: &Calibration,
    model: Compensation<f64>,
    curves: Option<Curves>,
    effects: Effects<f64, N>,
) -> Compensator<f64, NODES, N> {
    let (table, lags) = match curves {
        Some(curves) => (curves.table().clone(), *curves.lags()),
        None => (
            Table::constant(REFERENCE_C, model),
            PerSensor::both(DieLag::none()),
        ),
    };
    let any = !calibration.effects().is_empty();
    Compensator {
        table,
        lags,
        effects: any.then_some(effects),
    }
}

/// The effects of a calibration as the device removes them; one that `core` lacks is refused by its id.
pub(super) fn core_effects<T: RealField + Copy, const N: usize>(
    calibration: &Calibration,
) -> Result<Effects<T, N>> {
    let place = format!("calibration of {:?}", calibration.device);
    let model = |sensor| {
        calibration.inverse(sensor).ok_or_else(|| {
            let problem = format!("there is no [{sensor}], and the device needs both");
            Error::new(&place, problem, "calibrate both sensors")
        })
    };
    let (gyro, accel) = (model(Sensor::Gyro)?, model(Sensor::Accel)?);
    effects_of_models(calibration, &Compensation { gyro, accel })
}

/// The same for a unit with these inverse models.
pub(super) fn effects_of_models<T: RealField + Copy, const N: usize>(
    calibration: &Calibration,
    models: &Compensation<f64>,
) -> Result<Effects<T, N>> {
    let place = format!("calibration of {:?}", calibration.device);
    let singular = || Error::new(&place, "C is singular", "fit the recording again");
    let limits = calibration.limits().map(|limits| limits.map(convert));
    let mut all = Effects::new(models).ok_or_else(singular)?.within(limits);
    for removed in calibration.effects() {
        let refuse = |problem: String, remedy: &str| {
            let id = removed.candidate.id();
            Error::new(format!("{place}, [[effect]] {id}"), problem, remedy)
        };
        const WITHOUT: &str = "update the device, or use the calibration without effects";
        let effects = on_device(removed).map_err(|why| match why {
            NotOnDevice::Numbers => refuse(why.to_string(), "diagnose the recording again"),
            _ => refuse(why.to_string(), WITHOUT),
        })?;
        for effect in effects {
            all.push(effect).map_err(|_| {
                let problem = format!("the device has no room for it: at most {N} of a kind");
                refuse(problem, WITHOUT)
            })?;
        }
    }
    Ok(all)
}
