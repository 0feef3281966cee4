//! Removing effects from readings, by what the device itself measures.

use std::sync::Arc;

use mimu_core::compensation::Affine;
use mimu_core::die::BEYOND_C;
use nalgebra::{Matrix3, Vector3};

use super::fitted::FittedEffect;
use super::quantity::{Conditions, Need};
use super::temperature::{Followed, lagged, offsets, without_self_heating};
use crate::prepared::Prepared;
use crate::quantity::Sensor;
use crate::signal::blocks::Block;
use crate::signal::dwell::{Dwell, Fault};
use crate::signal::increment::Increment;
use crate::triad::directions;
use crate::warning::Warning;
use mimu_recording::{Error, Reference, Result};

/// Errors of the axes of the sensor under some conditions, SI. For effects with a lag, the conditions have to contain the temperature behind that
/// lag.
pub fn errors(effects: &[FittedEffect], conditions: &[Conditions]) -> Vec<Vector3<f64>> {
    let mut all = vec![Vector3::zeros(); conditions.len()];
    for effect in effects {
        for (error, at) in all.iter_mut().zip(conditions) {
            effect.add(at, error);
        }
    }
    all
}

/// Refuses a recording that lacks channels or temperatures without which one of `effects` cannot be removed.
pub fn removable(prepared: &Prepared, effects: &[FittedEffect]) -> Result<()> {
    let dwells = &prepared.dwells.list;
    let mut blocks = dwells.iter().enumerate().flat_map(|(i, dwell)| {
        let from = match (prepared.manifest.reference, i.checked_sub(1)) {
            // By hand the turns are judged too, and they lie between the dwells.
            (Reference::Gravity, Some(before)) => dwells[before].blocks.end,
            _ => dwell.blocks.start,
        };
        &prepared.condensed.blocks[from..dwell.blocks.end]
    });
    let cold = blocks.find(|b| !b.temp_c.mean.is_finite());
    for effect in effects {
        let sensor = effect.candidate.sensor;
        let lacks = |problem: String| {
            let problem = format!("{} cannot be removed: {problem}", effect.candidate.id());
            let remedy = "record what is missing, or use a calibration without this effect";
            Err(Error::new(&prepared.place, problem, remedy))
        };
        if !prepared.has(sensor) {
            continue;
        }
        for (other, need) in [(Sensor::Gyro, Need::Rate), (Sensor::Accel, Need::Force)] {
            if !prepared.has(other) && effect.candidate.needs(need) {
                return lacks(format!("the recording has no {other} columns"));
            }
        }
        if let (Some(block), true) = (cold, effect.candidate.needs(Need::Temperature)) {
            return lacks(format!("temp_c is missing at {} s", block.start_s));
        }
    }
    Ok(())
}

/// A recording with `effects` removed from the readings. The affine models are the triads' inverse models; the errors are subtracted in the raw
/// domain. `None` if a calibration is singular.
///
/// The conditions are what the device knows: its own compensated readings and its temperature, instead of the table's. An error that depends on its
/// own sensor's reading is evaluated twice, the second time without the first estimate of the error. With one evaluation a share k of an error with
/// slope k would remain; with two, k² remains.
pub fn remove(
    prepared: &Prepared,
    gyro: Option<&Affine<f64>>,
    accel: Option<&Affine<f64>>,
    effects: &[FittedEffect],
) -> Option<Prepared> {
    let mut out = prepared.clone();
    for sensor in Sensor::BOTH {
        let ours: Vec<&FittedEffect> = effects
            .iter()
            .filter(|e| e.candidate.sensor == sensor)
            .collect();
        let models = [gyro, accel];
        if models[sensor as usize].is_some() && !ours.is_empty() {
            of_sensor(prepared, sensor, models, &ours, &mut out)?;
        }
    }
    Some(out)
}

/// The same for a calibration over these temperatures, °C. As on the device, the effects use the temperature clamped to [`BEYOND_C`] beyond them.
pub fn remove_within(
    prepared: &Prepared,
    gyro: Option<&Affine<f64>>,
    accel: Option<&Affine<f64>>,
    effects: &[FittedEffect],
    limits_c: Option<[f64; 2]>,
) -> Option<Prepared> {
    let Some([from, to]) = limits_c else {
        return remove(prepared, gyro, accel, effects);
    };
    let mut seen = prepared.clone();
    for block in &mut Arc::make_mut(&mut seen.condensed).blocks {
        // clamp() keeps NaN.
        block.temp_c.mean = block.temp_c.mean.clamp(from - BEYOND_C, to + BEYOND_C);
    }
    let mut out = remove(&seen, gyro, accel, effects)?;
    let blocks = &mut Arc::make_mut(&mut out.condensed).blocks;
    for (block, read) in blocks.iter_mut().zip(&prepared.condensed.blocks) {
        block.temp_c = read.temp_c;
    }
    Some(out)
}

fn of_sensor(
    prepared: &Prepared,
    sensor: Sensor,
    models: [Option<&Affine<f64>>; 2],
    effects: &[&FittedEffect],
    out: &mut Prepared,
) -> Option<()> {
    let removal = Removal::of(prepared, sensor, models, effects)?;
    let of_block = removal.errors_of_blocks();
    let corrected = Arc::make_mut(&mut out.condensed);
    if sensor == Sensor::Gyro {
        for piece in &mut corrected.increments {
            removal.correct_increment(piece);
        }
    }
    removal.correct_blocks(&mut corrected.blocks, &of_block);
    for dwell in &mut out.dwells.list {
        removal.correct_dwell(dwell, &of_block);
    }
    leave_out_unknown(sensor, effects, out);
    Some(())
}

/// Middle of each block, s, and its temperature. As on the device: before the first temperature that one is used, and without any the reference.
fn temperatures(blocks: &[Block]) -> Vec<(f64, f64)> {
    let recorded = offsets(blocks);
    let first = recorded.iter().map(|w| w.1).find(|w| w.is_finite());
    let known = |w: f64| if w.is_nan() { first.unwrap_or(0.0) } else { w };
    recorded.into_iter().map(|(t, w)| (t, known(w))).collect()
}

/// The temperature that `effect` follows in each block, and the lagged one; `None` if it follows the recorded one.
fn followed_temperature(effect: &FittedEffect, recorded: &[(f64, f64)]) -> Option<Vec<(f64, f64)>> {
    let followed: Followed = effect.candidate.followed(effect.parameter)?;
    let other = match followed.without_self_heating {
        true => without_self_heating(recorded),
        false => None,
    };
    let recorded = other.as_deref().unwrap_or(recorded);
    let now = recorded.iter().map(|w| w.1);
    Some(match followed.lag_s {
        Some(lag_s) => now.zip(lagged(recorded, lag_s)).collect(),
        None => now.map(|w| (w, w)).collect(),
    })
}

/// The removal of the effects of one sensor from a recording.
struct Removal<'a> {
    prepared: &'a Prepared,
    sensor: Sensor,
    effects: &'a [&'a FittedEffect],
    /// Sensitive directions by rows; `to_body`, their inverse, transforms errors along them to the body frame.
    direction: Matrix3<f64>,
    to_body: Matrix3<f64>,
    /// For each effect that does not follow the recorded temperature: its temperature and the lagged one, by block.
    followed_temperatures: Vec<Option<Vec<(f64, f64)>>>,
    /// Inverse model of the sensor, and those of gyro and accelerometer.
    model: &'a Affine<f64>,
    models: [Option<&'a Affine<f64>>; 2],
    /// Scale factors of the sensor, raw/SI.
    scale: Vector3<f64>,
    /// See [`temperatures`].
    recorded: Vec<(f64, f64)>,
    /// Of each channel, see [`held`].
    held: [Vec<f64>; 6],
    t0_s: f64,
    middle_s: f64,
}

fn apply(model: Option<&Affine<f64>>, raw: Vector3<f64>) -> Vector3<f64> {
    model.map_or(Vector3::repeat(f64::NAN), |m| m.apply(&raw))
}

impl<'a> Removal<'a> {
    fn of(
        prepared: &'a Prepared,
        sensor: Sensor,
        models: [Option<&'a Affine<f64>>; 2],
        effects: &'a [&'a FittedEffect],
    ) -> Option<Self> {
        let model = models[sensor as usize]?;
        let (direction, scale, _) = directions(model)?;
        let blocks = &prepared.condensed.blocks;
        let t0_s = blocks.first()?.start_s;
        let recorded = temperatures(blocks);
        let followed = effects.iter().map(|e| followed_temperature(e, &recorded));
        Some(Self {
            prepared,
            sensor,
            effects,
            direction,
            to_body: direction.try_inverse()?,
            followed_temperatures: followed.collect(),
            model,
            models,
            scale,
            recorded,
            held: std::array::from_fn(|channel| held(blocks, channel)),
            t0_s,
            middle_s: prepared.middle_s(),
        })
    }

    fn blocks(&self) -> &'a [Block] {
        &self.prepared.condensed.blocks
    }

    /// Mean readings in block `at` of three channels.
    fn raw(&self, at: usize, from: usize) -> Vector3<f64> {
        Vector3::from_fn(|i, _| self.held[from + i][at])
    }

    fn conditions(
        &self,
        at: usize,
        t_s: f64,
        rate: Vector3<f64>,
        force: Vector3<f64>,
    ) -> Conditions {
        let block = &self.blocks()[at];
        let input = self.sensor.pick(rate, force);
        Conditions {
            session: 0,
            t_s: t_s - self.t0_s,
            on_s: t_s - self.prepared.power_on_s(),
            from_middle_s: t_s - self.middle_s,
            duration_s: f64::from(block.rows) * self.prepared.condensed.period_s,
            rate,
            force,
            angular_acceleration: Vector3::zeros(),
            sensed: self.direction * input,
            temperature_offset: self.recorded[at].1,
            lagged_temperature: self.recorded[at].1,
        }
    }

    /// The conditions without `error` of the sensor.
    fn without(&self, at: &Conditions, error: &Vector3<f64>) -> Conditions {
        let mut clean = *at;
        let input = self.sensor.pick(&mut clean.rate, &mut clean.force);
        *input -= self.to_body * error;
        clean.sensed = self.direction * *input;
        clean
    }

    /// Errors of the axes under conditions within block `at`, SI.
    fn error(&self, conditions: &Conditions, at: usize) -> Vector3<f64> {
        let sum = |conditions: &Conditions| {
            let mut error = Vector3::zeros();
            for (effect, followed) in self.effects.iter().zip(&self.followed_temperatures) {
                let now = (conditions.temperature_offset, conditions.temperature_offset);
                let (temperature_offset, lagged_temperature) =
                    followed.as_ref().map_or(now, |l| l[at]);
                let conditions = Conditions {
                    temperature_offset,
                    lagged_temperature,
                    ..*conditions
                };
                effect.add(&conditions, &mut error);
            }
            error
        };
        // As on the device: if the error is steeper than the input, a second evaluation would diverge.
        let first = sum(conditions);
        let second = sum(&self.without(conditions, &first));
        match (second - first).norm_squared() < first.norm_squared() {
            true => second,
            false => first,
        }
    }

    fn errors_of_blocks(&self) -> Vec<Vector3<f64>> {
        let each = self.recorded.iter().enumerate().map(|(at, (t_s, _))| {
            let [rate, force] = [0, 1].map(|s| apply(self.models[s], self.raw(at, 3 * s)));
            let conditions = self.conditions(at, *t_s, rate, force);
            self.error(&conditions, at)
        });
        each.collect()
    }

    /// Corrects an increment of the gyro.
    fn correct_increment(&self, piece: &mut Increment) {
        let blocks = self.blocks();
        let t_s = piece.end_s - 0.5 * piece.duration_s;
        let at = blocks
            .partition_point(|b| b.last_s < t_s)
            .min(blocks.len() - 1);
        let mean = Vector3::from(piece.integral) / piece.duration_s;
        let force = apply(self.models[1], self.raw(at, 3));
        let mut conditions = self.conditions(at, t_s, self.model.apply(&mean), force);
        conditions.duration_s = piece.duration_s;
        let error = self.error(&conditions, at);
        for i in 0..3 {
            piece.integral[i] -= self.scale[i] * error[i] * piece.duration_s;
        }
    }

    fn correct_blocks(&self, blocks: &mut [Block], of_block: &[Vector3<f64>]) {
        for (block, error) in blocks.iter_mut().zip(of_block) {
            for i in 0..3 {
                block.raw[self.sensor.channels().start + i].mean -= self.scale[i] * error[i];
            }
        }
    }

    fn correct_dwell(&self, dwell: &mut Dwell, of_block: &[Vector3<f64>]) {
        let (blocks, from) = (self.blocks(), self.sensor.channels().start);
        let range = dwell.blocks.clone();
        for i in 0..3 {
            // Weighted by the samples present, as in the mean of the dwell.
            let samples = |b: &Block| f64::from(b.raw[from + i].n);
            let total: f64 = blocks[range.clone()].iter().map(samples).sum();
            let pairs = blocks[range.clone()].iter().zip(&of_block[range.clone()]);
            let mean: f64 = pairs.map(|(b, e)| e[i] * (samples(b) / total)).sum();
            if total > 0.0 {
                dwell.raw[from + i].mean -= self.scale[i] * mean;
            }
        }
    }
}

/// If an effect depends on the other triad, a dwell without readings of that triad cannot be used for this one.
fn leave_out_unknown(sensor: Sensor, effects: &[&FittedEffect], out: &mut Prepared) {
    let (other, need) = sensor.pick((Sensor::Accel, Need::Force), (Sensor::Gyro, Need::Rate));
    let Some(effect) = effects.iter().find(|e| e.candidate.needs(need)) else {
        return;
    };
    for dwell in &mut out.dwells.list {
        let empty = |c: &usize| dwell.raw[*c].n == 0 && dwell.raw[*c].clipped == 0;
        let Some(fault) = other.channels().find(empty).map(Fault::Missing) else {
            continue;
        };
        let slot = &mut dwell.faults[sensor];
        if slot.is_none() {
            *slot = Some(fault);
            let id = effect.candidate.id();
            let warning = Warning::DwellWithEffect {
                dwell: dwell.step,
                sensor,
                fault,
                effect: id,
            };
            out.dwells.warnings.push(warning);
        }
    }
}

/// Mean of a channel in each block, raw. A block without samples has that of the block before; blocks before the first reading have the first.
fn held(blocks: &[Block], channel: usize) -> Vec<f64> {
    let read = |b: &Block| (b.raw[channel].n > 0).then_some(b.raw[channel].mean);
    let mut last = blocks.iter().find_map(read).unwrap_or(f64::NAN);
    let each = blocks.iter().map(|b| {
        last = read(b).unwrap_or(last);
        last
    });
    each.collect()
}
