//! Sampling: a task in a separate executor with the highest priority. However long another task computes, no sample is late. The task puts
//! each sample into a queue and computes nothing.

use core::future::Future;
use core::sync::atomic::{AtomicU32, Ordering};

use embassy_executor::InterruptExecutor;
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_time::Instant;
use mimu_core::wire::WrongRegister;

use crate::board;
use crate::design_parameters as design;
use crate::source::{Fault, Scan, Source};

/// The half of a source that takes its scans.
pub trait Acquire {
    /// See [`Source::Slow`].
    type Slow;

    /// Begins sampling and gives each scan to `take`, until samples were lost. The numbers of the next call go on where time is then.
    fn acquire(&mut self, take: impl FnMut(Scan<Self::Slow>)) -> impl Future<Output = Fault>;
}

/// A sample to be processed.
pub struct Taken {
    /// Its readings.
    pub scan: Scan<<board::Source as Source>::Slow>,
    /// Time of reading, µs, low word of the clock.
    pub at_us: u32,
}

/// Queue of samples for processing.
pub static QUEUE: Channel<CriticalSectionRawMutex, Taken, { design::QUEUE }> = Channel::new();

/// Counters of sampling.
pub static TALLY: Tally = Tally::new();

/// Counters of sampling and processing.
#[derive(Debug, Default)]
pub struct Tally {
    /// Samples taken.
    pub samples: AtomicU32,
    /// Number of the last.
    pub last: AtomicU32,
    /// See [`Fault`].
    pub late: AtomicU32,
    /// See [`Fault`].
    pub converter_overruns: AtomicU32,
    /// See [`Fault`].
    pub stalls: AtomicU32,
    /// Samples without room in the queue.
    pub queue_overruns: AtomicU32,
    /// Starts of the sensor that found a register wrong, and the last one's register; 0 if none since the last sample.
    pub wrong: [AtomicU32; 2],
    /// Longest time between a sample and the end of its processing, µs.
    pub longest_us: AtomicU32,
}

impl Tally {
    /// All zero.
    pub const fn new() -> Self {
        Self {
            samples: AtomicU32::new(0),
            last: AtomicU32::new(0),
            late: AtomicU32::new(0),
            converter_overruns: AtomicU32::new(0),
            stalls: AtomicU32::new(0),
            queue_overruns: AtomicU32::new(0),
            wrong: [const { AtomicU32::new(0) }; 2],
            longest_us: AtomicU32::new(0),
        }
    }
}

impl Tally {
    /// The sensor was started, and a register is wrong.
    fn found_wrong(&self, wrong: WrongRegister) {
        let WrongRegister {
            register,
            identifies,
            found,
            expected,
        } = wrong;
        let bytes = [1 | u8::from(identifies) << 1, register, found, expected];
        self.wrong[1].store(u32::from_be_bytes(bytes), Ordering::Relaxed);
        self.wrong[0].fetch_add(1, Ordering::Relaxed);
    }

    /// The register that is wrong since the last sample.
    pub fn wrong_register(&self) -> Option<WrongRegister> {
        let [kind, register, found, expected] = self.wrong[1].load(Ordering::Relaxed).to_be_bytes();
        (kind > 0).then_some(WrongRegister {
            register,
            identifies: kind & 2 != 0,
            found,
            expected,
        })
    }
}

/// Lets these interrupts of the line to the host wait for sampling, which the drivers leave above it.
pub fn waits_for_sampling(line: &[interrupt::Interrupt]) {
    line.iter().for_each(|one| one.set_priority(Priority::P2));
}

/// Runs the task, from an interrupt.
static EXECUTOR: InterruptExecutor = InterruptExecutor::new();

// Interrupt of an unused peripheral; the executor pends it when a task is due.
#[interrupt]
fn SWPMI1() {
    // SAFETY: the executor was started with this interrupt, and only this handler polls it.
    #[allow(unsafe_code)]
    unsafe {
        EXECUTOR.on_interrupt();
    }
}

/// Starts sampling. Call it once.
pub fn start(sensors: board::Acquisition) {
    // Below the controller's and the timer's interrupts (level 0): the ring's reader relies on
    // their counts being up to date.
    interrupt::SWPMI1.set_priority(Priority::P1);
    EXECUTOR
        .start(interrupt::SWPMI1)
        .spawn(sample(sensors).unwrap());
}

#[embassy_executor::task]
async fn sample(mut sensors: board::Acquisition) {
    loop {
        let fault = sensors.acquire(|scan| {
            TALLY.samples.fetch_add(1, Ordering::Relaxed);
            TALLY.last.store(scan.number, Ordering::Relaxed);
            let at_us = Instant::now().as_micros() as u32;
            if QUEUE.try_send(Taken { scan, at_us }).is_err() {
                TALLY.queue_overruns.fetch_add(1, Ordering::Relaxed);
            }
        });
        let counter = match fault.await {
            Fault::Late => &TALLY.late,
            Fault::Overrun => &TALLY.converter_overruns,
            Fault::Stalled => &TALLY.stalls,
            Fault::Wrong(wrong) => {
                TALLY.found_wrong(wrong);
                &TALLY.stalls
            }
        };
        counter.fetch_add(1, Ordering::Relaxed);
    }
}
