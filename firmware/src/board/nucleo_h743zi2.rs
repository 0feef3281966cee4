//! NUCLEO-H743ZI2: converter, line to the host, flash sectors, and last the pins. Its clock is the debugger's, 8 MHz from a crystal: no crystal
//! of its own, hence the bypass.
//!
//! RM0433 is the reference manual of the STM32H743, DS12110 its data sheet, UM2407 the manual of the board.

pub use super::clocks::ADC_HZ;
use mimu_core::wire::Capabilities;

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

/// What the sensors can do beyond measuring.
pub const CAPABILITIES: Capabilities = Capabilities::SELF_TEST;

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
    use embassy_stm32::peripherals::{self, ADC1, DMA1_CH0, IWDG1};
    use embassy_stm32::rcc::HseMode;
    use embassy_stm32::wdg::IndependentWatchdog;
    use embassy_stm32::{Peri, bind_interrupts, dma, interrupt};
    #[cfg(not(feature = "usb"))]
    use embassy_stm32::{mode::Async, usart};

    #[cfg(not(feature = "usb"))]
    use super::BAUD;
    use static_cell::ConstStaticCell;

    use crate::board::adc::{Converter, RING};
    use crate::board::clocks;
    use crate::channels::Channels;
    use crate::front_end::FrontEnd;
    use crate::sampling;
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
            let p = clocks::begin(HseMode::Bypass);
            let watchdog = clocks::watch(p.IWDG1);
            let low = |pin: Peri<'static, AnyPin>| Output::new(pin, Level::Low, Speed::Low);
            let board = Self {
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
            };
            #[cfg(not(feature = "usb"))]
            sampling::waits_for_sampling(&[
                interrupt::USART3,
                interrupt::DMA1_STREAM1,
                interrupt::DMA1_STREAM2,
            ]);
            #[cfg(feature = "usb")]
            sampling::waits_for_sampling(&[interrupt::OTG_FS]);
            board
        }
    }
}
