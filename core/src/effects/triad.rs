//! The effects of one triad: those that run with every sample, and the others folded into a matrix and a bias.

use heapless::Vec;
use nalgebra::{Matrix3, RealField, Vector3};

use super::directions::Directions;
use super::effect::{EffectError, Kind};
use super::law::{Ambient, Conditions, Fast, Slow, Slowly, Values};
use crate::Sensor;
use crate::die::lagged;

/// Evaluations for a first sample.
const COLD: usize = 2;

/// Effects of one triad, and how their errors become errors in the body frame.
#[derive(Debug, Clone)]
pub(super) struct Triad<T: RealField, const N: usize> {
    directions: Directions<T>,
    fast: Vec<Fast<T>, N>,
    slow: Vec<Slowly<T>, N>,
}

/// Memory of the effects of one triad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Memory<T: RealField, const N: usize> {
    /// The slow effects: errors of the sensors `A x + b`.
    slope: Matrix3<T>,
    bias: Vector3<T>,
    /// Error of the sample before, body frame; `None` if there was none.
    before: Option<Vector3<T>>,
    /// For each slow effect: the lagged temperature minus the temperature, °C.
    lags: [T; N],
}

impl<T: RealField + Copy, const N: usize> Memory<T, N> {
    /// Empty memory.
    pub fn none() -> Self {
        Self {
            slope: Matrix3::zeros(),
            bias: Vector3::zeros(),
            before: None,
            lags: [T::zero(); N],
        }
    }

    /// Samples are missing before the next one.
    pub fn gap(&mut self) {
        self.before = None;
    }
}

impl<T: RealField + Copy, const N: usize> Triad<T, N> {
    /// No effects.
    pub fn new(directions: Directions<T>) -> Self {
        Self {
            directions,
            fast: Vec::new(),
            slow: Vec::new(),
        }
    }

    pub fn push(&mut self, effect: &Kind<T>) -> Result<(), EffectError> {
        match effect {
            Kind::Fast(fast) => self.fast.push(*fast).map_err(|_| EffectError::Full)?,
            Kind::Slow(slow) => self.slow.push(*slow).map_err(|_| EffectError::Full)?,
        }
        Ok(())
    }

    /// Lagged temperatures of a memory minus the temperature, °C, each with its time constant, s.
    pub fn lags<'a>(&'a self, memory: &'a Memory<T, N>) -> impl Iterator<Item = (T, T)> + 'a {
        let all = self.slow.iter().zip(&memory.lags);
        all.filter_map(|(effect, lag)| match effect {
            Slowly::Law {
                nonlinear,
                lags: true,
                ..
            } => Some((*nonlinear, *lag)),
            _ => None,
        })
    }

    /// A memory with only the known lagged temperatures, by their time constants, s.
    pub fn memory(&self, known: impl Fn(T) -> Option<T>) -> Memory<T, N> {
        let mut memory = Memory::none();
        for (effect, lag) in self.slow.iter().zip(&mut memory.lags) {
            if let Slowly::Law {
                nonlinear,
                lags: true,
                ..
            } = effect
            {
                *lag = known(*nonlinear).unwrap_or(T::zero());
            }
        }
        memory
    }

    /// Folds the slow effects; expects the slow variables of the conditions to be set.
    pub fn slow(
        &self,
        memory: &mut Memory<T, N>,
        dt: T,
        risen: T,
        settled: bool,
        at: &Conditions<T>,
    ) {
        let [.., temperature_offset, _, time] = at.values;
        let mut total = Slow {
            bias: Vector3::zeros(),
            along: Vector3::zeros(),
            across: Matrix3::zeros(),
        };
        for (effect, lag) in self.slow.iter().zip(&mut memory.lags) {
            match effect {
                Slowly::Law {
                    law,
                    coefficients,
                    nonlinear,
                    lags,
                } => {
                    if *lags {
                        *lag = lagged(*lag, dt, risen, *nonlinear);
                    }
                    let lag = *lag;
                    law(
                        coefficients,
                        *nonlinear,
                        &Ambient {
                            time,
                            settled,
                            temperature_offset,
                            lag,
                        },
                        &mut total,
                    );
                }
                Slowly::Term(term) => (term.law)(term, at, &mut total.bias),
            }
        }
        memory.slope = Matrix3::from_diagonal(&total.along) * self.directions.sensed + total.across;
        memory.bias = total.bias;
    }

    /// The input of the triad without its errors; `own` selects it among the conditions, which stay unchanged.
    #[inline]
    pub fn remove(
        &self,
        memory: &mut Memory<T, N>,
        own: Sensor,
        input: &Vector3<T>,
        at: &mut Conditions<T>,
    ) -> Vector3<T> {
        match self.fast.is_empty() && self.slow.is_empty() {
            true => *input,
            false => input - self.error(memory, own, input, at),
        }
    }

    /// Error of the input, body frame.
    fn error(
        &self,
        memory: &mut Memory<T, N>,
        own: Sensor,
        input: &Vector3<T>,
        at: &mut Conditions<T>,
    ) -> Vector3<T> {
        let rounds = match memory.before {
            Some(_) => 1,
            None => COLD,
        };
        for _ in 0..rounds {
            let before = memory.before.unwrap_or(Vector3::zeros());
            // If the slope of the error exceeds that of the input (far beyond any sensor), the iteration would diverge. The 1 is 1 rad/s or
            // 1 m/s²: a sensor at rest errs by much less.
            let clean = match before.norm_squared() < input.norm_squared() + T::one() {
                true => input - before,
                false => *input,
            };
            put(&mut at.values, own, &clean);
            at.sensed = self.directions.sensed * clean;
            let mut e = memory.bias;
            e.gemv(T::one(), &memory.slope, &clean, T::one());
            for effect in &self.fast {
                (effect.law)(effect, at, &mut e);
            }
            memory.before = Some(self.directions.to_body * e);
        }
        put(&mut at.values, own, input);
        memory.before.unwrap_or(Vector3::zeros())
    }
}

/// Sets the input of a triad among the variables.
pub(super) fn put<T: RealField + Copy>(values: &mut Values<T>, own: Sensor, input: &Vector3<T>) {
    let [_, rx, ry, rz, fx, fy, fz, ..] = values;
    let [x, y, z] = match own {
        Sensor::Gyro => [rx, ry, rz],
        Sensor::Accel => [fx, fy, fz],
    };
    (*x, *y, *z) = (input.x, input.y, input.z);
}
