//! The PC's compensation, which the device's is compared with.

use mimu_core::compensation::{Affine, Compensation, Sample};
use mimu_core::compensator::{Compensator, State};
use mimu_core::die::{self, DieLag};
use mimu_core::stored::{NODES, ROOM};
use mimu_core::wire::BatchHead;
use nalgebra::{RealField, Vector3};

use super::Checked;
use crate::image::Image;
use crate::received::Samples;
use mimu::calibration::{Calibration, compensator};
use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::error::{Error, Result};

/// A compensator and its state in one stream.
struct Running<T: RealField> {
    compensator: Compensator<T, NODES, ROOM>,
    state: State<T, ROOM>,
}

/// The PC's compensation twice: in single precision as on the device, and in double precision from the file.
pub(super) struct HostReference {
    single: Running<f32>,
    double: Running<f64>,
    on_curves: bool,
    dies: Option<PerSensor<die::State<f32>>>,
    /// Time of the first sample of the previous batch, µs. Time since power-on is counted from it, as on the device.
    followed_us: u64,
    /// Number of the sample that comes next.
    next: Option<u32>,
}

impl HostReference {
    pub fn new(
        calibration: &Calibration,
        image: &Image,
        powered_for_ms: Option<u32>,
        place: &str,
    ) -> Result<Self> {
        let unusable = |_| {
            Error::device(
                place,
                "the device could not use it",
                "fit the recording again",
            )
        };
        let stored = image.stored().map_err(unusable)?;
        let model = |sensor| {
            let missing = || Error::device(place, "a sensor is missing", "calibrate both sensors");
            calibration.inverse(sensor).ok_or_else(missing)
        };
        let models = Compensation {
            gyro: model(Sensor::Gyro)?,
            accel: model(Sensor::Accel)?,
        };
        let curves = calibration.curves();
        let on_curves = curves.is_some();
        let effects = calibration.core_effects()?;
        let of_file = compensator(calibration, models, curves, effects);
        let mut single = Running::new(stored.compensator);
        let mut double = Running::new(of_file);
        if powered_for_ms.is_none() {
            single.state = single.state.long_after_power_on();
            double.state = double.state.long_after_power_on();
        }
        let before_us = u64::from(powered_for_ms.unwrap_or_default()) * 1000;
        Ok(Self {
            single,
            double,
            on_curves,
            dies: None,
            followed_us: 0_u64.wrapping_sub(before_us),
            next: None,
        })
    }

    /// Computes a batch as the device does, and records the differences.
    pub fn compare(&mut self, raw: &Samples, device: &Samples, found: &mut Checked) {
        let head = &raw.head;
        let first = self.next != Some(head.first);
        let dies_c = device.dies_c.unwrap_or(PerSensor::both(device.head.temp_c));
        self.follow_dies(head, dies_c, first, found);
        self.follow(head, dies_c);
        if first {
            self.single.state.gap();
            self.double.state.gap();
        }
        for (k, (raw, device)) in raw.values.iter().zip(&device.values).enumerate() {
            let single = self.single.apply(raw);
            let (double, bounds) = self.double(raw);
            // The angular acceleration is the difference to the previous sample, which is missing for the first one.
            if first && k == 0 && self.single.compensator.effects.is_some() {
                continue;
            }
            found.samples += 1;
            found
                .gyro
                .note(&device.gyro, &single.gyro, &double.gyro, &bounds.gyro);
            found
                .accel
                .note(&device.accel, &single.accel, &double.accel, &bounds.accel);
        }
        self.next = Some(head.first.wrapping_add(raw.values.len() as u32));
    }

    /// Compares the temperatures of the dies that the device reports with those computed from its thermometer and lags. The first batch gives the
    /// initial state.
    fn follow_dies(
        &mut self,
        head: &BatchHead,
        dies_c: PerSensor<f32>,
        first: bool,
        found: &mut Checked,
    ) {
        let dt_s = head.since_s(self.followed_us);
        if first {
            self.dies = None;
        }
        let lags = &self.single.compensator.lags;
        match &mut self.dies {
            Some(states) => {
                for (sensor, lag) in lags.iter() {
                    let (state, die_c) = (&mut states[sensor], dies_c[sensor]);
                    if *lag == DieLag::none() {
                        continue;
                    }
                    let ours = lag.follow(state, dt_s, head.temp_c);
                    let off = ours.map_or(f64::INFINITY, |c| f64::from((c - die_c).abs()));
                    let off = if off.is_nan() { f64::INFINITY } else { off };
                    let most = found.die_temperature_k.unwrap_or(0.0);
                    found.die_temperature_k = Some(most.max(off));
                }
            }
            None => {
                let known = lags.zip(dies_c);
                self.dies = Some(known.map(|(lag, die_c)| lag.state_of(head.temp_c, die_c)));
            }
        }
        let [mut low, mut high] = found.die_range_c.unwrap_or([dies_c.gyro; 2]);
        for (_, die_c) in dies_c {
            (low, high) = (low.min(die_c), high.max(die_c));
        }
        found.die_range_c = Some([low, high]);
    }

    /// Advances time and temperature, with the temperatures of the dies that the device used.
    fn follow(&mut self, head: &BatchHead, dies_c: PerSensor<f32>) {
        let passed_us = head.tick_us.wrapping_sub(self.followed_us);
        // Divides as the firmware does: the operation decides the last digit.
        let dt_s = head.since_s(self.followed_us);
        self.followed_us = head.tick_us;
        let thermometer_c = head.thermometer_c();
        let Running { compensator, state } = &mut self.single;
        state.at_rate(head.rate_hz() as f32);
        compensator.follow_at(state, dt_s, thermometer_c, Some(dies_c));
        let Running { compensator, state } = &mut self.double;
        let dt_s = passed_us as f64 / 1e6;
        state.at_rate(head.rate_hz());
        let dies_c = Some(dies_c.map(f64::from));
        compensator.follow_at(state, dt_s, thermometer_c.map(f64::from), dies_c);
    }

    /// The sample in double precision, and the largest error that rounding can cause in it.
    fn double(&mut self, raw: &Sample<f32>) -> (Sample<f64>, Sample<f64>) {
        let raw = raw.map(|u| u.map(f64::from));
        // On a curve each coefficient is itself a sum of four terms.
        let times = if self.on_curves { 2.0 } else { 1.0 };
        let Running { compensator, state } = &mut self.double;
        let of = state.models().as_ref().zip(raw.as_ref());
        let affine = of.map(|(model, raw)| model.matrix * raw + model.offset);
        let bounds = of.map(|(model, raw)| rounding(model, raw) * times);
        let sample = compensator.apply(state, &raw);
        let removed = affine
            .zip(sample.as_ref())
            .map(|(affine, sample)| affine - sample);
        (
            sample,
            bounds
                .zip(removed)
                .map(|(bound, removed)| bound.add_scalar(of_effects(&removed))),
        )
    }
}

impl<T: RealField + Copy> Running<T> {
    /// The sample rate comes with the first batch.
    fn new(compensator: Compensator<T, NODES, ROOM>) -> Self {
        Self {
            state: compensator.state(T::one()),
            compensator,
        }
    }

    fn apply(&mut self, raw: &Sample<T>) -> Sample<T> {
        self.compensator.apply(&mut self.state, raw)
    }
}

/// Largest error, SI, that rounding makes of what the effects remove from a sample: of the order of ten operations for each, on terms of which the largest
/// is at most four times the sum. Readings in volts have a null that makes the affine part's rounding larger than this; counts about zero have none.
fn of_effects(removed: &Vector3<f64>) -> f64 {
    removed.amax() * (24.0 * f64::from(f32::EPSILON))
}

/// Largest error, SI, of `x = C u + o` in single precision. C, o and the four operations of a sum of four terms each round by half a unit of the last
/// place, ε/2, of at most the sum S of the terms' magnitudes: 3 ε S for the affine part, doubled for reserve.
pub fn rounding(model: &Affine<f64>, raw: &Vector3<f64>) -> Vector3<f64> {
    let sizes = model.matrix.abs() * raw.abs() + model.offset.abs();
    sizes * (6.0 * f64::from(f32::EPSILON))
}
