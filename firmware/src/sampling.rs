//! Sampling: a task in an executor of its own, above everything else in priority. No other task, however long it computes, can make a
//! sample late. It hands each sample to a queue and computes nothing.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_executor::InterruptExecutor;
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_time::Instant;

use crate::adc::{Converter, Fault};
use crate::channels::Channels;
use crate::design_parameters as design;

/// A sample on its way to be processed.
pub struct Taken {
    /// See [`Sample`](crate::adc::Sample).
    pub number: u32,
    /// When it was read, µs, by the clock's low word.
    pub at_us: u32,
    /// Sums of the conversions of each channel.
    pub sums: Channels<u32>,
}

/// Samples that wait to be processed.
pub static QUEUE: Channel<CriticalSectionRawMutex, Taken, { design::QUEUE }> = Channel::new();

/// What sampling counts.
pub static TALLY: Tally = Tally::new();

/// What sampling and processing count.
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
    /// Samples that found no room in the queue.
    pub queue_overruns: AtomicU32,
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
            longest_us: AtomicU32::new(0),
        }
    }
}

/// Runs the task, from an interrupt.
static EXECUTOR: InterruptExecutor = InterruptExecutor::new();

// The vector of a peripheral that nothing here uses, pended by the executor when a task is due.
#[interrupt]
fn SWPMI1() {
    // SAFETY: this is the interrupt that the executor was started with, and nothing else polls it.
    #[allow(unsafe_code)]
    unsafe {
        EXECUTOR.on_interrupt();
    }
}

/// Starts sampling. To be called once.
pub fn start(converter: Converter) {
    // Below the controller's and the timer's interrupts (level 0): the ring's reader relies on
    // their counts being up to date.
    interrupt::SWPMI1.set_priority(Priority::P1);
    EXECUTOR
        .start(interrupt::SWPMI1)
        .spawn(sample(converter).unwrap());
}

#[embassy_executor::task]
async fn sample(mut converter: Converter) {
    loop {
        let mut stream = converter.start();
        let fault = loop {
            match stream.next().await {
                Ok(sample) => {
                    TALLY.samples.fetch_add(1, Ordering::Relaxed);
                    TALLY.last.store(sample.number, Ordering::Relaxed);
                    let taken = Taken {
                        number: sample.number,
                        at_us: Instant::now().as_micros() as u32,
                        sums: sample.sums,
                    };
                    if QUEUE.try_send(taken).is_err() {
                        TALLY.queue_overruns.fetch_add(1, Ordering::Relaxed);
                    }
                }
                Err(fault) => break fault,
            }
        };
        let counter = match fault {
            Fault::Late => &TALLY.late,
            Fault::ConverterOverrun => &TALLY.converter_overruns,
            Fault::Stalled => &TALLY.stalls,
        };
        counter.fetch_add(1, Ordering::Relaxed);
    }
}
