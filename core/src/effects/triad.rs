//! The effects of one triad: those that run with every sample, and the others folded into a matrix and a bias.

use nalgebra::{Matrix3, RealField, Vector3, convert};

use super::law::{Ambience, Conditions, Slow, Values, term};
use super::{Effect, Kind, Refused};
use crate::compensation::Affine;

/// Effects of one triad, and how their errors become errors in the body frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Triad<T: RealField, const N: usize> {
    /// Sensitive directions in the body frame: rows of the forward matrix, of unit length.
    directions: Matrix3<T>,
    /// R: errors along the sensors into errors of the compensated triad.
    to_body: Matrix3<T>,
    /// Without gaps.
    fast: [Option<Effect<T>>; N],
    /// Without gaps.
    slow: [Option<Effect<T>>; N],
}

/// The slow effects of one triad: `M x - b`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Folded<T: RealField, const N: usize> {
    matrix: Matrix3<T>,
    bias: Vector3<T>,
    /// Of each slow effect: the temperature behind its lag, less itself, °C. Kept as the difference: the lagged temperature itself
    /// would stand still in single precision once its step is below the last digit of some 10 °C.
    lags: [T; N],
}

impl<T: RealField + Copy, const N: usize> Folded<T, N> {
    /// Of no effects.
    pub fn none() -> Self {
        Self {
            matrix: Matrix3::identity(),
            bias: Vector3::zeros(),
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
        scale.iter().all(positive).then(|| Self {
            directions: Matrix3::from_fn(|i, j| convert(forward[(i, j)] / scale[i])),
            to_body: (inverse.matrix * Matrix3::from_diagonal(&scale)).map(convert),
            fast: [None; N],
            slow: [None; N],
        })
    }

    pub fn push(&mut self, effect: Effect<T>) -> Result<(), Refused> {
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
                Kind::Fast { .. } => {}
            }
        }
        let gain = Matrix3::from_diagonal(&total.along) * self.directions + total.across;
        folded.matrix = Matrix3::identity() - self.to_body * gain;
        folded.bias = self.to_body * total.bias;
    }

    /// The input of the triad without its errors.
    #[inline]
    pub fn remove(
        &self,
        folded: &Folded<T, N>,
        input: &Vector3<T>,
        at: &mut Conditions<T>,
        values: &Values<T>,
    ) -> Vector3<T> {
        let clean = folded.matrix * input - folded.bias;
        if !matches!(self.fast.first(), Some(Some(_))) {
            return clean;
        }
        at.sensed = self.directions * input;
        let mut e = Vector3::zeros();
        for effect in self.fast.iter().map_while(Option::as_ref) {
            match &effect.kind {
                Kind::Fast {
                    coefficients,
                    error,
                } => error(coefficients, at, &mut e),
                Kind::Term {
                    coefficient,
                    factors,
                } => term(coefficient, factors, values, &mut e),
                Kind::Slow { .. } => {}
            }
        }
        clean - self.to_body * e
    }
}
