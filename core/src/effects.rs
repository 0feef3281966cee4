//! Removal of what the affine model lacks: effects, sample by sample.
//!
//! The error e_i of sensor i is a sum of coefficients times functions of rate, force, temperature and time, in SI along the
//! sensitive direction of the sensor, and is added to what the sensor should read. In raw units it is `|P_i| e_i`, with
//! P_i the row of the forward matrix, so that with `x = C u + o` and D the sensitive directions, `P_i / |P_i|` by rows,
//!
//! `x_clean = x - R e(x_clean)`, `R = C diag(|P_x|, |P_y|, |P_z|) = D⁻¹`.
//!
//! The error e is a function of the true input, but only the erroneous reading is known. Evaluating e at the reading leaves a fraction k of
//! the error, with k the slope of e. Evaluating every law twice, the second time at the corrected reading, leaves k² and doubles the cost.
//! Here each law is evaluated once, at the reading corrected by the error of the previous sample. The remaining error is k² times the
//! change of the input within a sample, and zero for a constant input. With the nonlinearities of data sheets (gyro 0.1 %, accelerometer 1
//! %) and the whole range swept at 40 Hz, it is 1.8e-5 rad/s and 4.4e-4 m/s², a thousandth and a hundredth of the noise of a sample (`cargo
//! test -p mimu-core --test effects one_evaluation -- --nocapture`). Only the first sample, and the first after a gap, is evaluated twice.
//!
//! Effects that depend on temperature and time only are folded into one matrix and one bias by [`Effects::slow`], so the cost per sample
//! does not depend on their number.

mod directions;
mod effect;
mod law;
mod listing;
mod triad;

use nalgebra::{RealField, Vector3, convert};

use crate::compensation::{Compensation, Sample};
use crate::die::{BEYOND_C, lagged};
use crate::{PerSensor, Sensor};
use law::Conditions;
use triad::{Memory, Triad, put};

pub use directions::Directions;
pub use effect::{DeviceEffect, EffectError, TIME_CONSTANT_RANGE_S, Variable};

/// Temperature that temperature offsets count from, °C.
pub const REFERENCE_C: f64 = 25.0;
/// Time constant of the filter for the rate of change of the temperature, s; unfiltered it would be noise.
pub const RATE_LAG_S: f64 = 30.0;

/// Effects of a unit: immutable, for any number of streams. Each triad has room for N effects that run with every sample, and for N slow
/// ones.
///
/// ```
/// # use mimu_core::PerSensor;
/// # use mimu_core::compensation::{Affine, Sample};
/// # use mimu_core::effects::{DeviceEffect, Effects, State};
/// # use nalgebra::{Matrix3, Vector3};
/// // A gyro of which 1 g along z is read as 0.2 deg/s about x, at rest. Its readings are in SI already.
/// let si = Affine { matrix: Matrix3::identity(), offset: Vector3::zeros() };
/// let g = 9.80665;
/// let sag = 0.2_f64.to_radians();
/// let mut effects = Effects::<f64, 8>::new(&PerSensor::both(si)).unwrap();
/// let matrix = [0.0, 0.0, sag / g, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
/// effects.push(DeviceEffect::named("gyro_g_sensitivity", &matrix, None).unwrap()).unwrap();
/// let mut state = State::new(1000.0);
/// let read = Sample { gyro: Vector3::new(sag, 0.0, 0.0), accel: Vector3::new(0.0, 0.0, g) };
/// let clean = effects.remove(&mut state, &read);
/// assert!(clean.gyro.norm() < 1e-15);
/// assert_eq!(clean.accel, read.accel);
/// ```
#[derive(Debug, Clone)]
pub struct Effects<T: RealField, const N: usize> {
    triads: PerSensor<Triad<T, N>>,
    /// Temperatures that the effects see, °C.
    seen_c: Option<[T; 2]>,
}

/// Memory of the effects for one stream of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<T: RealField, const N: usize> {
    sample_rate_hz: T,
    /// Rate in the sample before, rad/s.
    previous: Option<Vector3<T>>,
    /// Latest variables; the slow ones are those of the last call of [`Effects::slow`].
    at: Conditions<T>,
    /// Time since power-on, s, and its accumulated rounding error.
    time: T,
    lost: T,
    /// Whether decays after power-on count as over.
    settled: bool,
    /// The last valid temperature, °C, as it was read; effects clamp it themselves.
    read_c: Option<T>,
    /// The temperature lagged by [`RATE_LAG_S`], minus itself, °C.
    rate_lag: T,
    triads: PerSensor<Memory<T, N>>,
}

impl<T: RealField + Copy, const N: usize> State<T, N> {
    /// State of a stream that begins at power-on, at this sample rate, Hz.
    ///
    /// Call [`Effects::slow`] before the first sample; until then the slow effects are not removed.
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
            settled: false,
            read_c: None,
            rate_lag: T::zero(),
            triads: PerSensor::both(Memory::none()),
        }
    }

    /// The sample rate from now on, Hz.
    pub fn at_rate(&mut self, sample_rate_hz: T) {
        self.sample_rate_hz = sample_rate_hz;
    }

    /// For a stream whose power-on is unknown: decays count as over, and effects that grow with time count from the beginning of the
    /// stream. If a warm-up were counted from there, a wrong correction of its full size would be added.
    pub fn long_after_power_on(self) -> Self {
        Self {
            settled: true,
            ..self
        }
    }

    /// Follows time and temperature like [`Effects::slow`], but without effects, so that both are known to the effects of a later
    /// calibration.
    pub fn pass(&mut self, dt_s: T, temp_c: T) {
        self.follow(dt_s, temp_c, None);
    }

    /// Updates time and temperature; effects see the temperature clamped to `seen_c`. Returns the time step and the step of the clamped
    /// temperature.
    fn follow(&mut self, dt_s: T, temp_c: T, seen_c: Option<[T; 2]>) -> [T; 2] {
        let dt = match dt_s > T::zero() && dt_s.is_finite() {
            true => dt_s,
            false => T::zero(),
        };
        // Compensated summation (Kahan): with steps of 0.1 s single precision loses seconds within hours.
        let step = dt - self.lost;
        let time = self.time + step;
        self.lost = (time - self.time) - step;
        self.time = time;

        let offset = |temp_c: T| {
            let seen = match seen_c {
                Some([least, most]) => temp_c.max(least).min(most),
                None => temp_c,
            };
            seen - convert(REFERENCE_C)
        };
        let before = self.read_c.map(offset);
        if temp_c.is_finite() {
            self.read_c = Some(temp_c);
        }
        let temperature_offset = self.read_c.map_or(T::zero(), offset);
        let risen = temperature_offset - before.unwrap_or(temperature_offset);
        let rate_lag: T = convert(RATE_LAG_S);
        self.rate_lag = lagged(self.rate_lag, dt, risen, rate_lag);
        let [.., temperature, rate, since] = &mut self.at.values;
        *temperature = temperature_offset;
        *rate = -self.rate_lag / rate_lag;
        *since = time;
        [dt, risen]
    }

    /// Samples are missing before the next one. Time and temperature continue; the angular acceleration of that sample is unknown and taken
    /// as zero.
    pub fn gap(&mut self) {
        self.previous = None;
        self.triads.gyro.gap();
        self.triads.accel.gap();
    }
}

impl<T: RealField + Copy, const N: usize> Effects<T, N> {
    /// No effects yet, for a unit with these inverse models, raw to SI. `None` if one of them is singular. For the PC, like
    /// [`Directions::of`].
    pub fn new(models: &Compensation<f64>) -> Option<Self> {
        let directions = models.map(|model| Directions::of(&model.matrix));
        Some(Self::of(directions.transpose()?))
    }

    /// No effects yet, for a unit with these sensitive directions.
    pub fn of(directions: PerSensor<Directions<T>>) -> Self {
        Self {
            triads: directions.map(Triad::new),
            seen_c: None,
        }
    }

    /// The same for a calibration with this temperature range, °C. Beyond it the temperature that effects see is clamped at [`BEYOND_C`],
    /// like the curves of the calibration; otherwise a square of the temperature would grow without bound.
    pub fn within(mut self, limits: Option<[T; 2]>) -> Self {
        let most: T = convert(BEYOND_C);
        self.seen_c = limits.map(|[from, to]| [from - most, to + most]);
        self
    }

    /// Adds one.
    pub fn push(&mut self, effect: DeviceEffect<T>) -> Result<(), EffectError> {
        self.triads[effect.sensor].push(&effect.kind())
    }

    /// Takes over the state of a stream from which other effects, or none, were removed so far. Time, temperature and its rate continue,
    /// and so does each lagged temperature that one of the new effects needs too, because it depends on the temperature alone. One with
    /// another time constant starts at the temperature of the next call of [`Self::slow`]. The errors of the previous sample belong to the
    /// old effects and are discarded.
    pub fn take_over(&self, before: Option<&Self>, state: &mut State<T, N>) {
        let PerSensor { gyro, accel } = state.triads;
        let known = |lag_s: T| {
            let before = &before?.triads;
            let mut all = (before.gyro.lags(&gyro)).chain(before.accel.lags(&accel));
            let same = all.find(|(other_s, _)| *other_s == lag_s);
            same.map(|(_, lag)| lag)
        };
        state.triads = self.triads.as_ref().map(|triad| triad.memory(known));
        state.previous = None;
    }

    /// Follows temperature (°C) and time (s since the previous call, or since power-on). A few calls per second are enough.
    ///
    /// The temperature is that of the thermometer, because effects are found with it: one of them is the lag of the dies. NaN repeats the
    /// previous temperature, or before the first one the reference. A time step that is not positive counts as zero.
    pub fn slow(&self, state: &mut State<T, N>, dt_s: T, temp_c: T) {
        let [dt, risen] = state.follow(dt_s, temp_c, self.seen_c);
        let (at, settled) = (&state.at, state.settled);
        let triads = &mut state.triads;
        (self.triads.gyro).slow(&mut triads.gyro, dt, risen, settled, at);
        (self.triads.accel).slow(&mut triads.accel, dt, risen, settled, at);
    }

    /// Removes the effects from a compensated sample, SI in the body frame. Call it with every sample in order, and [`State::gap`] if
    /// samples are missing, because the angular acceleration is the difference from the previous sample.
    #[inline]
    pub fn remove(&self, state: &mut State<T, N>, compensated: &Sample<T>) -> Sample<T> {
        let (rate, force) = (&compensated.gyro, &compensated.accel);
        let at = &mut state.at;
        put(&mut at.values, Sensor::Gyro, rate);
        put(&mut at.values, Sensor::Accel, force);
        let before = state.previous.unwrap_or(*rate);
        let per_s = state.sample_rate_hz;
        at.angular_acceleration = (rate - before) * per_s;
        state.previous = Some(*rate);
        let (ours, memory) = (&self.triads, &mut state.triads);
        Sample {
            gyro: (ours.gyro).remove(&mut memory.gyro, Sensor::Gyro, rate, at),
            accel: (ours.accel).remove(&mut memory.accel, Sensor::Accel, force, at),
        }
    }
}
