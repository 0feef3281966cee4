//! The clock tree.

use embassy_stm32::Config;
use embassy_stm32::rcc::mux::Adcsel;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, LsConfig, Pll, PllDiv, PllMul, PllPreDiv, PllSource,
    Sysclk, VoltageScale,
};
use embassy_stm32::time::Hertz;

use crate::design_parameters as design;

/// The clock tree of [`design_parameters`](crate::design_parameters).
pub fn config() -> Config {
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
    #[cfg(feature = "usb")]
    {
        // 48 MHz from the oscillator that USB trims by itself: no PLL makes them beside the others.
        config.rcc.hsi48 = Some(Default::default());
        config.rcc.mux.usbsel = embassy_stm32::rcc::mux::Usbsel::HSI48;
    }
    // The default source as well, but the sample rate hangs on it.
    config.rcc.mux.adcsel = Adcsel::PLL2_P;
    config
}
