//! Everything that makes SI of raw readings, in its one order: lags of the dies, curves over temperature, effects.
//!
//! Firmware, the comparison with it and the compensation of recordings on the PC all run this, so that none of them has an order of its
//! own. The calibration is immutable; what is remembered of a stream is in [`State`].
//!
//! [`Compensator::follow`] runs some times a second, with the temperature and the time that passed; [`Compensator::apply`] with every sample:
//!
//! 1. errors of the converter's code are taken out of the raw reading ([`Effects::without_code_errors`]);
//! 2. `x = C u + o`, C and o at the temperature of the dies ([`Table`], [`DieLag`]);
//! 3. the other effects are removed from x ([`Effects::remove`]).

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
    /// What the affine model lacks; `None` if there is nothing, so that no sample pays for it.
    pub effects: Option<Effects<T, ROOM>>,
}

/// What a [`Compensator`] remembers of one stream.
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

    /// See [`effects::State::long_after_power_on`].
    pub fn long_after_power_on(self) -> Self {
        Self {
            effects: self.effects.long_after_power_on(),
            ..self
        }
    }
}

impl<T: RealField + Copy, const NODES: usize, const ROOM: usize> Compensator<T, NODES, ROOM> {
    /// The state of a stream which begins at power-on, of so many samples a second.
    pub fn state(&self, sample_rate_hz: T) -> State<T, ROOM> {
        State {
            dies: PerSensor::both(die::State::new()),
            dies_c: None,
            model: self.table.state(),
            effects: effects::State::new(sample_rate_hz),
        }
    }

    /// Takes over the state of a stream that another calibration has compensated until now. Time since power-on goes on, and so do the lags of
    /// the dies and of the effects that both calibrations have: the unit does not know that it has another calibration. To be followed by
    /// [`Self::follow`] before the next sample, which brings the models of the new one.
    pub fn take_over(&self, before: &Self, state: &mut State<T, ROOM>) {
        let known = before.lags.zip(state.dies);
        state.dies = self.lags.map(|lag| {
            let mut same = known.into_iter().filter(|(_, (other, _))| *other == lag);
            same.next().map_or(die::State::new(), |(_, (_, die))| die)
        });
        // Without effects nothing is remembered but time and temperature.
        state.effects.gap();
        if let Some(all) = &self.effects {
            all.take_over(before.effects.as_ref(), &mut state.effects);
        }
    }

    /// Follows time, s since the call before or since power-on, and the thermometer, °C: `None` where it has no reading. Before the first
    /// reading the models are those of [`REFERENCE_C`], neither lags nor effects have a temperature, and the first one is not a step.
    ///
    /// Where the dies are in the table.
    pub fn follow(&self, state: &mut State<T, ROOM>, dt_s: T, thermometer_c: Option<T>) -> Place {
        // No number is no reading.
        let read_c = thermometer_c.unwrap_or(T::zero() / T::zero());
        let dies = self.lags.as_ref().zip(state.dies.as_mut());
        let dies_c = dies.map(|(lag, die)| lag.follow(die, dt_s, read_c));
        self.follow_at(state, dt_s, thermometer_c, dies_c.transpose())
    }

    /// The same where somebody else knows the temperatures of the dies, °C: the device reports them.
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

    /// A raw sample in SI. To be called with every sample in turn, and [`State::gap`] where some are missing.
    #[inline]
    pub fn apply(&self, state: &mut State<T, ROOM>, raw: &Sample<T>) -> Sample<T> {
        match &self.effects {
            Some(all) => self.apply_clean(state, &all.without_code_errors(raw)),
            None => state.model.model.apply(raw),
        }
    }

    /// The same of a reading that is free of the errors of the converters' codes: for somebody who takes them out with more care than a device
    /// has the time for.
    #[inline]
    pub fn apply_clean(&self, state: &mut State<T, ROOM>, clean: &Sample<T>) -> Sample<T> {
        let input = state.model.model.apply(clean);
        match &self.effects {
            Some(all) => all.remove(&mut state.effects, &input),
            None => input,
        }
    }
}
