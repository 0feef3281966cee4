//! Every electrical and timing constant of the board, each with the reason for its value.
//!
//! RM0433 is the reference manual of the STM32H743, DS12110 its datasheet.

// ---- Sensors -----------------------------------------------------------------------------------

/// Null voltage of an ADXRS300 rate gyro at its own pin, V. Absolute, not a share of the supply,
/// so a change of the converter's reference looks like a rate: hence [`REFERENCE`] in the scan.
pub const GYRO_NULL_V: f32 = 2.5;

/// Voltage of an ADXRS300's reference pin, V: what its null and its TEMP output are made from.
pub const GYRO_REFERENCE_V: f32 = 2.5;

/// How far the converted reference may be from its nominal value before its pin is taken for open. Reference and supply are
/// within 2 % each; an open or shorted pin reads 0 or 3.3 V.
pub const REFERENCE_TOLERANCE: f32 = 0.1;

/// Sensitivity of an ADXRS300 at its own pin, V per (deg/s): 1.0 to 4.0 V for its 300 deg/s.
pub const GYRO_SENSITIVITY_V_PER_DPS: f32 = 0.005;

/// Voltage of an ADXRS300's TEMP pin at [`GYRO_TEMPERATURE_NULL_C`], V. Proportional to absolute
/// temperature, which the two constants below state as a tangent.
pub const GYRO_TEMPERATURE_NULL_V: f32 = 2.5;

/// Temperature at which TEMP stands at [`GYRO_TEMPERATURE_NULL_V`], °C (298 K).
pub const GYRO_TEMPERATURE_NULL_C: f32 = 25.0;

/// Slope of TEMP, V/°C: 2.5 V / 298 K.
pub const GYRO_TEMPERATURE_V_PER_C: f32 = 0.0084;

/// Null voltage of an MMA7260QT accelerometer, V: half its 3.3 V supply. Ratiometric, and its
/// supply is the converter's reference, so its codes do not change with that voltage.
pub const ACCEL_NULL_V: f32 = 1.65;

/// Sensitivity of an MMA7260QT at its 1.5 g range, V/g. The finest of its four ranges, since a
/// calibration on a turntable never leaves 1 g by much; 1.5 g is 0.45 to 2.85 V, within the
/// reference.
pub const ACCEL_SENSITIVITY_V_PER_G: f32 = 0.8;

// ---- Between sensor and pin --------------------------------------------------------------------

/// Upper resistor of the divider behind every output of a gyro, Ω. The gyros are 5 V parts and
/// the converter ends at 3.3 V: 36 / (24 + 36) = 0.6 takes even a supply of 5.25 V to 3.15 V.
///
/// No larger than this, because the converter's sampling capacitor (about 4 pF) carries charge from
/// one channel to the next: 4 pF, 2000 times a second, through 24 kΩ ∥ 36 kΩ is 115 ppm of the
/// difference between neighbours. No smaller, because the three outputs differ in what they can
/// drive and TEMP is the weakest, at 50 µA: 3.0 V (85 °C) into 60 kΩ is that. One ratio for
/// all of them, so that a rate divided by the reference is free of the resistors' common drift.
///
/// The accelerometer has no divider, only the 1 kΩ and 0.1 µF that its datasheet asks for against
/// the noise of its clock.
pub const DIVIDER_UPPER_OHM: u32 = 24_000;

/// Lower resistor of the divider, Ω. 47 nF across it make a low-pass of 235 Hz: above the gyro's
/// own 40 Hz, below the 1 kHz half of the scan rate.
pub const DIVIDER_LOWER_OHM: u32 = 36_000;

/// Pin voltage over sensor voltage behind a divider.
pub const DIVIDER_RATIO: f32 =
    DIVIDER_LOWER_OHM as f32 / (DIVIDER_UPPER_OHM + DIVIDER_LOWER_OHM) as f32;

// ---- Pins --------------------------------------------------------------------------------------

/// One input of the scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signal {
    /// What is measured.
    pub name: &'static str,
    /// The pin of the microcontroller.
    pub pin: &'static str,
    /// Where that pin is on the board.
    pub header: &'static str,
    /// Which input of ADC1 the pin is (DS12110, pin table: ADC1_INPn or ADC12_INPn).
    pub channel: u8,
}

const fn signal(
    name: &'static str,
    pin: &'static str,
    header: &'static str,
    channel: u8,
) -> Signal {
    Signal {
        name,
        pin,
        header,
        channel,
    }
}

/// Number of inputs in one scan.
pub const CHANNELS: usize = 10;

/// The scan, in the order of conversion.
///
/// Only ADC1: one converter has one clock, one reference and one order. Of its inputs on this
/// package, PA1, PA2, PA7, PC1, PC4 and PC5 go to the Ethernet PHY and PB0 to an LED, which leaves
/// nine. PC2_C and PC3_C (A4 and A2 on the header) belong to ADC3. The tenth is PA7, which a jumper
/// parts from the PHY; it has the reference, the one signal whose loss does not cost an axis. The
/// debugger's serial line (PD8, PD9), USB and the other LEDs have no input of ADC1.
///
/// Pin and input numbers are those of the part's tables, and were seen to match on an emulated board. A0 to A3 and D3 to D13 are
/// those of Zephyr's description of this board, CN12 that of published drawings of the Nucleo-144 family; D24, D32 and the
/// jumper are to be checked against the board's manual (UM2407) before anything is wired.
///
/// The three axes of a triad stand together: neighbours are 50 µs apart, which at the gyro's 40 Hz
/// is 0.7 degrees of phase.
pub const SCAN: [Signal; CHANNELS] = [
    signal("gyro_x", "PA3", "A0", 15),
    signal("gyro_y", "PC0", "A1", 10),
    signal("gyro_z", "PB1", "A3", 5),
    signal("accel_x", "PA6", "D12", 3),
    signal("accel_y", "PA5", "D13", 19),
    signal("accel_z", "PA4", "D24", 18),
    signal("temperature_x", "PA0", "D32", 16),
    signal("temperature_y", "PF11", "CN12 pin 62", 2),
    signal("temperature_z", "PF12", "CN12 pin 59", 6),
    signal("reference", "PA7", "CN12 pin 15, Ethernet jumper off", 7),
];

/// First of the three gyro rates in [`SCAN`].
pub const GYRO: usize = 0;
/// First of the three accelerometer axes in [`SCAN`].
pub const ACCEL: usize = 3;
/// First of the three gyro temperatures in [`SCAN`].
pub const TEMPERATURE: usize = 6;
/// The 2.5 V reference of gyro x in [`SCAN`].
pub const REFERENCE: usize = 9;

/// Reference of the converter, V: VREF+ is tied to the board's 3.3 V.
pub const REFERENCE_V: f32 = 3.3;

// ---- Self-test ---------------------------------------------------------------------------------

// Four outputs of the Zio header that no input of ADC1 and no other part of the board is on:
//   PE13 (D3)  ST1 of the three gyros
//   PE11 (D5)  ST2 of the three gyros
//   PE9  (D6)  g-Select1 of the accelerometer
//   PD15 (D9)  g-Select2
// A self-test input of the ADXRS300 takes 3.3 V and more for high, which a pin of a 3.3 V part just does not reach: both go through a
// 74AHCT buffer at 5 V. The accelerometer is a 3.3 V part. Low, as after reset, is no test and the finest range.

/// Change of an ADXRS300's output by ST1, V, typically: it deflects the sensor by some -50 deg/s.
pub const SELF_TEST_ST1_V: f32 = -0.27;

/// The same by ST2.
pub const SELF_TEST_ST2_V: f32 = 0.27;

/// Largest departure from that: the datasheet states 0.15 to 0.45 V.
pub const SELF_TEST_TOLERANCE_V: f32 = 0.18;

/// The accelerometer has no input that moves its mass; but its 6 g range (both g-Selects high) is four times coarser, so that
/// gravity's share of the output must shrink from 0.8 to 0.2 V. This is the change of its length, V.
pub const SELF_TEST_ACCEL_V: f32 = 0.6;

/// Largest departure from that. Its nulls differ from 1.65 V by up to 0.165 V, and not by the same in both ranges.
pub const SELF_TEST_ACCEL_TOLERANCE_V: f32 = 0.35;

/// Time that every state of the self-test lasts before it is measured, ms. The slowest part of the chain is the gyro's 40 Hz filter,
/// 4 ms: 25 time constants.
pub const SELF_TEST_SETTLE_MS: u64 = 100;

/// Samples that are averaged in every state: 2.4 mV of a gyro's noise become 0.2 mV.
pub const SELF_TEST_SAMPLES: u32 = 128;

// ---- The line ----------------------------------------------------------------------------------

/// Baud rate: 100 kB/s, twice what raw and compensated streams take together. Not 921 600, of which a kernel clock of 100 MHz
/// makes 0.45 % more; this divides it evenly, and the debugger's bridge takes any rate.
pub const BAUD: u32 = 1_000_000;

/// Vendor and product of the port on the part's own USB: the numbers that pid.codes has set apart for testing. A product needs its own.
pub const USB_VENDOR: u16 = 0x1209;
/// See [`USB_VENDOR`].
pub const USB_PRODUCT: u16 = 0x0001;
/// Bytes of a packet, the most at full speed.
pub const USB_PACKET: u16 = 64;

/// Frames that wait for the line. A frame of a full batch takes 5 ms of the 20 that it stands for.
pub const FRAMES: usize = 6;

/// Bytes from the host that wait to be looked at: 10 ms of the line.
pub const RECEIVED: usize = 1024;

/// Samples that wait to be processed, so ms. Storing a calibration computes its hash twice, 4 ms; the rest is for what nobody
/// thought of.
pub const QUEUE: usize = 64;

/// Time in which the program has to come round, or the watchdog restarts it, µs. It comes round every [`WATCHDOG_FEED_MS`]; the
/// watchdog's own clock is 32 kHz within 10 %.
pub const WATCHDOG_US: u32 = 2_000_000;

/// How often the watchdog is fed, ms.
pub const WATCHDOG_FEED_MS: u64 = 250;

// ---- Flash -------------------------------------------------------------------------------------

/// Size of a word of the flash memory, bytes: programmed once between erases, and whole (RM0433 4.3.9).
pub const FLASH_WORD: usize = 32;

/// Size of a sector, bytes: what is erased.
pub const FLASH_SECTOR: usize = 128 * 1024;

/// The two sectors of `memory.x` as sectors of bank 2.
pub const FLASH_SECTORS: [u8; 2] = [6, 7];

// ---- Clocks ------------------------------------------------------------------------------------

/// The debugger's clock output, Hz, which drives the oscillator input: a clock, not a crystal,
/// hence the bypass. It is a crystal's all the same, and everything below, sampling included, is a
/// ratio of integers to it.
pub const HSE_HZ: u32 = 8_000_000;

/// Divider in front of both PLLs: none, for a reference of 8 MHz. The other common choice, 2 MHz,
/// belongs to the medium VCO (RM0433 8.5.5: 2 MHz or less), which ends at 420 MHz, below what the
/// core needs. 8 MHz belongs to the wide one without doubt, and the phase is compared four times
/// as often.
pub const PLL_PREDIVIDER: u32 = 1;

/// PLL1: VCO at 800 MHz.
pub const PLL1_MULTIPLIER: u32 = 100;

/// PLL1 output P, the core: 400 MHz, the most that voltage scale 1 allows. The part can do 480 MHz
/// at scale 0, which takes more current for speed that nothing here needs.
pub const PLL1_P: u32 = 2;

/// PLL2: VCO at 792 MHz. Its reason is [`PLL2_P`].
pub const PLL2_MULTIPLIER: u32 = 99;

/// PLL2 output P, the converter's kernel clock: 15.84 MHz, twice [`BLOCK_CYCLES`] a millisecond.
pub const PLL2_P: u32 = 50;

/// Kernel clock of the converter, Hz.
pub const ADC_KERNEL_HZ: u32 = HSE_HZ / PLL_PREDIVIDER * PLL2_MULTIPLIER / PLL2_P;

/// Silicon from revision V on halves the kernel clock before the converter sees it (RM0433 25.4.3,
/// figure 136). The driver refuses older silicon, on which everything would run twice as fast.
pub const ADC_FIXED_DIVIDER: u32 = 2;

/// Clock of the converter, Hz: 7.92 MHz.
pub const ADC_HZ: u32 = ADC_KERNEL_HZ / ADC_FIXED_DIVIDER;

/// The `REV_ID` of the last silicon without [`ADC_FIXED_DIVIDER`], revision Y.
pub const LAST_REVISION_WITHOUT_DIVIDER: u16 = 0x1003;

// ---- Sampling ----------------------------------------------------------------------------------

/// Samples per second.
pub const SAMPLE_HZ: u32 = 1_000;

/// Sampling time of every channel in half cycles of [`ADC_HZ`]: 387.5 cycles, 49 µs. The longest
/// that fits the number of conversions, since the channel is on the capacitor for all of it and
/// settles through 14 kΩ.
pub const SAMPLING_HALF_CYCLES: u32 = 775;

/// Conversion proper at 16 bits in half cycles: 8.5 cycles (RM0433 25.4.23, table 214).
pub const CONVERSION_HALF_CYCLES: u32 = 17;

/// One channel, sampling and conversion, in cycles: 396, which is 50 µs.
pub const CHANNEL_CYCLES: u32 = (SAMPLING_HALF_CYCLES + CONVERSION_HALF_CYCLES) / 2;

/// Scans averaged into one sample.
///
/// Two, for 20 000 conversions a second. A gyro's noise is 0.1 (deg/s)/√Hz, over 40 Hz about 2.4 mV
/// at the pin, an accelerometer's 4.7 mV; the converter's own is of the order of 0.1 mV, so
/// averaging more of it would show nowhere. It would show in the emulator that the image is tested
/// on, which spends about 12 µs on a conversion and falls behind real time near 80 000 a second.
pub const SCANS: usize = 2;

/// Time constant of the filter of temperature and reference, s. The noise of one sample of the reference, some 50 ppm of it, would
/// be 0.02 deg/s of every gyro at once; over a second it is 1.5 ppm. Both move with the temperature of a board, over minutes.
pub const SLOW_S: f32 = 1.0;

/// Conversions in one sample.
pub const BLOCK: usize = SCANS * CHANNELS;

/// One sample in cycles of the converter.
pub const BLOCK_CYCLES: u32 = BLOCK as u32 * CHANNEL_CYCLES;

// ---- What must hold ----------------------------------------------------------------------------

// The converter runs freely, one scan after the other, without a trigger: its clock alone makes the
// sample rate, and this is the proof that it is 1 kHz and not nearly so.
//   2 scans x 10 channels x 396 cycles = 7920 cycles; 7.92 MHz / 1000 = 7920 cycles.
const _: () = {
    assert!(HSE_HZ.is_multiple_of(PLL_PREDIVIDER));
    assert!((HSE_HZ / PLL_PREDIVIDER * PLL2_MULTIPLIER).is_multiple_of(PLL2_P));
    assert!(ADC_KERNEL_HZ.is_multiple_of(ADC_FIXED_DIVIDER));
    assert!((SAMPLING_HALF_CYCLES + CONVERSION_HALF_CYCLES).is_multiple_of(2));
    assert!(ADC_HZ.is_multiple_of(SAMPLE_HZ));
    assert!(BLOCK_CYCLES == ADC_HZ / SAMPLE_HZ);
    assert!(BLOCK as u32 * SAMPLE_HZ <= 24_000);
};

// The HAL picks the VCO by its output, the medium one wherever that ends (420 MHz), although a
// reference above 2 MHz asks for the wide one. A multiplier that lands in the overlap would be set
// wrongly.
const _: () = {
    let reference = HSE_HZ / PLL_PREDIVIDER;
    assert!(reference > 2_000_000 && reference <= 16_000_000);
    assert!(
        reference * PLL1_MULTIPLIER > 420_000_000 && reference * PLL1_MULTIPLIER <= 960_000_000
    );
    assert!(
        reference * PLL2_MULTIPLIER > 420_000_000 && reference * PLL2_MULTIPLIER <= 960_000_000
    );
    assert!(reference * PLL1_MULTIPLIER / PLL1_P == 400_000_000);
};

// Every input once, within the converter's twenty channels, in at most the sixteen places of its
// sequence.
const _: () = {
    assert!(CHANNELS <= 16);
    let mut seen = 0_u32;
    let mut place = 0;
    while place < CHANNELS {
        let bit = 1 << SCAN[place].channel;
        assert!(SCAN[place].channel < 20 && seen & bit == 0);
        seen |= bit;
        place += 1;
    }
};
