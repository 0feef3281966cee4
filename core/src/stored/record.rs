//! Effects as bytes.

use heapless::Vec;

use super::bytes::{Reader, TooLong, Writer};
use crate::effects::{self, Effect, Sensor, Variable};

const NAMED: u8 = 0;
const TERM: u8 = 1;
const CODE: u8 = 2;
/// The axis of a code that is that of all three.
const ALL: u8 = 3;
/// Most coefficients of an effect.
const COEFFICIENTS: usize = 9;
/// Most variables of a term.
const FACTORS: usize = 3;

/// An effect as it is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Record<'a> {
    /// As in [`Effect::named`].
    Named {
        /// Public id.
        id: &'a str,
        /// All of its coefficients, SI.
        coefficients: &'a [f32],
        /// Nonlinear constant of an effect that has any: time constant, s.
        nonlinear: Option<f32>,
    },
    /// As in [`Effect::term`].
    Term {
        /// Triad.
        sensor: Sensor,
        /// 0 to 2.
        axis: u8,
        /// SI.
        coefficient: f32,
        /// One to three.
        variables: &'a [Variable],
    },
    /// As in [`Effect::code`].
    Code {
        /// Triad.
        sensor: Sensor,
        /// 0 to 2; `None`: all three alike.
        axis: Option<u8>,
        /// Of the first bit, V.
        weight: f32,
        /// Reading of code 0, V.
        zero: f32,
        /// Of nine bits, in units of the weight.
        errors: &'a [f32; COEFFICIENTS],
    },
}

fn triad(sensor: Sensor) -> u8 {
    match sensor {
        Sensor::Gyro => 0,
        Sensor::Accel => 1,
    }
}

fn sensor(triad: u8) -> Result<Sensor, effects::Refused> {
    match triad {
        0 => Ok(Sensor::Gyro),
        1 => Ok(Sensor::Accel),
        _ => Err(effects::Refused::Unknown),
    }
}

/// `None` if the bytes end in it.
pub(super) fn read(
    from: &mut Reader<'_>,
    mut show: impl FnMut(&Record<'_>),
) -> Option<Result<Effect<f32>, effects::Refused>> {
    let mut used = |record: Record<'_>| {
        show(&record);
        Some(record.effect())
    };
    match from.u8()? {
        NAMED => {
            let length = from.u8()?;
            let id = from.slice(usize::from(length))?;
            let count = usize::from(from.u8()?);
            let mut coefficients = Vec::<f32, COEFFICIENTS>::new();
            if coefficients.resize(count, 0.0).is_err() {
                return Some(Err(effects::Refused::Unknown));
            }
            for coefficient in &mut coefficients {
                *coefficient = from.f32()?;
            }
            let constant = from.f32()?;
            used(Record::Named {
                id: core::str::from_utf8(id).unwrap_or_default(),
                coefficients: &coefficients,
                nonlinear: (constant != 0.0).then_some(constant),
            })
        }
        TERM => {
            let [triad, axis, count] = from.bytes()?;
            let mut variables = Vec::<Variable, FACTORS>::new();
            if variables
                .resize(usize::from(count), Variable::Time)
                .is_err()
            {
                return Some(Err(effects::Refused::Count { needed: FACTORS }));
            }
            let mut known = true;
            for variable in &mut variables {
                let number = from.u8()?;
                match VARIABLES.iter().find(|v| **v as u8 == number) {
                    Some(found) => *variable = *found,
                    None => known = false,
                }
            }
            let coefficient = from.f32()?;
            match sensor(triad) {
                Ok(sensor) if known => used(Record::Term {
                    sensor,
                    axis,
                    coefficient,
                    variables: &variables,
                }),
                _ => Some(Err(effects::Refused::Unknown)),
            }
        }
        CODE => {
            let [triad, axis] = from.bytes()?;
            let (weight, zero) = (from.f32()?, from.f32()?);
            let mut errors = [0.0; COEFFICIENTS];
            for error in &mut errors {
                *error = from.f32()?;
            }
            match sensor(triad) {
                Ok(sensor) => used(Record::Code {
                    sensor,
                    axis: (axis != ALL).then_some(axis),
                    weight,
                    zero,
                    errors: &errors,
                }),
                Err(refused) => Some(Err(refused)),
            }
        }
        // Of a kind that a later version has.
        _ => Some(Err(effects::Refused::Unknown)),
    }
}

impl Record<'_> {
    pub(super) fn write(&self, to: &mut Writer<'_>) -> Result<(), TooLong> {
        let count = |n: usize| u8::try_from(n).map_err(|_| TooLong);
        match self {
            Record::Named {
                id,
                coefficients,
                nonlinear,
            } => {
                to.bytes(&[NAMED, count(id.len())?])?;
                to.bytes(id.as_bytes())?;
                to.bytes(&[count(coefficients.len())?])?;
                coefficients.iter().try_for_each(|c| to.f32(*c))?;
                to.f32(nonlinear.unwrap_or(0.0))?;
            }
            Record::Term {
                sensor,
                axis,
                coefficient,
                variables,
            } => {
                to.bytes(&[TERM, triad(*sensor), *axis, count(variables.len())?])?;
                variables.iter().try_for_each(|v| to.bytes(&[*v as u8]))?;
                to.f32(*coefficient)?;
            }
            Record::Code {
                sensor,
                axis,
                weight,
                zero,
                errors,
            } => {
                let axis = match axis {
                    None => ALL,
                    // No axis, which must not be read as all of them.
                    Some(ALL) => u8::MAX,
                    Some(axis) => *axis,
                };
                to.bytes(&[CODE, triad(*sensor), axis])?;
                let mut numbers = [weight, zero].into_iter().chain(*errors);
                numbers.try_for_each(|v| to.f32(*v))?;
            }
        }
        Ok(())
    }

    /// What the device computes with.
    fn effect(&self) -> Result<Effect<f32>, effects::Refused> {
        match *self {
            Self::Named {
                id,
                coefficients,
                nonlinear,
            } => Effect::named(id, coefficients, nonlinear),
            Self::Term {
                sensor,
                axis,
                coefficient,
                variables,
            } => Effect::term(sensor, usize::from(axis), coefficient, variables),
            Self::Code {
                sensor,
                axis,
                weight,
                zero,
                errors,
            } => Effect::code(sensor, axis.map(usize::from), errors, weight, zero),
        }
    }
}

const VARIABLES: [Variable; 9] = [
    Variable::RateX,
    Variable::RateY,
    Variable::RateZ,
    Variable::ForceX,
    Variable::ForceY,
    Variable::ForceZ,
    Variable::Temperature,
    Variable::TemperatureRate,
    Variable::Time,
];
