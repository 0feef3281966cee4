//! A firmware that puts each reading together from two bytes and takes the low one for a signed number.
//!
//! A reading whose low byte is 128 or more comes 256 counts low. The low byte itself is right, so that the reading shows the fault and how to undo
//! it: from one sample to the next the error appears and goes as the low byte passes 128, and the readings jump by 256 counts where the
//! signal moves by a few. As an effect of a calibration it stays out of reach: the jumps are in the noise of the dwells, from which the share
//! of the time that a bit is set is found, and its coefficient erred by 40 to 64 counts of 256.

/// Values of a byte.
const BYTE: f64 = 256.0;
/// Fewer pairs of samples between which the error came or went prove nothing.
const FEWEST: u64 = 20;
/// Of all such pairs the fault brings nearly all nearer to each other when it is undone. Where it is absent, none of a quiet signal,
/// and half of those of noise above a byte.
const SHARE: f64 = 0.9;

/// What a reading is without the fault.
pub fn undone(reading: f64) -> f64 {
    match reading.rem_euclid(BYTE) >= 0.5 * BYTE {
        true => reading + BYTE,
        false => reading,
    }
}

/// Takes the samples of a channel in a stream.
#[derive(Debug, Clone, Default)]
pub(crate) struct Finder {
    /// Pairs of neighbours of which one has a low byte of 128 or more, and the other has not.
    pairs: u64,
    /// Those that are nearer to each other when the fault is undone.
    nearer: u64,
    fractions: bool,
}

impl Finder {
    /// Looks at the samples of a block.
    pub fn push(&mut self, samples: &[f64]) {
        for pair in samples.windows(2) {
            let [a, b] = [pair[0], pair[1]];
            if !(a.is_finite() && b.is_finite()) {
                continue;
            }
            self.fractions |= a.fract() != 0.0;
            let [free_a, free_b] = [a, b].map(undone);
            if (free_a == a) != (free_b == b) {
                self.pairs += 1;
                self.nearer += u64::from((free_b - free_a).abs() < (b - a).abs());
            }
        }
    }

    /// How many pairs of samples show the fault; `None` where it is absent, or readings are no whole counts.
    pub fn find(&self) -> Option<u64> {
        let shown = self.nearer >= FEWEST && self.nearer as f64 > SHARE * self.pairs as f64;
        (shown && !self.fractions).then_some(self.nearer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 131 counts per deg/s at a rate that swings by 3 deg/s, with noise that a generator of its own makes.
    fn signal(noise: f64) -> Vec<f64> {
        let mut state = 1_u32;
        let mut even = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state) / f64::from(u32::MAX) - 0.5
        };
        let swing = (0..4000).map(|k| 400.0 * (f64::from(k) * 0.01).sin() - 60.0);
        swing.map(|v| (v + noise * even()).round()).collect()
    }

    /// As that firmware does: `(high << 8) + (int8_t)low`.
    fn read(signal: &[f64]) -> Vec<f64> {
        let of = |v: &f64| {
            let [high, low] = (*v as i16).to_be_bytes();
            (f64::from(high as i8) * 256.0) + f64::from(low as i8)
        };
        signal.iter().map(of).collect()
    }

    fn found(samples: &[f64]) -> Option<u64> {
        let mut finder = Finder::default();
        samples.chunks(50).for_each(|block| finder.push(block));
        finder.find()
    }

    #[test]
    fn a_low_byte_taken_for_a_signed_number_is_found_and_undone() {
        for noise in [2.0, 40.0, 150.0] {
            let signal = signal(noise);
            let read = read(&signal);
            assert!(found(&read).is_some(), "{noise}");
            let undone: Vec<f64> = read.iter().map(|r| undone(*r)).collect();
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
