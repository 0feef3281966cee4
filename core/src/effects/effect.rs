//! One effect, with its numbers.

use nalgebra::{RealField, convert};

use super::code::{BITS, FARTHEST_ZERO};
use super::law::{COEFFICIENTS, Evaluation, FACTORS, Fast, Law, Nonlinear, Slowly, term};

/// Triad whose readings err.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensor {
    /// Gyro; errors in rad/s.
    Gyro,
    /// Accelerometer; errors in m/s².
    Accel,
}

/// A quantity that a [term](Effect::term) is a product of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Variable {
    /// Rate about body x, rad/s.
    RateX = 1,
    /// Rate about body y, rad/s.
    RateY,
    /// Rate about body z, rad/s.
    RateZ,
    /// Specific force along body x, m/s².
    ForceX,
    /// Specific force along body y, m/s².
    ForceY,
    /// Specific force along body z, m/s².
    ForceZ,
    /// Temperature above [`REFERENCE_C`](super::REFERENCE_C), °C.
    Temperature,
    /// Its rate of change behind a lag of [`RATE_LAG_S`](super::RATE_LAG_S), °C/s.
    TemperatureRate,
    /// Time since power-on, s.
    Time,
}

/// Time constants that an effect may have, s: from a sample at 1 kHz to four months. Outside, its decay or its lag is a constant within
/// any session.
pub const TIME_CONSTANT_RANGE_S: [f64; 2] = [1e-3, 1e7];

/// Why an effect is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refused {
    /// No effect of this name can be removed here.
    Unknown,
    /// It takes another number of coefficients, or a term another number of variables.
    Count {
        /// How many (a term: at most).
        needed: usize,
    },
    /// A coefficient is not a finite number, a nonlinear constant is missing, not wanted or outside
    /// [`TIME_CONSTANT_RANGE_S`], a weight is not positive, or there is no such axis.
    Value,
    /// There is no room for one more, or an axis has a code already.
    Full,
}

impl core::fmt::Display for Refused {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Unknown => f.write_str("no effect of this name can be removed here"),
            Self::Count { needed } => write!(f, "the effect takes {needed} numbers"),
            Self::Value => {
                f.write_str("the effect has an impossible coefficient or nonlinear parameter")
            }
            Self::Full => f.write_str("there is no room for one more effect"),
        }
    }
}

impl core::error::Error for Refused {}

/// An effect with its numbers.
#[derive(Debug, Clone, Copy)]
pub struct Effect<T: RealField> {
    pub(super) sensor: Sensor,
    pub(super) kind: Kind<T>,
}

/// How an effect is removed.
#[derive(Debug, Clone, Copy)]
pub(super) enum Kind<T: RealField> {
    Fast(Fast<T>),
    Slow(Slowly<T>),
    Code {
        /// Whose readings err.
        axes: [bool; 3],
        /// In units of the weight of bit 0.
        errors: [T; BITS],
        /// Of bit 0, raw.
        weight: T,
        /// Reading of code 0, raw.
        zero: T,
    },
}

impl<T: RealField + Copy> Effect<T> {
    /// The effect of a public id like `gyro_scale_cubic`, with all of its coefficients (SI, those of a matrix by rows) and the
    /// nonlinear constant of one that has any: a time constant, s.
    pub fn named(id: &str, coefficients: &[T], nonlinear: Option<T>) -> Result<Self, Refused> {
        let (sensor, name) = match (id.strip_prefix("gyro_"), id.strip_prefix("accel_")) {
            (Some(name), _) => (Sensor::Gyro, name),
            (_, Some(name)) => (Sensor::Accel, name),
            _ => return Err(Refused::Unknown),
        };
        let law = Law::<T>::named(name).ok_or(Refused::Unknown)?;
        if coefficients.len() != law.coefficients {
            let needed = law.coefficients;
            return Err(Refused::Count { needed });
        }
        let nonlinear = match (law.nonlinear, nonlinear) {
            (Nonlinear::None, None) => T::one(),
            (Nonlinear::TimeConstant | Nonlinear::Lag, Some(value))
                if value >= convert(TIME_CONSTANT_RANGE_S[0])
                    && value <= convert(TIME_CONSTANT_RANGE_S[1]) =>
            {
                value
            }
            _ => return Err(Refused::Value),
        };
        let mut all = [T::zero(); COEFFICIENTS];
        for (all, coefficient) in all.iter_mut().zip(coefficients) {
            if !coefficient.is_finite() {
                return Err(Refused::Value);
            }
            *all = *coefficient;
        }
        let kind = match law.evaluation {
            Evaluation::Fast(law) => Kind::Fast(Fast {
                law,
                coefficients: all,
                factors: [0; 3],
            }),
            Evaluation::Slow(run) => Kind::Slow(Slowly::Law {
                law: run,
                coefficients: all,
                nonlinear,
                lags: law.nonlinear == Nonlinear::Lag,
            }),
        };
        Ok(Self { sensor, kind })
    }

    /// `coefficient` times the product of one to three variables, in the error of one axis (0 to 2); SI.
    pub fn term(
        sensor: Sensor,
        axis: usize,
        coefficient: T,
        variables: &[Variable],
    ) -> Result<Self, Refused> {
        let needed = FACTORS;
        if variables.is_empty() || variables.len() > needed {
            return Err(Refused::Count { needed });
        }
        let mut coefficients = [T::zero(); COEFFICIENTS];
        let [x, y, z, ..] = &mut coefficients;
        match [x, y, z].into_iter().nth(axis) {
            Some(along) if coefficient.is_finite() => *along = coefficient,
            _ => return Err(Refused::Value),
        }
        let mut factors = [0; FACTORS];
        for (factor, variable) in factors.iter_mut().zip(variables) {
            *factor = *variable as u8;
        }
        let term = Fast {
            law: term,
            coefficients,
            factors,
        };
        let slow = |v: &Variable| *v as u8 >= Variable::Temperature as u8;
        let kind = match variables.iter().all(slow) {
            true => Kind::Slow(Slowly::Term(term)),
            false => Kind::Fast(term),
        };
        Ok(Self { sensor, kind })
    }

    /// Errors of a converter by the bits of its code, of one axis (0 to 2), or of all three alike.
    ///
    /// `weight`: of bit 0, the highest, raw; each of the nine bits has half the weight of the one before. `errors`: what a reading has too
    /// much where the bit is set, in units of `weight`. `zero`: the reading of code 0, raw; not 0 where something was subtracted from the
    /// readings. A reading of less than 1/65536 of `weight` below the turn of a bit counts as one of the turn, whichever way it was
    /// rounded. The code of all nine bits set, and one more, is again 0: what lies beyond is not distinguished. Refused where a number is not
    /// finite, the weight not positive, or `zero` farther from a reading of 0 than [`FARTHEST_ZERO`] weights.
    ///
    /// ```
    /// # use mimu_core::compensation::Sample;
    /// # use mimu_core::effects::{Directions, Effect, Effects, Sensor};
    /// # use nalgebra::{Matrix3, Vector3};
    /// // Bit 0 of a converter of ±2.5 V is worth 2.5 V, and 1 mV more than that.
    /// let code = Effect::code(Sensor::Gyro, Some(2), &[4e-4, 0., 0., 0., 0., 0., 0., 0., 0.], 2.5, -2.5).unwrap();
    /// let directions = Directions { sensed: Matrix3::identity(), to_body: Matrix3::identity() };
    /// let mut effects = Effects::<f64, 8>::of(directions, directions);
    /// effects.push(code).unwrap();
    /// let read = Sample { gyro: Vector3::new(0.5, 0.5, 0.5), accel: Vector3::repeat(1.7) };
    /// let clean = effects.without_code_errors(&read);
    /// assert_eq!(clean.gyro, Vector3::new(0.5, 0.5, 0.499));
    /// assert_eq!(clean.accel, read.accel);
    /// ```
    pub fn code(
        sensor: Sensor,
        axis: Option<usize>,
        errors: &[T; BITS],
        weight: T,
        zero: T,
    ) -> Result<Self, Refused> {
        let axes = match axis {
            None => [true; 3],
            Some(axis) => [0, 1, 2].map(|i| i == axis),
        };
        // What is not finite in single precision is not in this one, or becomes it in the tables.
        let codes = convert::<_, T>(256.0) / weight;
        let most = errors.iter().fold(T::zero(), |sum, e| sum + e.abs()) * weight;
        let finite = [weight, codes, most].iter().all(T::is_finite);
        let near = zero.abs() <= convert::<_, T>(FARTHEST_ZERO) * weight;
        if !(finite && near && weight > T::zero() && axes.contains(&true)) {
            return Err(Refused::Value);
        }
        let errors = *errors;
        let kind = Kind::Code {
            axes,
            errors,
            weight,
            zero,
        };
        Ok(Self { sensor, kind })
    }

    /// Whether it moves with temperature and time only, so that no sample pays for it.
    pub fn is_slow(&self) -> bool {
        matches!(self.kind, Kind::Slow(_))
    }
}
