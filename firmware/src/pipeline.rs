//! Processing of samples: from sums of codes to the batches of the streams and to the Kalman banks.
//!
//! Once for every sample: volts, compensation, effects, banks. Once for every batch: reference and temperature, the model at that
//! temperature, and other slow quantities. All samples of a batch are therefore compensated with the same numbers, which the batch
//! contains.

mod calibrated;

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use heapless::Vec;
use mimu_core::PerSensor;
use mimu_core::compensation::Sample;
use mimu_core::stored::Stored;
use mimu_core::table::Place;
use mimu_core::wire::{
    BATCH, BatchHead, COMPENSATED_BYTES, CompensatedBatch, Event, Message, RAW_BYTES, RawBatch,
    Sums, flags, volts,
};
use nalgebra::Vector3;

use calibrated::Calibrated;

use crate::bank::Bank;
use crate::channels::Channels;
use crate::convert::{ACCEL_VOLTS, Slow};
use crate::design_parameters::{
    ACCEL_STOP_MARGIN_V, ACCEL_STOPS_V, GYRO_STOP_MARGIN_V, GYRO_STOPS_V,
};

/// The pipeline, shared between tasks of one executor; no task borrows it while it waits.
pub type Shared = Mutex<NoopRawMutex, RefCell<Pipeline>>;

/// Which streams are sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Streams {
    /// Raw readings.
    pub raw: bool,
    /// Compensated samples.
    pub compensated: bool,
}

/// Counters of losses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Missing samples.
    pub samples: u32,
    /// Batches without room in the queue of the line.
    pub batches: u32,
}

/// Running mean of samples for the self-test.
#[derive(Clone, Copy, Debug)]
struct Measurement {
    wanted: u32,
    count: u32,
    /// Gyro and accelerometer, V, summed.
    total: Sample<f32>,
}

/// The batch being filled.
struct Batch {
    streams: Streams,
    head: BatchHead,
    /// Whether it ends before the next sample, because a new calibration starts a new batch.
    closed: bool,
    /// Temperatures of the dies at which it is compensated, see [`Calibrated::dies_c`].
    dies_c: (f32, Option<f32>),
    gyro_volts: f32,
    gyro_temps_c: [f32; 3],
    raw: Vec<[u8; RAW_BYTES], BATCH>,
    compensated: Vec<[u8; COMPENSATED_BYTES], BATCH>,
    /// Totals for [`Slow::update`].
    reference: u32,
    temperatures: [u32; 3],
}

/// The path of the samples.
pub struct Pipeline {
    calibrated: Option<Calibrated>,
    slow: Slow,
    batch: Batch,
    /// Number of the next sample, if none is lost.
    expected: Option<u32>,
    /// Streams from the next batch on.
    streams: Streams,
    /// Flags set by other parts, see [`flags`].
    held_flags: u16,
    /// Time since power-on at sample 0, ms, if known.
    powered_for_ms: Option<u32>,
    losses: Losses,
    measurement: Option<Measurement>,
    /// Banks of the gyros and of the accelerometers.
    pub banks: PerSensor<Option<Bank>>,
}

impl Default for Pipeline {
    fn default() -> Self {
        Self::new()
    }
}

impl Pipeline {
    /// Without a calibration and without streams.
    pub const fn new() -> Self {
        Self {
            calibrated: None,
            slow: Slow::NEW,
            batch: Batch {
                streams: Streams {
                    raw: false,
                    compensated: false,
                },
                head: BatchHead {
                    first: 0,
                    samples_lost: 0,
                    batches_dropped: 0,
                    temp_c: 0.0,
                    flags: 0,
                },
                closed: false,
                dies_c: (0.0, None),
                gyro_volts: 0.0,
                gyro_temps_c: [0.0; 3],
                raw: Vec::new(),
                compensated: Vec::new(),
                reference: 0,
                temperatures: [0; 3],
            },
            expected: None,
            streams: Streams {
                raw: false,
                compensated: false,
            },
            held_flags: 0,
            powered_for_ms: Some(0),
            losses: Losses {
                samples: 0,
                batches: 0,
            },
            measurement: None,
            banks: PerSensor {
                gyro: None,
                accel: None,
            },
        }
    }

    /// Sets the time since power-on at sample 0, ms (default 0; `None`: unknown). Call it before [`Self::calibrate`].
    pub fn powered_for(&mut self, ms: Option<u32>) {
        self.powered_for_ms = ms;
        self.flag(flags::POWER_ON_UNKNOWN, ms.is_none());
    }

    /// Uses this calibration from the next batch on, which begins with the next sample: no sample is compensated before the calibration has
    /// followed the present temperature. The state of the previous calibration continues, see
    /// [`Compensator::take_over`](mimu_core::compensator::Compensator::take_over).
    pub fn calibrate(&mut self, stored: Stored) {
        match &mut self.calibrated {
            Some(calibrated) => calibrated.replace(stored),
            none => *none = Some(Calibrated::new(stored, self.powered_for_ms)),
        }
        self.batch.closed = true;
    }

    /// Sets the stored offsets between the TEMP pins, °C. Call it before the first sample.
    pub fn set_temp_offsets(&mut self, pins_c: [f32; 3]) {
        self.slow = Slow::of_pins(pins_c);
    }

    /// The slow quantities.
    pub fn slow(&self) -> &Slow {
        &self.slow
    }

    /// Whether there is a calibration.
    pub fn is_calibrated(&self) -> bool {
        self.calibrated.is_some()
    }

    /// Selects the streams from the next batch on.
    pub fn stream(&mut self, streams: Streams) {
        self.streams = streams;
    }

    /// Sets or clears some of [`flags`] for the samples to come.
    pub fn flag(&mut self, flag: u16, on: bool) {
        match on {
            true => self.held_flags |= flag,
            false => self.held_flags &= !flag,
        }
    }

    /// The counters of losses.
    pub fn losses(&self) -> Losses {
        self.losses
    }

    /// Resets the counters of losses.
    pub fn reset_losses(&mut self) {
        self.losses = Losses::default();
    }

    /// Starts to average the next samples.
    pub fn measure(&mut self, samples: u32) {
        let zero = Vector3::zeros();
        self.measurement = Some(Measurement {
            wanted: samples,
            count: 0,
            total: Sample {
                gyro: zero,
                accel: zero,
            },
        });
    }

    /// The mean, V at the sensors, once it is complete.
    pub fn measured(&self) -> Option<Sample<f32>> {
        let done = self.measurement.filter(|m| m.count == m.wanted)?;
        let count = done.count as f32;
        Some(Sample {
            gyro: done.total.gyro / count,
            accel: done.total.accel / count,
        })
    }

    /// Processes the next sample. `send` gets each event and returns whether there was room for it.
    pub fn take(
        &mut self,
        number: u32,
        channels: &Channels<u32>,
        send: &mut impl FnMut(&Message<'_>) -> bool,
    ) {
        let lost = number.wrapping_sub(self.expected.unwrap_or(number));
        self.expected = Some(number.wrapping_add(1));
        if lost > 0 {
            self.end_batch(send);
            self.losses.samples = self.losses.samples.wrapping_add(lost);
            for bank in [&mut self.banks.gyro, &mut self.banks.accel] {
                let Some(bank) = bank else { continue };
                bank.skip(lost);
            }
            if let Some(calibrated) = &mut self.calibrated {
                calibrated.gap();
            }
        }
        if self.batch.closed {
            self.end_batch(send);
        }
        if self.batch.raw.is_empty() {
            self.begin_batch(number, channels);
        }

        let sums = Sums {
            gyro: channels.gyro,
            accel: channels.accel,
        };
        let batch = &mut self.batch;
        batch.reference += channels.reference;
        for (total, sum) in batch.temperatures.iter_mut().zip(channels.temperature) {
            *total += sum;
        }
        let raw = volts(&sums, batch.gyro_volts, ACCEL_VOLTS);
        if is_saturated(&raw) {
            batch.head.flags |= flags::SATURATED;
        }
        batch.head.flags |= self.held_flags;
        // There is always room, because a full batch ends below.
        let _ = batch.raw.push(RawBatch::pack(&sums));
        // Even without a stream, because the effects need every sample; the load is then always the same.
        if let Some(calibrated) = &mut self.calibrated {
            let sample = calibrated.apply(&raw);
            let _ = batch.compensated.push(CompensatedBatch::pack(&sample));
        }

        self.offer(number, &raw, send);
        if self.batch.raw.is_full() {
            self.end_batch(send);
        }
    }

    /// Passes a sample to the banks and the self-test.
    fn offer(
        &mut self,
        number: u32,
        raw: &Sample<f32>,
        send: &mut impl FnMut(&Message<'_>) -> bool,
    ) {
        if let Some(m) = &mut self.measurement
            && m.count < m.wanted
        {
            m.total.gyro += raw.gyro;
            m.total.accel += raw.accel;
            m.count += 1;
        }
        for (_, (bank, reading)) in self.banks.as_mut().zip(raw.as_ref()) {
            let Some(bank) = bank else { continue };
            if bank.offer(number, reading) {
                // A report without room is dropped; the next one contains more.
                send(&Message::Event(Event::Kalman(bank.state())));
            }
        }
    }

    fn begin_batch(&mut self, number: u32, channels: &Channels<u32>) {
        if !self.slow.begun() {
            self.slow
                .update(channels.reference, channels.temperature, 1);
        }
        let temp_c = self.slow.temp_c();
        let thermometer_c = self.slow.has_known_temperature().then_some(temp_c);
        let batch = &mut self.batch;
        batch.closed = false;
        batch.streams = self.streams;
        batch.compensated.clear();
        batch.gyro_volts = self.slow.gyro_volts();
        batch.gyro_temps_c = self.slow.gyro_temps_c();
        batch.reference = 0;
        batch.temperatures = [0; 3];
        batch.head = BatchHead {
            first: number,
            samples_lost: self.losses.samples,
            batches_dropped: self.losses.batches,
            temp_c,
            flags: self.slow.flags(),
        };
        if let Some(calibrated) = &mut self.calibrated {
            if calibrated.follow(number, thermometer_c) != Place::Inside {
                batch.head.flags |= flags::OUTSIDE_NODES;
            }
            batch.dies_c = calibrated.dies_c(temp_c);
        } else {
            batch.streams.compensated = false;
        }
    }

    fn end_batch(&mut self, send: &mut impl FnMut(&Message<'_>) -> bool) {
        let batch = &mut self.batch;
        if batch.raw.is_empty() {
            return;
        }
        let samples = batch.raw.len() as u32;
        self.slow
            .update(batch.reference, batch.temperatures, samples);
        let (streams, head) = (batch.streams, batch.head);
        let mut dropped = 0;
        if streams.raw {
            let event = Event::Raw(RawBatch {
                head,
                gyro_volts: batch.gyro_volts,
                accel_volts: ACCEL_VOLTS,
                gyro_temps_c: batch.gyro_temps_c,
                samples: batch.raw.as_flattened(),
            });
            dropped += u32::from(!send(&Message::Event(event)));
        }
        if streams.compensated {
            let (gyro_c, accel_c) = batch.dies_c;
            let event = Event::Compensated(CompensatedBatch {
                head: BatchHead {
                    temp_c: gyro_c,
                    ..head
                },
                samples: batch.compensated.as_flattened(),
                accel_die_c: accel_c,
            });
            dropped += u32::from(!send(&Message::Event(event)));
        }
        batch.raw.clear();
        self.losses.batches = self.losses.batches.wrapping_add(dropped);
    }
}

/// Whether a sensor's output is at an end of its range.
fn is_saturated(raw: &Sample<f32>) -> bool {
    let at_a_stop = |volts: &Vector3<f32>, [low, high]: [f32; 2], margin: f32| {
        volts.min() <= low + margin || volts.max() >= high - margin
    };
    at_a_stop(&raw.gyro, GYRO_STOPS_V, GYRO_STOP_MARGIN_V)
        || at_a_stop(&raw.accel, ACCEL_STOPS_V, ACCEL_STOP_MARGIN_V)
}

#[cfg(test)]
mod tests;
