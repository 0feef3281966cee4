//! One effect with its coefficients, as a device stores, lists and removes it.

use nalgebra::{RealField, convert};

use super::law::{
    COEFFICIENTS, Evaluation, FACTORS, Fast, Law, Nonlinear, Slowly, is_bounded, ordinary_error,
    term,
};
use crate::Sensor;

/// A quantity that a [term](DeviceEffect::term) is a product of. Its number is that of the stored layout.
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
    /// Its rate of change, filtered with [`RATE_LAG_S`](super::RATE_LAG_S), °C/s.
    TemperatureRate,
    /// Time since power-on, s.
    Time,
}

impl Variable {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::RateX,
        Self::RateY,
        Self::RateZ,
        Self::ForceX,
        Self::ForceY,
        Self::ForceZ,
        Self::Temperature,
        Self::TemperatureRate,
        Self::Time,
    ];

    /// Its name in the id of a term.
    pub const fn name(self) -> &'static str {
        match self {
            Self::RateX => "rate_x",
            Self::RateY => "rate_y",
            Self::RateZ => "rate_z",
            Self::ForceX => "force_x",
            Self::ForceY => "force_y",
            Self::ForceZ => "force_z",
            Self::Temperature => "temp",
            Self::TemperatureRate => "temp_rate",
            Self::Time => "time",
        }
    }
}

/// Allowed time constants of an effect, s: from one sample at 1 kHz to four months. Beyond, a decay or a lag is constant within any
/// session.
pub const TIME_CONSTANT_RANGE_S: [f64; 2] = [1e-3, 1e7];

/// Why an effect is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EffectError {
    /// No effect of this name can be removed here.
    Unknown,
    /// It needs another number of coefficients, or a term another number of variables.
    Count {
        /// The required number (for a term: the largest).
        needed: usize,
    },
    /// A coefficient is not finite, or its error at the end of a range is larger than any sensor's; a nonlinear constant is missing, superfluous or outside
    /// [`TIME_CONSTANT_RANGE_S`], a weight is not positive; or the axis does not exist.
    Value,
    /// The room is full, or an axis has a code already.
    Full,
}

impl core::fmt::Display for EffectError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Unknown => f.write_str("no effect of this name can be removed here"),
            Self::Count { needed } => write!(f, "the effect needs {needed} numbers"),
            Self::Value => {
                f.write_str("the effect has an impossible coefficient or nonlinear parameter")
            }
            Self::Full => f.write_str("there is no room for one more effect"),
        }
    }
}

impl core::error::Error for EffectError {}

/// An effect with valid coefficients: a device accepts every value of this type.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceEffect<T: RealField> {
    pub(super) sensor: Sensor,
    pub(super) numbers: Numbers<T>,
}

/// The coefficients of an effect, by its kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Numbers<T: RealField> {
    Named {
        law: &'static Law<T>,
        /// Unused ones are 0.
        coefficients: [T; COEFFICIENTS],
        nonlinear: Option<T>,
    },
    Term {
        axis: u8,
        coefficient: T,
        variables: [Option<Variable>; FACTORS],
    },
}

/// How an effect is removed.
#[derive(Debug, Clone, Copy)]
pub(super) enum Kind<T: RealField> {
    Fast(Fast<T>),
    Slow(Slowly<T>),
}

/// Names of the axes.
const AXES: [&str; 3] = ["x", "y", "z"];

impl<T: RealField + Copy> DeviceEffect<T> {
    /// The effect with a public id like `gyro_scale_cubic`. Coefficients are in SI, those of a matrix by rows; the nonlinear constant, if
    /// the effect has one, is a time constant in s.
    pub fn named(id: &str, coefficients: &[T], nonlinear: Option<T>) -> Result<Self, EffectError> {
        let (sensor, name) = match (id.strip_prefix("gyro_"), id.strip_prefix("accel_")) {
            (Some(name), _) => (Sensor::Gyro, name),
            (_, Some(name)) => (Sensor::Accel, name),
            _ => return Err(EffectError::Unknown),
        };
        let law: &'static Law<T> = Law::named(name).ok_or(EffectError::Unknown)?;
        if coefficients.len() != law.coefficients {
            let needed = law.coefficients;
            return Err(EffectError::Count { needed });
        }
        let nonlinear = match (law.nonlinear, nonlinear) {
            (Nonlinear::None, None) => None,
            (Nonlinear::TimeConstant | Nonlinear::Lag, Some(value))
                if value >= convert(TIME_CONSTANT_RANGE_S[0])
                    && value <= convert(TIME_CONSTANT_RANGE_S[1]) =>
            {
                Some(value)
            }
            _ => return Err(EffectError::Value),
        };
        let mut all = [T::zero(); COEFFICIENTS];
        for (all, coefficient) in all.iter_mut().zip(coefficients) {
            if !coefficient.is_finite() {
                return Err(EffectError::Value);
            }
            *all = *coefficient;
        }
        if !law.is_bounded(sensor, &all) {
            return Err(EffectError::Value);
        }
        Ok(Self {
            sensor,
            numbers: Numbers::Named {
                law,
                coefficients: all,
                nonlinear,
            },
        })
    }

    /// `coefficient` times the product of one to three variables, in the error of one axis (0 to 2); SI.
    pub fn term(
        sensor: Sensor,
        axis: usize,
        coefficient: T,
        variables: &[Variable],
    ) -> Result<Self, EffectError> {
        let needed = FACTORS;
        if variables.is_empty() || variables.len() > needed {
            return Err(EffectError::Count { needed });
        }
        if axis >= 3 || !coefficient.is_finite() {
            return Err(EffectError::Value);
        }
        let mut all = [None; FACTORS];
        let mut alone = Fast {
            law: term,
            coefficients: [T::zero(); COEFFICIENTS],
            factors: [0; FACTORS],
        };
        for (one, variable) in all.iter_mut().zip(variables) {
            *one = Some(*variable);
        }
        for (factor, variable) in alone.factors.iter_mut().zip(variables) {
            *factor = *variable as u8;
        }
        if let Some(one) = alone.coefficients.get_mut(axis) {
            *one = coefficient;
        }
        if !is_bounded(ordinary_error(&alone, sensor), sensor) {
            return Err(EffectError::Value);
        }
        Ok(Self {
            sensor,
            numbers: Numbers::Term {
                axis: axis as u8,
                coefficient,
                variables: all,
            },
        })
    }

    /// Triad whose readings err.
    pub fn sensor(&self) -> Sensor {
        self.sensor
    }

    /// Name of the law of a named effect; the id is the sensor's name, `_`, and this.
    pub(crate) fn law(&self) -> Option<&'static str> {
        match self.numbers {
            Numbers::Named { law, .. } => Some(law.name),
            _ => None,
        }
    }

    /// Its coefficients: all of a named effect, the single one of a term.
    pub fn coefficients(&self) -> &[T] {
        match &self.numbers {
            Numbers::Named {
                law, coefficients, ..
            } => coefficients.get(..law.coefficients).unwrap_or(coefficients),
            Numbers::Term { coefficient, .. } => core::slice::from_ref(coefficient),
        }
    }

    /// Nonlinear constant of a named effect that has one: a time constant, s.
    pub fn nonlinear(&self) -> Option<T> {
        match self.numbers {
            Numbers::Named { nonlinear, .. } => nonlinear,
            _ => None,
        }
    }

    /// Axis and variables of a term.
    pub fn product(&self) -> Option<(usize, impl Iterator<Item = Variable> + Clone)> {
        match self.numbers {
            Numbers::Term {
                axis, variables, ..
            } => Some((usize::from(axis), variables.into_iter().flatten())),
            _ => None,
        }
    }

    /// Whether it depends on temperature and time only, so that it costs nothing per sample.
    pub fn is_slow(&self) -> bool {
        matches!(self.kind(), Kind::Slow(_))
    }

    /// Whether it depends on the temperature of some minutes ago, by a lag or by the rate of change, so that whoever begins in the middle of a
    /// stream cannot know it.
    pub fn remembers(&self) -> bool {
        match &self.numbers {
            Numbers::Named { law, .. } => law.nonlinear == Nonlinear::Lag,
            Numbers::Term { variables, .. } => variables.contains(&Some(Variable::TemperatureRate)),
        }
    }

    /// How it is removed.
    pub(super) fn kind(&self) -> Kind<T> {
        match &self.numbers {
            Numbers::Named {
                law,
                coefficients,
                nonlinear,
            } => match law.evaluation {
                Evaluation::Fast(law) => Kind::Fast(Fast {
                    law,
                    coefficients: *coefficients,
                    factors: [0; FACTORS],
                }),
                Evaluation::Slow(run) => Kind::Slow(Slowly::Law {
                    law: run,
                    coefficients: *coefficients,
                    nonlinear: nonlinear.unwrap_or(T::one()),
                    lags: law.nonlinear == Nonlinear::Lag,
                }),
            },
            Numbers::Term {
                axis,
                coefficient,
                variables,
            } => {
                let mut coefficients = [T::zero(); COEFFICIENTS];
                if let Some(along) = coefficients.get_mut(usize::from(*axis)) {
                    *along = *coefficient;
                }
                let term = Fast {
                    law: term,
                    coefficients,
                    factors: variables.map(|v| v.map_or(0, |v| v as u8)),
                };
                let slow = |v: &Variable| *v as u8 >= Variable::Temperature as u8;
                match variables.iter().flatten().all(slow) {
                    true => Kind::Slow(Slowly::Term(term)),
                    false => Kind::Fast(term),
                }
            }
        }
    }
}

/// Name of an axis.
pub(super) fn axis_name(axis: usize) -> &'static str {
    AXES.get(axis).copied().unwrap_or("?")
}
