//! The calibration in use: at a temperature once for every batch, and on a sample a thousand times a second.

use mimu_core::compensation::Sample;
use mimu_core::die::{self, DieLag};
use mimu_core::effects;
use mimu_core::single;
use mimu_core::stored::{ROOM, Stored};
use mimu_core::table::{self, Place};

use crate::design_parameters::{GYRO_TEMPERATURE_NULL_C, SAMPLE_HZ};

/// A calibration with what it remembers of the stream.
pub(super) struct Calibrated {
    stored: Stored,
    /// Of gyro and accelerometer, as all that is of the dies.
    lags: [DieLag<f32>; 2],
    dies: [die::State<f32>; 2],
    /// Temperatures of the dies at the beginning of the batch, °C.
    dies_c: [f32; 2],
    model: table::State<f32>,
    effects: effects::State<f32, ROOM>,
    /// Number of the sample at which the slow effects were followed last; time since power-on is counted by it.
    followed: u32,
    /// The same of the dies, whose lag begins with the first reading of the thermometer, however long the power has been there.
    die_followed: Option<u32>,
}

impl Calibrated {
    /// From the next batch on. `powered_for_ms`: how long the device had its power at sample 0, if that is known. `before`: the calibration
    /// until now.
    pub fn new(stored: Stored, powered_for_ms: Option<u32>, before: Option<&Self>) -> Self {
        let effects = effects::State::new(SAMPLE_HZ as f32);
        let (effects, powered_for_ms) = match powered_for_ms {
            Some(ms) => (effects, ms),
            None => (effects.long_after_power_on(), 0),
        };
        let lags = stored.lags();
        // The dies do not know that they have another calibration: what is left of a ramp goes on, where it is of the same lags.
        let before = before.filter(|before| before.lags == lags);
        Self {
            dies: before.map_or([die::State::new(); 2], |before| before.dies),
            die_followed: before.and_then(|before| before.die_followed),
            dies_c: [GYRO_TEMPERATURE_NULL_C; 2],
            lags,
            model: stored.table.state(),
            effects,
            // A number is a millisecond. Time since power-on goes on, whenever the calibration comes.
            followed: 0_u32.wrapping_sub(powered_for_ms),
            stored,
        }
    }

    /// Samples are missing.
    pub fn gap(&mut self) {
        self.effects.gap();
    }

    /// Temperature of the gyros' dies at the beginning of the batch, °C, and that of the accelerometer's, if it has a lag of its own.
    pub fn dies_c(&self) -> (f32, Option<f32>) {
        let [gyro_c, accel_c] = self.dies_c;
        let [gyro, accel] = &self.lags;
        (gyro_c, (gyro != accel).then_some(accel_c))
    }

    /// Follows temperature and time to the beginning of a batch. `known`: there was a reading of the thermometer, and `temp_c` is not
    /// what stands in for one.
    pub fn follow(&mut self, number: u32, temp_c: f32, known: bool) -> Place {
        let seconds = |samples: u32| samples as f32 / SAMPLE_HZ as f32;
        self.dies_c = [temp_c; 2];
        if known {
            let passed = self
                .die_followed
                .map_or(0, |before| number.wrapping_sub(before));
            let triads = self.lags.iter().zip(&mut self.dies).zip(&mut self.dies_c);
            for ((lag, die), die_c) in triads {
                let followed = lag.follow(die, seconds(passed), temp_c);
                *die_c = followed.unwrap_or(temp_c);
            }
            self.die_followed = Some(number);
        }
        self.stored.table.follow(&mut self.model, self.dies_c);
        if let Some(all) = &self.stored.effects {
            let dt_s = seconds(number.wrapping_sub(self.followed));
            all.slow(&mut self.effects, dt_s, temp_c);
            self.followed = number;
        }
        self.model.place
    }

    #[inline]
    pub fn apply(&mut self, raw: &Sample<f32>) -> Sample<f32> {
        let model = &self.model.model;
        match &self.stored.effects {
            Some(all) => {
                let raw = single::without_code_errors(all, raw);
                single::remove(all, &mut self.effects, &single::compensate(model, &raw))
            }
            None => single::compensate(model, raw),
        }
    }
}
