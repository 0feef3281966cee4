//! Sensors, front end and timing: constants that do not depend on the board, each with the reason for its value. Those of the board are in
//! [`board`](crate::board).

// ---- Sensors -----------------------------------------------------------------------------------

/// Null voltage of an ADXRS300 rate gyro at its pin, V. It is absolute, not proportional to the supply, so a change of the converter's
/// reference looks like a rate. The gyros' reference is therefore one of the channels.
pub const GYRO_NULL_V: f32 = 2.5;

/// Voltage of an ADXRS300's reference pin, V: what its null and its TEMP output are made from.
pub const GYRO_REFERENCE_V: f32 = 2.5;

/// Largest deviation of the converted reference from its nominal value; beyond it the pin counts as open. Reference and supply are within 2
/// % each; an open or shorted pin reads 0 or 3.3 V.
pub const REFERENCE_TOLERANCE: f32 = 0.1;

/// Sensitivity of an ADXRS300 at its own pin, V per (deg/s): 1.0 to 4.0 V for its 300 deg/s.
pub const GYRO_SENSITIVITY_V_PER_DPS: f32 = 0.005;

/// Specified range of an ADXRS300, degrees per second.
pub const GYRO_RANGE_DPS: f32 = 300.0;

/// Radians of a degree.
pub const RADIANS: f32 = core::f32::consts::PI / 180.0;

/// Voltage of an ADXRS300's TEMP pin at [`GYRO_TEMPERATURE_NULL_C`], V. Proportional to absolute
/// temperature, which the two constants below state as a tangent.
pub const GYRO_TEMPERATURE_NULL_V: f32 = 2.5;

/// Temperature at which TEMP is [`GYRO_TEMPERATURE_NULL_V`], °C (298 K).
pub const GYRO_TEMPERATURE_NULL_C: f32 = 25.0;

/// Slope of TEMP, V/°C: 2.5 V / 298 K.
pub const GYRO_TEMPERATURE_V_PER_C: f32 = 0.0084;

/// Range of readings of a working TEMP pin, °C. The part works from -40 to 85 °C. TEMP is proportional to its gyro's reference and is
/// divided by that of gyro x; each is 2.45 to 2.55 V, which makes 6 °C each. A pin that is open or shorted to ground reads -270 °C,
/// one at 5 V 320 °C.
pub const GYRO_TEMPERATURE_RANGE_C: [f32; 2] = [-55.0, 100.0];

/// Largest difference between two working TEMP pins, °C: 12 from the two gyros' references, and about 6 from self-heating (5 °C at 30 mW)
/// and from their places on the board.
pub const GYRO_TEMPERATURE_SPREAD_C: f32 = 20.0;

/// Largest change of a gyro's die between two batches (20 ms), °C. Its package, 0.4 g of ceramic, has about 0.3 J/K: 1 °C in 20 ms needs 15
/// W, and the gyro dissipates 0.03 W. The mean of a batch has 40 conversions, each within 0.03 °C. An opening contact, a multiplexer that
/// reads a neighbour, or a changed resistor exceeds this.
pub const GYRO_TEMPERATURE_STEP_C: f32 = 1.0;

/// Fastest sustained change of the dies, °C/s: a board of 20 g (16 J/K) that takes 8 W from a hot-air gun. For each second without a good
/// temperature, the accepted distance from the last one grows by this.
pub const GYRO_TEMPERATURE_RATE_C_PER_S: f32 = 0.5;

/// Largest departure of a TEMP pin from its offset to the others, °C. References drift by a few tenths of a percent over the range (1 °C),
/// and gyros on three faces of a unit in a stream of air differ by 2 or 3 °C. A stuck pin is found once the others have changed by this. A
/// constant code alone proves nothing: at a constant temperature a good pin repeats its code except for the converter's noise, and a pin
/// that is tied to a voltage has that noise too.
pub const GYRO_TEMPERATURE_DEPARTURE_C: f32 = 5.0;

/// Time constant with which the offset of a TEMP pin is learnt, s: longer than a ramp needs to reach [`GYRO_TEMPERATURE_DEPARTURE_C`];
/// otherwise the offset would follow a stuck pin.
pub const GYRO_TEMPERATURE_OFFSET_S: f32 = 3_600.0;

/// During this first time, s, the offset is the mean: 500 batches.
pub const GYRO_TEMPERATURE_BEGINNING_S: f32 = 10.0;

/// Range of the gyros' reference, V: 2.45 to 2.55 by the data sheet of the ADXRS300. The measurement may err by as much again: by the
/// dividers (0.8 % with 1 % resistors), and by the converter's supply, which the internal reference gives within 1 %.
pub const GYRO_REFERENCE_TOLERANCE_V: f32 = 0.1;

/// Ends of the output of an ADXRS300, V: it reaches at least 0.25 V, and 0.25 V below its supply of 5 V (450 deg/s in either direction). It
/// does not reach the ends of the converter's range, which are 5.5 V apart after the divider. (Data sheet, output voltage swing; recalled,
/// as in the
/// catalogue of the bench.)
pub const GYRO_STOPS_V: [f32; 2] = [0.25, 4.75];

/// Distance from the end within which a gyro counts as saturated, V: 1 % resistors in two dividers, its own and that of the reference, make
/// 1.6 % of 4.75 V, 0.08 V; noise adds 0.01 V. The specified 300 deg/s end at 4.0 V, or 4.3 V with the largest sensitivity and null.
pub const GYRO_STOP_MARGIN_V: f32 = 0.1;

/// Null voltage of an MMA7260QT accelerometer, V: half of its 3.3 V supply. It is ratiometric, and its supply is the converter's reference,
/// so its codes do not change with that voltage.
pub const ACCEL_NULL_V: f32 = 1.65;

/// Sensitivity of an MMA7260QT at its 1.5 g range, V/g. The finest of its four ranges, since a
/// calibration on a turntable never leaves 1 g by much; 1.5 g is 0.45 to 2.85 V, within the
/// reference.
pub const ACCEL_SENSITIVITY_V_PER_G: f32 = 0.8;

/// That range, g.
pub const ACCEL_RANGE_G: f32 = 1.5;

/// The g of data sheets, m/s².
pub const STANDARD_GRAVITY: f32 = 9.806_65;

/// Ends of the output of an MMA7260QT at 3.3 V, V: 0.25 V from either rail (data sheet, full scale output range; recalled). The 0.45 and
/// 2.85 V of 1.5 g would be wrong: with a null of 1.815 V, which is allowed, 2.85 V is a valid reading of 1.3 g.
pub const ACCEL_STOPS_V: [f32; 2] = [0.25, 3.05];

/// Distance from the end within which the accelerometer counts as saturated, V: ten times its noise. It has no divider, and is proportional
/// to the converter's reference.
pub const ACCEL_STOP_MARGIN_V: f32 = 0.05;

// ---- Between sensor and pin --------------------------------------------------------------------

/// Upper resistor of the divider at every output of a gyro, Ω. The gyros are 5 V parts and the converter ends at 3.3 V: 36 / (24 + 36) =
/// 0.6 reduces even a supply of 5.25 V to 3.15 V.
///
/// A larger one would let the converter's sampling capacitor (about 4 pF) carry more charge from one channel to the next: 4 pF, 2000 times
/// per second, through 24 kΩ ∥ 36 kΩ is 115 ppm of the difference between neighbours. A smaller one would overload TEMP, the weakest of the
/// three outputs at 50 µA: 3.0 V (85 °C) into 60 kΩ is that current. All have the same ratio, so that a rate divided by the reference does
/// not depend on the resistors' common drift.
///
/// The accelerometer has no divider, only the 1 kΩ and 0.1 µF that its data sheet requires against the noise of its clock.
pub const DIVIDER_UPPER_OHM: u32 = 24_000;

/// Lower resistor of the divider, Ω. 47 nF across it make a low-pass of 235 Hz: above the gyro's
/// own 40 Hz, below the 1 kHz half of the scan rate.
pub const DIVIDER_LOWER_OHM: u32 = 36_000;

/// Ratio of pin voltage to sensor voltage with a divider.
pub const DIVIDER_RATIO: f32 =
    DIVIDER_LOWER_OHM as f32 / (DIVIDER_UPPER_OHM + DIVIDER_LOWER_OHM) as f32;

// ---- Self-test ---------------------------------------------------------------------------------

/// Change of an ADXRS300's output by ST1 or ST2, V: by its data sheet 0.15 to 0.45, typically 0.27, which is about 50 deg/s. ST1 lowers the
/// output, ST2 raises it. The measured means have 0.2 mV of noise. Wider limits would pass a sensor that has lost half of its sensitivity.
pub const SELF_TEST_GYRO_V: [f32; 2] = [0.15, 0.45];

/// Sensitivity of the accelerometer at its 6 g range (both g-Selects high) over that at 1.5 g: 200 of 800 mV/g. It has no input that
/// deflects its mass, but its signal must shrink by this ratio.
pub const SELF_TEST_ACCEL_RATIO: f32 = 0.25;

/// Largest distance of the null of an axis, `(fine * ratio - coarse) / (ratio - 1)`, from [`ACCEL_NULL_V`], V. The data sheet allows 0.165
/// (1.485 to 1.815 V). The sensitivities of both ranges may be 7.5 % off, which adds 0.04 V under 1 g.
pub const SELF_TEST_ACCEL_NULL_V: f32 = 0.22;

/// Change of all three axes together from the finest range to the coarsest under 1 g, V: 0.8 - 0.2.
pub const SELF_TEST_ACCEL_V: f32 = 0.6;

/// Largest departure from that, V: 0.075 because both sensitivities may be 7.5 % off, and as much for nulls that differ between the ranges
/// (not specified in the data sheet). An axis that should sense two thirds of gravity but senses none changes it by 0.153 V.
pub const SELF_TEST_ACCEL_TOLERANCE_V: f32 = 0.15;

/// Least change between the ranges that proves that an axis of the accelerometer responds, V: two fifths of gravity, more than nulls can
/// differ by.
pub const SELF_TEST_ACCEL_SEEN_V: f32 = 0.24;

/// Largest relative deviation of the supply of converter and accelerometer from [`REFERENCE_V`](crate::board::REFERENCE_V): the regulator
/// is within 2 %, and the internal reference within 1 % with its factory calibration, 3 % without.
pub const SUPPLY_TOLERANCE: f32 = 0.05;

/// Settling time of each state of the self-test before it is measured, ms: 25 time constants of the slowest part, the gyro's 40 Hz filter
/// (4 ms).
pub const SELF_TEST_SETTLE_MS: u64 = 100;

/// Number of samples averaged in each state: a gyro's noise of 2.4 mV becomes 0.2 mV.
pub const SELF_TEST_SAMPLES: u32 = 128;

// ---- The line, queues and deadlines ------------------------------------------------------------

/// Vendor and product number of the part's own USB: numbers of pid.codes for testing. A product needs its own.
pub const USB_VENDOR: u16 = 0x1209;
/// See [`USB_VENDOR`].
pub const USB_PRODUCT: u16 = 0x0001;
/// Bytes of a packet, the most at full speed.
pub const USB_PACKET: u16 = 64;

/// Queue of frames for the line. A frame of a full batch takes 5 ms to send and contains 20 ms of samples.
pub const FRAMES: usize = 6;

/// Buffer for bytes from the host: 10 ms of the line.
pub const RECEIVED: usize = 1024;

/// Queue of samples for processing, i.e. ms. Storing a calibration computes its hash twice, 4 ms; the rest is reserve.
pub const QUEUE: usize = 64;

/// If no sample is taken within this time, the watchdog restarts the program, µs. It is fed every [`WATCHDOG_FEED_MS`] while samples come;
/// its clock is 32 kHz within 10 %. Until the clocks run it has its reset value, 512 ms: the oscillator needs 2 ms, a PLL less.
pub const WATCHDOG_US: u32 = 2_000_000;

/// How often the watchdog is fed, ms.
pub const WATCHDOG_FEED_MS: u64 = 250;

/// The transmitter is stuck if a frame waits and none is sent for this long, ms. The longest frame takes 5 ms.
pub const TRANSMITTER_MS: u64 = 1_000;

/// The commands are stuck if a request is not answered for this long, ms. Storing a calibration takes longest: 4 s for the erase by the data sheet, and
/// 10 ms for each of 300 words where the flash is slow. The host waits for 15 s.
pub const COMMAND_MS: u64 = 20_000;

/// This time in rounds of the watchdog's task.
pub const fn rounds(ms: u64) -> u32 {
    (ms / WATCHDOG_FEED_MS) as u32
}

// ---- Sampling ----------------------------------------------------------------------------------

/// Samples per second.
pub const SAMPLE_HZ: u32 = 1_000;

/// Time constant of the filter of temperature and reference, s. The noise of one sample of the reference, about 50 ppm, would be 0.02 deg/s
/// on all gyros at once; over a second it is 1.5 ppm. Both quantities change with the temperature of the board, over minutes.
pub const SLOW_S: f32 = 1.0;

// ---- Flash -------------------------------------------------------------------------------------

/// Size of a flash word, bytes: it is programmed as a whole, once between erases (RM0433 4.3.9).
pub const FLASH_WORD: usize = 32;
