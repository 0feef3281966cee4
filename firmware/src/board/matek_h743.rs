//! Matek H743 flight controllers: an ICM-42688-P on SPI1, the line to the host, flash sectors, pins.
//!
//! The pins are those of ArduPilot's description of the board (`hwdef/MatekH743/hwdef.dat`). The second inertial sensor, on SPI4, is not used: a
//! unit has one triad of each kind. The part is the STM32H743VI, the die of the ZI with fewer pins, so that the HAL's ZI serves both.

use mimu_core::wire::Capabilities;

use crate::icm42688p::Icm42688p;

/// Name of the board.
pub const NAME: &str = "Matek H743";

/// Reference of the converter, V, which measures the supply: VREF+ is tied to the board's 3.3 V.
pub const REFERENCE_V: f32 = 3.3;

/// Baud rate of the telemetry port: 100 kB/s, twice the rate of raw and compensated streams together. It divides the kernel clock of 100 MHz
/// evenly.
pub const BAUD: u32 = 1_000_000;

/// The two sectors of `memory.x` as sectors of bank 2.
pub const CALIBRATION_SECTORS: [u8; 2] = [6, 7];

/// What the sensors can do beyond measuring.
pub const CAPABILITIES: Capabilities = Capabilities::SELF_TEST;

/// Clock of the sensor's line, Hz: an eighth of the SPI's 100 MHz, below the sensor's 24 MHz (DS-000347, 3.3). A packet of 20 bytes takes
/// 13 µs.
pub const SENSOR_HZ: u32 = 12_500_000;

/// What the integers of [`Acquisition`] mean.
pub type Source = crate::digital::Digital<Icm42688p<()>>;

#[cfg(target_os = "none")]
pub use crate::digital::self_test::SelfTest;
#[cfg(all(target_os = "none", feature = "usb"))]
pub use parts::UsbPins;
#[cfg(target_os = "none")]
pub use parts::{Acquisition, Board, Irqs, Sensors};

/// The parts of the board, for the target only.
#[cfg(target_os = "none")]
mod parts {
    #[cfg(feature = "usb")]
    use embassy_stm32::Peri;
    use embassy_stm32::gpio::{Level, Output, Speed};
    use embassy_stm32::peripherals::{self, IWDG1};
    use embassy_stm32::rcc::HseMode;
    use embassy_stm32::spi::{self, MODE_0, Spi};
    use embassy_stm32::time::Hertz;
    use embassy_stm32::wdg::IndependentWatchdog;
    use embassy_stm32::{bind_interrupts, dma, interrupt};
    #[cfg(not(feature = "usb"))]
    use embassy_stm32::{mode::Async, usart};

    use super::*;
    use crate::board::clocks;
    use crate::digital::{Controls, Polled};
    use crate::front_end::FrontEnd;
    use crate::sampling;
    use crate::spi::Line;

    bind_interrupts!(
        /// Handlers of the interrupts.
        pub struct Irqs {
            #[cfg(not(feature = "usb"))]
            DMA1_STREAM1 => dma::InterruptHandler<peripherals::DMA1_CH1>;
            #[cfg(not(feature = "usb"))]
            DMA1_STREAM2 => dma::InterruptHandler<peripherals::DMA1_CH2>;
            DMA1_STREAM3 => dma::InterruptHandler<peripherals::DMA1_CH3>;
            DMA1_STREAM4 => dma::InterruptHandler<peripherals::DMA1_CH4>;
            #[cfg(not(feature = "usb"))]
            UART7 => usart::InterruptHandler<peripherals::UART7>;
            #[cfg(feature = "usb")]
            OTG_FS => embassy_stm32::usb::InterruptHandler<peripherals::USB_OTG_FS>;
        }
    );

    static CONTROLS: Controls = Controls::new();

    /// The line to the inertial sensor.
    pub struct Sensors(Line);

    /// What takes the samples.
    pub type Acquisition = Polled<Icm42688p<Line>>;

    impl Sensors {
        /// No converter takes part.
        pub fn needs_factors(&self, _: &FrontEnd) -> bool {
            false
        }

        /// The sensor is started with the first sample.
        pub fn prepare(self, _: &mut FrontEnd) -> Acquisition {
            Polled::new(Icm42688p { bus: self.0 }, &CONTROLS)
        }
    }

    /// USB of the part, at the board's connector.
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
        /// The inertial sensor.
        pub sensors: Sensors,
        /// Its self-test.
        pub self_test: SelfTest,
        /// To the host: UART7, the telemetry port TX7 and RX7, with [`BAUD`], 8 data bits, no parity, 1 stop bit.
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
            let p = clocks::begin(HseMode::Oscillator);
            let watchdog = clocks::watch(p.IWDG1);
            let mut config = spi::Config::default();
            // The sensor takes mode 0 or 3 (DS-000347, 9.6).
            config.mode = MODE_0;
            config.frequency = Hertz(SENSOR_HZ);
            let (tx, rx) = (p.DMA1_CH3, p.DMA1_CH4);
            let bus = Spi::new(p.SPI1, p.PA5, p.PD7, p.PA6, tx, rx, Irqs, config);
            let select = Output::new(p.PC15, Level::High, Speed::VeryHigh);
            let board = Self {
                sensors: Sensors(Line::new(bus, select)),
                self_test: SelfTest(&CONTROLS),
                #[cfg(not(feature = "usb"))]
                line: {
                    let mut config = usart::Config::default();
                    config.baudrate = BAUD;
                    let (rx, tx) = (p.PE7, p.PE8);
                    let (tx_dma, rx_dma) = (p.DMA1_CH1, p.DMA1_CH2);
                    // `new` refuses only baud rates that the clock cannot make.
                    usart::Uart::new(p.UART7, rx, tx, tx_dma, rx_dma, Irqs, config).unwrap()
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
                interrupt::UART7,
                interrupt::DMA1_STREAM1,
                interrupt::DMA1_STREAM2,
            ]);
            #[cfg(feature = "usb")]
            sampling::waits_for_sampling(&[interrupt::OTG_FS]);
            board
        }
    }
}
