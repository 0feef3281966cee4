//! Samples, batch by batch, and the streams computed from them.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use mimu_core::effects;
use mimu_core::stored::{self, ROOM, Stored};
use mimu_core::wire::{
    BATCH, BatchHead, CompensatedBatch, Counts, Event, Message, RawBatch, flags, reading,
};

use super::{Act, Device, TEMP_C, sums};

pub(super) struct Calibrated {
    pub(super) stored: Stored,
    pub(super) effects: effects::State<f32, ROOM>,
    pub(super) followed_us: u64,
}

impl Device {
    /// Sends the batches that are due.
    pub(super) fn sample(&mut self) {
        let ms = self.began.elapsed().as_secs_f64() * 1e3 * self.script.speed;
        while f64::from(self.next) + BATCH as f64 <= ms && !self.stop.load(Ordering::Relaxed) {
            let first = self.next;
            self.next += BATCH as u32;
            let streamed = self
                .streamed_from
                .map_or(0, |from| self.next.saturating_sub(from));
            let act = match self.script.acts.first() {
                Some(&(at, act)) if at < streamed => {
                    self.script.acts.remove(0);
                    Some(act)
                }
                _ if self.script.lose.swap(false, Ordering::Relaxed) => Some(Act::Drop),
                _ => None,
            };
            match act {
                Some(Act::Restart) => return self.restart(),
                Some(Act::Hold) => return self.script.speed = 0.0,
                Some(Act::Vanish) => self.port = None,
                Some(Act::Unplug { away_ms }) => {
                    if let Some(link) = &self.script.link {
                        std::fs::remove_file(link).unwrap();
                    }
                    self.port = None;
                    self.back = Some(Instant::now() + Duration::from_millis(away_ms));
                }
                Some(Act::Drop) => self.dropped += 1,
                _ => {}
            }
            self.batch(first, act);
        }
    }

    pub(super) fn batch(&mut self, first: u32, act: Option<Act>) {
        let head = BatchHead {
            first,
            tick_us: u64::from(first) * u64::from(self.script.period_ns) / 1000,
            period_ns: self.script.period_ns,
            samples_lost: self.lost,
            batches_dropped: self.dropped,
            temp_c: TEMP_C,
            flags: self.script.flags
                | match first.is_multiple_of(1000) {
                    true => flags::SATURATED,
                    false => 0,
                },
        };
        let held = self.seen.lock().unwrap().stored.clone();
        // As the firmware, it uses no calibration of another layout.
        let held = held.and_then(|bytes| stored::decode(&bytes).ok());
        if let (None, Some(stored)) = (&self.calibrated, held) {
            let effects = effects::State::new(head.rate_hz() as f32);
            let (effects, powered_for_ms) = match self.script.powered_for_ms {
                Some(ms) => (effects, ms),
                None => (effects.long_after_power_on(), 0),
            };
            self.calibrated = Some(Calibrated {
                stored,
                effects,
                followed_us: 0_u64.wrapping_sub(u64::from(powered_for_ms) * 1000),
            });
        }
        let (mut raw, mut compensated) = (Vec::new(), Vec::new());
        let mut model = None;
        if let Some(c) = &mut self.calibrated {
            let mut state = c.stored.compensator.table.state();
            c.stored
                .compensator
                .table
                .follow(&mut state, mimu_core::PerSensor::both(TEMP_C));
            if let Some(all) = &c.stored.compensator.effects {
                let dt_s = head.tick_us.wrapping_sub(c.followed_us) as f32 / 1e6;
                all.slow(&mut c.effects, dt_s, TEMP_C);
                c.followed_us = head.tick_us;
            }
            model = Some(state.model);
        }
        for n in first..first + BATCH as u32 {
            let [gx, gy, gz, ax, ay, az] = sums(n);
            let counts = Counts {
                gyro: [gx, gy, gz],
                accel: [ax, ay, az],
            };
            raw.extend_from_slice(&RawBatch::pack(&counts));
            let reading = reading(&counts, &self.script.scale);
            if let (Some(c), Some(model)) = (&mut self.calibrated, &model) {
                let mut sample = model.apply(&reading);
                if let Some(all) = &c.stored.compensator.effects {
                    sample = all.remove(&mut c.effects, &sample);
                }
                sample.gyro.x += self.script.bent;
                compensated.extend_from_slice(&CompensatedBatch::pack(&sample));
            }
        }
        if act == Some(Act::Drop) {
            return;
        }
        let garble = act == Some(Act::Garble);
        if self.streams.0 {
            let temperatures = [TEMP_C.to_le_bytes(); 3].concat();
            let batch = RawBatch {
                head,
                scale: self.script.scale,
                temperatures: &temperatures,
                samples: &raw,
            };
            self.frame(&Message::Event(Event::Raw(batch)), garble);
        }
        if self.streams.1 && !compensated.is_empty() {
            let samples = &compensated;
            let batch = CompensatedBatch {
                head,
                samples,
                accel_die_c: None,
            };
            self.frame(&Message::Event(Event::Compensated(batch)), garble);
        }
    }
}
