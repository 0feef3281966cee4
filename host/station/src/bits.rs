//! Bits of the codes that never change, and runs of equal readings.

/// Largest distance of a reading from a whole code, in codes: text files and scales round the last digits.
const WHOLE: f64 = 0.05;
/// Share of the readings in which a bit has to differ from the rest to count as changing. A single spike that crosses a power of two changes high bits
/// alone.
const CHANGES: f64 = 0.01;
/// Fewer readings do not show which bits change.
const FEWEST: usize = 200;

/// The codes behind `readings` with this quantisation step; `None` if they are not multiples of it. If the step was found in the readings, a stuck lowest bit cannot
/// be seen.
pub fn codes(readings: &[f64], step: f64) -> Option<Vec<i64>> {
    let code = |reading: &f64| {
        let code = reading / step;
        ((code - code.round()).abs() < WHOLE).then_some(code.round() as i64)
    };
    readings.iter().map(code).collect()
}

/// Number of bits that have one value in all `codes` although a higher bit changes; `None` if there are too few codes, or they are all alike.
///
/// A range of successive codes that crosses a multiple of 2^h contains the code below it, whose lower bits are all set, and the multiple itself, whose
/// lower bits are all clear. So every bit below one that changes has to change too.
pub fn stuck_bits(codes: &[i64]) -> Option<u32> {
    if codes.len() < FEWEST {
        return None;
    }
    let n = codes.len() as f64;
    let set = |bit: u32| codes.iter().filter(|c| (**c >> bit) & 1 == 1).count();
    let rarer = |bit: u32| set(bit).min(codes.len() - set(bit));
    let highest = (0..32).rev().find(|b| rarer(*b) as f64 > CHANGES * n)?;
    Some((0..highest).filter(|b| rarer(*b) == 0).count() as u32)
}

/// The longest run of equal readings.
pub fn equal_run(readings: &[f64]) -> usize {
    let runs = readings.chunk_by(|a, b| a == b).map(<[f64]>::len);
    runs.max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Codes about `level` with noise of `sigma` codes.
    fn noisy(level: f64, sigma: f64, seed: u64) -> Vec<i64> {
        let mut random = mimu_rig::random::Random::new(seed, "bits");
        let code = |_| (level + sigma * random.normal()).round() as i64;
        (0..2000).map(code).collect()
    }

    #[test]
    fn a_working_converter_has_no_stuck_bit_at_any_level_and_noise() {
        for sigma in [0.3, 0.7, 2.0, 9.0, 40.0] {
            for k in 0..200 {
                let level = f64::from(k) * 3.37 - 300.0;
                let found = stuck_bits(&noisy(level, sigma, k as u64 + 1));
                assert!(found.is_none_or(|n| n == 0), "{level} {sigma} {found:?}");
            }
        }
    }

    #[test]
    fn a_bit_that_is_always_set_or_clear_is_counted() {
        for bit in 0..4 {
            for level in [-77.0, 0.0, 1000.0, 2047.6] {
                let good = noisy(level, 20.0, 5);
                let set: Vec<i64> = good.iter().map(|c| c | (1 << bit)).collect();
                let clear: Vec<i64> = good.iter().map(|c| c & !(1 << bit)).collect();
                assert_eq!(stuck_bits(&set), Some(1), "{bit} {level}");
                assert_eq!(stuck_bits(&clear), Some(1), "{bit} {level}");
            }
        }
    }

    #[test]
    fn one_spike_does_not_make_bits_stuck() {
        let mut codes = noisy(40.0, 3.0, 9);
        codes[700] = 8192;
        assert_eq!(stuck_bits(&codes), Some(0));
    }

    #[test]
    fn codes_are_found_behind_a_scale() {
        let raw = noisy(120.0, 5.0, 3);
        let scaled: Vec<f64> = raw.iter().map(|c| *c as f64 / 16.4).collect();
        assert_eq!(codes(&scaled, 1.0 / 16.4), Some(raw));
        let none: Vec<f64> = scaled
            .iter()
            .enumerate()
            .map(|(k, v)| v + (k as f64).sin())
            .collect();
        assert_eq!(codes(&none, 1.0 / 16.4), None);
    }

    #[test]
    fn the_longest_run_is_that_of_a_channel_that_sticks() {
        let mut readings: Vec<f64> = noisy(0.0, 2.0, 4).iter().map(|c| *c as f64).collect();
        assert!(equal_run(&readings) < 10);
        readings[500..800].fill(3.0);
        assert!((300..310).contains(&equal_run(&readings)));
    }
}
