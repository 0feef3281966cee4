//! Samples in batches.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::extensible;
use crate::PerSensor;
use crate::compensation::Sample;
use crate::effects::REFERENCE_C;

/// Most samples of a batch. Fewer come where a sample is missing, since those of a batch are consecutive, and before the first sample of a new
/// calibration.
///
/// Twenty: 20 ms of delay, and 46 bytes of everything else are 11 % of a raw frame.
pub const BATCH: usize = 20;

/// Bytes of a raw sample: six sums of three bytes.
pub const RAW_BYTES: usize = 18;

/// Bytes of a compensated sample: six `f32`.
pub const COMPENSATED_BYTES: usize = 24;

/// Bits of [`BatchHead::flags`].
pub mod flags {
    /// The temperature of the dies is outside what the calibration is for, by however little: its curves go on along their slope for 5 K, and are
    /// held farther out.
    pub const OUTSIDE_NODES: u16 = 1;
    /// The self-test deflects the sensors.
    pub const SELF_TEST: u16 = 1 << 1;
    /// A calibration is being written.
    pub const STORING: u16 = 1 << 2;
    /// A sample of the batch stands where a sensor's output can go no further: its input is larger than it tells.
    pub const SATURATED: u16 = 1 << 3;
    /// The gyros' reference is not where it can be: its pin is open, and its nominal voltage is used.
    pub const NO_REFERENCE: u16 = 1 << 4;
    /// The TEMP pins of gyro x, y, z: one that reads what no working gyro has, that disagrees with the others, that has made a step that no die
    /// makes, or that stands still while the others move is left out of [`BatchHead::temp_c`](super::BatchHead::temp_c).
    pub const TEMPERATURE_LEFT_OUT: [u16; 3] = [1 << 5, 1 << 6, 1 << 7];
    /// No TEMP pin is left, and the last good temperature is used; before there was one, 25 °C.
    pub const NO_TEMPERATURE: u16 = 1 << 8;
    /// When the power came is not known: what passes after it is taken for long past.
    pub const POWER_ON_UNKNOWN: u16 = 1 << 9;
}

/// Sums of the converter's codes of x, y, z over the scans of a sample, so that averaging loses nothing.
pub type Sums = PerSensor<[u32; 3]>;

/// What holds for all samples of a batch.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BatchHead {
    /// Number of the first sample: milliseconds since sampling began. The others follow one by one; a gap between batches is a gap
    /// in time.
    pub first: u32,
    /// Samples that the device lost so far, of all causes: sampling began anew, or processing was behind.
    pub samples_lost: u32,
    /// Batches that were lost so far because the line was behind.
    pub batches_dropped: u32,
    /// Temperature, °C. In a raw batch that of the thermometer, filtered: the gyros' TEMP pins that are not left out. In a compensated batch that of
    /// the gyros' dies, which is what compensation goes by: the same behind the lag of the calibration.
    pub temp_c: f32,
    /// [`flags`].
    pub flags: u16,
}

impl BatchHead {
    /// The thermometer of a raw batch, °C; `None` where it has had no reading yet: 25 °C stands in for it, beside the flag.
    pub fn thermometer_c(&self) -> Option<f32> {
        let none = self.flags & flags::NO_TEMPERATURE != 0 && self.temp_c == REFERENCE_C as f32;
        (!none).then_some(self.temp_c)
    }
}

/// Raw readings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RawBatch<'a> {
    /// What holds for all of them.
    pub head: BatchHead,
    /// Volts at a gyro for one step of its sum. It moves with the filtered reading of the gyros' own reference, so that drift of the
    /// converter's is taken out. Reading in V = sum * this, in `f32`, which is what the device compensates.
    pub gyro_volts: f32,
    /// Volts at the accelerometer for one step of its sum.
    pub accel_volts: f32,
    /// Temperatures by the TEMP pins of gyro x, y, z, filtered, °C, also of a pin that is left out.
    pub gyro_temps_c: [f32; 3],
    /// [`Sums`]: gyro x, y, z, accel x, y, z, each three bytes, little end first; sample after sample.
    pub samples: &'a [u8],
}

/// Compensated samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CompensatedBatch<'a> {
    /// What holds for all of them.
    pub head: BatchHead,
    /// Gyro x, y, z, rad/s, accel x, y, z, m/s², each an `f32`, little end first; sample after sample.
    pub samples: &'a [u8],
    /// Temperature of the accelerometer's die, °C, where the calibration has a lag of its own for it; `None` where it is that of the
    /// gyros. Since protocol 2.2.
    #[serde(with = "extensible::last")]
    pub accel_die_c: Option<f32>,
}

impl<'a> RawBatch<'a> {
    /// The bytes of a sample, from its sums; those above 2²⁴ are cut off.
    pub fn pack(sums: &Sums) -> [u8; RAW_BYTES] {
        let mut bytes = [0; RAW_BYTES];
        let sums = sums.gyro.iter().chain(&sums.accel);
        for (bytes, sum) in bytes.as_chunks_mut::<3>().0.iter_mut().zip(sums) {
            for (byte, of) in bytes.iter_mut().zip(sum.to_le_bytes()) {
                *byte = of;
            }
        }
        bytes
    }

    /// Whether the length of [`Self::samples`] is one that a device sends.
    pub fn is_whole(&self) -> bool {
        self.samples.len().is_multiple_of(RAW_BYTES)
            && (1..=BATCH).contains(&(self.samples.len() / RAW_BYTES))
    }

    /// Numbers and sums of the samples, in order.
    pub fn sums(&self) -> impl Iterator<Item = (u32, Sums)> + 'a {
        let numbers = numbers(self.head.first);
        numbers.zip(self.samples.as_chunks::<RAW_BYTES>().0.iter().map(|bytes| {
            let mut sums = [0; 6];
            for (sum, bytes) in sums.iter_mut().zip(bytes.as_chunks::<3>().0) {
                for byte in bytes.iter().rev() {
                    *sum = *sum << 8 | u32::from(*byte);
                }
            }
            let [gx, gy, gz, ax, ay, az] = sums;
            Sums {
                gyro: [gx, gy, gz],
                accel: [ax, ay, az],
            }
        }))
    }

    /// Numbers and readings of the samples, V, in order: to the last bit what the device compensates.
    pub fn volts(&self) -> impl Iterator<Item = (u32, Sample<f32>)> + 'a {
        let (gyro, accel) = (self.gyro_volts, self.accel_volts);
        self.sums()
            .map(move |(number, sums)| (number, volts(&sums, gyro, accel)))
    }
}

/// Reading of a sample, V, from its sums and the volts for a step of them; see [`RawBatch`].
#[inline]
pub fn volts(sums: &Sums, gyro_volts: f32, accel_volts: f32) -> Sample<f32> {
    let volts = |sums: [u32; 3], step: f32| Vector3::from(sums).map(|sum| sum as f32) * step;
    Sample {
        gyro: volts(sums.gyro, gyro_volts),
        accel: volts(sums.accel, accel_volts),
    }
}

impl<'a> CompensatedBatch<'a> {
    /// The bytes of a sample, SI.
    pub fn pack(sample: &Sample<f32>) -> [u8; COMPENSATED_BYTES] {
        let mut bytes = [0; COMPENSATED_BYTES];
        let values = sample.gyro.iter().chain(sample.accel.iter());
        for (bytes, value) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(values) {
            for (byte, of) in bytes.iter_mut().zip(value.to_le_bytes()) {
                *byte = of;
            }
        }
        bytes
    }

    /// Whether the length of [`Self::samples`] is one that a device sends.
    pub fn is_whole(&self) -> bool {
        self.samples.len().is_multiple_of(COMPENSATED_BYTES)
            && (1..=BATCH).contains(&(self.samples.len() / COMPENSATED_BYTES))
    }

    /// Temperatures of the dies, °C.
    pub fn dies_c(&self) -> PerSensor<f32> {
        let gyro = self.head.temp_c;
        let accel = self.accel_die_c.unwrap_or(gyro);
        PerSensor { gyro, accel }
    }

    /// Numbers and values of the samples, rad/s and m/s² in the body frame, in order.
    pub fn values(&self) -> impl Iterator<Item = (u32, Sample<f32>)> + 'a {
        let numbers = numbers(self.head.first);
        numbers.zip(
            self.samples
                .as_chunks::<COMPENSATED_BYTES>()
                .0
                .iter()
                .map(|bytes| {
                    let mut values = [0.0; 6];
                    for (value, bytes) in values.iter_mut().zip(bytes.as_chunks::<4>().0) {
                        *value = f32::from_le_bytes(*bytes);
                    }
                    let [gx, gy, gz, ax, ay, az] = values;
                    Sample {
                        gyro: Vector3::new(gx, gy, gz),
                        accel: Vector3::new(ax, ay, az),
                    }
                }),
        )
    }
}

/// Sample numbers from the first on; after 49 days they begin again at 0.
fn numbers(first: u32) -> impl Iterator<Item = u32> {
    (0..).map(move |k| first.wrapping_add(k))
}
