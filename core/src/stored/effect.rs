//! Effects as bytes.

use heapless::Vec;

use super::bytes::{Reader, TooLong, Writer};
use crate::Sensor;
use crate::effects::{DeviceEffect, EffectError, Variable};

const NAMED: u8 = 0;
const TERM: u8 = 1;
/// Most coefficients of an effect.
const COEFFICIENTS: usize = 9;
/// Most variables of a term.
const FACTORS: usize = 3;

fn sensor(number: u8) -> Result<Sensor, EffectError> {
    let all = Sensor::BOTH.get(usize::from(number));
    all.copied().ok_or(EffectError::Unknown)
}

/// `None` if the bytes end in it.
pub(super) fn read(from: &mut Reader<'_>) -> Option<Result<DeviceEffect<f32>, EffectError>> {
    match from.u8()? {
        NAMED => {
            let length = from.u8()?;
            let id = from.slice(usize::from(length))?;
            let count = usize::from(from.u8()?);
            let mut coefficients = Vec::<f32, COEFFICIENTS>::new();
            if coefficients.resize(count, 0.0).is_err() {
                return Some(Err(EffectError::Unknown));
            }
            for coefficient in &mut coefficients {
                *coefficient = from.f32()?;
            }
            let constant = from.f32()?;
            let id = core::str::from_utf8(id).unwrap_or_default();
            let nonlinear = (constant != 0.0).then_some(constant);
            Some(DeviceEffect::named(id, &coefficients, nonlinear))
        }
        TERM => {
            let [triad, axis, count] = from.bytes()?;
            let mut variables = Vec::<Variable, FACTORS>::new();
            if variables
                .resize(usize::from(count), Variable::Time)
                .is_err()
            {
                return Some(Err(EffectError::Count { needed: FACTORS }));
            }
            let mut known = true;
            for variable in &mut variables {
                let number = from.u8()?;
                match Variable::ALL.iter().find(|v| **v as u8 == number) {
                    Some(found) => *variable = *found,
                    None => known = false,
                }
            }
            let coefficient = from.f32()?;
            let sensor = match sensor(triad) {
                Ok(sensor) if known => sensor,
                _ => return Some(Err(EffectError::Unknown)),
            };
            let axis = usize::from(axis);
            Some(DeviceEffect::term(sensor, axis, coefficient, &variables))
        }
        // A kind of a later version.
        _ => Some(Err(EffectError::Unknown)),
    }
}

pub(super) fn write(effect: &DeviceEffect<f32>, to: &mut Writer<'_>) -> Result<(), TooLong> {
    let count = |n: usize| u8::try_from(n).map_err(|_| TooLong);
    let (sensor, coefficients) = (effect.sensor(), effect.coefficients());
    let numbers = |to: &mut Writer<'_>| coefficients.iter().try_for_each(|c| to.f32(*c));
    if let Some(law) = effect.law() {
        let id = [sensor.name(), "_", law];
        to.bytes(&[NAMED, count(id.iter().map(|part| part.len()).sum())?])?;
        id.iter().try_for_each(|part| to.bytes(part.as_bytes()))?;
        to.bytes(&[count(coefficients.len())?])?;
        numbers(to)?;
        to.f32(effect.nonlinear().unwrap_or(0.0))?;
    }
    if let Some((axis, variables)) = effect.product() {
        let number = count(variables.clone().count())?;
        to.bytes(&[TERM, sensor as u8, axis as u8, number])?;
        variables
            .map(|v| v as u8)
            .try_for_each(|v| to.bytes(&[v]))?;
        numbers(to)?;
    }
    Ok(())
}
