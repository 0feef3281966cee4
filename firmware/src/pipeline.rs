//! Processing of samples: from sums of codes to the batches of the streams and to the Kalman banks.
//!
//! Once for every sample: raw units, compensation, effects, banks. Once for every batch: scale and temperature by the source, the model at
//! that temperature, and other slow quantities. All samples of a batch are therefore compensated with the same numbers, which the batch
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
    flags, reading,
};
use nalgebra::Vector3;

use calibrated::Calibrated;

use crate::bank::Bank;
use crate::front_end::FrontEnd;
use crate::source::{Scan, Source, THERMOMETERS};

/// The pipeline, shared between tasks of one executor; no task borrows it while it waits.
pub type Shared<S> = Mutex<NoopRawMutex, RefCell<Pipeline<S>>>;

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
    /// Gyro and accelerometer in raw units, summed.
    total: Sample<f32>,
}

/// The batch being filled.
struct Batch<Slow> {
    streams: Streams,
    head: BatchHead,
    /// Whether it ends before the next sample, because a new calibration starts a new batch.
    closed: bool,
    /// Temperatures of the dies at which it is compensated, see [`Calibrated::dies_c`].
    dies_c: (f32, Option<f32>),
    /// Raw units per unit of the integers.
    scale: PerSensor<f32>,
    temps_c: Vec<f32, THERMOMETERS>,
    raw: Vec<[u8; RAW_BYTES], BATCH>,
    compensated: Vec<[u8; COMPENSATED_BYTES], BATCH>,
    /// Total for [`Source::update`].
    slow: Slow,
}

/// The path of the samples.
pub struct Pipeline<S: Source> {
    calibrated: Option<Calibrated>,
    source: S,
    batch: Batch<S::Slow>,
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

impl<S: Source> Pipeline<S> {
    /// Without a calibration and without streams; `kept` was stored with the calibration in use.
    pub fn new(kept: &FrontEnd) -> Self {
        Self {
            calibrated: None,
            source: S::new(kept),
            batch: Batch {
                streams: Streams::default(),
                head: BatchHead {
                    first: 0,
                    tick_us: 0,
                    period_ns: 0,
                    samples_lost: 0,
                    batches_dropped: 0,
                    temp_c: 0.0,
                    flags: 0,
                },
                closed: false,
                dies_c: (0.0, None),
                scale: PerSensor::both(0.0),
                temps_c: Vec::new(),
                raw: Vec::new(),
                compensated: Vec::new(),
                slow: S::Slow::default(),
            },
            expected: None,
            streams: Streams::default(),
            held_flags: 0,
            powered_for_ms: Some(0),
            losses: Losses::default(),
            measurement: None,
            banks: PerSensor::both(None),
        }
    }

    /// Samples per second by the crystal; `None` before the first batch.
    pub fn rate_hz(&self) -> Option<f32> {
        let head = &self.batch.head;
        (head.period_ns > 0).then_some(head.rate_hz() as f32)
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

    /// The meaning of the samples at present.
    pub fn source(&self) -> &S {
        &self.source
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

    /// The mean, in raw units, once it is complete.
    pub fn measured(&self) -> Option<Sample<f32>> {
        let done = self.measurement.filter(|m| m.count == m.wanted)?;
        let count = done.count as f32;
        Some(Sample {
            gyro: done.total.gyro / count,
            accel: done.total.accel / count,
        })
    }

    /// Processes the next sample. `send` gets each event and returns whether there was room for it.
    pub fn take(&mut self, scan: &Scan<S::Slow>, send: &mut impl FnMut(&Message<'_>) -> bool) {
        let number = scan.number;
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
            self.begin_batch(scan);
        }

        let batch = &mut self.batch;
        batch.slow += scan.slow;
        let raw = reading(&scan.counts, &batch.scale);
        if S::is_saturated(&scan.counts, &raw) {
            batch.head.flags |= flags::SATURATED;
        }
        batch.head.flags |= self.held_flags;
        // There is always room, because a full batch ends below.
        let _ = batch.raw.push(RawBatch::pack(&scan.counts));
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

    fn begin_batch(&mut self, scan: &Scan<S::Slow>) {
        if !self.source.begun() {
            self.source.update(&scan.slow, 1);
        }
        let temp_c = self.source.temp_c();
        let thermometer_c = self.source.has_known_temperature().then_some(temp_c);
        let batch = &mut self.batch;
        batch.closed = false;
        batch.streams = self.streams;
        batch.compensated.clear();
        batch.scale = self.source.scale();
        batch.temps_c = self.source.temperatures_c();
        batch.slow = S::Slow::default();
        batch.head = BatchHead {
            first: scan.number,
            tick_us: scan.tick_us,
            period_ns: scan.period_ns,
            samples_lost: self.losses.samples,
            batches_dropped: self.losses.batches,
            temp_c,
            flags: self.source.flags(),
        };
        if let Some(calibrated) = &mut self.calibrated {
            if calibrated.follow(&batch.head, thermometer_c) != Place::Inside {
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
        self.source.update(&batch.slow, samples);
        let (streams, head) = (batch.streams, batch.head);
        let (mut dropped, mut temperatures) = (0, [0; 4 * THERMOMETERS]);
        if streams.raw {
            let event = Event::Raw(RawBatch {
                head,
                scale: batch.scale,
                temperatures: temperature_bytes(&batch.temps_c, &mut temperatures),
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

/// The bytes of the temperatures of a batch, in `room`.
fn temperature_bytes<'a>(temps_c: &[f32], room: &'a mut [u8; 4 * THERMOMETERS]) -> &'a [u8] {
    let (places, _) = room.as_chunks_mut::<4>();
    for (bytes, temp_c) in places.iter_mut().zip(temps_c) {
        *bytes = temp_c.to_le_bytes();
    }
    &room[..4 * temps_c.len().min(THERMOMETERS)]
}

#[cfg(all(test, not(feature = "matek-h743")))]
mod tests;
