//! The effects of one triad: those that run with every sample, and the others folded into a matrix and a bias.

use nalgebra::{Matrix3, RealField, Vector3, convert};

use super::law::{Ambience, Code, Conditions, Slow, Values, readout_code, term};
use super::{Effect, Kind, Refused, Sensor};
use crate::compensation::Affine;

/// Effects of one triad, and how their errors become errors in the body frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Triad<T: RealField, const N: usize> {
    /// Sensitive directions in the body frame: rows of the forward matrix, of unit length.
    directions: Matrix3<T>,
    /// Their lengths, raw/SI, and the readings without input, raw.
    scale: Vector3<T>,
    bias: Vector3<T>,
    /// R: errors along the sensors into errors of the compensated triad.
    to_body: Matrix3<T>,
    /// Without gaps.
    fast: [Option<Effect<T>>; N],
    /// Without gaps.
    slow: [Option<Effect<T>>; N],
    code: Option<Code<T>>,
}

/// The slow effects of one triad: errors of the compensated triad `G x + b`, and with them once taken out of x as well, `M x + a`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Folded<T: RealField, const N: usize> {
    gain: Matrix3<T>,
    bias: Vector3<T>,
    clean: Affine<T>,
    /// Of each slow effect: the temperature behind its lag, less itself, °C. Kept as the difference: the lagged temperature itself
    /// would stand still in single precision once its step is below the last digit of some 10 °C.
    lags: [T; N],
}

impl<T: RealField + Copy, const N: usize> Folded<T, N> {
    /// Of no effects.
    pub fn none() -> Self {
        Self {
            gain: Matrix3::zeros(),
            bias: Vector3::zeros(),
            clean: Affine {
                matrix: Matrix3::identity(),
                offset: Vector3::zeros(),
            },
            lags: [T::zero(); N],
        }
    }
}

/// A step of `late - warm` over `dt` behind a first-order lag, `step` being that of `warm`: exact if it is a ramp.
pub(super) fn lagged<T: RealField + Copy>(difference: T, dt: T, step: T, lag: T) -> T {
    let z = dt / lag;
    // No time passed: all of the step is yet to come.
    if !(z > T::zero()) {
        return difference - step;
    }
    let gone = -(-z).exp_m1();
    difference - difference * gone - step * (gone / z)
}

impl<T: RealField + Copy, const N: usize> Triad<T, N> {
    /// No effects of a triad with this inverse model; `None` if it is singular.
    pub fn new(inverse: &Affine<f64>) -> Option<Self> {
        let forward = inverse.matrix.try_inverse()?;
        let scale = Vector3::from_fn(|i, _| forward.row(i).norm());
        let positive = |s: &f64| *s > 0.0 && s.is_finite();
        let bias = -(forward * inverse.offset);
        scale.iter().all(positive).then(|| Self {
            scale: scale.map(convert),
            bias: bias.map(convert),
            code: None,
            directions: Matrix3::from_fn(|i, j| convert(forward[(i, j)] / scale[i])),
            to_body: (inverse.matrix * Matrix3::from_diagonal(&scale)).map(convert),
            fast: [None; N],
            slow: [None; N],
        })
    }

    pub fn push(&mut self, effect: Effect<T>) -> Result<(), Refused> {
        if let Kind::Code { errors, weight } = &effect.kind {
            if self.code.is_some() {
                return Err(Refused::Full);
            }
            self.code = Some(Code::new(errors, *weight, &self.scale, &self.bias));
            return Ok(());
        }
        let list = match effect.is_slow() {
            true => &mut self.slow,
            false => &mut self.fast,
        };
        let free = list.iter_mut().find(|e| e.is_none());
        *free.ok_or(Refused::Full)? = Some(effect);
        Ok(())
    }

    /// Folds the slow effects; the variables of the slow ones are set.
    pub fn slow(&self, folded: &mut Folded<T, N>, dt: T, risen: T, values: &Values<T>) {
        let [.., warm, _, time] = *values;
        let mut total = Slow {
            bias: Vector3::zeros(),
            along: Vector3::zeros(),
            across: Matrix3::zeros(),
        };
        for (effect, lag) in self.slow.iter().flatten().zip(&mut folded.lags) {
            match &effect.kind {
                Kind::Slow {
                    coefficients,
                    form,
                    lags,
                    error,
                } => {
                    if *lags {
                        *lag = lagged(*lag, dt, risen, *form);
                    }
                    let lag = *lag;
                    error(
                        coefficients,
                        *form,
                        &Ambience { time, warm, lag },
                        &mut total,
                    );
                }
                Kind::Term {
                    coefficient,
                    factors,
                } => term(coefficient, factors, values, &mut total.bias),
                Kind::Fast { .. } | Kind::Code { .. } => {}
            }
        }
        let along = Matrix3::from_diagonal(&total.along) * self.directions + total.across;
        let (gain, bias) = (self.to_body * along, self.to_body * total.bias);
        folded.clean = Affine {
            matrix: Matrix3::identity() - gain + gain * gain,
            offset: gain * bias - bias,
        };
        (folded.gain, folded.bias) = (gain, bias);
    }

    /// The input of the triad without its errors; `own` says which of the conditions that is.
    #[inline]
    pub fn remove(
        &self,
        folded: &Folded<T, N>,
        own: Sensor,
        at: &Conditions<T>,
        values: &Values<T>,
    ) -> Vector3<T> {
        let input = match own {
            Sensor::Gyro => at.rate,
            Sensor::Accel => at.force,
        };
        let none = !matches!(self.fast.first(), Some(Some(_)));
        if none && self.code.is_none() {
            return folded.clean.apply(&input);
        }
        let first = self.error(folded, &input, at, values);
        let once = input - first;
        let (mut at, mut values) = (*at, *values);
        let [_, rx, ry, rz, fx, fy, fz, ..] = &mut values;
        match own {
            Sensor::Gyro => {
                at.rate = once;
                (*rx, *ry, *rz) = (once.x, once.y, once.z);
            }
            Sensor::Accel => {
                at.force = once;
                (*fx, *fy, *fz) = (once.x, once.y, once.z);
            }
        }
        let second = self.error(folded, &once, &at, &values);
        // Where the error is steeper than the input, far beyond any sensor, this would lead away, and out of all numbers.
        match (second - first).norm_squared() < first.norm_squared() {
            true => input - second,
            false => input - first,
        }
    }

    /// Error of the compensated triad by its input.
    fn error(
        &self,
        folded: &Folded<T, N>,
        input: &Vector3<T>,
        at: &Conditions<T>,
        values: &Values<T>,
    ) -> Vector3<T> {
        let sensed = self.directions * input;
        let at = Conditions { sensed, ..*at };
        let mut e = Vector3::zeros();
        for effect in self.fast.iter().map_while(Option::as_ref) {
            match &effect.kind {
                Kind::Fast {
                    coefficients,
                    error,
                } => error(coefficients, &at, &mut e),
                Kind::Term {
                    coefficient,
                    factors,
                } => term(coefficient, factors, values, &mut e),
                Kind::Slow { .. } | Kind::Code { .. } => {}
            }
        }
        if let Some(code) = &self.code {
            readout_code(code, &sensed, &mut e);
        }
        folded.gain * input + folded.bias + self.to_body * e
    }
}
