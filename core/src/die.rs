//! Temperature of the dies from that of the thermometer.
//!
//! What drifts is the die; what is measured is a thermometer beside it. Between the two is a first-order lag (niu, thermal ramp): the heat
//! reaches one of them later than the other.
//!
//! * Lag positive: the die follows, `lag dD/dt + D = T`.
//! * Lag negative: the die leads, `D = T + |lag| dT/dt`, the rate of change taken behind a filter of [`RATE_SHARE`] of the lag. On a
//!   steady ramp it is exact. It multiplies the noise of the thermometer by `1 + 1 / RATE_SHARE`, whatever the lag, which is why the
//!   thermometer has to be filtered before.
//!
//! Both are one state: the lagged temperature minus the temperature, which is exact over a ramp within a step however long the step is,
//! so that a gap is one long step and a device of fifty steps a second and a recording of some agree.

use nalgebra::{RealField, convert};

use crate::PerSensor;

/// So far outside the temperatures that a calibration is for its curves go on along their slope, K; farther out they are held.
pub const BEYOND_C: f64 = 5.0;

/// Time constant of the filter of the rate of change, as a share of a lead. At the beginning of a ramp the lead is missing for so long; a
/// quarter leaves three quarters of the hysteresis removed within it, and makes five times the thermometer's noise.
pub const RATE_SHARE: f64 = 0.25;

/// Lags that a calibration may have, s.
pub const LAG_RANGE_S: [f64; 2] = [-120.0, 600.0];

/// Shortest lag or lead that is not none, s: a sample at 1 kHz. The thermometer is read by the batch, 20 ms, and nothing shorter is followed.
pub const LEAST_LAG_S: f64 = 1e-3;

/// The lag between thermometer and dies: immutable, for any number of streams.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DieLag<T> {
    lag_s: T,
}

/// What it remembers of one stream.
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
    /// Of a stream of which there is no reading yet. The first is taken for the temperature of the dies too: what was before is not known.
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

    /// Of so many seconds; `None` outside [`LAG_RANGE_S`], and below [`LEAST_LAG_S`] unless it is 0.
    pub fn new(lag_s: T) -> Option<Self> {
        let [least, most] = LAG_RANGE_S.map(convert::<f64, T>);
        let shortest: T = convert(LEAST_LAG_S);
        let followed = lag_s == T::zero() || lag_s.abs() >= shortest;
        (followed && lag_s >= least && lag_s <= most).then_some(Self { lag_s })
    }

    /// Of both triads by their lags, s; none where these are not known or [`Self::new`] refuses them.
    pub fn of_triads(lags_s: Option<PerSensor<T>>) -> PerSensor<Self> {
        let known = |lag_s| Self::new(lag_s).unwrap_or_else(Self::none);
        lags_s.map_or_else(|| PerSensor::both(Self::none()), |lags_s| lags_s.map(known))
    }

    /// Seconds by which the dies follow the thermometer; negative: lead.
    pub fn lag_s(&self) -> T {
        self.lag_s
    }

    /// Temperature of the dies, °C, `dt_s` after the call before, where the thermometer reads this, °C. `None` until there was a reading.
    ///
    /// A reading that is not a number is that of before. A step of time that is not positive is none.
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

    /// The state of a stream in which the thermometer reads this and the dies have that temperature, °C: for one who hears both, and has not
    /// heard what was before.
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
            // The rate of change is that of the filter, `-behind / filter`.
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

/// A step of the lagged temperature minus the temperature over `dt` behind a first-order lag, `step` being that of the temperature: exact if
/// it is a ramp. Kept as the difference: the lagged temperature itself would stand still in single precision once its step is below the
/// last digit of some 10 °C.
pub(crate) fn lagged<T: RealField + Copy>(difference: T, dt: T, step: T, lag: T) -> T {
    let z = dt / lag;
    // No time passed: all of the step is yet to come.
    if !(z > T::zero()) {
        return difference - step;
    }
    let gone = -(-z).exp_m1();
    difference - difference * gone - step * (gone / z)
}
