//! The effects of one triad: those that run with every sample, and the others folded into a matrix and a bias.

use nalgebra::{Matrix3, RealField, Vector3};

use super::law::{Ambience, COEFFICIENTS, Code, Conditions, Fast, Slow, SlowLaw, Values, affine};
use super::{Directions, Kind, Refused, Sensor};

/// Evaluations of a sample that none goes before.
const COLD: usize = 2;

/// An effect that moves with temperature and time only.
#[derive(Debug, Clone, Copy)]
pub(super) enum Slowly<T: RealField> {
    Law {
        law: SlowLaw<T>,
        coefficients: [T; COEFFICIENTS],
        form: T,
        lags: bool,
    },
    /// A term of slow variables, which is a bias.
    Term(Fast<T>),
}

/// Effects of one triad, and how their errors become errors in the body frame. In this order: what lies further from the beginning
/// than an instruction can say takes one more.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(super) struct Triad<T: RealField, const N: usize> {
    directions: Directions<T>,
    /// Without gaps.
    fast: [Option<Fast<T>>; N],
    /// Without gaps.
    slow: [Option<Slowly<T>>; N],
    /// By axis, which may each have a converter of its own.
    code: [Option<Code<T>>; 3],
}

/// What the effects of one triad remember.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Memory<T: RealField, const N: usize> {
    /// The slow effects: errors of the sensors `A x + b`.
    slope: Matrix3<T>,
    bias: Vector3<T>,
    /// Error of the sample before, body frame; `None` if there was none.
    before: Option<Vector3<T>>,
    /// Of each slow effect: the temperature behind its lag, less itself, °C. Kept as the difference: the lagged temperature itself
    /// would stand still in single precision once its step is below the last digit of some 10 °C.
    lags: [T; N],
}

impl<T: RealField + Copy, const N: usize> Memory<T, N> {
    /// Of nothing.
    pub fn none() -> Self {
        Self {
            slope: Matrix3::zeros(),
            bias: Vector3::zeros(),
            before: None,
            lags: [T::zero(); N],
        }
    }

    /// The next sample does not follow the one before.
    pub fn gap(&mut self) {
        self.before = None;
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
    /// No effects.
    pub fn new(directions: Directions<T>) -> Self {
        Self {
            directions,
            fast: [None; N],
            slow: [None; N],
            code: [None; 3],
        }
    }

    pub fn push(&mut self, effect: &Kind<T>) -> Result<(), Refused> {
        match effect {
            Kind::Code {
                axes,
                errors,
                weight,
                zero,
            } => {
                // All are looked at before any is set: what is refused changes nothing.
                let mut both = self.code.iter().zip(axes);
                if both.any(|(code, meant)| *meant && code.is_some()) {
                    return Err(Refused::Full);
                }
                let new = Code::new(errors, *weight, *zero);
                for (code, meant) in self.code.iter_mut().zip(axes) {
                    if *meant {
                        *code = Some(new);
                    }
                }
            }
            Kind::Fast(fast) => {
                let free = self.fast.iter_mut().find(|e| e.is_none());
                *free.ok_or(Refused::Full)? = Some(*fast);
            }
            Kind::Slow(slow) => {
                let free = self.slow.iter_mut().find(|e| e.is_none());
                *free.ok_or(Refused::Full)? = Some(*slow);
            }
        }
        Ok(())
    }

    /// Folds the slow effects; the slow variables of the conditions are set.
    pub fn slow(&self, memory: &mut Memory<T, N>, dt: T, risen: T, at: &Conditions<T>) {
        let [.., warm, _, time] = at.values;
        let mut total = Slow {
            bias: Vector3::zeros(),
            along: Vector3::zeros(),
            across: Matrix3::zeros(),
        };
        for (effect, lag) in self.slow.iter().flatten().zip(&mut memory.lags) {
            match effect {
                Slowly::Law {
                    law,
                    coefficients,
                    form,
                    lags,
                } => {
                    if *lags {
                        *lag = lagged(*lag, dt, risen, *form);
                    }
                    let lag = *lag;
                    law(
                        coefficients,
                        *form,
                        &Ambience { time, warm, lag },
                        &mut total,
                    );
                }
                Slowly::Term(term) => (term.law)(term, at, &mut total.bias),
            }
        }
        memory.slope = Matrix3::from_diagonal(&total.along) * self.directions.sensed + total.across;
        memory.bias = total.bias;
    }

    /// Raw readings without the errors of the converters.
    #[inline(always)]
    pub fn without_code_errors(&self, raw: &Vector3<T>) -> Vector3<T> {
        let mut clean = *raw;
        let [x, y, z] = &self.code;
        if let Some(code) = x {
            clean.x = code.clean(raw.x);
        }
        if let Some(code) = y {
            clean.y = code.clean(raw.y);
        }
        if let Some(code) = z {
            clean.z = code.clean(raw.z);
        }
        clean
    }

    /// The input of the triad without its errors; `own` says which of the conditions that is. They are left as they were.
    #[inline(never)]
    pub fn remove(
        &self,
        memory: &mut Memory<T, N>,
        own: Sensor,
        input: &Vector3<T>,
        at: &mut Conditions<T>,
    ) -> Vector3<T> {
        let none = !matches!(self.fast.first(), Some(Some(_)))
            && !matches!(self.slow.first(), Some(Some(_)));
        if none {
            return *input;
        }
        let rounds = match memory.before {
            Some(_) => 1,
            None => COLD,
        };
        for _ in 0..rounds {
            let before = memory.before.unwrap_or(Vector3::zeros());
            // Where the error is steeper than the input, far beyond any sensor, this would lead away, and out of all numbers. The
            // one is 1 rad/s or 1 m/s²: by much less may a resting sensor be off.
            let size = |v: &Vector3<T>| v.x * v.x + v.y * v.y + v.z * v.z;
            let clean = match size(&before) < size(input) + T::one() {
                true => Vector3::new(input.x - before.x, input.y - before.y, input.z - before.z),
                false => *input,
            };
            put(&mut at.values, own, &clean);
            at.sensed = affine(&self.directions.sensed, &clean, &Vector3::zeros());
            let mut e = affine(&memory.slope, &clean, &memory.bias);
            for effect in self.fast.iter().map_while(Option::as_ref) {
                (effect.law)(effect, at, &mut e);
            }
            memory.before = Some(affine(&self.directions.to_body, &e, &Vector3::zeros()));
        }
        put(&mut at.values, own, input);
        input - memory.before.unwrap_or(Vector3::zeros())
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
