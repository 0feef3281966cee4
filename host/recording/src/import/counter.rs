//! Running numbers of samples that begin again at 0.

/// How many numbers the counters of 16 and of 32 bits have.
const SIZES: [f64; 2] = [65_536.0, 4_294_967_296.0];

/// A number that goes back from within so many of the end to within so many of 0 has begun again: ten seconds at 100 Hz may be lost
/// there. Anything else that goes back is another recording, or a mistake, and is not counted on.
const NEAR: f64 = 1000.0;

/// Counts on where a running number begins again.
#[derive(Debug, Clone, Default)]
pub(super) struct Counter {
    last: Option<f64>,
    before: f64,
    /// How often it began again.
    pub wraps: u64,
}

impl Counter {
    /// The number counted on; `number` is that of the next row.
    pub fn next(&mut self, number: f64) -> f64 {
        let last = self.last.replace(number).unwrap_or(number);
        let wrapped = |size: &f64| (*size - NEAR..*size).contains(&last) && number < NEAR;
        if let Some(size) = SIZES.into_iter().find(wrapped) {
            self.before += size;
            self.wraps += 1;
        }
        self.before + number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_counter_of_16_bits_goes_on_across_its_end_and_one_that_goes_back_elsewhere_does_not() {
        let mut counter = Counter::default();
        let all = [65_534.0, 65_535.0, 1.0, 2.0].map(|n| counter.next(n));
        assert_eq!(all, [65_534.0, 65_535.0, 65_537.0, 65_538.0]);
        assert_eq!(counter.wraps, 1);
        let mut counter = Counter::default();
        assert_eq!([40_000.0, 0.0].map(|n| counter.next(n)), [40_000.0, 0.0]);
        assert_eq!(counter.wraps, 0);
    }
}
