//! NUCLEO-H743ZI2: converter, line to the host, flash sectors, clocks, and last the pins.
//!
//! RM0433 is the reference manual of the STM32H743, DS12110 its data sheet, UM2407 the manual of the board.

use crate::channels::CHANNELS;

/// Name of the board.
pub const NAME: &str = "NUCLEO-H743ZI2";

// ---- Converter ---------------------------------------------------------------------------------

/// Reference of the converter, V: VREF+ is tied to the board's 3.3 V.
pub const REFERENCE_V: f32 = 3.3;

// ---- The line ----------------------------------------------------------------------------------

/// Baud rate: 100 kB/s, twice the rate of raw and compensated streams together. It divides the kernel clock of 100 MHz evenly (921 600
/// would be 0.45 % off), and the debugger's bridge accepts any rate.
pub const BAUD: u32 = 1_000_000;

// ---- Flash -------------------------------------------------------------------------------------

/// The two sectors of `memory.x` as sectors of bank 2.
pub const CALIBRATION_SECTORS: [u8; 2] = [6, 7];

// ---- Clocks ------------------------------------------------------------------------------------

/// The debugger's clock output, Hz, which drives the oscillator input: a clock, not a crystal, hence the bypass. It comes from a crystal,
/// and all clocks below, including sampling, are integer ratios of it.
const HSE_HZ: u32 = 8_000_000;

/// Divider before both PLLs: none, for a reference of 8 MHz. The other common choice, 2 MHz, is for the medium VCO (RM0433 8.5.5: 2 MHz or
/// less), which ends at 420 MHz, below what the core needs. 8 MHz is clearly for the wide VCO, and the phase is compared four times as
/// often.
const PLL_PREDIVIDER: u32 = 1;

/// PLL1: VCO at 800 MHz.
const PLL1_MULTIPLIER: u32 = 100;

/// PLL1 output P, the core: 400 MHz, the maximum at voltage scale 1. The part allows 480 MHz at scale 0, with more current and for speed
/// that is not needed.
const PLL1_P: u32 = 2;

/// PLL2: VCO at 792 MHz. Its reason is [`PLL2_P`].
const PLL2_MULTIPLIER: u32 = 99;

/// PLL2 output P, the converter's kernel clock: 15.84 MHz, twice the cycles of a sample in a millisecond.
const PLL2_P: u32 = 50;

/// PLL3: VCO at 480 MHz, for the part's own USB.
const PLL3_MULTIPLIER: u32 = 60;

/// PLL3 output Q: 48 MHz exactly, from the same crystal.
///
/// The part's 48 MHz oscillator is off by up to some percent; USB allows 0.25 % (USB 2.0, 7.1.11). It would have to be trimmed to the
/// frames of the bus by CRS with the right source: SYNCSRC 0, USB2, for the connector's pins. The HAL's switch selects USB1, and its
/// default does not trim. 48 MHz cannot be derived from the 800 MHz of PLL1 or the 792 MHz of PLL2.
const PLL3_Q: u32 = 10;

/// Clock of the converter, Hz: 7.92 MHz. Silicon from revision V on halves the kernel clock before the converter (RM0433 25.4.3, figure
/// 136).
pub const ADC_HZ: u32 = HSE_HZ / PLL_PREDIVIDER * PLL2_MULTIPLIER / PLL2_P / 2;

// The division above is exact.
const _: () = {
    assert!(HSE_HZ.is_multiple_of(PLL_PREDIVIDER));
    assert!((HSE_HZ / PLL_PREDIVIDER * PLL2_MULTIPLIER).is_multiple_of(PLL2_P * 2));
};

// The HAL chooses the VCO by its output: the medium one up to 420 MHz, although a reference above 2 MHz needs the wide one. A multiplier in
// the overlap would be set wrongly.
const _: () = {
    let reference = HSE_HZ / PLL_PREDIVIDER;
    assert!(reference > 2_000_000 && reference <= 16_000_000);
    assert!(
        reference * PLL1_MULTIPLIER > 420_000_000 && reference * PLL1_MULTIPLIER <= 960_000_000
    );
    assert!(
        reference * PLL2_MULTIPLIER > 420_000_000 && reference * PLL2_MULTIPLIER <= 960_000_000
    );
    assert!(
        reference * PLL3_MULTIPLIER > 420_000_000 && reference * PLL3_MULTIPLIER <= 960_000_000
    );
    assert!(reference * PLL1_MULTIPLIER / PLL1_P == 400_000_000);
    assert!(reference * PLL3_MULTIPLIER == 48_000_000 * PLL3_Q);
};

// ---- Sampling ----------------------------------------------------------------------------------

/// Sampling time of every channel in half cycles of [`ADC_HZ`]: 387.5 cycles, 49 µs. It is the longest that fits the number of conversions,
/// because the channel settles on the capacitor through 14 kΩ during this time.
pub const SAMPLING_HALF_CYCLES: u32 = 775;

/// Conversion proper at 16 bits in half cycles: 8.5 cycles (RM0433 25.4.23, table 214).
const CONVERSION_HALF_CYCLES: u32 = 17;

/// Scans averaged into one sample.
///
/// Two, for 20 000 conversions a second. A gyro's noise is 0.1 (deg/s)/√Hz, over 40 Hz about 2.4 mV
/// at the pin, an accelerometer's 4.7 mV; the converter's own is of the order of 0.1 mV, so more averaging has no effect. It would slow
/// down the emulator on which the image is tested, which needs about 12 µs per conversion and falls behind real time near 80 000 per
/// second.
pub const SCANS: usize = 2;

// The converter runs freely, one scan after the other, without a trigger. Its clock alone determines the sample rate; this proves that it
// is exactly 1 kHz.
//   2 scans x 10 channels x 396 cycles = 7920 cycles; 7.92 MHz / 1000 = 7920 cycles.
const _: () = {
    use crate::design_parameters::SAMPLE_HZ;
    let half_cycles = SAMPLING_HALF_CYCLES + CONVERSION_HALF_CYCLES;
    assert!(half_cycles.is_multiple_of(2) && ADC_HZ.is_multiple_of(SAMPLE_HZ));
    assert!((SCANS * CHANNELS) as u32 * half_cycles / 2 == ADC_HZ / SAMPLE_HZ);
    assert!((SCANS * CHANNELS) as u32 * SAMPLE_HZ <= 24_000);
};

#[cfg(all(target_os = "none", feature = "usb"))]
pub use parts::UsbPins;
#[cfg(target_os = "none")]
pub use parts::{Acquisition, Board, Irqs, SelfTest, Sensors};

/// What the integers of [`Acquisition`] mean.
pub type Source = crate::convert::Analog;

/// The parts of the board, for the target only.
#[cfg(target_os = "none")]
mod parts {
    use embassy_stm32::adc::{AdcChannel, AnyAdcChannel};
    use embassy_stm32::gpio::{AnyPin, Level, Output, Speed};
    use embassy_stm32::pac::iwdg::vals::Key;
    use embassy_stm32::peripherals::{self, ADC1, DMA1_CH0, IWDG1};
    use embassy_stm32::rcc::{
        AHBPrescaler, APBPrescaler, Hse, HseMode, LsConfig, Pll, PllDiv, PllMul, PllPreDiv,
        PllSource, Sysclk, VoltageScale, mux,
    };
    use embassy_stm32::time::Hertz;
    use embassy_stm32::wdg::IndependentWatchdog;
    use embassy_stm32::{Config, Peri, bind_interrupts, dma, pac};
    #[cfg(not(feature = "usb"))]
    use embassy_stm32::{mode::Async, usart};

    use super::*;
    use static_cell::ConstStaticCell;

    use crate::adc::{Converter, RING};
    use crate::channels::Channels;
    use crate::design_parameters::WATCHDOG_US;
    use crate::front_end::FrontEnd;
    use crate::supply::Supply;

    bind_interrupts!(
        /// Handlers of the interrupts.
        pub struct Irqs {
            DMA1_STREAM0 => dma::InterruptHandler<peripherals::DMA1_CH0>;
            #[cfg(not(feature = "usb"))]
            DMA1_STREAM1 => dma::InterruptHandler<peripherals::DMA1_CH1>;
            #[cfg(not(feature = "usb"))]
            DMA1_STREAM2 => dma::InterruptHandler<peripherals::DMA1_CH2>;
            #[cfg(not(feature = "usb"))]
            USART3 => usart::InterruptHandler<peripherals::USART3>;
            #[cfg(feature = "usb")]
            OTG_FS => embassy_stm32::usb::InterruptHandler<peripherals::USB_OTG_FS>;
        }
    );

    /// The converter, and the sensors at its inputs.
    ///
    /// Only ADC1: one converter has one clock, one reference and one order. Of its inputs on this package, PA1, PA2, PA7, PC1, PC4 and PC5
    /// are connected to the Ethernet PHY and PB0 to an LED; nine remain. PC2_C and PC3_C (A4 and A2 on the header) belong to ADC3. The
    /// tenth is PA7, which a jumper separates from the PHY; it has the reference, because losing the reference does not cost an axis. The
    /// debugger's serial line (PD8, PD9), USB and the other LEDs have no input of ADC1.
    ///
    /// The HAL's tables give the input of ADC1 of each pin; on the emulated board they matched. A0 to A3 and D3
    /// to D13 are those of Zephyr's description of this board, CN12 that of published drawings of the Nucleo-144 family; check D24, D32 and
    /// the jumper against the board's manual (UM2407) before wiring.
    pub struct Sensors {
        /// ADC1.
        pub adc: Peri<'static, ADC1>,
        /// DMA stream of its words.
        pub dma: Peri<'static, DMA1_CH0>,
        /// Pin of each channel.
        pub pins: Channels<AnyAdcChannel<'static, ADC1>>,
    }

    /// What takes the samples.
    pub type Acquisition = Converter;

    impl Sensors {
        /// Whether the factors of the converter that a calibration was made with are missing.
        pub fn needs_factors(&self, kept: &FrontEnd) -> bool {
            kept.converter.is_none()
        }

        /// Powers up the converter with the factors that were kept, if there are any, and updates them.
        pub fn prepare(self, kept: &mut FrontEnd) -> Acquisition {
            /// Ring into which the controller writes samples.
            static SCANS: ConstStaticCell<[u16; RING]> = ConstStaticCell::new([0; RING]);
            let converter = Converter::new(self, SCANS.take(), kept.converter);
            kept.converter = converter.factors();
            converter
        }
    }

    /// Self-test and range inputs of the sensors. Low, as after reset: no test, and the finest range.
    ///
    /// Four outputs of the Zio header that are not shared with ADC1 or other parts of the board. A self-test input of the ADXRS300 needs at
    /// least 3.3 V for high, which a pin of a 3.3 V part just misses: both go through a 74AHCT buffer at 5 V. The accelerometer is a 3.3 V
    /// part.
    pub type SelfTest = crate::self_test::SelfTest;

    /// USB of the part, at the connector beside the debugger's.
    #[cfg(feature = "usb")]
    pub struct UsbPins {
        /// Its full-speed controller.
        pub controller: Peri<'static, peripherals::USB_OTG_FS>,
        /// D+.
        pub dp: Peri<'static, peripherals::PA12>,
        /// D-.
        pub dm: Peri<'static, peripherals::PA11>,
    }

    /// All parts of the board that the program uses.
    pub struct Board {
        /// The sensors' outputs.
        pub sensors: Sensors,
        /// The sensors' inputs.
        pub self_test: SelfTest,
        /// To the host: USART3, at the debugger's bridge, with [`BAUD`], 8 data bits, no parity, 1 stop bit.
        #[cfg(not(feature = "usb"))]
        pub line: usart::Uart<'static, Async>,
        /// To the host.
        #[cfg(feature = "usb")]
        pub line: UsbPins,
        /// Watchdog; already running.
        pub watchdog: IndependentWatchdog<'static, IWDG1>,
    }

    impl Board {
        /// Starts the watchdog and the clocks, and takes the board. Call it once, first.
        pub fn start() -> Self {
            // Directly, with its reset value of 512 ms: `init` waits for the oscillator forever, and if it does not start, a reset tries
            // again. This also starts the watchdog's clock.
            pac::IWDG1.kr().write(|w| w.set_key(Key::START));
            if let Some(mut core) = cortex_m::Peripherals::take() {
                // Without it, each instruction that is not in the prefetch buffer waits for the flash. The data cache stays off: all memory
                // here is AXI RAM, which DMA accesses without the cache, so every buffer would have to be invalidated.
                core.SCB.enable_icache();
            }
            let p = embassy_stm32::init(clocks());
            let mut watchdog = IndependentWatchdog::new(p.IWDG1, WATCHDOG_US);
            watchdog.unleash();
            // Its counter still has the rest of the 512 ms.
            watchdog.pet();
            // It was on for `clocks` only.
            #[cfg(not(feature = "usb"))]
            pac::RCC.cr().modify(|w| w.set_pllon(2, false));
            let low = |pin: Peri<'static, AnyPin>| Output::new(pin, Level::Low, Speed::Low);
            Self {
                sensors: Sensors {
                    adc: p.ADC1,
                    dma: p.DMA1_CH0,
                    pins: Channels {
                        gyro: [
                            AdcChannel::<ADC1>::degrade_adc(p.PA3), // A0
                            p.PC0.degrade_adc(),                    // A1
                            p.PB1.degrade_adc(),                    // A3
                        ],
                        accel: [
                            p.PA6.degrade_adc(), // D12
                            p.PA5.degrade_adc(), // D13
                            p.PA4.degrade_adc(), // D24
                        ],
                        temperature: [
                            p.PA0.degrade_adc(),  // D32
                            p.PF11.degrade_adc(), // CN12 pin 62
                            p.PF12.degrade_adc(), // CN12 pin 59
                        ],
                        reference: p.PA7.degrade_adc(), // CN12 pin 15, Ethernet jumper off
                    },
                },
                self_test: SelfTest {
                    st1: low(p.PE13.into()),                        // D3
                    st2: low(p.PE11.into()),                        // D5
                    range: [low(p.PE9.into()), low(p.PD15.into())], // D6, D9
                    supply: Supply::new(p.ADC3),
                },
                #[cfg(not(feature = "usb"))]
                line: {
                    let mut config = usart::Config::default();
                    config.baudrate = BAUD;
                    let (rx, tx) = (p.PD9, p.PD8);
                    let (tx_dma, rx_dma) = (p.DMA1_CH1, p.DMA1_CH2);
                    // `new` refuses only baud rates that the clock cannot make.
                    usart::Uart::new(p.USART3, rx, tx, tx_dma, rx_dma, Irqs, config).unwrap()
                },
                #[cfg(feature = "usb")]
                line: UsbPins {
                    controller: p.USB_OTG_FS,
                    dp: p.PA12,
                    dm: p.PA11,
                },
                watchdog,
            }
        }
    }

    /// The clock tree.
    fn clocks() -> Config {
        let pll = |multiplier: u32, p: u32| Pll {
            source: PllSource::HSE,
            prediv: PllPreDiv::from_bits(PLL_PREDIVIDER as u8),
            // The registers hold multiplier and divider minus one.
            mul: PllMul::from_bits(multiplier as u16 - 1),
            fracn: None,
            divp: Some(PllDiv::from_bits(p as u8 - 1)),
            divq: None,
            divr: None,
        };
        let mut config = Config::default();
        config.rcc.hse = Some(Hse {
            freq: Hertz(HSE_HZ),
            mode: HseMode::Bypass,
        });
        config.rcc.pll1 = Some(pll(PLL1_MULTIPLIER, PLL1_P));
        config.rcc.pll2 = Some(pll(PLL2_MULTIPLIER, PLL2_P));
        // Even without USB. The HAL switches off an unused PLL by writing zeros to a register that it shares with the running ones, whose
        // fields must not be written then (RM0433 8.7.11). The hardware ignores this, but the program should not rely on it: the third PLL
        // is started as USB needs it, and stopped afterwards if USB is not used.
        config.rcc.pll3 = Some(Pll {
            divp: None,
            divq: Some(PllDiv::from_bits(PLL3_Q as u8 - 1)),
            ..pll(PLL3_MULTIPLIER, PLL2_P)
        });
        config.rcc.mux.usbsel = mux::Usbsel::PLL3_Q;
        // Unused; the default would start it.
        config.rcc.hsi48 = None;
        // No calendar is needed; the default would reset the backup domain to choose a clock for it.
        config.rcc.ls = LsConfig::off();
        config.rcc.sys = Sysclk::PLL1_P;
        config.rcc.voltage_scale = VoltageScale::Scale1;
        // At voltage scale 1 the buses allow 200 MHz, their peripherals 100 MHz.
        config.rcc.ahb_pre = AHBPrescaler::DIV2;
        config.rcc.apb1_pre = APBPrescaler::DIV2;
        config.rcc.apb2_pre = APBPrescaler::DIV2;
        config.rcc.apb3_pre = APBPrescaler::DIV2;
        config.rcc.apb4_pre = APBPrescaler::DIV2;
        // This is the default too; it is explicit because the sample rate depends on it.
        config.rcc.mux.adcsel = mux::Adcsel::PLL2_P;
        config
    }
}
