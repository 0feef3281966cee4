//! The calibration in use: evaluated for the temperature once per batch, and applied to each sample.

use mimu_core::PerSensor;
use mimu_core::compensation::Sample;
use mimu_core::compensator::{Compensator, State};
use mimu_core::single;
use mimu_core::stored::{NODES, ROOM, Stored};
use mimu_core::table::Place;
use mimu_core::wire::BatchHead;

use crate::design_parameters::SAMPLE_HZ;

/// A calibration with its state for the stream.
pub(super) struct Calibrated {
    compensator: Compensator<f32, NODES, ROOM>,
    state: State<f32, ROOM>,
    /// Time of the last `follow`, µs, as in [`BatchHead::tick_us`]; time since power-on is counted from it.
    followed_us: u64,
}

impl Calibrated {
    /// The first calibration of a device; the argument is the time since power-on at sample 0, if known.
    pub fn new(stored: Stored, powered_for_ms: Option<u32>) -> Self {
        let compensator = stored.compensator;
        let state = compensator.state(SAMPLE_HZ as f32);
        let (state, powered_for_ms) = match powered_for_ms {
            Some(ms) => (state, ms),
            None => (state.long_after_power_on(), 0),
        };
        Self {
            compensator,
            state,
            // Time since power-on counts from the beginning of sampling, whenever the calibration arrives.
            followed_us: 0_u64.wrapping_sub(u64::from(powered_for_ms) * 1000),
        }
    }

    /// Switches to another calibration. Call [`Self::follow`] before the next sample.
    pub fn replace(&mut self, stored: Stored) {
        let compensator = stored.compensator;
        compensator.take_over(&self.compensator, &mut self.state);
        self.compensator = compensator;
    }

    /// Samples are missing.
    pub fn gap(&mut self) {
        self.state.gap();
    }

    /// Temperature of the gyros' dies at the beginning of the batch, °C, and that of the accelerometer's, if it has a separate lag. Before
    /// the first temperature, both are `temp_c`.
    pub fn dies_c(&self, temp_c: f32) -> (f32, Option<f32>) {
        let dies_c = self.state.dies_c().unwrap_or(PerSensor::both(temp_c));
        let lags = &self.compensator.lags;
        let apart = lags.gyro != lags.accel;
        (dies_c.gyro, apart.then_some(dies_c.accel))
    }

    /// Follows temperature and the crystal's time to the beginning of a batch, and uses its sample rate.
    pub fn follow(&mut self, head: &BatchHead, thermometer_c: Option<f32>) -> Place {
        let dt_s = head.since_s(self.followed_us);
        self.followed_us = head.tick_us;
        self.state.at_rate(head.rate_hz() as f32);
        self.compensator
            .follow(&mut self.state, dt_s, thermometer_c)
    }

    #[inline]
    pub fn apply(&mut self, raw: &Sample<f32>) -> Sample<f32> {
        single::apply(&self.compensator, &mut self.state, raw)
    }
}
