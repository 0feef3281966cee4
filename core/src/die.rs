//! Temperature of the dies from that of the thermometer.
//!
//! The die drifts, but a thermometer beside it is measured. Between the two is a first-order lag (niu, thermal ramp), because heat reaches
//! one of them later than the other.
//!
//! * Lag positive: the die follows, `lag dD/dt + D = T`.
//! * Lag negative: the die leads, `D = T + |lag| dT/dt`, with the rate of change filtered by [`RATE_SHARE`] of the lag. This is exact on a
//!   steady ramp. It multiplies the noise of the thermometer by `1 + 1 / RATE_SHARE` for any lag, so the thermometer has to be filtered
//!   before.
//!
//! Both have one state: the lagged temperature minus the temperature. Its update is exact for a ramp over a time step of any length. A gap
//! is therefore one long step, and a device with fifty steps per second agrees with a recording with a few.

use nalgebra::{RealField, convert};

use crate::PerSensor;

/// Up to this distance beyond the temperature range of a calibration its curves continue along their slope, K; farther out they are
/// constant.
pub const BEYOND_C: f64 = 5.0;

/// Time constant of the filter of the rate of change, as a fraction of the lead. At the beginning of a ramp the lead is missing for this
/// time. A quarter removes three quarters of the hysteresis within it, and multiplies the thermometer's noise by five.
pub const RATE_SHARE: f64 = 0.25;

/// Lags that a calibration may have, s.
pub const LAG_RANGE_S: [f64; 2] = [-120.0, 600.0];

/// Shortest lag or lead other than 0, s: one sample at 1 kHz. The thermometer is read once per batch (20 ms), so shorter lags have no
/// effect.
pub const LEAST_LAG_S: f64 = 1e-3;

/// The lag between thermometer and dies: immutable, for any number of streams.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DieLag<T> {
    lag_s: T,
}

/// Its memory of one stream.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<T> {
    /// The last reading that was a number, °C.
    thermometer_c: Option<T>,
    /// The filtered reading minus the reading, °C.
    behind: T,
}

impl<T: RealField + Copy> Default for State<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: RealField + Copy> State<T> {
    /// State of a stream without a reading yet. The first reading is taken as the temperature of the dies too, because the history is
    /// unknown.
    pub fn new() -> Self {
        Self {
            thermometer_c: None,
            behind: T::zero(),
        }
    }
}

impl<T: RealField + Copy> DieLag<T> {
    /// The dies are at the temperature of the thermometer.
    pub fn none() -> Self {
        Self { lag_s: T::zero() }
    }

    /// Lag of this many seconds; `None` outside [`LAG_RANGE_S`], and below [`LEAST_LAG_S`] unless it is 0.
    pub fn new(lag_s: T) -> Option<Self> {
        let [least, most] = LAG_RANGE_S.map(convert::<f64, T>);
        let shortest: T = convert(LEAST_LAG_S);
        let followed = lag_s == T::zero() || lag_s.abs() >= shortest;
        (followed && lag_s >= least && lag_s <= most).then_some(Self { lag_s })
    }

    /// Lags of both triads, s; zero if they are unknown or [`Self::new`] refuses them.
    pub fn of_triads(lags_s: Option<PerSensor<T>>) -> PerSensor<Self> {
        let known = |lag_s| Self::new(lag_s).unwrap_or_else(Self::none);
        lags_s.map_or_else(|| PerSensor::both(Self::none()), |lags_s| lags_s.map(known))
    }

    /// Seconds by which the dies follow the thermometer; negative: lead.
    pub fn lag_s(&self) -> T {
        self.lag_s
    }

    /// Temperature of the dies, °C, `dt_s` after the previous call, with this reading of the thermometer, °C. `None` before the first
    /// reading.
    ///
    /// NaN repeats the previous reading. A time step that is not positive counts as zero.
    pub fn follow(&self, state: &mut State<T>, dt_s: T, thermometer_c: T) -> Option<T> {
        let known = state.thermometer_c;
        let now = match thermometer_c.is_finite() {
            true => thermometer_c,
            false => known?,
        };
        let step = now - known.unwrap_or(now);
        let dt = match dt_s > T::zero() && dt_s.is_finite() {
            true => dt_s,
            false => T::zero(),
        };
        state.thermometer_c = Some(now);
        if known.is_some() && self.lag_s != T::zero() {
            state.behind = lagged(state.behind, dt, step, self.filter_s());
        }
        Some(self.of(now, state))
    }

    /// State of a stream with these temperatures of thermometer and dies, °C: for a receiver that gets both but missed the history.
    pub fn state_of(&self, thermometer_c: T, die_c: T) -> State<T> {
        let apart = die_c - thermometer_c;
        let share: T = convert(RATE_SHARE);
        let behind = match self.lag_s > T::zero() {
            true => apart,
            false => -apart * share,
        };
        State {
            thermometer_c: Some(thermometer_c),
            behind: match self.lag_s == T::zero() {
                true => T::zero(),
                false => behind,
            },
        }
    }

    fn of(&self, now: T, state: &State<T>) -> T {
        match self.lag_s > T::zero() {
            true => now + state.behind,
            // The filtered rate of change is `-behind / filter`.
            false => now - state.behind / convert(RATE_SHARE),
        }
    }

    fn filter_s(&self) -> T {
        match self.lag_s > T::zero() {
            true => self.lag_s,
            false => -self.lag_s * convert(RATE_SHARE),
        }
    }
}

/// Updates the lagged temperature minus the temperature over `dt` for a first-order lag; `step` is the change of the temperature. Exact for
/// a ramp. The difference is stored because the lagged temperature itself would stop changing in single precision once its step is below
/// the last digit of a few 10 °C.
pub(crate) fn lagged<T: RealField + Copy>(difference: T, dt: T, step: T, lag: T) -> T {
    let z = dt / lag;
    // No time passed: the lagged temperature has not moved, so the difference changes by the whole step.
    if !(z > T::zero()) {
        return difference - step;
    }
    let gone = -(-z).exp_m1();
    difference - difference * gone - step * (gone / z)
}
