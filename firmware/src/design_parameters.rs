//! Sensors, front end and timing: what would be the same on another board, each constant with the reason for its value. What belongs
//! to the board is in [`board`](crate::board).

// ---- Sensors -----------------------------------------------------------------------------------

/// Null voltage of an ADXRS300 rate gyro at its own pin, V. Absolute, not a share of the supply,
/// so a change of the converter's reference looks like a rate: hence the reference among the channels.
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

/// Temperatures that a working TEMP pin can stand for, °C. The part works from -40 to 85 °C. TEMP is a share of its gyro's own
/// reference and is divided by that of gyro x, each 2.45 to 2.55 V: 6 °C each. A pin that is open or shorted to ground reads -270 °C,
/// one at 5 V 320 °C.
pub const GYRO_TEMPERATURE_RANGE_C: [f32; 2] = [-55.0, 100.0];

/// Most that two TEMP pins differ by while both work, °C: 12 by the two gyros' references, and half a dozen by what the gyros warm
/// themselves (5 °C, by 30 mW) and by where they sit on the board.
pub const GYRO_TEMPERATURE_SPREAD_C: f32 = 20.0;

/// Most that a gyro's die changes between two batches, 20 ms, °C. Its package, 0.4 g of ceramic, holds about 0.3 J/K: 1 °C in 20 ms are 15 W
/// into it, and it makes 0.03 W itself. The mean of a batch is of 40 conversions, each within 0.03 °C. A contact that opens, a multiplexer that
/// reads a neighbour, or a changed resistor is above it.
pub const GYRO_TEMPERATURE_STEP_C: f32 = 1.0;

/// Fastest that the dies change for longer than a batch, °C/s: a board of 20 g (16 J/K) that a hot-air gun puts 8 W into. So much farther from
/// the last good temperature is believed for each second that there was none.
pub const GYRO_TEMPERATURE_RATE_C_PER_S: f32 = 0.5;

/// Most that a TEMP pin departs from where it stood beside the others, °C. References drift by a few tenths of a percent over the range (1 °C),
/// and gyros on three faces of a unit in a stream of air differ by 2 or 3. A pin that stands still while the others move is found once they have
/// moved by this. That its code stays the same proves nothing by itself: so does that of a good pin in an even temperature, but for the
/// converter's noise, and a pin that is tied to a voltage has that noise too.
pub const GYRO_TEMPERATURE_DEPARTURE_C: f32 = 5.0;

/// Time over which it is learnt where a TEMP pin stands beside the others, s: longer than a ramp takes to reach
/// [`GYRO_TEMPERATURE_DEPARTURE_C`], or a pin that stands still would be followed.
pub const GYRO_TEMPERATURE_OFFSET_S: f32 = 3_600.0;

/// Over the first so many seconds it is the mean: 500 batches.
pub const GYRO_TEMPERATURE_BEGINNING_S: f32 = 10.0;

/// The gyros' reference as the data sheet of the ADXRS300 allows, V: 2.45 to 2.55. By as much again it may be off where it is measured: by
/// the dividers (0.8 % with 1 % resistors), and by the converter's supply, which the internal reference tells within 1 %.
pub const GYRO_REFERENCE_TOLERANCE_V: f32 = 0.1;

/// Where the output of an ADXRS300 ends, V: it reaches at least 0.25 V and 0.25 V below its supply of 5 V, 450 deg/s either way, and not
/// the ends of the converter's range, which are 5.5 V apart behind the divider. (Data sheet, output voltage swing; recalled, as in the
/// catalogue of the bench.)
pub const GYRO_STOPS_V: [f32; 2] = [0.25, 4.75];

/// So near to a stop a gyro counts as saturated, V: 1 % resistors in two dividers, its own and that of the reference, make 1.6 % of
/// 4.75 V, 0.08 V; noise 0.01 V. The specified 300 deg/s end at 4.0 V, or 4.3 V with the largest sensitivity and null.
pub const GYRO_STOP_MARGIN_V: f32 = 0.1;

/// Null voltage of an MMA7260QT accelerometer, V: half its 3.3 V supply. Ratiometric, and its
/// supply is the converter's reference, so its codes do not change with that voltage.
pub const ACCEL_NULL_V: f32 = 1.65;

/// Sensitivity of an MMA7260QT at its 1.5 g range, V/g. The finest of its four ranges, since a
/// calibration on a turntable never leaves 1 g by much; 1.5 g is 0.45 to 2.85 V, within the
/// reference.
pub const ACCEL_SENSITIVITY_V_PER_G: f32 = 0.8;

/// Where the output of an MMA7260QT ends at 3.3 V, V: 0.25 V from either rail (data sheet, full scale output range; recalled). Not the
/// 0.45 and 2.85 V of 1.5 g: with a null of 1.815 V, which is allowed, 2.85 V are 1.3 g and read rightly.
pub const ACCEL_STOPS_V: [f32; 2] = [0.25, 3.05];

/// So near to a stop the accelerometer counts as saturated, V: ten times its noise. There is no divider, and it follows the converter's
/// reference.
pub const ACCEL_STOP_MARGIN_V: f32 = 0.05;

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

// ---- Self-test ---------------------------------------------------------------------------------

/// Change of an ADXRS300's output by ST1 or ST2 as its data sheet states it, V: 0.15 to 0.45, typically 0.27, which is some 50 deg/s.
/// ST1 lowers the output, ST2 raises it. The means that it is compared with have 0.2 mV of noise; to allow more than the data sheet does
/// would pass a sensor that has lost half of its sensitivity.
pub const SELF_TEST_GYRO_V: [f32; 2] = [0.15, 0.45];

/// Sensitivity of the accelerometer at its 6 g range (both g-Selects high) over that at 1.5 g: 200 of 800 mV/g. It has no input that moves
/// its mass; but what it senses must shrink to this.
pub const SELF_TEST_ACCEL_RATIO: f32 = 0.25;

/// Farthest that the null of an axis, `(fine * ratio - coarse) / (ratio - 1)`, may be from [`ACCEL_NULL_V`], V. The data sheet allows 0.165
/// (1.485 to 1.815 V). The sensitivities of both ranges may be 7.5 % off, which under 1 g is 0.04 V of it.
pub const SELF_TEST_ACCEL_NULL_V: f32 = 0.22;

/// Change of all three axes together from the finest range to the coarsest under 1 g, V: 0.8 - 0.2.
pub const SELF_TEST_ACCEL_V: f32 = 0.6;

/// Largest departure from that: 0.075 V, since both sensitivities may be 7.5 % off, and as much for nulls that differ between the ranges, of
/// which the data sheet says nothing. An axis that ought to see two thirds of gravity and sees none is missed by 0.153 V.
pub const SELF_TEST_ACCEL_TOLERANCE_V: f32 = 0.15;

/// Farthest that the supply of converter and accelerometer may be from [`REFERENCE_V`](crate::board::REFERENCE_V), part of it: the
/// regulator is within 2 %, and the internal reference within 1 % of its own calibration, 3 % without one.
pub const SUPPLY_TOLERANCE: f32 = 0.05;

/// Time that every state of the self-test lasts before it is measured, ms. The slowest part of the chain is the gyro's 40 Hz filter,
/// 4 ms: 25 time constants.
pub const SELF_TEST_SETTLE_MS: u64 = 100;

/// Samples that are averaged in every state: 2.4 mV of a gyro's noise become 0.2 mV.
pub const SELF_TEST_SAMPLES: u32 = 128;

// ---- The line, queues and deadlines ------------------------------------------------------------

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

/// Time in which a sample has to be taken, or the watchdog restarts the program, µs. It is fed every [`WATCHDOG_FEED_MS`] while samples
/// come; the watchdog's own clock is 32 kHz within 10 %. Until the clocks run it has its reset value, 512 ms: the oscillator takes 2 ms, a
/// PLL less.
pub const WATCHDOG_US: u32 = 2_000_000;

/// How often the watchdog is fed, ms.
pub const WATCHDOG_FEED_MS: u64 = 250;

// ---- Sampling ----------------------------------------------------------------------------------

/// Samples per second.
pub const SAMPLE_HZ: u32 = 1_000;

/// Time constant of the filter of temperature and reference, s. The noise of one sample of the reference, some 50 ppm of it, would
/// be 0.02 deg/s of every gyro at once; over a second it is 1.5 ppm. Both move with the temperature of a board, over minutes.
pub const SLOW_S: f32 = 1.0;

// ---- Flash -------------------------------------------------------------------------------------

/// Size of a word of the flash memory, bytes: programmed once between erases, and whole (RM0433 4.3.9).
pub const FLASH_WORD: usize = 32;
