//! A trace computed again.

use std::collections::BTreeMap;

use mimu_core::compensation::Sample;
use mimu_core::compensator::State;
use mimu_core::kalman::Bank;
use mimu_core::single;
use mimu_core::stored::{self, ROOM};
use mimu_core::wire::{BATCH, BatchHead, Decoder, Event, KalmanState, MAX_FRAME, Message, encode};
use mimu_core::{PerSensor, Sensor};
use nalgebra::Vector3;

use super::{INPUTS, NOISE, SPANS, Trace};

/// Numbers of compared values.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Replayed {
    /// Samples of the raw stream.
    pub raw: usize,
    /// Compensated samples that equal the device's bit by bit.
    pub compensated: usize,
    /// Reports of banks that equal the device's bit by bit.
    pub reports: usize,
}

/// Has `core` compute a trace again.
///
/// Errors: the first frame, sample or report that differs.
pub fn replay(trace: &Trace) -> Result<Replayed, String> {
    let stored = stored::decode(&trace.calibration).map_err(|e| format!("calibration: {e:?}"))?;
    let mut host_reference = HostReference {
        state: stored.compensator.state(1000.0),
        slow_at: None,
        powered_for_ms: 0,
        next: None,
        stored,
    };
    let (mut found, mut decoder) = (Replayed::default(), Decoder::new());
    let mut raw: Option<(BatchHead, Vec<Sample<f32>>)> = None;
    let (mut all, mut reports) = (BTreeMap::new(), Vec::new());
    let mut begin = 0;
    for (i, byte) in trace.wire.iter().enumerate() {
        let frame = decoder.push(*byte);
        let bytes = begin..=i;
        if *byte == 0 {
            begin = i + 1;
        }
        let Some(frame) = frame else { continue };
        let message = frame
            .message()
            .ok_or_else(|| format!("byte {i}: a frame that is not understood"))?;
        same_bytes(&message, &trace.wire[bytes]).map_err(|e| format!("byte {i}: {e}"))?;
        match message {
            Message::Event(Event::Raw(batch)) => {
                let samples: Vec<_> = batch.readings().collect();
                found.raw += samples.len();
                all.extend(samples.iter().copied());
                raw = Some((batch.head, samples.into_iter().map(|(_, s)| s).collect()));
            }
            Message::Event(Event::Compensated(batch)) => {
                let (head, samples) = raw.take().ok_or("a compensated batch without a raw one")?;
                let device: Vec<_> = batch.values().map(|(_, s)| s).collect();
                // The compensated batch contains the temperatures of the dies.
                let dies_c = batch.dies_c();
                let same = BatchHead {
                    temp_c: head.temp_c,
                    ..batch.head
                };
                if head != same || samples.len() != device.len() {
                    return Err(format!("sample {}: the two batches differ", head.first));
                }
                found.compensated += host_reference.compare(&head, dies_c, &samples, &device)?;
            }
            Message::Event(Event::Kalman(state)) => {
                // The last samples that it includes arrive with the next batch.
                reports.push(state);
            }
            Message::Greeting { greeting, .. } => {
                let unknown = "the device does not know for how long it has had its power";
                host_reference.powered_for_ms = greeting.powered_for_ms.ok_or(unknown)?;
            }
            _ => {}
        }
    }
    for report in &reports {
        found.reports += usize::from(same_report(report, &all)?);
    }
    match decoder.garbled() {
        0 => Ok(found),
        n => Err(format!("{n} frames are garbled")),
    }
}

/// Checks that encoding a message gives the device's bytes.
fn same_bytes(message: &Message<'_>, bytes: &[u8]) -> Result<(), String> {
    let mut out = [0; MAX_FRAME];
    let length = encode(message, &mut out).map_err(|e| format!("{e:?}"))?;
    // To the decoder, the zero before a frame is an empty frame.
    match out[1..length] == *bytes {
        true => Ok(()),
        false => Err("the message is encoded otherwise".into()),
    }
}

/// The device's computation, in single precision.
struct HostReference {
    stored: stored::Stored,
    state: State<f32, ROOM>,
    /// Number of the sample at the last temperature update.
    slow_at: Option<u32>,
    /// Time since power-on at sample 0.
    powered_for_ms: u32,
    next: Option<u32>,
}

/// If effects are removed, the comparison starts at this sample of a segment. The angular acceleration is a difference to the previous sample, which
/// is unknown for the first. Each sample is corrected with the error of the previous one, of which a thousandth or less remains in the next.
const SETTLED: usize = 8;

impl HostReference {
    fn compare(
        &mut self,
        head: &BatchHead,
        dies_c: PerSensor<f32>,
        raw: &[Sample<f32>],
        device: &[Sample<f32>],
    ) -> Result<usize, String> {
        self.follow(head, dies_c);
        let mut compared = 0;
        for (k, (raw, device)) in raw.iter().zip(device).enumerate() {
            let sample = single::apply(&self.stored.compensator, &mut self.state, raw);
            let effects = self.stored.compensator.effects.is_some();
            if effects && k < SETTLED && self.next != Some(head.first) {
                continue;
            }
            let bits = |s: &Sample<f32>| [s.gyro, s.accel].map(|v| v.map(f32::to_bits));
            if bits(&sample) != bits(device) {
                let number = head.first + k as u32;
                return Err(format!(
                    "sample {number}: {sample:?}, and the device {device:?}"
                ));
            }
            compared += 1;
        }
        self.next = Some(head.first + raw.len() as u32);
        Ok(compared)
    }

    /// As the firmware does: batch after batch, because the time is a sum. Batches begin where the calibration came.
    fn follow(&mut self, head: &BatchHead, dies_c: PerSensor<f32>) {
        let begins = head.first % BATCH as u32;
        let mut at = self.slow_at.map_or(begins, |last| last + BATCH as u32);
        loop {
            let before_us = match self.slow_at {
                Some(before) => 1000 * u64::from(before),
                None => 0_u64.wrapping_sub(1000 * u64::from(self.powered_for_ms)),
            };
            let tick_us = 1000 * u64::from(at);
            let dt_s = BatchHead { tick_us, ..*head }.since_s(before_us);
            let thermometer_c = head.thermometer_c();
            let compensator = &self.stored.compensator;
            compensator.follow_at(&mut self.state, dt_s, thermometer_c, Some(dies_c));
            self.slow_at = Some(at);
            if at >= head.first {
                break;
            }
            at += BATCH as u32;
        }
    }
}

/// Updates a bank up to a report. Returns `false` for a report before the first input or after the last batch.
fn same_report(device: &KalmanState, samples: &BTreeMap<u32, Sample<f32>>) -> Result<bool, String> {
    if device.updates == 0 {
        return Ok(false);
    }
    let (i, what) = match device.sensor {
        Sensor::Gyro => (0, "gyro"),
        Sensor::Accel => (1, "accel"),
    };
    let (noise, input) = (Vector3::from(NOISE), Vector3::from(INPUTS[i]));
    let mut bank = Bank::<f32>::diffuse(&noise, SPANS[i]);
    for number in device.last + 1 - device.updates..=device.last {
        let Some(sample) = samples.get(&number) else {
            return Ok(false);
        };
        let reading = [&sample.gyro, &sample.accel][i];
        single::update(&mut bank, &input, reading, &noise)
            .map_err(|e| format!("{what}, sample {number}: {e:?}"))?;
    }
    for (axis, (filter, told)) in bank.axes.iter().zip(&device.axes).enumerate() {
        let p = filter.covariance();
        let covariance = [
            p.m11, p.m12, p.m13, p.m14, p.m22, p.m23, p.m24, p.m33, p.m34, p.m44,
        ];
        let mean: [f32; 4] = filter.mean().into();
        let same = mean.map(f32::to_bits) == told.mean.map(f32::to_bits)
            && covariance.map(f32::to_bits) == told.covariance.map(f32::to_bits);
        if !same {
            return Err(format!(
                "{what} {axis} after sample {}: {mean:?}, and the device {:?}",
                device.last, told.mean
            ));
        }
    }
    Ok(true)
}
