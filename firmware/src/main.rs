//! Firmware of the inertial unit: the tasks and their resources.
//!
//! - Samples three gyros, three accelerometer axes, the gyros' temperatures and their reference at
//!   exactly 1 kHz, timed by the crystal alone.
//! - Samples in a separate executor with the highest priority: however long another task computes, no sample is late. The task puts each
//!   sample into a queue and computes nothing.
//! - Compensates, streams and answers in the other executor, see [`mimu_firmware`].
//! - Counts losses by cause, and restarts aligned.
//! - Restarts after a panic, a fault, or if it hangs, and reports this in its greeting.
#![no_std]
#![no_main]

use core::cell::RefCell;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m_rt::{ExceptionFrame, exception};
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::peripherals::IWDG1;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::zerocopy_channel::Channel;
use embassy_time::{Duration, Instant, Ticker};
use heapless::Vec;
use mimu_core::stored::MAX_LENGTH;
use mimu_core::wire::{Message, StoredInfo, flags};
use mimu_firmware::board::{self, Board};
use mimu_firmware::commands::{ANSWERED, Commands, info};
use mimu_firmware::design_parameters as design;
use mimu_firmware::flash::Flash;
use mimu_firmware::front_end::FrontEnd;
use mimu_firmware::link::{
    self, FrameReceiver, FrameSender, Input, Outgoing, Output, TRANSMITTED, transmit, try_send,
};
use mimu_firmware::liveness::Overseer;
use mimu_firmware::pipeline::{Pipeline, Shared};
use mimu_firmware::restart::{self, Before};
use mimu_firmware::sampling::{self, QUEUE, TALLY};
use mimu_firmware::slots::Slots;
use mimu_firmware::source::usable;
use mimu_firmware::upload::Upload;
use static_cell::{ConstStaticCell, StaticCell};

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    static BEFORE: StaticCell<Before> = StaticCell::new();
    static STORED: ConstStaticCell<Vec<u8, MAX_LENGTH>> = ConstStaticCell::new(Vec::new());

    let before = &*BEFORE.init(restart::take());
    let board = Board::start();
    let stored = STORED.take();
    let mut slots = Slots::open(Flash::new(), stored).await;
    let kept = slots.front_end().await;
    let mut front_end = kept.unwrap_or_default();
    let own_factors = slots.in_use().is_some() && board.sensors.needs_factors(&front_end);
    let faults = [
        (flags::YOUNGER_UNUSABLE, slots.younger_unusable()),
        (flags::OWN_FACTORS, own_factors),
    ];
    let sensors = board.sensors.prepare(&mut front_end);
    // Sampling begins within some milliseconds.
    let powered_for_ms = powered_for_ms(before);
    let (pipeline, in_use) = pipeline(slots.in_use(), stored, powered_for_ms, &front_end);
    for (flag, is) in faults {
        pipeline.lock(|p| p.borrow_mut().flag(flag, is));
    }
    let (events, events_out) = queue_of_events();
    let (replies, replies_out) = queue_of_replies();
    #[cfg(not(feature = "usb"))]
    let (to_host, from_host) = {
        static RECEIVED: ConstStaticCell<[u8; design::RECEIVED]> =
            ConstStaticCell::new([0; design::RECEIVED]);
        link::split(board.line, RECEIVED.take())
    };
    #[cfg(feature = "usb")]
    let (to_host, from_host) = {
        static MEMORY: StaticCell<link::Memory> = StaticCell::new();
        let serial = embassy_stm32::uid::uid_hex();
        let memory = MEMORY.init_with(link::Memory::new);
        let (to_host, from_host, device) = link::split(board.line, serial, memory);
        spawner.spawn(usb(device).unwrap());
        (to_host, from_host)
    };
    let everything = Commands {
        pipeline,
        tally: &TALLY,
        slots,
        front_end,
        upload: Upload::new(stored),
        stored: in_use,
        self_test: board.self_test,
        before,
        powered_for_ms,
        replies,
    };

    sampling::start(sensors);
    spawner.spawn(process(pipeline, events).unwrap());
    spawner.spawn(output(to_host, replies_out, events_out).unwrap());
    spawner.spawn(commands(everything, from_host).unwrap());
    watch(board.watchdog, pipeline, before).await
}

/// Processes the samples of the queue.
#[embassy_executor::task]
async fn process(pipeline: &'static Shared<board::Source>, mut events: FrameSender) {
    loop {
        let taken = QUEUE.receive().await;
        pipeline.lock(|p| {
            let mut send = |message: &Message<'_>| try_send(&mut events, message);
            p.borrow_mut().take(&taken.scan, &mut send);
        });
        let took = (Instant::now().as_micros() as u32).wrapping_sub(taken.at_us);
        TALLY.longest_us.fetch_max(took, Ordering::Relaxed);
    }
}

/// Sends queued frames.
#[embassy_executor::task]
async fn output(output: Output, replies: FrameReceiver, events: FrameReceiver) {
    transmit(output, replies, events).await;
}

/// Answers the host.
#[embassy_executor::task]
async fn commands(commands: Commands<'static>, input: Input) {
    commands.serve(input).await
}

/// Runs the part's own USB.
#[cfg(feature = "usb")]
#[embassy_executor::task]
async fn usb(mut usb: link::Usb) {
    usb.run().await
}

/// Present time since power-on, ms, if known.
fn powered_for_ms(before: &Before) -> Option<u32> {
    let uptime_ms = u32::try_from(Instant::now().as_millis()).unwrap_or(u32::MAX);
    let so_far = before.powered_for_ms()?;
    Some(so_far.saturating_add(uptime_ms))
}

/// Feeds the watchdog as long as samples come and are processed, keeps the time since power-on, and logs. Panics if transmitter or commands make no
/// progress: the restart then tells the line, which the watchdog cannot.
async fn watch(
    mut watchdog: IndependentWatchdog<'static, IWDG1>,
    pipeline: &Shared<board::Source>,
    before: &Before,
) -> ! {
    let mut due = Ticker::every(Duration::from_millis(design::WATCHDOG_FEED_MS));
    let (mut last, mut rounds) = ([0; 2], 0);
    let mut transmitter = Overseer::new(design::rounds(design::TRANSMITTER_MS));
    let mut commands = Overseer::new(design::rounds(design::COMMAND_MS));
    loop {
        due.next().await;
        // A USB host that does not read stops the transmitter, and is no fault of the device.
        assert!(cfg!(feature = "usb") || !transmitter.is_stuck(&TRANSMITTED));
        assert!(!commands.is_stuck(&ANSWERED));
        // Only samples count: a converter without samples is restarted again and again, which is not progress. A full queue means that
        // nobody empties it. No restart remedies a missing sensor, which is asked again and again, and reported.
        let now = [&TALLY.samples, &TALLY.wrong[0]].map(|c| c.load(Ordering::Relaxed));
        if now != last && !QUEUE.is_full() {
            watchdog.pet();
            restart::keep_powered(powered_for_ms(before));
        }
        if now[0] != last[0] {
            TALLY.wrong[1].store(0, Ordering::Relaxed);
        }
        last = now;
        rounds += 1;
        if rounds % (1000 / design::WATCHDOG_FEED_MS) == 0 {
            let losses = pipeline.lock(|p| p.borrow().losses());
            let of = |counter: &AtomicU32| counter.load(Ordering::Relaxed);
            defmt::info!(
                "{} samples; began anew: {} late, {} overrun, {} stalled; lost: {} samples, {} batches",
                of(&TALLY.samples),
                of(&TALLY.late),
                of(&TALLY.converter_overruns),
                of(&TALLY.stalls),
                losses.samples,
                losses.batches,
            );
        }
    }
}

/// The pipeline with the calibration in use. Not in `main`, because its future would keep room for both.
#[inline(never)]
fn pipeline(
    in_use: Option<(u32, u64)>,
    bytes: &[u8],
    powered_for_ms: Option<u32>,
    kept: &FrontEnd,
) -> (&'static Shared<board::Source>, Option<StoredInfo>) {
    static PIPELINE: StaticCell<Shared<board::Source>> = StaticCell::new();
    let pipeline = PIPELINE.init_with(|| Mutex::new(RefCell::new(Pipeline::new(kept))));
    pipeline.lock(|p| p.borrow_mut().powered_for(powered_for_ms));
    let info = in_use.and_then(|(length, hash)| {
        let stored = usable(bytes).ok()?;
        let info = info(length, hash, &stored);
        pipeline.lock(|p| p.borrow_mut().calibrate(stored));
        Some(info)
    });
    (pipeline, info)
}

type Frames = Channel<'static, NoopRawMutex, Outgoing>;

/// Queue of events.
fn queue_of_events() -> (FrameSender, FrameReceiver) {
    static MEMORY: ConstStaticCell<[Outgoing; design::FRAMES]> =
        ConstStaticCell::new([Outgoing::EMPTY; design::FRAMES]);
    static FRAMES: StaticCell<Frames> = StaticCell::new();
    FRAMES.init(Frames::new(MEMORY.take())).split()
}

/// Queue of answers: one being sent, one being written.
fn queue_of_replies() -> (FrameSender, FrameReceiver) {
    static MEMORY: ConstStaticCell<[Outgoing; 2]> = ConstStaticCell::new([Outgoing::EMPTY; 2]);
    static FRAMES: StaticCell<Frames> = StaticCell::new();
    FRAMES.init(Frames::new(MEMORY.take())).split()
}

/// A panic records its place and restarts the device: a unit that stands still cannot be used in the field.
#[panic_handler]
fn panic(panic: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    restart::after_panic(panic, || {
        if let Some(at) = panic.location() {
            defmt::error!("panic at {=str}:{=u32}", at.file(), at.line());
        }
    })
}

// SAFETY: it never returns, and uses only the record of `restart`.
#[allow(unsafe_code)]
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    let pc = frame.pc();
    restart::after_fault(pc, || defmt::error!("fault at {=u32:#x}", pc))
}
