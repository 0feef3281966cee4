//! Sampling of a chip that keeps its own time, written from the data sheet.

extern crate std;
use std::collections::VecDeque;
use std::vec::Vec;

use embassy_futures::block_on;

use super::*;
use crate::chip::BusFault;
use crate::icm42688p::Icm42688p;

/// Packets that the FIFO holds: 2048 bytes without one packet, 20 bytes each (6.3).
const CAPACITY: usize = 101;

/// The chip, with a clock of its own.
struct OwnClock {
    registers: [u8; 128],
    bank: u8,
    /// Period of its samples in the crystal's time, µs.
    period_us: f64,
    /// Relative change of the period in a second: the oscillator drifts with the temperature of the die.
    drift: f64,
    /// Samples made so far, and since when it runs and when the next one is made, µs.
    made: u64,
    on_us: Option<f64>,
    next_us: f64,
    fifo: VecDeque<u8>,
    now_us: f64,
    /// From and to when waiting takes to the end of it: the reader is starved.
    starved_us: Option<[f64; 2]>,
    /// From and to when the chip does not answer.
    gone_us: Option<[f64; 2]>,
    end_us: f64,
    /// Numbers of samples without a valid reading.
    invalid: Vec<u64>,
}

impl OwnClock {
    fn new(error: f64, end_us: f64) -> Self {
        Self {
            registers: [0; 128],
            bank: 0,
            period_us: 1000.0 * (1.0 + error),
            drift: 0.0,
            made: 0,
            on_us: None,
            next_us: 0.0,
            fifo: VecDeque::new(),
            now_us: 7_000.0,
            starved_us: None,
            gone_us: None,
            end_us,
            invalid: Vec::new(),
        }
    }

    /// Each sample has its own number in the accelerometer.
    fn catch_up(&mut self) {
        let Some(on_us) = self.on_us else { return };
        while self.next_us <= self.now_us {
            self.made += 1;
            let changed = self.drift * (self.next_us - on_us) * 1e-6;
            self.next_us += self.period_us * (1.0 + changed);
            let number = self.made as i32;
            // 30 counts in 32 µs of the chip's clock, 16 in a step.
            let stamp = (self.made * 1000 * 30 / 32 / 16 % 65_536) as u16;
            let mut packet = std::vec![0x78];
            let valid = !self.invalid.contains(&self.made);
            let x = if valid {
                (number >> 2) as i16
            } else {
                i16::MIN
            };
            for word in [x, 0, 0, 0, 0, 0, 1325] {
                packet.extend(word.to_be_bytes());
            }
            packet.extend(stamp.to_be_bytes());
            packet.extend([if valid { (number & 3) as u8 * 4 } else { 0 } << 4, 0, 0]);
            self.fifo.extend(packet);
            if self.fifo.len() > 20 * CAPACITY {
                self.fifo.drain(..20);
            }
        }
    }

    fn answers(&self) -> Result<(), BusFault> {
        let gone = self
            .gone_us
            .is_some_and(|[from, to]| (from..to).contains(&self.now_us));
        match gone || self.now_us >= self.end_us {
            true => Err(BusFault),
            false => Ok(()),
        }
    }
}

impl Bus for OwnClock {
    async fn read(&mut self, register: u8, into: &mut [u8]) -> Result<(), BusFault> {
        self.answers()?;
        self.catch_up();
        let length = ((self.fifo.len() / 20) as u16).to_be_bytes();
        for (k, byte) in into.iter_mut().enumerate() {
            *byte = match (self.bank, register, k) {
                (0, 0x30, _) => self.fifo.pop_front().unwrap_or(0xff),
                (0, 0x2e, 0) => length[0],
                (0, 0x2e, 1) => length[1],
                (0, 0x75, 0) => 0x47,
                (0, register, _) => self.registers[usize::from(register)],
                _ => 0,
            };
        }
        self.now_us += 10.0;
        Ok(())
    }

    async fn write(&mut self, register: u8, value: u8) -> Result<(), BusFault> {
        self.answers()?;
        self.now_us += 2.0;
        self.registers[usize::from(register)] = value;
        match (register, value) {
            (0x76, bank) => self.bank = bank,
            (0x11, 1) => (self.on_us, self.made) = (None, 0),
            (0x4e, 0x0f) => {
                (self.on_us, self.next_us) = (Some(self.now_us), self.now_us + self.period_us);
            }
            (0x4b, 0x02) => {
                self.catch_up();
                self.fifo.clear();
            }
            _ => {}
        }
        Ok(())
    }

    async fn wait_us(&mut self, us: u32) {
        self.now_us += f64::from(us);
        if let Some([from, to]) = self.starved_us
            && (from..to).contains(&self.now_us)
        {
            self.now_us = to;
        }
    }

    fn now_us(&self) -> u64 {
        self.now_us as u64
    }
}

static CONTROLS: Controls = Controls::new();

/// All scans until the chip's end; after a fault the sensor is started again, as the sampling task does.
fn scans(bus: OwnClock) -> (Vec<Scan<DieSum>>, Polled<Icm42688p<OwnClock>>) {
    let mut polled = Polled::new(Icm42688p { bus }, &CONTROLS);
    let mut all = Vec::new();
    while polled.chip.bus.now_us < polled.chip.bus.end_us {
        block_on(polled.run(|scan| all.push(scan)));
    }
    (all, polled)
}

#[test]
fn every_sample_comes_once_with_its_time_by_the_crystal_however_wrong_the_chip_s_clock_is() {
    for error in [-0.03, -0.004, 0.0, 0.004, 0.03] {
        let (all, polled) = scans(OwnClock::new(error, 20e6));
        let chip = polled.chip.bus;
        let (on_us, period_us) = (chip.on_us.unwrap(), chip.period_us);
        assert!(all.len() > 18_500);
        for (k, scan) in all.iter().enumerate() {
            assert_eq!(scan.number, k as u32);
            let made = scan.counts.accel[0];
            assert_eq!(made, all[0].counts.accel[0] + k as i32);
            // Sampling began at 7 ms. A phase that does not move against the polls is known to half a period.
            let at_us = on_us + f64::from(made) * period_us - 7_000.0;
            let off_us = scan.tick_us as f64 - at_us;
            assert!(off_us.abs() < 520.0, "{error} {k}: {off_us}");
            if error != 0.0 && k > 10_000 {
                assert!(off_us.abs() < 40.0, "{error} {k}: {off_us}");
            }
        }
        let period_ns = f64::from(all.last().unwrap().period_ns);
        assert!(
            (period_ns / period_us - 1000.0).abs() < 0.01,
            "{error}: {period_ns}"
        );
    }
}

#[test]
fn a_chip_whose_clock_drifts_by_a_tenth_of_a_per_cent_keeps_the_crystal_s_time() {
    // In two minutes, as the die warms by 20 K, and twice as fast the other way.
    for (drift, error) in [(1e-3 / 120.0, 0.0077), (-1e-3 / 60.0, -0.004)] {
        let mut chip = OwnClock::new(error, 120e6);
        chip.drift = drift;
        let (all, polled) = scans(chip);
        let on_us = polled.chip.bus.on_us.unwrap();
        // The times that the chip's samples were made at, summed up independently.
        let mut made_us = std::vec![on_us];
        while made_us.len() < all.len() + 1_000 {
            let last = made_us[made_us.len() - 1];
            let since_s = (last - on_us) * 1e-6;
            let since_s = if made_us.len() == 1 { 0.0 } else { since_s };
            made_us.push(last + 1000.0 * (1.0 + error) * (1.0 + drift * since_s));
        }
        let period_us = |k: usize| made_us[k + 1] - made_us[k];
        // A filter of level and slope with the gains of a line over n samples lags behind a slope that changes: by change n² / 6 in level and change 2 n / 3 in
        // slope. With n = 10 000 samples of a millisecond these are 16.7 s² and 6.7 s.
        let (level_us, slope) = (16.7e6 * drift.abs(), 6.7 * drift.abs());
        for scan in all.iter().skip(20_000) {
            let k = scan.counts.accel[0] as usize;
            let off_us = scan.tick_us as f64 + 7_000.0 - made_us[k];
            assert!(
                off_us.abs() < 1.2 * level_us + 40.0,
                "{drift} {k}: {off_us}"
            );
            let off = f64::from(scan.period_ns) * 1e-3 / period_us(k) - 1.0;
            assert!(off.abs() < 1.2 * slope + 20e-6, "{drift} {k}: {off:e}");
        }
    }
}

#[test]
fn samples_that_a_starved_reader_loses_are_missing_from_the_numbers_and_no_others() {
    for (starved_ms, error) in [
        (50.0, 0.01),
        (100.0, -0.02),
        (150.0, 0.03),
        (700.0, -0.03),
        (1900.0, 0.03),
    ] {
        let mut chip = OwnClock::new(error, 9e6);
        chip.starved_us = Some([4e6, 4e6 + 1000.0 * starved_ms]);
        let (all, _) = scans(chip);
        let mut lost = 0;
        for pair in all.windows(2) {
            let made = pair[1].counts.accel[0] - pair[0].counts.accel[0];
            assert_eq!((pair[1].number - pair[0].number) as i32, made);
            lost += made - 1;
        }
        // The FIFO keeps 101 ms.
        let expected = starved_ms / (1.0 + error) - CAPACITY as f64;
        assert!(
            (f64::from(lost) - expected.max(0.0)).abs() < 2.5,
            "{starved_ms}: {lost}"
        );
    }
}

#[test]
fn a_sample_without_a_valid_reading_is_a_lost_one() {
    let mut chip = OwnClock::new(0.0123, 2e6);
    chip.invalid = std::vec![1000, 1001, 1500];
    let (all, _) = scans(chip);
    let gaps: Vec<_> = (all.windows(2))
        .filter(|pair| pair[1].number != pair[0].number + 1)
        .map(|pair| (pair[0].counts.accel[0], pair[1].number - pair[0].number))
        .collect();
    assert_eq!(gaps, [(999, 3), (1499, 2)]);
}

#[test]
fn a_chip_that_was_gone_is_started_again_and_the_numbers_go_on_by_the_crystal() {
    let mut chip = OwnClock::new(-0.02, 6e6);
    chip.gone_us = Some([2e6, 3.5e6]);
    let (all, polled) = scans(chip);
    let period_us = polled.chip.bus.period_us;
    let (before, after) = (all.iter())
        .zip(&all[1..])
        .find(|(a, b)| b.number > a.number + 1)
        .unwrap();
    let gone_us = (after.tick_us - before.tick_us) as f64;
    assert!((1.5e6..1.65e6).contains(&gone_us), "{gone_us}");
    let samples = f64::from(after.number - before.number);
    assert!((samples - gone_us / period_us).abs() <= 1.5, "{samples}");
    // In order, and the rate as before from the first sample on.
    assert!(all.windows(2).all(|pair| pair[1].tick_us > pair[0].tick_us));
    assert!((f64::from(after.period_ns) / period_us - 1000.0).abs() < 0.2);
}
