//! The estimates at which the errors are linear: biases, and how the reference is mounted and timed.

use serde::Serialize;

use super::smoothed::{Smoothed, SmoothedState};
use super::state::{CLOCK, LEVER, MOUNTING, offset};
use crate::quantity::PerSensor;

/// Half-width of a 95 % interval in standard deviations.
pub(super) const SIGMAS: f64 = 1.96;

/// An estimate with its 95 % interval.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Estimate {
    /// Value.
    pub value: f64,
    /// Ends of the interval.
    pub interval: [f64; 2],
}

impl Estimate {
    fn of(state: &SmoothedState, k: usize) -> Self {
        let (value, half) = (state.value(k), SIGMAS * state.sigma(k));
        Self {
            value,
            interval: [value - half, value + half],
        }
    }

    /// Half-width of the interval.
    pub fn half(&self) -> f64 {
        0.5 * (self.interval[1] - self.interval[0])
    }
}

/// How a trajectory is mounted and timed against the unit.
#[derive(Debug, Clone, Serialize)]
pub struct Mounted {
    /// What to add to the trajectory's times, s; negative if it is late.
    pub clock_s: Estimate,
    /// Rotation vector from the unit's axes to those that the trajectory gives the attitude of, in axes of the unit, rad.
    pub rotation_rad: [Estimate; 3],
    /// Where the trajectory's point lies, in axes of the unit, m.
    pub lever_m: [Estimate; 3],
}

impl Mounted {
    pub(super) fn of(smoothed: &Smoothed) -> Self {
        let state = smoothed.middle();
        let three = |from: usize| std::array::from_fn(|k| Estimate::of(state, from + k));
        Self {
            clock_s: Estimate::of(state, CLOCK),
            rotation_rad: three(MOUNTING.start),
            lever_m: three(LEVER.start),
        }
    }
}

/// Biases in the middle of the session.
pub(super) fn biases(smoothed: &Smoothed) -> PerSensor<[Estimate; 3]> {
    let state = smoothed.middle();
    PerSensor::from_fn(|s| std::array::from_fn(|k| Estimate::of(state, offset(s).start + k)))
}
