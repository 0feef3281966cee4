//! The whole path from raw readings to SI: lags of the dies, curves over temperature, effects.
//!
//! The firmware, `mimu device check` and the compensation of recordings on the PC all run this code, so the order of the operations is the
//! same everywhere. The calibration is immutable; the memory of a stream is in [`State`].
//!
//! [`Compensator::follow`] runs several times per second, with the temperature and the elapsed time; [`Compensator::apply`] runs with every
//! sample:
//!
//! 1. `x = C u + o`, C and o at the temperature of the dies ([`Table`], [`DieLag`]);
//! 2. the effects are removed from x ([`Effects::remove`]).

use nalgebra::{RealField, convert};

use crate::PerSensor;
use crate::compensation::{Compensation, Sample};
use crate::die::{self, DieLag};
use crate::effects::{self, Effects, REFERENCE_C};
use crate::table::{self, Place, Table};

/// A calibration, ready to run: up to NODES nodes over temperature, up to ROOM effects of a triad and kind.
#[derive(Debug, Clone)]
pub struct Compensator<T: RealField, const NODES: usize, const ROOM: usize> {
    /// Compensation over the temperature of the dies.
    pub table: Table<T, NODES>,
    /// Lags of the dies behind the thermometer.
    pub lags: PerSensor<DieLag<T>>,
    /// The effects; `None` if there are none, so that samples do not pay for them.
    pub effects: Option<Effects<T, ROOM>>,
}

/// Memory of a [`Compensator`] for one stream.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<T: RealField, const ROOM: usize> {
    dies: PerSensor<die::State<T>>,
    dies_c: Option<PerSensor<T>>,
    model: table::State<T>,
    effects: effects::State<T, ROOM>,
}

impl<T: RealField + Copy, const ROOM: usize> State<T, ROOM> {
    /// The next sample does not follow the one before: samples are missing.
    pub fn gap(&mut self) {
        self.effects.gap();
    }

    /// Temperatures of the dies at the last [`Compensator::follow`], °C; `None` before the first reading of the thermometer.
    pub fn dies_c(&self) -> Option<PerSensor<T>> {
        self.dies_c
    }

    /// Inverse models at the last [`Compensator::follow`], raw to SI.
    pub fn models(&self) -> &Compensation<T> {
        &self.model.model
    }

    /// The sample rate from now on, Hz: that of a digital sensor drifts with its temperature.
    pub fn at_rate(&mut self, sample_rate_hz: T) {
        self.effects.at_rate(sample_rate_hz);
    }

    /// See [`effects::State::long_after_power_on`].
    pub fn long_after_power_on(self) -> Self {
        Self {
            effects: self.effects.long_after_power_on(),
            ..self
        }
    }
}

impl<T: RealField + Copy, const NODES: usize, const ROOM: usize> Compensator<T, NODES, ROOM> {
    /// State of a stream that begins at power-on, at this sample rate, Hz.
    pub fn state(&self, sample_rate_hz: T) -> State<T, ROOM> {
        State {
            dies: PerSensor::both(die::State::new()),
            dies_c: None,
            model: self.table.state(),
            effects: effects::State::new(sample_rate_hz),
        }
    }

    /// Takes over the state of a stream that another calibration has compensated so far. Time since power-on continues, and so do the lags
    /// of the dies and of the effects that are in both calibrations. Call [`Self::follow`] before the next sample: it evaluates the models
    /// of the new calibration.
    pub fn take_over(&self, before: &Self, state: &mut State<T, ROOM>) {
        let known = before.lags.zip(state.dies);
        state.dies = self.lags.map(|lag| {
            let mut same = known.into_iter().filter(|(_, (other, _))| *other == lag);
            same.next().map_or(die::State::new(), |(_, (_, die))| die)
        });
        // Without effects only time and temperature are remembered.
        state.effects.gap();
        if let Some(all) = &self.effects {
            all.take_over(before.effects.as_ref(), &mut state.effects);
        }
    }

    /// Follows time (s since the previous call, or since power-on) and the thermometer (°C; `None` if it has no reading). Before the first
    /// reading the models are those of [`REFERENCE_C`], and lags and effects have no temperature; the first reading does not count as a
    /// step.
    ///
    /// Returns where the temperatures of the dies are in the table.
    pub fn follow(&self, state: &mut State<T, ROOM>, dt_s: T, thermometer_c: Option<T>) -> Place {
        // NaN counts as no reading.
        let read_c = thermometer_c.unwrap_or(T::zero() / T::zero());
        let dies = self.lags.as_ref().zip(state.dies.as_mut());
        let dies_c = dies.map(|(lag, die)| lag.follow(die, dt_s, read_c));
        self.follow_at(state, dt_s, thermometer_c, dies_c.transpose())
    }

    /// The same with known temperatures of the dies, °C, such as those that the device reports.
    pub fn follow_at(
        &self,
        state: &mut State<T, ROOM>,
        dt_s: T,
        thermometer_c: Option<T>,
        dies_c: Option<PerSensor<T>>,
    ) -> Place {
        state.dies_c = dies_c;
        let at = dies_c.unwrap_or(PerSensor::both(convert(REFERENCE_C)));
        self.table.follow(&mut state.model, at);
        let read_c = thermometer_c.unwrap_or(T::zero() / T::zero());
        match &self.effects {
            Some(all) => all.slow(&mut state.effects, dt_s, read_c),
            None => state.effects.pass(dt_s, read_c),
        }
        state.model.place
    }

    /// Converts a raw sample to SI. Call it with every sample in order, and [`State::gap`] if samples are missing.
    #[inline]
    pub fn apply(&self, state: &mut State<T, ROOM>, raw: &Sample<T>) -> Sample<T> {
        let input = state.model.model.apply(raw);
        match &self.effects {
            Some(all) => all.remove(&mut state.effects, &input),
            None => input,
        }
    }
}
