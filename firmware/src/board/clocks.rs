//! Clocks and start of the boards with an 8 MHz crystal.
//!
//! RM0433 is the reference manual of the STM32H743, DS12110 its data sheet.

/// Frequency at the oscillator input, Hz, from a crystal on every board here. All clocks below, including sampling, are integer ratios of it.
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

/// PLL1 output Q, the SPI's kernel clock: 100 MHz, of which a sensor's line takes an eighth.
const PLL1_Q: u32 = 8;

const _: () = assert!(HSE_HZ / PLL_PREDIVIDER * PLL1_MULTIPLIER / PLL1_Q == 100_000_000);

#[cfg(target_os = "none")]
pub(super) use start::{begin, watch};

/// For the target only.
#[cfg(target_os = "none")]
mod start {
    use embassy_stm32::pac::iwdg::vals::Key;
    use embassy_stm32::peripherals::IWDG1;
    use embassy_stm32::rcc::{
        AHBPrescaler, APBPrescaler, Hse, HseMode, LsConfig, Pll, PllDiv, PllMul, PllPreDiv,
        PllSource, Sysclk, VoltageScale, mux,
    };
    use embassy_stm32::time::Hertz;
    use embassy_stm32::wdg::IndependentWatchdog;
    use embassy_stm32::{Config, Peri, Peripherals, pac};

    use super::*;
    use crate::design_parameters::WATCHDOG_US;
    use crate::protection;

    /// Starts the watchdog and the clocks. Call it once, first. `mode`: whether a crystal or a clock is at the oscillator's pins.
    pub fn begin(mode: HseMode) -> Peripherals {
        // Directly, with its reset value of 512 ms: `init` waits for the oscillator forever, and if it does not start, a reset tries
        // again. This also starts the watchdog's clock.
        pac::IWDG1.kr().write(|w| w.set_key(Key::START));
        if let Some(mut core) = cortex_m::Peripherals::take() {
            // Without it, each instruction that is not in the prefetch buffer waits for the flash. The data cache stays off: all memory
            // here is AXI RAM, which DMA accesses without the cache, so every buffer would have to be invalidated.
            core.SCB.enable_icache();
            protection::begin(&core.MPU);
        }
        let p = embassy_stm32::init(tree(mode));
        // It was on for [`tree`] only.
        #[cfg(not(feature = "usb"))]
        pac::RCC.cr().modify(|w| w.set_pllon(2, false));
        p
    }

    /// The watchdog with its time.
    pub fn watch(watchdog: Peri<'static, IWDG1>) -> IndependentWatchdog<'static, IWDG1> {
        let mut watchdog = IndependentWatchdog::new(watchdog, WATCHDOG_US);
        watchdog.unleash();
        // Its counter still has the rest of the 512 ms.
        watchdog.pet();
        watchdog
    }

    /// The clock tree.
    fn tree(mode: HseMode) -> Config {
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
            mode,
        });
        config.rcc.pll1 = Some(Pll {
            divq: Some(PllDiv::from_bits(PLL1_Q as u8 - 1)),
            ..pll(PLL1_MULTIPLIER, PLL1_P)
        });
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
