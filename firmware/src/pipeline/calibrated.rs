//! The calibration in use: evaluated for the temperature once per batch, and applied to each sample.

use mimu_core::PerSensor;
use mimu_core::compensation::Sample;
use mimu_core::compensator::{Compensator, State};
use mimu_core::single;
use mimu_core::stored::{NODES, ROOM, Stored};
use mimu_core::table::Place;

use crate::design_parameters::SAMPLE_HZ;

/// A calibration with its state for the stream.
pub(super) struct Calibrated {
    compensator: Compensator<f32, NODES, ROOM>,
    state: State<f32, ROOM>,
    /// Number of the sample of the last `follow`; it counts the time since power-on.
    followed: u32,
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
            // One number is one millisecond. Time since power-on counts from sample 0, whenever the calibration arrives.
            followed: 0_u32.wrapping_sub(powered_for_ms),
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

    /// Follows temperature and time to the beginning of a batch.
    pub fn follow(&mut self, number: u32, thermometer_c: Option<f32>) -> Place {
        let passed = number.wrapping_sub(self.followed);
        self.followed = number;
        let dt_s = passed as f32 / SAMPLE_HZ as f32;
        self.compensator
            .follow(&mut self.state, dt_s, thermometer_c)
    }

    #[inline]
    pub fn apply(&mut self, raw: &Sample<f32>) -> Sample<f32> {
        single::apply(&self.compensator, &mut self.state, raw)
    }
}
