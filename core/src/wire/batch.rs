//! Samples in batches.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::extensible;
use crate::PerSensor;
use crate::compensation::Sample;
use crate::effects::REFERENCE_C;

/// Largest number of samples in a batch. A batch is shorter before a missing sample, because its samples are consecutive, and before the
/// first sample of a new calibration.
///
/// Twenty samples mean 20 ms of delay; the 46 bytes of overhead are then 11 % of a raw frame.
pub const BATCH: usize = 20;

/// Bytes of a raw sample: six sums of three bytes.
pub const RAW_BYTES: usize = 18;

/// Bytes of a compensated sample: six `f32`.
pub const COMPENSATED_BYTES: usize = 24;

/// Bits of [`BatchHead::flags`].
pub mod flags {
    /// The temperature of the dies is outside the range of the calibration, by any amount. The curves continue along their slope for 5 K
    /// and are constant beyond.
    pub const OUTSIDE_NODES: u16 = 1;
    /// The self-test deflects the sensors.
    pub const SELF_TEST: u16 = 1 << 1;
    /// A calibration is being written.
    pub const STORING: u16 = 1 << 2;
    /// A sample of the batch is at the end of a sensor's output range: the input is larger than the reading.
    pub const SATURATED: u16 = 1 << 3;
    /// The gyros' reference is out of its range (its pin is open), so its nominal voltage is used.
    pub const NO_REFERENCE: u16 = 1 << 4;
    /// TEMP pins of gyro x, y, z. A pin that is out of range, disagrees with the others, has jumped faster than a die can, or is stuck
    /// while the others change is left out of [`BatchHead::temp_c`](super::BatchHead::temp_c).
    pub const TEMPERATURE_LEFT_OUT: [u16; 3] = [1 << 5, 1 << 6, 1 << 7];
    /// No TEMP pin is usable, so the last good temperature is used; before there was one, 25 °C.
    pub const NO_TEMPERATURE: u16 = 1 << 8;
    /// The time since power-on is unknown: decays after power-on count as over.
    pub const POWER_ON_UNKNOWN: u16 = 1 << 9;
    /// A slot contains a calibration that cannot be used, and that may be younger than the one in use, if there is one.
    pub const YOUNGER_UNUSABLE: u16 = 1 << 10;
    /// The factors of the converter that belong to the calibration cannot be read: the converter calibrated itself at its start.
    pub const OWN_FACTORS: u16 = 1 << 11;
}

/// Bytes of a sample of signed counts: six of three bytes.
pub const COUNT_BYTES: usize = 18;

/// Signed readings of x, y, z of a digital sensor: at most 24 bits.
pub type Counts = PerSensor<[i32; 3]>;

/// Sums of the converter's codes of x, y, z over the scans of a sample; a mean would lose resolution.
pub type Sums = PerSensor<[u32; 3]>;

/// Fields that apply to all samples of a batch.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BatchHead {
    /// Number of the first sample: milliseconds since sampling began. The others follow one by one; a gap between batches is a gap
    /// in time.
    pub first: u32,
    /// Samples that the device has lost so far, for any reason: sampling restarted, or processing was late.
    pub samples_lost: u32,
    /// Batches lost so far because the line was too slow.
    pub batches_dropped: u32,
    /// Temperature, °C. In a raw batch it is that of the thermometer: the filtered mean of the gyros' usable TEMP pins. In a compensated
    /// batch it is that of the gyros' dies, which compensation uses: the same after the calibration's lag.
    pub temp_c: f32,
    /// [`flags`].
    pub flags: u16,
}

impl BatchHead {
    /// Thermometer of a raw batch, °C; `None` if it has had no reading yet (the batch then has 25 °C and the flag).
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
    /// Volts at a gyro per unit of its sum. It follows the filtered reading of the gyros' reference, which removes the drift of the
    /// converter's reference. Reading in V = sum * this, in `f32`, as the device compensates it.
    pub gyro_volts: f32,
    /// Volts at the accelerometer per unit of its sum.
    pub accel_volts: f32,
    /// Filtered temperatures of the TEMP pins of gyro x, y, z, °C, including pins that are left out.
    pub gyro_temps_c: [f32; 3],
    /// [`Sums`]: gyro x, y, z, accel x, y, z, each three bytes, little end first; sample after sample.
    pub samples: &'a [u8],
}

/// Raw readings of a digital sensor, which samples by a clock of its own. Since protocol 2.3.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CountBatch<'a> {
    /// What holds for all of them.
    pub head: BatchHead,
    /// Time of the first sample by the device's crystal, µs since sampling began.
    pub tick_us: u64,
    /// True time between the samples by the crystal, ns.
    pub period_ns: u32,
    /// Raw units of [`Triad::unit`](super::Triad::unit) per count. Reading = count * this, in `f32`, as the device compensates it.
    pub scale: PerSensor<f32>,
    /// Temperatures of the thermometers of the greeting in their order, °C, each an `f32`, little end first.
    pub temperatures: &'a [u8],
    /// [`Counts`]: gyro x, y, z, accel x, y, z, each three bytes, two's complement, little end first; sample after sample.
    pub samples: &'a [u8],
}

/// Compensated samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CompensatedBatch<'a> {
    /// What holds for all of them.
    pub head: BatchHead,
    /// Gyro x, y, z, rad/s, accel x, y, z, m/s², each an `f32`, little end first; sample after sample.
    pub samples: &'a [u8],
    /// Temperature of the accelerometer's die, °C, if the calibration has a separate lag for it; `None` if it is that of the gyros. Since
    /// protocol 2.2.
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
        numbers(self.head.first).zip(sums(self.samples))
    }

    /// Numbers and readings of the samples, V, in order; identical to the readings that the device compensates, to the last bit.
    pub fn volts(&self) -> impl Iterator<Item = (u32, Sample<f32>)> + 'a {
        let (gyro, accel) = (self.gyro_volts, self.accel_volts);
        self.sums()
            .map(move |(number, sums)| (number, volts(&sums, gyro, accel)))
    }
}

impl<'a> CountBatch<'a> {
    /// The bytes of a sample; bits beyond 24 are cut off.
    pub fn pack(counts: &Counts) -> [u8; COUNT_BYTES] {
        // Two's complement: the lower three bytes are those of the unsigned number.
        let unsigned = |counts: [i32; 3]| counts.map(|count| count as u32);
        RawBatch::pack(&Sums {
            gyro: unsigned(counts.gyro),
            accel: unsigned(counts.accel),
        })
    }

    /// Whether the lengths are those that a device sends.
    pub fn is_whole(&self) -> bool {
        self.samples.len().is_multiple_of(COUNT_BYTES)
            && (1..=BATCH).contains(&(self.samples.len() / COUNT_BYTES))
            && self.temperatures.len().is_multiple_of(4)
    }

    /// Numbers and counts of the samples, in order.
    pub fn counts(&self) -> impl Iterator<Item = (u32, Counts)> + 'a {
        // The sign is the highest of 24 bits.
        let signed = |sums: [u32; 3]| sums.map(|sum| ((sum << 8) as i32) >> 8);
        numbers(self.head.first)
            .zip(sums(self.samples))
            .map(move |(number, sums)| {
                let counts = Counts {
                    gyro: signed(sums.gyro),
                    accel: signed(sums.accel),
                };
                (number, counts)
            })
    }

    /// Numbers and readings of the samples in raw units, in order; identical to the readings that the device compensates, to the last bit.
    pub fn readings(&self) -> impl Iterator<Item = (u32, Sample<f32>)> + 'a {
        let scale = self.scale;
        self.counts()
            .map(move |(number, counts)| (number, reading(&counts, &scale)))
    }

    /// Times of the samples by the crystal, s since sampling began, in order.
    pub fn times_s(&self) -> impl Iterator<Item = f64> + 'a {
        let (tick_us, period_ns) = (self.tick_us, u64::from(self.period_ns));
        (0_u64..).map(move |k| tick_us as f64 * 1e-6 + (k * period_ns) as f64 * 1e-9)
    }

    /// Temperatures of the thermometers, °C.
    pub fn temperatures_c(&self) -> impl Iterator<Item = f32> + 'a {
        let (bytes, _) = self.temperatures.as_chunks::<4>();
        bytes.iter().map(|bytes| f32::from_le_bytes(*bytes))
    }
}

/// Reading of a sample in raw units; see [`CountBatch::scale`].
#[inline]
pub fn reading(counts: &Counts, scale: &PerSensor<f32>) -> Sample<f32> {
    let of = |counts: [i32; 3], scale: f32| Vector3::from(counts).map(|count| count as f32) * scale;
    Sample {
        gyro: of(counts.gyro, scale.gyro),
        accel: of(counts.accel, scale.accel),
    }
}

/// Reading of a sample, V, from its sums and the volts per unit; see [`RawBatch`].
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

/// Six numbers of three bytes, sample after sample.
fn sums(samples: &[u8]) -> impl Iterator<Item = Sums> {
    samples.as_chunks::<RAW_BYTES>().0.iter().map(|bytes| {
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
    })
}

/// Sample numbers from the first on; after 49 days they wrap to 0.
fn numbers(first: u32) -> impl Iterator<Item = u32> {
    (0..).map(move |k| first.wrapping_add(k))
}
