//! Supply of converter and accelerometer, measured with the part's internal reference.
//!
//! Only ADC3 is connected to that reference (RM0433 25.4.11), so it cannot be a channel in the scan of ADC1. The self-test switches ADC3 on
//! for this measurement and off again. This code uses the registers, because the HAL's driver also calibrates linearity (21 ms of polling),
//! and enables the reference while the converter is on, which the reference manual forbids (25.4.10).

use embassy_stm32::pac::adc::vals::{Boost, Pcsel, Res, SampleTime};
use embassy_stm32::peripherals::ADC3;
use embassy_stm32::{Peri, pac, rcc};
use embassy_time::{Duration, Timer, with_timeout};

use crate::board::REFERENCE_V;
use crate::convert::FULL_SCALE;

/// The internal reference, V: least, typical, most (DS12110, embedded reference voltage).
const INTERNAL_V: [f32; 3] = [1.180, 1.216, 1.255];

/// Address of the factory measurement: the code of the internal reference, 16 bits, at a supply of 3.3 V (DS12110).
const MEASURED_AT: *const u16 = 0x1FF1_E860 as *const u16;

/// Its input of ADC3.
const INPUT: u8 = 19;

/// Number of conversions averaged. Each takes 50 µs, with a sampling time of 49 µs; 4.3 µs are required.
const CONVERSIONS: u32 = 16;

/// Calibration of the offset takes 2 ms, the rest one.
const PATIENCE: Duration = Duration::from_millis(50);

/// ADC3 at the internal reference; on only while it measures.
pub struct Supply(Peri<'static, ADC3>);

impl Supply {
    /// It is off.
    pub fn new(adc: Peri<'static, ADC3>) -> Self {
        Self(adc)
    }

    /// The supply, V; 0 if the converter does not answer. Takes some milliseconds.
    pub async fn volts(&mut self) -> f32 {
        rcc::enable_and_reset::<ADC3>();
        let code = with_timeout(PATIENCE, self.code()).await;
        rcc::disable::<ADC3>();
        match code {
            Ok(code) if code > 0.0 => code_at_nominal() / code * REFERENCE_V,
            _ => 0.0,
        }
    }

    /// Mean code of the internal reference.
    async fn code(&mut self) -> f32 {
        let (adc, common) = (pac::ADC3, pac::ADC3_COMMON);
        adc.cr().modify(|w| {
            w.set_deeppwd(false);
            // For 7.92 MHz, as ADC1, with which it shares its clock.
            w.set_boost(Boost::LT12_5);
        });
        adc.cr().modify(|w| w.set_advregen(true));
        common.ccr().modify(|w| w.set_vrefen(true));
        // The regulator, 10 µs, and the reference's buffer.
        Timer::after_millis(1).await;
        // Offset only: linearity matters by about a hundred of 65535 codes, which is irrelevant here.
        adc.cr().modify(|w| w.set_adcal(true));
        while adc.cr().read().adcal() {
            Timer::after_millis(1).await;
        }
        adc.isr().write(|w| w.set_adrdy(true));
        adc.cr().modify(|w| w.set_aden(true));
        while !adc.isr().read().adrdy() {
            Timer::after_micros(10).await;
        }
        adc.cfgr().modify(|w| w.set_res(Res::BITS16));
        adc.pcsel()
            .modify(|w| w.set_pcsel(usize::from(INPUT), Pcsel::PRESELECTED));
        adc.smpr(usize::from(INPUT / 10))
            .modify(|w| w.set_smp(usize::from(INPUT % 10), SampleTime::CYCLES387_5));
        adc.sqr1().modify(|w| {
            w.set_l(0);
            w.set_sq(0, INPUT);
        });
        let mut total = 0;
        for _ in 0..CONVERSIONS {
            adc.cr().modify(|w| w.set_adstart(true));
            while !adc.isr().read().eoc() {
                Timer::after_micros(50).await;
            }
            // Reading it clears the flag.
            total += u32::from(adc.dr().read().rdata());
        }
        adc.cr().modify(|w| w.set_addis(true));
        while adc.cr().read().aden() {
            Timer::after_micros(10).await;
        }
        total as f32 / CONVERSIONS as f32
    }
}

/// Code of the internal reference at the nominal supply: the factory value, or the typical one if that word is implausible.
fn code_at_nominal() -> f32 {
    // SAFETY: it is system flash, which is always readable and never written.
    #[allow(unsafe_code)]
    let measured = f32::from(unsafe { MEASURED_AT.read_volatile() });
    let [least, typical, most] = INTERNAL_V.map(|v| v / REFERENCE_V * FULL_SCALE as f32);
    match (least..=most).contains(&measured) {
        true => measured,
        false => typical,
    }
}
