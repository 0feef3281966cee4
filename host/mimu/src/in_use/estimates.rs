//! What a smoother over the segments of a session knows: biases over time, and how the reference is mounted and timed.
//!
//! The errors of dead reckoning are linear about such estimates. A bias of 4 deg/s turns a segment of 8 s by half a radian, and a clock that is 20 ms off
//! tilts gravity: one linearisation about zero would take what it leaves for noise.

use nalgebra::{DVector, Vector3};
use serde::Serialize;

use super::state::{CLOCK, LEVER, MOUNTING, STATES, offset};
use crate::quantity::{PerSensor, Sensor};

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

/// The state of the session at an instant.
#[derive(Debug, Clone)]
pub(super) struct SmoothedState {
    pub at_s: f64,
    /// Of all states of a session; 0 for those that the model lacks.
    pub value: DVector<f64>,
    /// Their standard deviations.
    pub sigma: DVector<f64>,
}

/// The state by all segments, at the time of each, in order of time. The default is a linearisation about zero.
#[derive(Debug, Clone, Default)]
pub(super) struct Smoothed(pub Vec<SmoothedState>);

impl SmoothedState {
    fn three(&self, from: usize) -> Vector3<f64> {
        self.value.fixed_rows::<3>(from).into_owned()
    }

    fn estimate(&self, k: usize) -> Estimate {
        let (value, half) = (self.value[k], SIGMAS * self.sigma[k]);
        Estimate {
            value,
            interval: [value - half, value + half],
        }
    }

    fn estimates(&self, from: usize) -> [Estimate; 3] {
        std::array::from_fn(|k| self.estimate(from + k))
    }

    /// Biases, rad/s and m/s².
    pub fn biases(&self) -> PerSensor<[Estimate; 3]> {
        PerSensor::from_fn(|s| self.estimates(offset(s).start))
    }

    pub fn mounted(&self) -> Mounted {
        Mounted {
            clock_s: self.estimate(CLOCK),
            rotation_rad: self.estimates(MOUNTING.start),
            lever_m: self.estimates(LEVER.start),
        }
    }
}

impl Smoothed {
    /// The state in the middle of the session.
    pub fn middle(&self) -> Option<&SmoothedState> {
        self.0.get(self.0.len() / 2)
    }

    /// As [`MOUNTING`].
    pub fn mounting(&self) -> Vector3<f64> {
        self.middle()
            .map_or_else(Vector3::zeros, |own| own.three(MOUNTING.start))
    }

    /// As [`CLOCK`].
    pub fn clock_s(&self) -> f64 {
        self.middle().map_or(0.0, |own| own.value[CLOCK])
    }

    /// Biases (rad/s, m/s²) of the estimate next to `t_s`.
    pub fn biases_at(&self, t_s: f64) -> PerSensor<Vector3<f64>> {
        let after = self.0.partition_point(|own| own.at_s < t_s);
        let near = self.0[after.saturating_sub(1)..].iter().take(2);
        let off = |own: &&SmoothedState| (own.at_s - t_s).abs();
        let near = near.min_by(|a, b| off(a).total_cmp(&off(b)));
        near.map_or(PerSensor::both(Vector3::zeros()), |own| {
            PerSensor::from_fn(|s| own.three(offset(s).start))
        })
    }

    /// The state of the session that is the point of linearisation, where the biases are `biases`.
    pub fn state(&self, biases: &PerSensor<Vector3<f64>>) -> DVector<f64> {
        let mut state = DVector::zeros(STATES);
        for sensor in Sensor::BOTH {
            state
                .rows_mut(offset(sensor).start, 3)
                .copy_from(&biases[sensor]);
        }
        state
            .rows_mut(MOUNTING.start, 3)
            .copy_from(&self.mounting());
        state[CLOCK] = self.clock_s();
        state
    }

    /// How far this point is from the estimates `found` about it, in the standard deviation of the one that is furthest. Where the reference lies and how
    /// its frame is tilted enter linearly, and need no point.
    pub fn distance(&self, found: &Self) -> f64 {
        let nonlinear = Sensor::BOTH.into_iter().flat_map(offset).chain(MOUNTING);
        let nonlinear: Vec<usize> = nonlinear.chain([CLOCK]).collect();
        let each = found.0.iter().flat_map(|own| {
            let state = self.state(&self.biases_at(own.at_s));
            let known = nonlinear.iter().filter(|k| own.sigma[**k] > 0.0);
            let off = known.map(move |k| (own.value[*k] - state[*k]).abs() / own.sigma[*k]);
            off.collect::<Vec<_>>()
        });
        each.fold(0.0, f64::max)
    }
}
