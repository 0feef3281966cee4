//! The inertial sensor ICM-42688-P: registers, FIFO and self-test. All integers stay integers.
//!
//! DS-000347 is its data sheet; sections are those of revision 1.6. The driver is generic over the [`Bus`], so that it runs on the PC too.
//!
//! # What the sheet hides
//!
//! - The time stamp is in "microseconds", but counts 30 in 32 µs of the chip's own clock unless a clock is connected to its pin (12.7). At
//!   1 kHz successive stamps differ by 937 or 938. Taken as microseconds they would make every rate 6.7 % too large.
//! - In packets of 20 bits the ranges are always 2000 dps and 16 g, whatever the range registers say (6.1).
//! - A stamp has 16 bits. In steps of 1 µs it wraps after 70 ms, less than the FIFO holds (101 ms), so a loss could be miscounted by 70
//!   samples. In steps of 16 µs it wraps after 1.1 s.
//! - The automatic adjustment of the sampling phase (bits 7:6 of INTF_CONFIG1, not described) can make the gyro repeat its last reading for
//!   some milliseconds. The autopilots switch it off with the value 01, and so does this driver.

use mimu_core::PerSensor;
use mimu_core::wire::{Counts, Triad, WrongRegister};

use crate::chip::{Bus, BusFault, Chip, Packet, Part, Problem};
use crate::design_parameters::{RADIANS, STANDARD_GRAVITY};

/// Samples per second by the chip's nominal clock.
const RATE_HZ: f64 = 1_000.0;

/// Range of the gyro, degrees per second, and of the accelerometer, g, in packets of 20 bits (6.1).
const RANGE: PerSensor<f64> = PerSensor {
    gyro: 2_000.0,
    accel: 16.0,
};

/// Bits of a reading with its sign. The packet has 20; the lowest bit of the gyro and the lowest two of the accelerometer are zero (6.1).
const BITS: PerSensor<u32> = PerSensor {
    gyro: 19,
    accel: 18,
};

/// Rate and filters as they are set below, which determine the readings beside the range: a calibration belongs to them.
const FILTERS: &str = "1 kHz, second order, 250 Hz";

/// Counts of the time stamp between samples: [`RATE_HZ`], 30 counts in 32 µs, and 16 of these in a step.
const STAMPS: f64 = 1e6 / RATE_HZ * 30.0 / 32.0 / 16.0;

/// Largest distance of a stamp from a whole number of samples, in samples. Rounding a stamp to its step makes 0.02.
const STAMP_TOLERANCE: f64 = 0.1;

/// Bytes of a packet of 20 bits (6.1).
const PACKET: usize = 20;

/// Packets in a transfer. At one poll per sample there are one or two; more come in several transfers.
const BURST: usize = 4;

/// Header of a packet with accelerometer, gyro, 20 bits and time stamp (6.2); the two lowest bits tell of a new rate.
const HEADER: u8 = 0b0111_1000;
const HEADER_MASK: u8 = 0b1111_1000;

/// Temperature of a packet while there is no valid one (14.34).
const NO_TEMPERATURE: i16 = i16::MIN;

/// A reading of 20 bits that is not valid (14.34).
const INVALID: i32 = -(1 << 19);

/// Readings this close to the end of the range are saturated. The lowest valid one is 32 counts of 20 bits above the end (14.34).
const END: i32 = 32;

// Bank 0.
const DEVICE_CONFIG: u8 = 0x11;
const FIFO_CONFIG: u8 = 0x16;
const FIFO_COUNTH: u8 = 0x2e;
const FIFO_DATA: u8 = 0x30;
const SIGNAL_PATH_RESET: u8 = 0x4b;
const INTF_CONFIG0: u8 = 0x4c;
const INTF_CONFIG1: u8 = 0x4d;
const PWR_MGMT0: u8 = 0x4e;
const GYRO_CONFIG0: u8 = 0x4f;
const ACCEL_CONFIG0: u8 = 0x50;
const GYRO_CONFIG1: u8 = 0x51;
const GYRO_ACCEL_CONFIG0: u8 = 0x52;
const ACCEL_CONFIG1: u8 = 0x53;
const TMST_CONFIG: u8 = 0x54;
const FIFO_CONFIG1: u8 = 0x5f;
const SELF_TEST_CONFIG: u8 = 0x70;
const WHO_AM_I: u8 = 0x75;
const REG_BANK_SEL: u8 = 0x76;
// Bank 1 and bank 2: the factory's responses to the self-test.
const XG_ST_DATA: u8 = 0x5f;
const XA_ST_DATA: u8 = 0x3b;

/// WHO_AM_I of this chip.
const IDENTITY: u8 = 0x47;

/// Settings, in order, with what differs from the reset value. All readings are big end first, as after reset.
const SETTINGS: [(u8, u8); 10] = [
    // The FIFO's length in packets; I2C off.
    (INTF_CONFIG0, 0b0111_0011),
    // Clock by the PLL; the adjustment of the sampling phase off.
    (INTF_CONFIG1, 0b0101_0001),
    // 2000 dps, 16 g, 1 kHz.
    (GYRO_CONFIG0, 0x06),
    (ACCEL_CONFIG0, 0x06),
    // Filters as after reset, stated because a calibration belongs to them: second order, a quarter of 1 kHz.
    (GYRO_CONFIG1, 0x16),
    (GYRO_ACCEL_CONFIG0, 0x11),
    (ACCEL_CONFIG1, 0x0d),
    // Time stamps in steps of 16 µs.
    (TMST_CONFIG, 0b0010_1001),
    // Packets of 20 bits with both sensors, temperature and time stamp.
    (FIFO_CONFIG1, 0b0001_1111),
    // Gyro and accelerometer on, in low noise.
    (PWR_MGMT0, 0x0f),
];

/// A packet from its bytes (6.1, packet 4).
pub fn decode(bytes: &[u8; PACKET]) -> Result<Packet, Problem> {
    let [header, words @ .., x, y, z] = bytes;
    if header & HEADER_MASK != HEADER {
        return Err(Problem::Packet(*header));
    }
    let word = |k: usize| i16::from_be_bytes([words[2 * k], words[2 * k + 1]]);
    let low = [*x, *y, *z].map(i32::from);
    let whole = |k: usize, low: i32| i32::from(word(k)) << 4 | low;
    let accel: [i32; 3] = core::array::from_fn(|i| whole(i, low[i] >> 4));
    let gyro: [i32; 3] = core::array::from_fn(|i| whole(3 + i, low[i] & 0xf));
    let valid = gyro.iter().chain(&accel).all(|reading| *reading != INVALID);
    Ok(Packet {
        counts: valid.then_some(Counts {
            gyro: gyro.map(|reading| reading >> (20 - BITS.gyro)),
            accel: accel.map(|reading| reading >> (20 - BITS.accel)),
        }),
        temperature: Some(word(6)).filter(|temperature| *temperature != NO_TEMPERATURE),
        stamp: u32::from(word(7) as u16),
    })
}

impl<B> Part for Icm42688p<B> {
    const TRIADS: PerSensor<Triad<'static>> = PerSensor {
        gyro: triad(RANGE.gyro * RADIANS as f64, BITS.gyro),
        accel: triad(RANGE.accel * STANDARD_GRAVITY as f64, BITS.accel),
    };

    fn is_saturated(counts: &Counts) -> bool {
        let at_an_end = |counts: &[i32; 3], bits: u32| {
            let end = (1 << (bits - 1)) - (END >> (20 - bits)) - 1;
            counts.iter().any(|count| count.abs() >= end)
        };
        at_an_end(&counts.gyro, BITS.gyro) || at_an_end(&counts.accel, BITS.accel)
    }

    /// 4.13.
    fn celsius(temperature: f32) -> f32 {
        temperature / 132.48 + 25.0
    }

    /// Half of the stamp's 1.1 s is room enough for a poll's delay and a wrong clock.
    fn samples_between(before: u32, after: u32, elapsed_us: u64) -> Option<u32> {
        let span = f64::from(u16::MAX) + 1.0;
        let expected = elapsed_us as f64 * RATE_HZ / 1e6 * STAMPS;
        let since = f64::from((after as u16).wrapping_sub(before as u16));
        // Truncation of what is not negative: `core` has no `floor`.
        let wraps = f64::from(((expected - since) / span + 0.5).max(0.0) as u32);
        let samples = (since + wraps * span) / STAMPS;
        // Positive, so this rounds to the nearest.
        let whole = (samples + 0.5) as u32;
        let fits = (samples - f64::from(whole)).abs() <= STAMP_TOLERANCE;
        (whole > 0 && fits).then_some(whole)
    }
}

/// A triad whose readings of so many bits end at `range`, SI.
const fn triad(range: f64, bits: u32) -> Triad<'static> {
    Triad {
        part: "ICM-42688-P",
        unit: "count",
        bits: bits as u8,
        range: range as f32,
        null: 0.0,
        per_si: ((1_u32 << (bits - 1)) as f64 / range) as f32,
        rate_hz: RATE_HZ as f32,
        filter: FILTERS,
    }
}

/// The chip.
pub struct Icm42688p<B> {
    /// The line to it.
    pub bus: B,
}

impl<B: Bus> Chip for Icm42688p<B> {
    type Bus = B;

    fn bus(&mut self) -> &mut B {
        &mut self.bus
    }

    async fn start(&mut self) -> Result<(), Problem> {
        self.bus.write(REG_BANK_SEL, 0).await?;
        self.bus.write(DEVICE_CONFIG, 1).await?;
        // 14.1: 1 ms.
        self.bus.wait_us(2_000).await;
        self.check(WHO_AM_I, IDENTITY).await?;
        for (register, value) in SETTINGS {
            self.bus.write(register, value).await?;
        }
        // 14.36: no write for 200 µs; the gyro needs 30 ms to start (table 1), which are not sampled.
        self.bus.wait_us(50_000).await;
        // Of other filters or ranges, no reading would be what the calibration belongs to.
        for (register, value) in SETTINGS {
            self.check(register, value).await?;
        }
        // Stream: a full FIFO drops the oldest packet.
        self.bus.write(FIFO_CONFIG, 1 << 6).await?;
        self.bus.write(SIGNAL_PATH_RESET, 1 << 1).await?;
        Ok(())
    }

    async fn poll(&mut self, most: usize, mut take: impl FnMut(Packet)) -> Result<usize, Problem> {
        let [high, low] = self.registers(FIFO_COUNTH).await?;
        let waiting = usize::from(u16::from_be_bytes([high, low]));
        let mut left = waiting.min(most);
        let mut bytes = [0; BURST * PACKET];
        while left > 0 {
            let count = left.min(BURST);
            let burst = &mut bytes[..count * PACKET];
            self.bus.read(FIFO_DATA, burst).await?;
            for packet in burst.as_chunks::<PACKET>().0 {
                take(decode(packet)?);
            }
            left -= count;
        }
        Ok(waiting.saturating_sub(most))
    }

    async fn deflect(&mut self, gyro: bool, accel: bool) -> Result<(), Problem> {
        let bits = (u8::from(gyro) * 0b0111) | (u8::from(accel) * 0b0111_1000);
        Ok(self.bus.write(SELF_TEST_CONFIG, bits).await?)
    }

    async fn factory_responses(&mut self) -> Result<PerSensor<[Option<f32>; 3]>, Problem> {
        self.bus.write(REG_BANK_SEL, 1).await?;
        let gyro: [u8; 3] = self.registers(XG_ST_DATA).await?;
        self.bus.write(REG_BANK_SEL, 2).await?;
        let accel: [u8; 3] = self.registers(XA_ST_DATA).await?;
        self.bus.write(REG_BANK_SEL, 0).await?;
        // Code 1 is 2620 counts at 250 dps and at 2 g; each further one is 1 % more (the maker's own driver; recalled).
        let response = |code: u8, unit: f32| (code > 0).then(|| unit * power(1.01, code - 1));
        Ok(PerSensor {
            gyro: gyro.map(|code| response(code, 2620.0 * 250.0 / 32_768.0)),
            accel: accel.map(|code| response(code, 2620.0 * 2.0 / 32_768.0)),
        })
    }
}

impl<B: Bus> Icm42688p<B> {
    /// Whether `register` reads what it must.
    async fn check(&mut self, register: u8, expected: u8) -> Result<(), Problem> {
        let [found] = self.registers(register).await?;
        match found == expected {
            true => Ok(()),
            false => Err(Problem::Register(WrongRegister {
                register,
                identifies: register == WHO_AM_I,
                found,
                expected,
            })),
        }
    }

    async fn registers<const N: usize>(&mut self, first: u8) -> Result<[u8; N], BusFault> {
        let mut values = [0; N];
        self.bus.read(first, &mut values).await?;
        Ok(values)
    }
}

/// `base` to a whole power: `core` has no `powi`.
fn power(base: f32, exponent: u8) -> f32 {
    (0..exponent).fold(1.0, |product, _| product * base)
}

#[cfg(test)]
mod tests;
