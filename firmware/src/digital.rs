//! A digital inertial sensor as a source: its packets polled by a timer, numbered by their stamps, timed by the crystal.
//!
//! The sensor samples by its own clock and keeps its packets, so a poll that comes late loses nothing until the FIFO is full. Which samples
//! were lost then, the stamps say; how long a sample is, the [`Timebase`].

pub mod self_test;

use core::marker::PhantomData;
use core::ops::AddAssign;
use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

use heapless::Vec;
use mimu_core::PerSensor;
use mimu_core::compensation::Sample;
use mimu_core::effects::REFERENCE_C;
use mimu_core::wire::{Triad, flags};

use crate::chip::{Bus, Chip, Packet, Part, Problem};
use crate::front_end::FrontEnd;
use crate::lag::Lag;
use crate::source::{Counts, Fault, Scan, Source, THERMOMETERS};
use crate::timebase::Timebase;

/// Time between polls, µs: one sample. A shorter one finds most polls empty, a longer one delays samples.
const POLL_US: u64 = 1_000;

/// Polls before the first sample: the rate is then known to 0.1 %, and the line of the [`Timebase`] moves by less than a sample.
const MEASURED: u32 = 500;

/// Most packets in a poll. The backlog of a late reader, up to a tenth of a second, then reaches the queue of samples and the line within some
/// milliseconds each, instead of flooding both.
const MOST: usize = 8;

/// Without a packet for this long, µs, the sensor counts as stalled: 20 samples.
const SILENCE_US: u64 = 20_000;

/// Wait after a fault before the sensor is reset, µs: a chip without supply must not occupy the sampling task.
const PAUSE_US: u32 = 10_000;

/// Readings of the die's thermometer in a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DieSum {
    /// Sum of the valid ones.
    pub total: i32,
    /// How many these are.
    pub valid: i32,
}

impl AddAssign for DieSum {
    fn add_assign(&mut self, other: Self) {
        self.total += other.total;
        self.valid += other.valid;
    }
}

/// The meaning of the sensor's integers: counts, and one thermometer in the die.
#[derive(Clone, Copy, Debug)]
pub struct Digital<C> {
    part: PhantomData<C>,
    temp_c: Lag,
    /// Whether any batch was processed, and whether the last one had a valid temperature.
    begun: bool,
    has_temperature: bool,
}

impl<C: Part> Source for Digital<C> {
    type Slow = DieSum;

    const TRIADS: PerSensor<Triad<'static>> = C::TRIADS;

    const PLACES: &'static str = "die";

    fn new(_: &FrontEnd) -> Self {
        Self {
            part: PhantomData,
            temp_c: Lag::NEW,
            begun: false,
            has_temperature: false,
        }
    }

    fn keep(&self, _: &mut FrontEnd) {}

    fn update(&mut self, total: &DieSum, _: u32) {
        self.begun = true;
        self.has_temperature = total.valid > 0;
        if self.has_temperature {
            let mean = total.total as f32 / total.valid as f32;
            self.temp_c.take(C::celsius(mean), total.valid as f32);
        }
    }

    fn begun(&self) -> bool {
        self.begun
    }

    /// Counts are the raw unit.
    fn scale(&self) -> PerSensor<f32> {
        PerSensor::both(1.0)
    }

    fn is_saturated(counts: &Counts, _: &Sample<f32>) -> bool {
        C::is_saturated(counts)
    }

    fn temp_c(&self) -> f32 {
        match self.has_known_temperature() {
            true => self.temp_c.value,
            false => REFERENCE_C as f32,
        }
    }

    fn has_known_temperature(&self) -> bool {
        self.temp_c.samples > 0.0
    }

    fn temperatures_c(&self) -> Vec<f32, THERMOMETERS> {
        let mut die = Vec::new();
        // There is room for one.
        let _ = die.push(self.temp_c());
        die
    }

    fn flags(&self) -> u16 {
        match self.has_temperature {
            true => 0,
            false => flags::NO_TEMPERATURE,
        }
    }
}

/// What the self-test asks of the sampling task, and what it gets.
#[derive(Debug)]
pub struct Controls {
    /// Bit 0: deflect the gyro; bit 1: the accelerometer.
    deflect: AtomicU8,
    /// The factory's responses, gyro x, y, z in dps, accelerometer x, y, z in g, as bits of `f32`; NaN: none.
    factory: [AtomicU32; 6],
}

impl Controls {
    /// No deflection, no responses.
    pub const fn new() -> Self {
        Self {
            deflect: AtomicU8::new(0),
            factory: [const { AtomicU32::new(0x7fc0_0000) }; 6],
        }
    }

    /// Deflects triads from the next poll on.
    pub fn deflect(&self, gyro: bool, accel: bool) {
        let bits = u8::from(gyro) | u8::from(accel) << 1;
        self.deflect.store(bits, Ordering::Relaxed);
    }

    /// The factory's responses, dps and g.
    pub fn factory(&self) -> PerSensor<[Option<f32>; 3]> {
        let of = |k: usize| {
            let response = f32::from_bits(self.factory[k].load(Ordering::Relaxed));
            response.is_finite().then_some(response)
        };
        PerSensor {
            gyro: [of(0), of(1), of(2)],
            accel: [of(3), of(4), of(5)],
        }
    }

    fn set_factory(&self, responses: &PerSensor<[Option<f32>; 3]>) {
        let all = responses.gyro.iter().chain(&responses.accel);
        for (to, response) in self.factory.iter().zip(all) {
            let bits = response.unwrap_or(f32::NAN).to_bits();
            to.store(bits, Ordering::Relaxed);
        }
    }
}

impl Default for Controls {
    fn default() -> Self {
        Self::new()
    }
}

/// The sensor and where its samples are in time.
pub struct Polled<C> {
    chip: C,
    controls: &'static Controls,
    base: Option<Timebase>,
    /// Number of the newest packet, from the first packet of all.
    newest: u64,
    /// That of sample 0, once the rate is known.
    zero: Option<u64>,
    /// When sampling began, µs.
    started_us: Option<u64>,
}

impl<C: Chip> Polled<C> {
    /// Not yet running.
    pub const fn new(chip: C, controls: &'static Controls) -> Self {
        Self {
            chip,
            controls,
            base: None,
            newest: 0,
            zero: None,
            started_us: None,
        }
    }

    /// Starts the sensor and gives its samples to `take`, until it has to be started again.
    pub async fn run(&mut self, mut take: impl FnMut(Scan<DieSum>)) -> Fault {
        let now_us = self.chip.bus().now_us();
        self.started_us.get_or_insert(now_us);
        let fault = match self.chip.start().await {
            Ok(()) => self.poll(&mut take).await,
            Err(Problem::Register(wrong)) => Fault::Wrong(wrong),
            Err(_) => Fault::Stalled,
        };
        self.chip.bus().wait_us(PAUSE_US).await;
        fault
    }

    async fn poll(&mut self, take: &mut impl FnMut(Scan<DieSum>)) -> Fault {
        match self.chip.factory_responses().await {
            Ok(responses) => self.controls.set_factory(&responses),
            Err(_) => return Fault::Stalled,
        }
        let mut stamp = None;
        let (mut heard_us, mut polls, mut deflected) = (self.chip.bus().now_us(), 0_u32, 0);
        let mut due_us = heard_us;
        loop {
            due_us += POLL_US;
            let now_us = self.chip.bus().now_us();
            match due_us.checked_sub(now_us) {
                Some(wait_us) => self.chip.bus().wait_us(wait_us as u32).await,
                // Late: polls that were missed are not made up for, because the FIFO kept the packets.
                None => due_us = now_us,
            }
            let wanted = self.controls.deflect.load(Ordering::Relaxed);
            if wanted != deflected {
                deflected = wanted;
                let (gyro, accel) = (wanted & 1 != 0, wanted & 2 != 0);
                if self.chip.deflect(gyro, accel).await.is_err() {
                    return Fault::Stalled;
                }
            }
            let now_us = self.chip.bus().now_us();
            let mut elapsed_us = now_us - heard_us;
            let (mut newest, mut lost_track, mut packets) = (self.newest, false, 0_u32);
            let (base, started_us) = (&self.base, self.started_us);
            // The first poll after a start only finds the new phase.
            let zero = self.zero.filter(|_| polls > 0);
            let polled = self.chip.poll(MOST, |packet| {
                newest += match stamp.replace(packet.stamp) {
                    Some(before) => match C::samples_between(before, packet.stamp, elapsed_us) {
                        Some(samples) => u64::from(samples),
                        None => {
                            lost_track = true;
                            1
                        }
                    },
                    None => first_after(base, newest, now_us),
                };
                // The packets of one poll follow each other within a wrap of the stamp.
                (elapsed_us, packets) = (0, packets + 1);
                if let (Some(base), Some(zero)) = (base, zero)
                    && let Some(scan) = scan(&packet, newest - zero, base)
                {
                    let tick_us = base.at_us(newest) - started_us.unwrap_or_default();
                    take(Scan { tick_us, ..scan });
                }
            });
            let left = match polled.await {
                Ok(left) if !lost_track => left,
                _ => return Fault::Stalled,
            };
            if packets == 0 {
                if elapsed_us > SILENCE_US {
                    return Fault::Stalled;
                }
                continue;
            }
            (self.newest, heard_us) = (newest, now_us);
            if left > 0 {
                // The newest packet was not read, so the poll does not say when it was made.
                continue;
            }
            match &mut self.base {
                Some(base) if polls > 0 => base.poll(newest, now_us),
                Some(base) => *base = base.again(newest, now_us),
                none => {
                    *none = Some(Timebase::new(
                        1e6 / f64::from(C::TRIADS.gyro.rate_hz),
                        newest,
                        now_us,
                    ))
                }
            }
            polls = polls.saturating_add(1);
            if polls == MEASURED && self.zero.is_none() {
                self.zero = Some(newest + 1);
            }
        }
    }
}

/// Samples from number `newest` to the first packet after a start, by the crystal.
fn first_after(base: &Option<Timebase>, newest: u64, now_us: u64) -> u64 {
    let Some(base) = base else { return 1 };
    let since_us = now_us.saturating_sub(base.at_us(newest));
    // Rounded up: a number is never used twice.
    (since_us as f64 / base.period_us()) as u64 + 1
}

fn scan(packet: &Packet, number: u64, base: &Timebase) -> Option<Scan<DieSum>> {
    Some(Scan {
        // Wraps after 49 days, like every number of a sample.
        number: number as u32,
        tick_us: 0,
        period_ns: (base.period_us() * 1e3) as u32,
        // Without a valid reading the sample is missing.
        counts: packet.counts?,
        slow: DieSum {
            total: packet.temperature.map_or(0, i32::from),
            valid: i32::from(packet.temperature.is_some()),
        },
    })
}

#[cfg(test)]
mod tests;
