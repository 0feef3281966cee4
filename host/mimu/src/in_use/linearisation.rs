//! The point about which the errors of dead reckoning are linear. A bias of 4 deg/s turns a segment of 8 s by half a radian, and a clock that is 20 ms off
//! tilts gravity: one linearisation about zero would take what it leaves for noise.

use nalgebra::{DVector, Vector3};

use super::smoothed::Smoothed;
use super::state::{CLOCK, MOUNTING, STATES, offset};
use crate::quantity::{PerSensor, Sensor};

/// Biases over time, and how the reference is mounted. Where it lies and how its frame is tilted enter linearly, and need no point.
#[derive(Debug, Clone, Default)]
pub(super) struct Linearisation {
    /// Time, s, and biases (rad/s, m/s²), in order of time.
    biases: Vec<(f64, PerSensor<Vector3<f64>>)>,
    /// As [`MOUNTING`].
    pub mounting: Vector3<f64>,
    /// As [`CLOCK`].
    pub clock_s: f64,
}

impl Linearisation {
    /// The estimates of a smoother.
    pub fn of(smoothed: &Smoothed) -> Self {
        let biases = smoothed.each.iter().map(|own| {
            let of = |s: Sensor| Vector3::from_fn(|k, _| own.value(offset(s).start + k));
            (own.at_s, PerSensor::from_fn(of))
        });
        let own = smoothed.middle();
        Self {
            mounting: Vector3::from_fn(|k, _| own.value(MOUNTING.start + k)),
            clock_s: own.value(CLOCK),
            biases: biases.collect(),
        }
    }

    /// Biases at the time of the estimate next to `t_s`.
    pub fn biases_at(&self, t_s: f64) -> PerSensor<Vector3<f64>> {
        let after = self.biases.partition_point(|(t, _)| *t < t_s);
        let near = self.biases[after.saturating_sub(1)..].iter().take(2);
        let near = near.min_by(|a, b| (a.0 - t_s).abs().total_cmp(&(b.0 - t_s).abs()));
        near.map_or(PerSensor::both(Vector3::zeros()), |(_, own)| *own)
    }

    /// The state of the session that this is, where the biases are `biases`.
    pub fn state(&self, biases: &PerSensor<Vector3<f64>>) -> DVector<f64> {
        let mut state = DVector::zeros(STATES);
        for sensor in Sensor::BOTH {
            state
                .rows_mut(offset(sensor).start, 3)
                .copy_from(&biases[sensor]);
        }
        state.rows_mut(MOUNTING.start, 3).copy_from(&self.mounting);
        state[CLOCK] = self.clock_s;
        state
    }

    /// How far it is from the estimates of a smoother, in the standard deviation of the one that is furthest.
    pub fn distance(&self, smoothed: &Smoothed) -> f64 {
        let nonlinear = Sensor::BOTH.into_iter().flat_map(offset).chain(MOUNTING);
        let nonlinear: Vec<usize> = nonlinear.chain([CLOCK]).collect();
        let each = smoothed.each.iter().map(|own| {
            let state = self.state(&self.biases_at(own.at_s));
            let each = nonlinear.iter().filter(|k| own.sigma(**k) > 0.0);
            let each = each.map(|k| (own.value(*k) - state[*k]).abs() / own.sigma(*k));
            each.fold(0.0, f64::max)
        });
        each.fold(0.0, f64::max)
    }
}
