//! Readings that a firmware puts together wrongly from two bytes: unsigned for signed, too large for 16 bits, or with a signed low byte.

use super::{Fault, Finding};
use crate::columns::RAW_COLUMNS;
use crate::signed_low_byte::corrected;

/// Number of codes of 16 bits, and the lowest of a signed reading.
const CODES: f64 = 65_536.0;
const LOWEST_SIGNED: f64 = -32_768.0;
/// Fewest jumps across all codes that are no single damaged readings.
const FEWEST_ACROSS: u64 = 3;

/// The finding about the first `readings` of channel `c` if they jump between the ends of 16 bits.
pub fn across_16_bits(c: usize, readings: &[f64]) -> Option<Finding> {
    let jumps = readings.windows(2).map(|w| (w[1] - w[0]).abs());
    let jumps = jumps.filter(|jump| *jump > 0.9 * CODES).count() as u64;
    let within = |lowest: f64| {
        let mut known = readings.iter().filter(|reading| !reading.is_nan());
        known.all(|r| r.fract() == 0.0 && (lowest..lowest + CODES).contains(r))
    };
    let fault = match jumps {
        0..FEWEST_ACROSS => return None,
        _ if within(0.0) => Fault::Unsigned,
        _ if within(LOWEST_SIGNED) => Fault::Overflow,
        _ => return None,
    };
    Some(Finding::new(RAW_COLUMNS[c], jumps, fault))
}

/// Fewer pairs of samples between which the error came or went prove nothing.
const FEWEST: u64 = 12;
/// Share of such pairs that must be nearer to each other when the fault is undone. If there is a fault, nearly all are. Otherwise none are
/// in a quiet signal, and half of them if the noise exceeds a byte.
const SHARE: f64 = 0.9;
/// If the signal moves by this many counts per sample next to a pair, it is too fast for the pair to count: in turns by hand at 100 Hz it
/// may move by a whole byte.
const FAST: f64 = 64.0;

/// Finds readings whose low byte a firmware took for a signed number, in the samples of a channel as they come.
///
/// Such a reading is 256 counts too low if its low byte is 128 or more. The low byte itself is right, so the fault can be undone. When the low byte
/// passes 128, the error appears or disappears between two samples, and the readings jump by 256 counts while the signal moves by a few. A
/// calibration could not fit this as an effect. It would take the share of time that a bit is set from the noise of the dwells, which contains the
/// jumps: the coefficient was wrong by 40 to 64 counts of 256.
#[derive(Debug, Clone, Default)]
pub struct SignedLowByteFinder {
    /// Up to three samples before the next one.
    before: Vec<f64>,
    /// Pairs of neighbours, in a slow signal, of which exactly one has a low byte of 128 or more.
    pairs: u64,
    /// Those that are nearer to each other when the fault is undone.
    nearer: u64,
    fractions: bool,
}

impl SignedLowByteFinder {
    /// Looks at the samples of a block.
    pub fn push(&mut self, samples: &[f64]) {
        for &sample in samples {
            if !sample.is_finite() {
                self.before.clear();
                continue;
            }
            self.fractions |= sample.fract() != 0.0;
            if let [a, b, c] = self.before[..] {
                self.look([a, b, c, sample]);
                self.before.remove(0);
            }
            self.before.push(sample);
        }
    }

    /// Looks at the pair in the middle of four samples.
    fn look(&mut self, [a, b, c, d]: [f64; 4]) {
        let is_low = |v: f64| corrected(v) != v;
        let slow = |v: f64, w: f64| is_low(v) == is_low(w) && (w - v).abs() < FAST;
        if is_low(b) != is_low(c) && slow(a, b) && slow(c, d) {
            self.pairs += 1;
            self.nearer += u64::from((corrected(c) - corrected(b)).abs() < (c - b).abs());
        }
    }

    /// The finding about channel `c`, whose rows are the sample pairs that show the fault; `None` if the readings are not whole counts.
    pub fn found(&self, c: usize) -> Option<Finding> {
        let shown = self.nearer >= FEWEST && self.nearer as f64 > SHARE * self.pairs as f64;
        let fault = Fault::SignedLowByte;
        (shown && !self.fractions).then(|| Finding::new(RAW_COLUMNS[c], self.nearer, fault))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 131 counts per deg/s at a rate that swings by 3 deg/s, with noise.
    fn signal(noise: f64) -> Vec<f64> {
        let mut state = 1_u32;
        let mut even = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state) / f64::from(u32::MAX) - 0.5
        };
        let swing = (0..4000).map(|k| 400.0 * (f64::from(k) * 0.01).sin() - 60.0);
        swing.map(|v| (v + noise * even()).round()).collect()
    }

    /// Reads like that firmware: `(high << 8) + (int8_t)low`.
    fn read(signal: &[f64]) -> Vec<f64> {
        let of = |v: &f64| {
            let [high, low] = (*v as i16).to_be_bytes();
            (f64::from(high as i8) * 256.0) + f64::from(low as i8)
        };
        signal.iter().map(of).collect()
    }

    fn found(samples: &[f64]) -> Option<Finding> {
        let mut finder = SignedLowByteFinder::default();
        samples.chunks(50).for_each(|block| finder.push(block));
        finder.found(0)
    }

    #[test]
    fn a_low_byte_taken_for_a_signed_number_is_found_and_undone() {
        for noise in [2.0, 40.0, 150.0] {
            let signal = signal(noise);
            let read = read(&signal);
            assert!(found(&read).is_some(), "{noise}");
            let undone: Vec<f64> = read.iter().map(|r| corrected(*r)).collect();
            assert_eq!(undone, signal);
        }
    }

    #[test]
    fn sound_readings_are_left_alone_whatever_their_noise() {
        for noise in [2.0, 40.0, 300.0, 3000.0] {
            assert_eq!(found(&signal(noise)), None, "{noise}");
        }
        let volts: Vec<f64> = read(&signal(2.0)).iter().map(|v| v * 1e-3).collect();
        assert_eq!(found(&volts), None);
    }
}
