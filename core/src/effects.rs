//! Removal of what the affine model lacks: effects, sample by sample.
//!
//! The error e_i of sensor i is a sum of coefficients times functions of rate, force, temperature and time, in SI along the
//! sensitive direction of the sensor, and is added to what the sensor should read. In raw units it is `|P_i| e_i`, with
//! P_i the row of the forward matrix, so that with `x = C u + o` and D the sensitive directions, `P_i / |P_i|` by rows,
//!
//! `x_clean = x - R e(x_clean)`, `R = C diag(|P_x|, |P_y|, |P_z|) = D⁻¹`.
//!
//! The input that e is a function of is read by the sensor that errs, and e of the reading itself would leave the share k of the error
//! in, k being the slope of e. To evaluate every law twice, the second time without the first, leaves k² and costs as much again. Here
//! each is evaluated once, without the error of the sample before: what is left is k² times the change of the input within a
//! sample, and nothing while it stands still. With the nonlinearities that datasheets state (gyro 0.1 %, accelerometer 1 %) and
//! the whole range swept at 40 Hz, that is 1.8e-5 rad/s and 4.4e-4 m/s², a thousandth and a hundredth of the noise of a
//! sample (`cargo test -p mimu-core --test effects one_evaluation -- --nocapture`). Only a sample that none goes before is evaluated twice.
//!
//! What moves with temperature and time only is folded into a matrix and a bias by [`Effects::slow`], which cost the same however
//! many there are.
//!
//! Errors of the converter are another matter: they are functions of the raw reading, whatever that stands for, and are taken out of it
//! before it is compensated, by [`Effects::without_code_errors`]. They are those of an axis, which may have a converter to itself, and are
//! made by [`Effect::code`].

mod law;
mod triad;

use nalgebra::{Matrix3, RealField, Vector3, convert};

use crate::compensation::{Affine, Sample};
use law::{COEFFICIENTS, Conditions, Evaluation, Fast, Form, Law, term};
use triad::{Memory, Slowly, Triad, lagged, put};

/// Temperature that warmth counts from, °C.
pub const REFERENCE_C: f64 = 25.0;
/// Weights of bit 0 that the reading of code 0 may be away from a reading of 0: farther, rounding in single precision comes near
/// what a converter's codes are kept away from their turns by.
pub const FARTHEST_ZERO: f64 = 64.0;
/// Lag of the filter by which the rate of change of the temperature is taken, s: unfiltered it would be noise.
pub const RATE_LAG_S: f64 = 30.0;

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
    /// Temperature above [`REFERENCE_C`], °C.
    Temperature,
    /// Its rate of change behind a lag of [`RATE_LAG_S`], °C/s.
    TemperatureRate,
    /// Time since power-on, s.
    Time,
}

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
    /// A coefficient is not a finite number, a nonlinear constant or a weight is missing, not wanted or not positive, or there is no such
    /// axis.
    Value,
    /// There is no room for one more, or an axis has a code already.
    Full,
}

/// An effect with its numbers.
#[derive(Debug, Clone, Copy)]
pub struct Effect<T: RealField> {
    sensor: Sensor,
    kind: Kind<T>,
}

#[derive(Debug, Clone, Copy)]
enum Kind<T: RealField> {
    Fast(Fast<T>),
    Slow(Slowly<T>),
    Code {
        /// Whose readings err.
        axes: [bool; 3],
        /// Of nine bits, in units of the weight of bit 0.
        errors: [T; COEFFICIENTS],
        /// Of bit 0, raw.
        weight: T,
        /// Reading of code 0, raw.
        zero: T,
    },
}

impl<T: RealField + Copy> Effect<T> {
    /// The effect of a public id like `gyro_scale_cubic`, with all of its coefficients (SI, those of a matrix by rows) and the
    /// nonlinear constant of one that has any: a time constant, s.
    pub fn named(id: &str, coefficients: &[T], form: Option<T>) -> Result<Self, Refused> {
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
        let form = match (law.form, form) {
            (Form::None, None) => T::one(),
            (Form::TimeConstant | Form::Lag, Some(value))
                if value > T::zero() && value.is_finite() =>
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
                form,
                lags: law.form == Form::Lag,
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
        let needed = 3;
        if variables.is_empty() || variables.len() > needed {
            return Err(Refused::Count { needed });
        }
        let mut coefficients = [T::zero(); COEFFICIENTS];
        let [x, y, z, ..] = &mut coefficients;
        match [x, y, z].into_iter().nth(axis) {
            Some(along) if coefficient.is_finite() => *along = coefficient,
            _ => return Err(Refused::Value),
        }
        let mut factors = [0; 3];
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
    /// rounded. The code of all nine bits set, and one more, is again 0: what lies beyond is not told apart. Refused where a number is not
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
        errors: &[T; COEFFICIENTS],
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

/// Where the sensors of a triad look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Directions<T: RealField> {
    /// D: sensitive directions in the body frame, rows of the forward matrix at unit length.
    pub sensed: Matrix3<T>,
    /// R, its inverse: errors along the sensors into errors in the body frame.
    pub to_body: Matrix3<T>,
}

impl<T: RealField + Copy> Directions<T> {
    /// Of a triad with this C, raw to SI; `None` if it is singular. In double precision whatever T is, and for the PC: no inverse is
    /// taken on the device, which is sent this.
    pub fn of(inverse: &Matrix3<f64>) -> Option<Self> {
        let forward = inverse.try_inverse()?;
        let scale = Vector3::from_fn(|i, _| forward.row(i).norm());
        let positive = |s: &f64| *s > 0.0 && s.is_finite();
        scale.iter().all(positive).then(|| Self {
            // Zero added: of the two zeros there is one, as whether an inverse has the other is chance, and bytes are hashed.
            sensed: Matrix3::from_fn(|i, j| convert(forward[(i, j)] / scale[i] + 0.0)),
            to_body: (inverse * Matrix3::from_diagonal(&scale)).map(|r| convert(r + 0.0)),
        })
    }
}

/// Effects of a unit: immutable, for any number of streams. Up to N of each triad that run with every sample, and N that do
/// not.
///
/// ```
/// # use mimu_core::compensation::{Affine, Sample};
/// # use mimu_core::effects::{Effect, Effects, State};
/// # use nalgebra::{Matrix3, Vector3};
/// // A gyro of which 1 g along z is read as 0.2 deg/s about x, at rest. Its readings are in SI already.
/// let si = Affine { matrix: Matrix3::identity(), offset: Vector3::zeros() };
/// let g = 9.80665;
/// let sag = 0.2_f64.to_radians();
/// let mut effects = Effects::<f64, 8>::new(&si, &si).unwrap();
/// let matrix = [0.0, 0.0, sag / g, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
/// effects.push(Effect::named("gyro_g_sensitivity", &matrix, None).unwrap()).unwrap();
/// let mut state = State::new(1000.0);
/// let read = Sample { gyro: Vector3::new(sag, 0.0, 0.0), accel: Vector3::new(0.0, 0.0, g) };
/// let clean = effects.remove(&mut state, &read);
/// assert!(clean.gyro.norm() < 1e-15);
/// assert_eq!(clean.accel, read.accel);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Effects<T: RealField, const N: usize> {
    gyro: Triad<T, N>,
    accel: Triad<T, N>,
}

/// What the effects remember of one stream of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<T: RealField, const N: usize> {
    sample_rate_hz: T,
    /// Rate in the sample before, rad/s.
    previous: Option<Vector3<T>>,
    /// As they were last; the slow ones, at the last call of [`Effects::slow`].
    at: Conditions<T>,
    /// Time since power-on, s, and what rounding has added to it.
    time: T,
    lost: T,
    /// The last temperature above the reference that was a number, °C.
    warm: Option<T>,
    /// The temperature behind [`RATE_LAG_S`], less itself, °C.
    rate_lag: T,
    gyro: Memory<T, N>,
    accel: Memory<T, N>,
}

impl<T: RealField + Copy, const N: usize> State<T, N> {
    /// That of a stream which begins at power-on, of so many samples a second.
    ///
    /// [`Effects::slow`] before the first sample, or the slow effects stay in until its first call.
    pub fn new(sample_rate_hz: T) -> Self {
        let (none, one) = (T::zero(), T::one());
        Self {
            sample_rate_hz,
            previous: None,
            at: Conditions {
                values: [one, none, none, none, none, none, none, none, none, none],
                angular_acceleration: Vector3::zeros(),
                sensed: Vector3::zeros(),
            },
            time: T::zero(),
            lost: T::zero(),
            warm: None,
            rate_lag: T::zero(),
            gyro: Memory::none(),
            accel: Memory::none(),
        }
    }

    /// The next sample does not follow the one before: samples are missing. Time and temperature go on; the angular acceleration of
    /// that sample is not known, and taken for none.
    pub fn gap(&mut self) {
        self.previous = None;
        self.gyro.gap();
        self.accel.gap();
    }
}

impl<T: RealField + Copy, const N: usize> Effects<T, N> {
    /// No effects yet, of a unit with these inverse models, raw to SI. `None` if one of them is singular. For the PC, as
    /// [`Directions::of`].
    pub fn new(gyro: &Affine<f64>, accel: &Affine<f64>) -> Option<Self> {
        let (gyro, accel) = (
            Directions::of(&gyro.matrix)?,
            Directions::of(&accel.matrix)?,
        );
        Some(Self::of(gyro, accel))
    }

    /// No effects yet, of a unit whose sensors look there.
    pub fn of(gyro: Directions<T>, accel: Directions<T>) -> Self {
        Self {
            gyro: Triad::new(gyro),
            accel: Triad::new(accel),
        }
    }

    /// Adds one.
    pub fn push(&mut self, effect: Effect<T>) -> Result<(), Refused> {
        let triad = match effect.sensor {
            Sensor::Gyro => &mut self.gyro,
            Sensor::Accel => &mut self.accel,
        };
        triad.push(&effect.kind)
    }

    /// Follows temperature, °C, and time, s since the call before or since power-on: some times a second is enough.
    ///
    /// A temperature that is not a number is that of before; as long as there was none, the reference. A step of time that is not
    /// positive is none.
    pub fn slow(&self, state: &mut State<T, N>, dt_s: T, temp_c: T) {
        let dt = match dt_s > T::zero() && dt_s.is_finite() {
            true => dt_s,
            false => T::zero(),
        };
        // Compensated (Kahan): of steps of 0.1 s each single precision loses seconds within hours.
        let step = dt - state.lost;
        let time = state.time + step;
        state.lost = (time - state.time) - step;
        state.time = time;

        let before = state.warm;
        let warm = match temp_c.is_finite() {
            true => temp_c - convert(REFERENCE_C),
            false => before.unwrap_or(T::zero()),
        };
        if temp_c.is_finite() {
            state.warm = Some(warm);
        }
        let risen = warm - before.unwrap_or(warm);
        let rate_lag: T = convert(RATE_LAG_S);
        state.rate_lag = lagged(state.rate_lag, dt, risen, rate_lag);
        let [.., temperature, rate, since] = &mut state.at.values;
        *temperature = warm;
        *rate = -state.rate_lag / rate_lag;
        *since = time;

        self.gyro.slow(&mut state.gyro, dt, risen, &state.at);
        self.accel.slow(&mut state.accel, dt, risen, &state.at);
    }

    /// Raw readings without the errors of the converters' codes: to be compensated in place of those that were read.
    #[inline]
    pub fn without_code_errors(&self, raw: &Sample<T>) -> Sample<T> {
        Sample {
            gyro: self.gyro.without_code_errors(&raw.gyro),
            accel: self.accel.without_code_errors(&raw.accel),
        }
    }

    /// A compensated sample, SI in the body frame, without the effects. To be called with every sample in turn, and
    /// [`State::gap`] where some are missing: the angular acceleration is the difference to the one before.
    #[inline]
    pub fn remove(&self, state: &mut State<T, N>, compensated: &Sample<T>) -> Sample<T> {
        let (rate, force) = (&compensated.gyro, &compensated.accel);
        let at = &mut state.at;
        put(&mut at.values, Sensor::Gyro, rate);
        put(&mut at.values, Sensor::Accel, force);
        let before = state.previous.unwrap_or(*rate);
        let per_s = state.sample_rate_hz;
        at.angular_acceleration = Vector3::new(
            (rate.x - before.x) * per_s,
            (rate.y - before.y) * per_s,
            (rate.z - before.z) * per_s,
        );
        state.previous = Some(*rate);
        Sample {
            gyro: self.gyro.remove(&mut state.gyro, Sensor::Gyro, rate, at),
            accel: self
                .accel
                .remove(&mut state.accel, Sensor::Accel, force, at),
        }
    }
}
