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
/// Twenty samples mean 20 ms of delay; the overhead is then 13 % of a raw frame.
pub const BATCH: usize = 20;

/// Bytes of a raw sample: six integers of three bytes.
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
    /// The first three thermometers of the greeting. One that is out of range, disagrees with the others, has jumped faster than a die can, or
    /// is stuck while the others change is left out of [`BatchHead::temp_c`](super::BatchHead::temp_c).
    pub const TEMPERATURE_LEFT_OUT: [u16; 3] = [1 << 5, 1 << 6, 1 << 7];
    /// No thermometer is usable, so the last good temperature is used; before there was one, 25 °C.
    pub const NO_TEMPERATURE: u16 = 1 << 8;
    /// The time since power-on is unknown: decays after power-on count as over.
    pub const POWER_ON_UNKNOWN: u16 = 1 << 9;
    /// A slot contains a calibration that cannot be used, and that may be younger than the one in use, if there is one.
    pub const YOUNGER_UNUSABLE: u16 = 1 << 10;
    /// The factors of the converter that belong to the calibration cannot be read: the converter calibrated itself at its start.
    pub const OWN_FACTORS: u16 = 1 << 11;
}

/// Integers of x, y, z as the board has them, at most 24 bits with their sign: counts of a digital sensor, or sums of a converter's codes over
/// the scans of a sample, because a mean would lose resolution.
pub type Counts = PerSensor<[i32; 3]>;

/// Fields that apply to all samples of a batch.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BatchHead {
    /// Number of the first sample since sampling began. The others follow one by one; a gap between batches is a gap in time.
    pub first: u32,
    /// Time of the first sample by the board's crystal, µs since sampling began.
    pub tick_us: u64,
    /// True time between samples by the crystal, ns: a digital sensor samples by a clock of its own.
    pub period_ns: u32,
    /// Samples that the device has lost so far, for any reason: sampling restarted, or processing was late.
    pub samples_lost: u32,
    /// Batches lost so far because the line was too slow.
    pub batches_dropped: u32,
    /// Temperature, °C. In a raw batch it is that of the thermometer: the filtered mean of those that are usable. In a compensated batch it is
    /// that of the gyros' dies, which compensation uses: the same after the calibration's lag.
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

    /// Samples per second by the crystal.
    pub fn rate_hz(&self) -> f64 {
        1e9 / f64::from(self.period_ns)
    }

    /// Time from `us` to the first sample, s: what slow effects follow with. In single precision and by this division everywhere, because the
    /// operation decides the last digit.
    pub fn since_s(&self, us: u64) -> f32 {
        self.tick_us.wrapping_sub(us) as f32 / 1e6
    }

    /// Time of one of its samples by the crystal, s since sampling began.
    pub fn time_s(&self, number: u32) -> f64 {
        let k = u64::from(number.wrapping_sub(self.first));
        let since_ns = k.saturating_mul(u64::from(self.period_ns));
        self.tick_us.saturating_mul(1000).saturating_add(since_ns) as f64 / 1e9
    }

    /// Times of the samples by the crystal, ns since sampling began, in order.
    pub fn times_ns(&self) -> impl Iterator<Item = u64> + use<> {
        let (tick_us, period_ns) = (self.tick_us, u64::from(self.period_ns));
        (0_u64..).map(move |k| {
            let first = tick_us.saturating_mul(1000);
            first.saturating_add(k.saturating_mul(period_ns))
        })
    }
}

/// Raw readings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RawBatch<'a> {
    /// What holds for all of them.
    pub head: BatchHead,
    /// Raw units of [`Triad::unit`](super::Triad::unit) per unit of the integers. Reading = integer * this, in `f32`, as the device
    /// compensates it. That of analog gyros follows the filtered reading of their reference, which removes the drift of the converter's.
    pub scale: PerSensor<f32>,
    /// Filtered temperatures of the greeting's thermometers in their order, °C, including those that are left out: each an `f32`, little end
    /// first.
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
    /// Temperature of the accelerometer's die, °C, if the calibration has a separate lag for it; `None` if it is that of the gyros.
    #[serde(with = "extensible::last")]
    pub accel_die_c: Option<f32>,
}

impl<'a> RawBatch<'a> {
    /// The bytes of a sample; bits beyond 24 are cut off.
    pub fn pack(counts: &Counts) -> [u8; RAW_BYTES] {
        let mut bytes = [0; RAW_BYTES];
        let counts = counts.gyro.iter().chain(&counts.accel);
        for (bytes, count) in bytes.as_chunks_mut::<3>().0.iter_mut().zip(counts) {
            // Two's complement: the lower three bytes are those of the shorter number.
            for (byte, of) in bytes.iter_mut().zip(count.to_le_bytes()) {
                *byte = of;
            }
        }
        bytes
    }

    /// Whether the lengths are those that a device sends.
    pub fn is_whole(&self) -> bool {
        self.samples.len().is_multiple_of(RAW_BYTES)
            && (1..=BATCH).contains(&(self.samples.len() / RAW_BYTES))
            && self.temperatures.len().is_multiple_of(4)
    }

    /// Numbers and integers of the samples, in order.
    pub fn counts(&self) -> impl Iterator<Item = (u32, Counts)> + 'a {
        numbers(self.head.first).zip(counts(self.samples))
    }

    /// Numbers and readings of the samples in raw units, in order; identical to the readings that the device compensates, to the last bit.
    pub fn readings(&self) -> impl Iterator<Item = (u32, Sample<f32>)> + 'a {
        let scale = self.scale;
        self.counts()
            .map(move |(number, counts)| (number, reading(&counts, &scale)))
    }

    /// Temperatures of the thermometers, °C.
    pub fn temperatures_c(&self) -> impl Iterator<Item = f32> + 'a {
        let (bytes, _) = self.temperatures.as_chunks::<4>();
        bytes.iter().map(|bytes| f32::from_le_bytes(*bytes))
    }
}

/// Reading of a sample in raw units; see [`RawBatch::scale`].
#[inline]
pub fn reading(counts: &Counts, scale: &PerSensor<f32>) -> Sample<f32> {
    let of = |counts: [i32; 3], scale: f32| Vector3::from(counts).map(|count| count as f32) * scale;
    Sample {
        gyro: of(counts.gyro, scale.gyro),
        accel: of(counts.accel, scale.accel),
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

/// Six signed numbers of three bytes, sample after sample.
fn counts(samples: &[u8]) -> impl Iterator<Item = Counts> {
    samples.as_chunks::<RAW_BYTES>().0.iter().map(|bytes| {
        let mut counts = [0_i32; 6];
        for (count, bytes) in counts.iter_mut().zip(bytes.as_chunks::<3>().0) {
            let [low, middle, high] = *bytes;
            // The sign is the highest of 24 bits.
            *count = i32::from_le_bytes([0, low, middle, high]) >> 8;
        }
        let [gx, gy, gz, ax, ay, az] = counts;
        Counts {
            gyro: [gx, gy, gz],
            accel: [ax, ay, az],
        }
    })
}

/// Sample numbers from the first on; after 49 days of 1 kHz they wrap to 0.
fn numbers(first: u32) -> impl Iterator<Item = u32> {
    (0..).map(move |k| first.wrapping_add(k))
}
