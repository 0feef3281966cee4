//! The driver on a register file, with packets written out by the data sheet.

extern crate std;
use std::collections::VecDeque;
use std::vec::Vec;

use embassy_futures::block_on;

use super::*;

type Sensor = Icm42688p<()>;

/// Registers of four banks and the FIFO behind them, and every write in order.
struct Registers {
    banks: [[u8; 128]; 4],
    bank: usize,
    fifo: VecDeque<u8>,
    writes: Vec<(usize, u8, u8)>,
    /// A register of bank 0 that reads this, whatever is written.
    fixed: Option<(u8, u8)>,
    us: u64,
}

impl Registers {
    fn new() -> Self {
        let mut banks = [[0; 128]; 4];
        banks[0][usize::from(WHO_AM_I)] = 0x47;
        Self {
            banks,
            bank: 0,
            fifo: VecDeque::new(),
            writes: Vec::new(),
            fixed: None,
            us: 0,
        }
    }
}

impl Bus for Registers {
    async fn read(&mut self, register: u8, into: &mut [u8]) -> Result<(), BusFault> {
        let mut at = register;
        for byte in into {
            // INTF_CONFIG0 has the length in packets, big end first.
            let length = ((self.fifo.len() / 20) as u16).to_be_bytes();
            *byte = match (self.bank, at) {
                (0, 0x2e) => length[0],
                (0, 0x2f) => length[1],
                (0, 0x30) => self.fifo.pop_front().unwrap_or(0xff),
                (0, at) if self.fixed.is_some_and(|(fixed, _)| fixed == at) => {
                    self.fixed.map_or(0, |(_, value)| value)
                }
                _ => self.banks[self.bank][usize::from(at)],
            };
            // A burst stays at the FIFO's port.
            at += u8::from((self.bank, at) != (0, 0x30));
        }
        Ok(())
    }

    async fn write(&mut self, register: u8, value: u8) -> Result<(), BusFault> {
        self.writes.push((self.bank, register, value));
        match register {
            0x76 => self.bank = usize::from(value),
            _ => self.banks[self.bank][usize::from(register)] = value,
        }
        Ok(())
    }

    async fn wait_us(&mut self, us: u32) {
        self.us += u64::from(us);
    }

    fn now_us(&self) -> u64 {
        self.us
    }
}

/// A packet by 6.1: upper 16 of 20 bits of accelerometer and gyro, temperature, stamp, and the low four bits of each axis, those of the
/// accelerometer in the upper half.
fn packet(accel: [i32; 3], gyro: [i32; 3], temperature: i16, stamp: u16) -> [u8; 20] {
    let mut bytes = std::vec![0x78];
    for reading in accel.iter().chain(&gyro) {
        bytes.extend(((reading >> 4) as i16).to_be_bytes());
    }
    bytes.extend(temperature.to_be_bytes());
    bytes.extend(stamp.to_be_bytes());
    for axis in 0..3 {
        bytes.push(((accel[axis] & 0xf) << 4 | gyro[axis] & 0xf) as u8);
    }
    bytes.try_into().unwrap()
}

#[test]
fn a_packet_of_20_bits_keeps_every_bit() {
    // 1 g is 8192 counts of 18 bits; 100 dps are 13 107 of 19.
    let accel = [8192 << 2, -(8191 << 2), 3 << 2];
    let gyro = [13_107 << 1, -(13_107 << 1), -(1 << 1)];
    let read = decode(&packet(accel, gyro, -1325, 0xfedc)).unwrap();
    let counts = read.counts.unwrap();
    assert_eq!(counts.accel, [8192, -8191, 3]);
    assert_eq!(counts.gyro, [13_107, -13_107, -1]);
    assert!((Sensor::celsius(f32::from(read.temperature.unwrap())) - 15.0).abs() < 0.01);
    assert_eq!(read.stamp, 0xfedc);
}

#[test]
fn what_is_no_packet_and_what_is_not_valid_is_told() {
    // An empty FIFO reads 0xff; a packet of 16 bits has another header.
    assert_eq!(decode(&[0xff; 20]), Err(Problem::Packet(0xff)));
    let mut bytes = packet([0; 3], [0; 3], 0, 0);
    bytes[0] = 0x68;
    assert_eq!(decode(&bytes), Err(Problem::Packet(0x68)));
    let mut accel = [0; 3];
    accel[1] = -524_288;
    let invalid = packet(accel, [0; 3], 0, 0);
    assert_eq!(decode(&invalid).unwrap().counts, None);
    let without = decode(&packet([0; 3], [0; 3], i16::MIN, 0)).unwrap();
    assert_eq!(
        (without.counts, without.temperature),
        (Some(Counts::both([0; 3])), None)
    );
}

#[test]
fn readings_at_the_ends_of_the_ranges_are_saturated() {
    let of = |gyro: i32, accel: i32| Counts {
        gyro: [0, gyro, 0],
        accel: [accel, 0, 0],
    };
    // 1999 dps and 15.99 g are within the ranges; the lowest valid readings of 20 bits are -524 256.
    assert!(!Sensor::is_saturated(&of(262_012, -130_990)));
    for counts in [
        of(262_143, 0),
        of(-524_256 >> 1, 0),
        of(0, 131_071),
        of(0, -524_256 >> 2),
    ] {
        assert!(Sensor::is_saturated(&counts), "{counts:?}");
    }
}

#[test]
fn stamps_count_the_samples_whatever_was_lost() {
    // 937.5 counts of 1 µs between samples are 58.6 of 16.
    let stamp = |sample: u64| (sample * 9375 / 160 % 65_536) as u32;
    for first in [0, 1117, 123_456] {
        for lost in [1_u64, 2, 3, 59, 70, 101, 500, 1118, 1119, 1999] {
            for clock in [0.97, 1.0, 1.03] {
                let elapsed_us = (lost as f64 * 1000.0 * clock) as u64 + 900;
                let found = Sensor::samples_between(stamp(first), stamp(first + lost), elapsed_us);
                assert_eq!(found, Some(lost as u32), "{first} {lost} {clock}");
            }
        }
    }
    // The same stamp again, and one between two samples.
    assert_eq!(Sensor::samples_between(7, 7, 1000), None);
    assert_eq!(Sensor::samples_between(0, 29, 1000), None);
}

#[test]
fn it_starts_only_the_chip_that_it_knows_and_leaves_it_as_set() {
    let mut chip = Icm42688p {
        bus: Registers::new(),
    };
    block_on(chip.start()).unwrap();
    let bank = &chip.bus.banks[0];
    for (register, value) in SETTINGS {
        assert_eq!(bank[usize::from(register)], value, "{register:#x}");
    }
    // The sensors run for the 30 ms of table 1 before the FIFO keeps a packet.
    assert!(chip.bus.us >= 32_000);
    let writes: Vec<u8> = chip.bus.writes.iter().map(|w| w.1).collect();
    let at = |register| writes.iter().position(|r| *r == register).unwrap();
    assert!(at(DEVICE_CONFIG) < at(PWR_MGMT0) && at(PWR_MGMT0) < at(FIFO_CONFIG));

    let wrong = |register, identifies, found, expected| {
        Err(Problem::Register(WrongRegister {
            register,
            identifies,
            found,
            expected,
        }))
    };
    chip.bus.fixed = Some((ACCEL_CONFIG1, 0x05));
    assert_eq!(
        block_on(chip.start()),
        wrong(ACCEL_CONFIG1, false, 0x05, 0x0d)
    );
    chip.bus.fixed = Some((WHO_AM_I, 0x42));
    assert_eq!(block_on(chip.start()), wrong(WHO_AM_I, true, 0x42, 0x47));
}

#[test]
fn a_poll_takes_the_oldest_packets_in_order_and_says_how_many_are_left() {
    let mut chip = Icm42688p {
        bus: Registers::new(),
    };
    block_on(chip.start()).unwrap();
    for (waiting, most) in [
        (0, 8),
        (1, 8),
        (2, 8),
        (4, 8),
        (5, 8),
        (9, 8),
        (101, 8),
        (101, 200),
    ] {
        chip.bus.fifo.clear();
        for k in 0..waiting {
            let bytes = packet([k << 2; 3], [-k << 1; 3], 0, k as u16);
            chip.bus.fifo.extend(bytes);
        }
        let mut taken = Vec::new();
        let left = block_on(chip.poll(most as usize, |p| taken.push(p)));
        assert_eq!(left, Ok((waiting - most).max(0) as usize));
        let numbers: Vec<i32> = taken.iter().map(|p| p.stamp as i32).collect();
        assert_eq!(numbers, (0..waiting.min(most)).collect::<Vec<_>>());
        let gyro_y = |p: &Packet| p.counts.unwrap().gyro[1];
        assert!(taken.iter().all(|p| gyro_y(p) == -(p.stamp as i32)));
    }
}

#[test]
fn the_factory_s_responses_are_read_from_their_banks() {
    let mut chip = Icm42688p {
        bus: Registers::new(),
    };
    chip.bus.banks[1][0x5f..0x62].copy_from_slice(&[1, 101, 0]);
    chip.bus.banks[2][0x3b..0x3e].copy_from_slice(&[0, 1, 71]);
    let of = block_on(chip.factory_responses()).unwrap();
    let near = |found: Option<f32>, expected: f32| (found.unwrap() / expected - 1.0).abs() < 1e-3;
    // 1.01^100 = 2.7048 and 1.01^70 = 2.0068.
    assert!(near(of.gyro[0], 19.989) && near(of.gyro[1], 54.066) && of.gyro[2].is_none());
    assert!(near(of.accel[1], 0.159_912) && near(of.accel[2], 0.320_91) && of.accel[0].is_none());
    assert_eq!(chip.bus.bank, 0);
}
