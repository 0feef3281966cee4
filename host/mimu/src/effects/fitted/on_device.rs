//! Effects in the form that the device takes, and back.

use mimu_core::RealField;
use mimu_core::effects::{DeviceEffect, EffectError, Variable};
use mimu_core::wire::EFFECTS;
use nalgebra::convert;

use super::{FittedEffect, candidate};
use crate::effects::candidate::CandidateKind;
use crate::effects::quantity::Quantity;

/// Why no device removes an effect.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotOnDevice {
    /// No device has its law.
    #[error("devices do not remove this effect")]
    NoLaw,
    /// No device has a factor of the product.
    #[error("it has a factor that devices do not know")]
    NoFactor,
    /// It is a jump, which is over.
    #[error("a bias that has jumped once may jump again, so the jump cannot be removed later")]
    Jump,
    /// A device has its law, but does not take its numbers: the first of these, with its name.
    #[error("{0} is impossible: at 1 g, 1 rad/s and 10 K the effect would exceed the input")]
    Numbers(String),
}

impl FittedEffect {
    /// The effect as the device takes it, in the device's precision or a better one.
    ///
    /// # Errors
    /// Why no device removes it.
    pub fn on_device<T: RealField + Copy>(&self) -> Result<DeviceEffect<T>, NotOnDevice> {
        self.form().map_err(|why| match why {
            NotOnDevice::Numbers(_) => NotOnDevice::Numbers(self.refused()),
            other => other,
        })
    }

    /// The same, without saying which number is refused.
    fn form<T: RealField + Copy>(&self) -> Result<DeviceEffect<T>, NotOnDevice> {
        let candidate = &self.candidate;
        let sensor = candidate.sensor;
        let numbers =
            |made: Result<_, EffectError>| made.map_err(|_| NotOnDevice::Numbers(String::new()));
        match &candidate.kind {
            CandidateKind::Effect(effect) if !EFFECTS.contains(&effect.id) => {
                Err(NotOnDevice::NoLaw)
            }
            CandidateKind::Effect(effect) => {
                // Coefficients of a recording come last; no file has them, and the device takes none.
                let mut coefficients = vec![T::zero(); effect.of_unit().count()];
                for (k, value) in candidate.active.iter().zip(&self.values) {
                    if let Some(slot) = coefficients.get_mut(*k) {
                        *slot = convert(*value);
                    }
                }
                let nonlinear = effect.parameter.map(|_| convert(self.parameter));
                let named = DeviceEffect::named(effect.id, &coefficients, nonlinear);
                numbers(named)
            }
            CandidateKind::Term(axis, product) => {
                let value = self.values.first().copied().unwrap_or_default();
                let mut variables = Vec::new();
                for (quantity, power) in product.parts() {
                    let variable = variable(quantity).ok_or(NotOnDevice::NoFactor)?;
                    variables.extend(std::iter::repeat_n(variable, usize::from(power)));
                }
                let term = DeviceEffect::term(sensor, *axis, convert(value), &variables);
                numbers(term)
            }
            CandidateKind::Jump { .. } => Err(NotOnDevice::Jump),
        }
    }

    /// The number that a device refuses, with its name.
    fn refused(&self) -> String {
        let alone = |k: Option<usize>| {
            let mut one = self.clone();
            let values = one.values.iter_mut().enumerate();
            values.for_each(|(at, value)| *value *= f64::from(u8::from(Some(at) == k)));
            one.form::<f64>().is_err()
        };
        let constant = self.nonlinear_parameter().filter(|_| alone(None));
        let named = self.coefficients().into_iter().enumerate();
        let mut refused = named.filter(|(k, _)| alone(Some(*k)));
        match (constant, refused.next()) {
            (Some(constant), _) => format!("{} = {:?} s", constant.name, constant.value),
            (None, Some((_, c))) => format!("{} = {:?} {}", c.name, c.value, c.unit),
            (None, None) => "one of its numbers".into(),
        }
    }

    /// The effects that a device stores.
    ///
    /// # Errors
    /// The first effect that this program does not know.
    pub fn all_of_device(on_device: &[DeviceEffect<f32>]) -> Result<Vec<Self>, DeviceEffect<f32>> {
        let each = on_device.iter();
        each.map(|one| Self::of_device(one).ok_or(*one)).collect()
    }

    fn of_device(one: &DeviceEffect<f32>) -> Option<Self> {
        let mut candidate = candidate(&one.to_string())?;
        let all = one.coefficients();
        // Coefficients that were not determined are zero on the device, and are left out of the file.
        let whole = all.iter().all(|c| *c == 0.0);
        let (active, values): (Vec<usize>, Vec<f64>) = (0..)
            .zip(all)
            .filter(|(_, value)| whole || **value != 0.0)
            .map(|(k, value)| (k, f64::from(*value)))
            .unzip();
        let known = active.iter().all(|k| candidate.active.contains(k));
        candidate.active = active;
        let parameter = match candidate.parameter() {
            Some(_) => f64::from(one.nonlinear()?),
            None => 0.0,
        };
        known.then(|| Self::new(candidate, parameter, values))
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
