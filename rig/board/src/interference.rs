//! Faults of the line from the device: garbled bytes.

use mimu_rig::random::Random;

/// The unit of `per_million`.
pub(crate) const MILLION: u32 = 1_000_000;

/// Garbles bytes.
#[derive(Debug)]
pub(crate) struct Interference {
    random: Random,
    /// Garbled bytes per million.
    per_million: u32,
    /// The next so many bytes are all garbled.
    burst: u64,
}

impl Interference {
    /// Garbles nothing yet. The seed decides which bytes are garbled later.
    pub(crate) fn new(seed: u64) -> Self {
        Self {
            random: Random::new(seed, "line from the device"),
            per_million: 0,
            burst: 0,
        }
    }

    /// Garbles so many of a million bytes from now on.
    pub(crate) fn garble(&mut self, per_million: u32) {
        self.per_million = per_million;
    }

    /// Garbles the next `count` bytes.
    pub(crate) fn burst(&mut self, count: u64) {
        self.burst = count;
    }

    /// Garbles bytes on the line. Returns how many were changed.
    pub(crate) fn pass(&mut self, bytes: &mut [u8]) -> u64 {
        let mut garbled = 0;
        for byte in bytes {
            let struck = self.burst > 0
                || self.per_million > 0
                    && self.random.uniform() * f64::from(MILLION) < f64::from(self.per_million);
            self.burst = self.burst.saturating_sub(1);
            if struck {
                // Any bit pattern except zero, so that a garbled byte always differs.
                *byte ^= 1 + (self.random.word() % 255) as u8;
                garbled += 1;
            }
        }
        garbled
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Indices, among `count` bytes, of those that arrive changed.
    fn struck(interference: &mut Interference, count: usize) -> Vec<usize> {
        let sent: Vec<u8> = (0..count).map(|k| k as u8).collect();
        let mut come = sent.clone();
        let garbled = interference.pass(&mut come);
        let others: Vec<usize> = (0..count).filter(|&k| come[k] != sent[k]).collect();
        assert_eq!(garbled, others.len() as u64);
        others
    }

    #[test]
    fn a_burst_strikes_the_next_bytes_and_no_other() {
        let mut interference = Interference::new(1);
        assert_eq!(struck(&mut interference, 1000), [0; 0]);
        interference.burst(5);
        assert_eq!(struck(&mut interference, 3), [0, 1, 2]);
        assert_eq!(struck(&mut interference, 1000), [0, 1]);
    }

    #[test]
    fn so_many_of_a_million_are_struck_and_the_seed_says_which() {
        let [mut one, mut same, mut other] = [1, 1, 2].map(Interference::new);
        for interference in [&mut one, &mut same, &mut other] {
            interference.garble(10_000);
        }
        let first = struck(&mut one, 100_000);
        // 1000 expected, with a standard deviation of 31.
        assert!((850..1150).contains(&first.len()), "{}", first.len());
        assert_eq!(first, struck(&mut same, 100_000));
        assert_ne!(first, struck(&mut other, 100_000));
        one.garble(0);
        assert_eq!(struck(&mut one, 100_000), [0; 0]);
    }
}
