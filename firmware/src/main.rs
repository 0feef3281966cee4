//! Firmware of the inertial unit on a NUCLEO-H743ZI2.
//!
//! - Samples three gyros, three accelerometer axes, the gyros' temperatures and their reference at
//!   exactly 1 kHz, by the crystal alone.
//! - Samples in an executor of its own, above everything else in priority: no other task, however
//!   long it computes, can make a sample late.
//! - Counts what it loses, by cause, and starts again aligned.
//! - Logs once a second: samples, losses, each channel's mean voltage, the gyros' temperatures.
#![no_std]
#![no_main]

use core::cell::RefCell;

use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, Spawner};
use embassy_stm32::adc::AdcChannel;
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::{ADC1, DMA1_CH0};
use embassy_stm32::rcc::mux::Adcsel;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, LsConfig, Pll, PllDiv, PllMul, PllPreDiv, PllSource,
    Sysclk, VoltageScale,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, bind_interrupts, dma, pac};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::{Duration, Ticker};
use mimu_firmware::adc::{Converter, Fault, RING, Sample};
use mimu_firmware::convert::{CodeSum, gyro_temperature_c};
use mimu_firmware::design_parameters as design;
use panic_probe as _;
use static_cell::ConstStaticCell;

bind_interrupts!(struct Irqs {
    DMA1_STREAM0 => dma::InterruptHandler<DMA1_CH0>;
});

type Sampler = Converter<'static, Irqs>;

/// Where the controller writes.
static BUFFER: ConstStaticCell<[u16; RING]> = ConstStaticCell::new([0; RING]);

/// Runs the sampling task, from an interrupt.
static SAMPLING: InterruptExecutor = InterruptExecutor::new();

/// What sampling has brought, for the log.
static TALLY: Mutex<CriticalSectionRawMutex, RefCell<Tally>> = Mutex::new(RefCell::new(Tally::NEW));

/// Counts since the start, and the conversions since the last log.
#[derive(Clone, Copy)]
struct Tally {
    samples: u32,
    last_number: u32,
    late: u32,
    converter_overruns: u32,
    stalls: u32,
    channels: [CodeSum; design::CHANNELS],
}

impl Tally {
    const NEW: Self = Self {
        samples: 0,
        last_number: 0,
        late: 0,
        converter_overruns: 0,
        stalls: 0,
        channels: [CodeSum::EMPTY; design::CHANNELS],
    };

    fn add(&mut self, sample: &Sample) {
        self.samples = self.samples.wrapping_add(1);
        self.last_number = sample.number;
        for (total, channel) in self.channels.iter_mut().zip(sample.channels) {
            total.add(channel);
        }
    }

    fn count(&mut self, fault: Fault) {
        let counter = match fault {
            Fault::Late => &mut self.late,
            Fault::ConverterOverrun => &mut self.converter_overruns,
            Fault::Stalled => &mut self.stalls,
        };
        *counter = counter.wrapping_add(1);
    }
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
                Ok(sample) => TALLY.lock(|tally| tally.borrow_mut().add(&sample)),
                Err(fault) => break fault,
            }
        };
        TALLY.lock(|tally| tally.borrow_mut().count(fault));
    }
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let p = embassy_stm32::init(config());
    // Was on for `config` only.
    pac::RCC.cr().modify(|w| w.set_pllon(2, false));
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

    let mut second = Ticker::every(Duration::from_secs(1));
    loop {
        second.next().await;
        log();
    }
}

/// Logs what has come in since the last time.
fn log() {
    let tally = TALLY.lock(|tally| {
        let mut tally = tally.borrow_mut();
        let now = *tally;
        tally.channels = Tally::NEW.channels;
        now
    });
    let v = tally.channels.map(CodeSum::mean_v);
    let triad = |first: usize| [v[first], v[first + 1], v[first + 2]];
    defmt::info!(
        "{} samples, last number {}; lost: {} late, {} overrun, {} stalled",
        tally.samples,
        tally.last_number,
        tally.late,
        tally.converter_overruns,
        tally.stalls,
    );
    defmt::info!(
        "pins in V: gyro {}, accel {}, temperature {}, reference {}; gyros at {} C",
        triad(design::GYRO),
        triad(design::ACCEL),
        triad(design::TEMPERATURE),
        v[design::REFERENCE],
        triad(design::TEMPERATURE).map(gyro_temperature_c),
    );
}

/// The clock tree of [`design_parameters`](design).
fn config() -> Config {
    let pll = |multiplier: u32, p: u32| Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::from_bits(design::PLL_PREDIVIDER as u8),
        // The registers hold multiplier and divider less one.
        mul: PllMul::from_bits(multiplier as u16 - 1),
        fracn: None,
        divp: Some(PllDiv::from_bits(p as u8 - 1)),
        divq: None,
        divr: None,
    };
    let mut config = Config::default();
    config.rcc.hse = Some(Hse {
        freq: Hertz(design::HSE_HZ),
        mode: HseMode::Bypass,
    });
    config.rcc.pll1 = Some(pll(design::PLL1_MULTIPLIER, design::PLL1_P));
    config.rcc.pll2 = Some(pll(design::PLL2_MULTIPLIER, design::PLL2_P));
    // A PLL that is left out is switched off by a write of zeros to the register that it shares
    // with the running ones, whose fields must not be written then (RM0433 8.7.11). The hardware
    // ignores them, but nothing should rely on it: so the third is started, without outputs, and
    // stopped after.
    config.rcc.pll3 = Some(Pll {
        divp: None,
        ..pll(design::PLL2_MULTIPLIER, design::PLL2_P)
    });
    // Nothing needs a calendar; the default resets the backup domain to choose a clock for one.
    config.rcc.ls = LsConfig::off();
    config.rcc.sys = Sysclk::PLL1_P;
    config.rcc.voltage_scale = VoltageScale::Scale1;
    // At voltage scale 1 the buses end at 200 MHz, the peripherals behind them at 100 MHz.
    config.rcc.ahb_pre = AHBPrescaler::DIV2;
    config.rcc.apb1_pre = APBPrescaler::DIV2;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    config.rcc.apb3_pre = APBPrescaler::DIV2;
    config.rcc.apb4_pre = APBPrescaler::DIV2;
    // The default source as well, but the sample rate hangs on it.
    config.rcc.mux.adcsel = Adcsel::PLL2_P;
    config
}
