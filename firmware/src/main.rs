//! Firmware of the inertial unit on a NUCLEO-H743ZI2.
//!
//! - Samples three gyros, three accelerometer axes, the gyros' temperatures and their reference at
//!   exactly 1 kHz, by the crystal alone.
//! - Samples in an executor of its own, above everything else in priority: no other task, however
//!   long it computes, can make a sample late. It hands each sample to a queue and computes nothing.
//! - Compensates, streams and answers in the other executor, see [`mimu_firmware`].
//! - Counts what it loses, by cause, and starts again aligned.
//! - Starts again after a panic, a fault, or when it stands still, and says so in its greeting.
#![no_std]
#![no_main]

use core::cell::RefCell;
use core::panic::PanicInfo;
use core::sync::atomic::Ordering;

use cortex_m_rt::{ExceptionFrame, exception};
use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, Spawner};
use embassy_stm32::adc::AdcChannel;
use embassy_stm32::gpio::{AnyPin, Level, Output as Pin, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::{ADC1, DMA1_CH0, IWDG1};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, bind_interrupts, dma, pac};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::{CriticalSectionRawMutex, NoopRawMutex};
use embassy_sync::channel::Channel;
use embassy_sync::zerocopy_channel;
use embassy_time::{Instant, Ticker};
use mimu_core::stored::{self, MAX_LENGTH};
use mimu_core::wire::{Message, StoredInfo};
use mimu_firmware::adc::{Converter, Fault, RING};
use mimu_firmware::commands::{Commands, Shared, Tally, info};
use mimu_firmware::convert::Sums;
use mimu_firmware::design_parameters as design;
use mimu_firmware::flash::Flash;
use mimu_firmware::link::{
    self, FrameReceiver, FrameSender, Input, Outgoing, Output, transmit, try_send,
};
use mimu_firmware::pipeline::Pipeline;
use mimu_firmware::restart::{self, Before};
use mimu_firmware::self_test::SelfTest;
use mimu_firmware::slots::Slots;
use mimu_firmware::upload::Upload;
use static_cell::{ConstStaticCell, StaticCell};

bind_interrupts!(struct Irqs {
    DMA1_STREAM0 => dma::InterruptHandler<DMA1_CH0>;
    #[cfg(not(feature = "usb"))]
    DMA1_STREAM1 => dma::InterruptHandler<embassy_stm32::peripherals::DMA1_CH1>;
    #[cfg(not(feature = "usb"))]
    DMA1_STREAM2 => dma::InterruptHandler<embassy_stm32::peripherals::DMA1_CH2>;
    #[cfg(not(feature = "usb"))]
    USART3 => embassy_stm32::usart::InterruptHandler<embassy_stm32::peripherals::USART3>;
    #[cfg(feature = "usb")]
    OTG_FS => embassy_stm32::usb::InterruptHandler<embassy_stm32::peripherals::USB_OTG_FS>;
});

type Sampler = Converter<'static, Irqs>;

/// A sample on its way to be processed.
struct Taken {
    number: u32,
    /// When it was read, µs, by the clock's low word.
    at_us: u32,
    sums: Sums,
}

/// Where the controller writes samples.
static BUFFER: ConstStaticCell<[u16; RING]> = ConstStaticCell::new([0; RING]);

/// Runs the sampling task, from an interrupt.
static SAMPLING: InterruptExecutor = InterruptExecutor::new();

/// Samples that wait to be processed.
static QUEUE: Channel<CriticalSectionRawMutex, Taken, { design::QUEUE }> = Channel::new();

/// What sampling counts.
static TALLY: Tally = Tally::new();

type Frames = zerocopy_channel::Channel<'static, NoopRawMutex, Outgoing>;

/// A panic leaves its place and starts the device anew: a unit in the field that stands still helps nobody.
#[panic_handler]
fn panic(panic: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    if let Some(at) = panic.location() {
        defmt::error!("panic at {=str}:{=u32}", at.file(), at.line());
    }
    restart::after_panic(panic)
}

// SAFETY: it never returns, and all that it uses is the record of `restart`.
#[allow(unsafe_code)]
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    defmt::error!("fault at {=u32:#x}", frame.pc());
    restart::after_fault(frame.pc())
}

// The vector of a peripheral that nothing here uses, pended by the executor when a task is due.
#[interrupt]
fn SWPMI1() {
    // SAFETY: this is the interrupt that the executor was started with, and nothing else polls it.
    #[allow(unsafe_code)]
    unsafe {
        SAMPLING.on_interrupt();
    }
}

#[embassy_executor::task]
async fn sample(mut converter: Sampler) {
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

#[embassy_executor::task]
async fn process(pipeline: &'static Shared, mut events: FrameSender) {
    loop {
        let taken = QUEUE.receive().await;
        pipeline.lock(|p| {
            let mut send = |message: &Message<'_>| try_send(&mut events, message);
            p.borrow_mut().take(taken.number, &taken.sums, &mut send);
        });
        let took = (Instant::now().as_micros() as u32).wrapping_sub(taken.at_us);
        TALLY.longest_us.fetch_max(took, Ordering::Relaxed);
    }
}

#[embassy_executor::task]
async fn output(output: Output, replies: FrameReceiver, events: FrameReceiver) {
    transmit(output, replies, events).await;
}

#[embassy_executor::task]
async fn commands(commands: Commands<'static>, input: Input) {
    commands.serve(input).await
}

#[cfg(feature = "usb")]
#[embassy_executor::task]
async fn usb(mut usb: link::Usb) {
    usb.run().await
}

/// Feeds the watchdog as long as samples come and are processed, and logs.
async fn watch(mut watchdog: IndependentWatchdog<'static, IWDG1>, pipeline: &Shared) -> ! {
    let mut due = Ticker::every(embassy_time::Duration::from_millis(
        design::WATCHDOG_FEED_MS,
    ));
    let (mut before, mut rounds) = (TALLY.progress(), 0);
    loop {
        due.next().await;
        let now = TALLY.progress();
        // A queue that is full is one that nobody empties.
        if now != before && !QUEUE.is_full() {
            watchdog.pet();
        }
        before = now;
        rounds += 1;
        if rounds % (1000 / design::WATCHDOG_FEED_MS) == 0 {
            let losses = pipeline.lock(|p| p.borrow().losses());
            let of = |counter: &core::sync::atomic::AtomicU32| counter.load(Ordering::Relaxed);
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

/// The path of the samples, with the calibration in use. Not in `main`, whose future would keep room for both.
#[inline(never)]
fn pipeline(
    in_use: Option<(u32, u64)>,
    bytes: &[u8; MAX_LENGTH],
) -> (&'static Shared, Option<StoredInfo>) {
    static PIPELINE: StaticCell<Shared> = StaticCell::new();
    let pipeline = PIPELINE.init_with(|| Mutex::new(RefCell::new(Pipeline::new())));
    let info = in_use.and_then(|(length, hash)| {
        let stored = stored::decode(bytes.get(..length as usize)?).ok()?;
        let info = info(length, hash, &stored);
        pipeline.lock(|p| p.borrow_mut().calibrate(stored));
        Some(info)
    });
    (pipeline, info)
}

/// A queue of frames for the line.
fn frames(
    memory: &'static mut [Outgoing],
    channel: &'static StaticCell<Frames>,
) -> (FrameSender, FrameReceiver) {
    channel.init(Frames::new(memory)).split()
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    static BEFORE: StaticCell<Before> = StaticCell::new();
    static STORED: ConstStaticCell<[u8; MAX_LENGTH]> = ConstStaticCell::new([0; MAX_LENGTH]);
    static EVENT_FRAMES: ConstStaticCell<[Outgoing; design::FRAMES]> =
        ConstStaticCell::new([Outgoing::EMPTY; design::FRAMES]);
    static REPLY_FRAMES: ConstStaticCell<[Outgoing; 2]> =
        ConstStaticCell::new([Outgoing::EMPTY; 2]);
    static EVENTS: StaticCell<Frames> = StaticCell::new();
    static REPLIES: StaticCell<Frames> = StaticCell::new();

    let before = &*BEFORE.init(restart::take());
    let p = embassy_stm32::init(mimu_firmware::clocks::config());
    // Was on for `config` only.
    pac::RCC.cr().modify(|w| w.set_pllon(2, false));

    let room = STORED.take();
    let slots = Slots::open(Flash::new(), room).await;
    let (pipeline, in_use) = pipeline(slots.in_use(), room);

    let (event_sender, event_receiver) = frames(EVENT_FRAMES.take(), &EVENTS);
    let (reply_sender, reply_receiver) = frames(REPLY_FRAMES.take(), &REPLIES);
    #[cfg(not(feature = "usb"))]
    let (to_host, from_host) = {
        static RECEIVED: ConstStaticCell<[u8; design::RECEIVED]> =
            ConstStaticCell::new([0; design::RECEIVED]);
        let uart = embassy_stm32::usart::Uart::new(
            p.USART3,
            p.PD9,
            p.PD8,
            p.DMA1_CH1,
            p.DMA1_CH2,
            Irqs,
            link::config(),
        );
        link::split(uart.unwrap(), RECEIVED.take())
    };
    #[cfg(feature = "usb")]
    let (to_host, from_host) = {
        static MEMORY: StaticCell<link::Memory> = StaticCell::new();
        let memory = MEMORY.init(link::Memory::new());
        let serial = embassy_stm32::uid::uid_hex();
        let (to_host, from_host, device) =
            link::split(p.USB_OTG_FS, p.PA12, p.PA11, Irqs, serial, memory);
        spawner.spawn(usb(device).unwrap());
        (to_host, from_host)
    };

    let converter = Converter::new(
        p.ADC1,
        p.DMA1_CH0,
        Irqs,
        BUFFER.take(),
        // In the order of `design_parameters::SCAN`, which the converter checks.
        [
            AdcChannel::<ADC1>::degrade_adc(p.PA3),
            p.PC0.degrade_adc(),
            p.PB1.degrade_adc(),
            p.PA6.degrade_adc(),
            p.PA5.degrade_adc(),
            p.PA4.degrade_adc(),
            p.PA0.degrade_adc(),
            p.PF11.degrade_adc(),
            p.PF12.degrade_adc(),
            p.PA7.degrade_adc(),
        ],
    );

    // Below the controller's and the timer's interrupts (level 0): the ring's reader relies on
    // their counts being up to date.
    interrupt::SWPMI1.set_priority(Priority::P1);
    SAMPLING
        .start(interrupt::SWPMI1)
        .spawn(sample(converter).unwrap());
    spawner.spawn(process(pipeline, event_sender).unwrap());
    spawner.spawn(output(to_host, reply_receiver, event_receiver).unwrap());
    let low = |pin: Peri<'static, AnyPin>| Pin::new(pin, Level::Low, Speed::Low);
    let everything = Commands {
        pipeline,
        tally: &TALLY,
        slots,
        upload: Upload::new(room),
        stored: in_use,
        self_test: SelfTest {
            st1: low(p.PE13.into()),
            st2: low(p.PE11.into()),
            range: [low(p.PE9.into()), low(p.PD15.into())],
        },
        before,
        replies: reply_sender,
    };
    spawner.spawn(commands(everything, from_host).unwrap());

    let mut watchdog = IndependentWatchdog::new(p.IWDG1, design::WATCHDOG_US);
    watchdog.unleash();
    watch(watchdog, pipeline).await
}
