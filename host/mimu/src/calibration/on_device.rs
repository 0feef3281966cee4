//! Effects in the words of the device: the bytes that it stores and what the PC compares it with are both made of these.

use mimu_core::RealField;
use mimu_core::compensation::{Affine, Compensation};
use mimu_core::compensator::Compensator;
use mimu_core::die::DieLag;
use mimu_core::effects::{
    Effect as DeviceEffect, Effects, REFERENCE_C, Refused, Sensor as DeviceSensor,
    Variable as DeviceVariable,
};
use mimu_core::stored::NODES;
use mimu_core::table::Table;
use mimu_core::wire::EFFECTS;
use nalgebra::convert;

use super::{Calibration, Curves};
use crate::effects::candidate::{Kind, OfConverter};
use crate::effects::converter::BITS;
use crate::effects::quantity::Quantity;
use crate::effects::removal::Removed;
use crate::quantity::Sensor;
use mimu_recording::error::{Error, Result};

/// An effect, or a converter of one, in the device's precision or a better one.
#[derive(Debug, Clone)]
pub struct OnDevice<T> {
    /// Public id.
    pub id: String,
    /// Whose readings err.
    pub sensor: DeviceSensor,
    /// Its numbers.
    pub what: What<T>,
}

/// The numbers of an effect as `core` takes them.
#[derive(Debug, Clone)]
pub enum What<T> {
    /// Of one that has a name.
    Named {
        /// All of its coefficients, SI; what the recording did not determine is 0.
        coefficients: Vec<T>,
        /// Its nonlinear constant.
        form: Option<T>,
    },
    /// Errors of a converter.
    Code {
        /// Axis that it reads; `None`: all of them.
        axis: Option<usize>,
        /// Of its bits, in units of the weight.
        errors: [T; BITS],
        /// Of its first bit, raw.
        weight: T,
        /// Reading of its code 0, raw.
        zero: T,
    },
    /// A product that was found from the data.
    Term {
        /// Axis that errs.
        axis: usize,
        /// SI.
        coefficient: T,
        /// One to three.
        variables: Vec<DeviceVariable>,
    },
}

impl<T: RealField + Copy> OnDevice<T> {
    /// An effect, of converters of the axes one for each; or why no device removes it.
    pub fn of(removed: &Removed) -> std::result::Result<Vec<Self>, &'static str> {
        let candidate = &removed.candidate;
        let one = |what| Self {
            id: candidate.id(),
            sensor: match candidate.sensor {
                Sensor::Gyro => DeviceSensor::Gyro,
                Sensor::Accel => DeviceSensor::Accel,
            },
            what,
        };
        match &candidate.kind {
            Kind::Effect(effect) if !EFFECTS.contains(&effect.id) => {
                Err("no device removes this effect")
            }
            Kind::Effect(_) if candidate.reads_code() => {
                let of = |c: OfConverter| {
                    one(What::Code {
                        axis: c.axis,
                        errors: c.errors.map(convert),
                        weight: convert(c.converter.weight),
                        zero: convert(c.converter.zero),
                    })
                };
                let all = candidate.by_converter(&removed.values);
                Ok(all.into_iter().map(of).collect())
            }
            Kind::Effect(effect) => {
                // Those of a recording stand last; no file has them, and the device takes none.
                let mut coefficients = vec![T::zero(); effect.of_unit().count()];
                for (k, value) in candidate.active.iter().zip(&removed.values) {
                    if let Some(slot) = coefficients.get_mut(*k) {
                        *slot = convert(*value);
                    }
                }
                let form = effect.parameter.map(|_| convert(removed.parameter));
                Ok(vec![one(What::Named { coefficients, form })])
            }
            Kind::Term(axis, product) => {
                let value = removed.values.first().copied().unwrap_or_default();
                let mut variables = Vec::new();
                for (quantity, power) in product.parts() {
                    let variable = variable(quantity).ok_or("no device knows a factor of it")?;
                    variables.extend(std::iter::repeat_n(variable, usize::from(power)));
                }
                Ok(vec![one(What::Term {
                    axis: *axis,
                    coefficient: convert(value),
                    variables,
                })])
            }
            Kind::Jump { .. } => {
                Err("a bias that has jumped once says nothing of the time after it")
            }
        }
    }

    /// The same compiled.
    pub fn effect(&self) -> std::result::Result<DeviceEffect<T>, Refused> {
        match &self.what {
            What::Named { coefficients, form } => {
                DeviceEffect::named(&self.id, coefficients, *form)
            }
            What::Code {
                axis,
                errors,
                weight,
                zero,
            } => DeviceEffect::code(self.sensor, *axis, errors, *weight, *zero),
            What::Term {
                axis,
                coefficient,
                variables,
            } => DeviceEffect::term(self.sensor, *axis, *coefficient, variables),
        }
    }
}

/// A variable of a term.
fn variable(of: Quantity) -> Option<DeviceVariable> {
    use DeviceVariable as Device;
    Some(match of {
        Quantity::Rate(i) => [Device::RateX, Device::RateY, Device::RateZ][i],
        Quantity::Force(i) => [Device::ForceX, Device::ForceY, Device::ForceZ][i],
        Quantity::Temperature => Device::Temperature,
        Quantity::TemperatureRate => Device::TemperatureRate,
        Quantity::Time => Device::Time,
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
        Some(curves) => (curves.table().clone(), Sensor::BOTH.map(|s| *curves.lag(s))),
        None => (Table::constant(REFERENCE_C, model), [DieLag::none(); 2]),
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
    let model = |sensor: Sensor| {
        calibration.inverse(sensor).ok_or_else(|| {
            let problem = format!("there is no [{sensor}], and the device needs both");
            Error::new(&place, problem, "calibrate both sensors")
        })
    };
    effects_of_models(calibration, &[model(Sensor::Gyro)?, model(Sensor::Accel)?])
}

/// The same for a unit with these inverse models.
pub(super) fn effects_of_models<T: RealField + Copy, const N: usize>(
    calibration: &Calibration,
    [gyro, accel]: &[Affine<f64>; 2],
) -> Result<Effects<T, N>> {
    let place = format!("calibration of {:?}", calibration.device);
    let singular = || Error::new(&place, "C is singular", "fit the recording again");
    let limits = calibration.limits().map(|limits| limits.map(convert));
    let mut all = Effects::new(gyro, accel)
        .ok_or_else(singular)?
        .within(limits);
    for removed in calibration.effects() {
        let refuse = |problem: String, remedy: &str| {
            let id = removed.candidate.id();
            Error::new(format!("{place}, [[effect]] {id}"), problem, remedy)
        };
        const WITHOUT: &str = "update the device, or use the calibration without effects";
        let parts = OnDevice::of(removed).map_err(|why| refuse(why.into(), WITHOUT))?;
        for part in parts {
            let pushed = part.effect().and_then(|effect| all.push(effect));
            pushed.map_err(|refused| match refused {
                Refused::Full => refuse(
                    format!("the device has no room for it: at most {N} of a kind"),
                    WITHOUT,
                ),
                Refused::Unknown => refuse("the device cannot remove it".into(), WITHOUT),
                Refused::Count { .. } | Refused::Value => {
                    refuse(NO_SENSE.into(), "diagnose the recording again")
                }
            })?;
        }
    }
    Ok(all)
}

/// What is wrong with an effect that `core` knows and does not take.
pub const NO_SENSE: &str = "its numbers make no sense to the device";
