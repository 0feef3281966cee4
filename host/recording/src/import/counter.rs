//! Sample counters and time stamps that wrap around to 0.

use super::time::Stamp;

/// Number of values of counters of 8, 16 and 32 bits, and how close to its end and its beginning a counter has to be before and after a wrap. So ten
/// seconds at 100 Hz may be lost at the wrap of the longer ones. Any other step back is another recording or a mistake, and is kept unchanged.
const SIZES: [(f64, f64); 3] = [(256.0, 64.0), (65_536.0, 1000.0), (4_294_967_296.0, 1000.0)];

/// Number of values of the time stamps of microcontrollers, and of those that count a day or the week of satellite navigation in s or ms.
const STAMP_SIZES: [i64; 7] = [
    1 << 16,
    1 << 24,
    1 << 32,
    86_400,
    604_800,
    86_400_000,
    604_800_000,
];

/// Continues a sample counter across its wraps.
#[derive(Debug, Clone, Default)]
pub(super) struct Counter {
    last: Option<f64>,
    highest: f64,
    before: f64,
    /// How often it wrapped.
    pub wraps: u64,
}

/// A wrapped stamp is at most this many intervals after the one before. So a second at 100 Hz may be lost at the wrap.
const NEAR_INTERVALS: i64 = 100;

/// Continues time stamps across their wraps. Those of a microcontroller wrap in 16 bits of milliseconds after 65.5 s, in 32 bits of microseconds
/// after 71.6 min.
#[derive(Debug, Clone, Default)]
pub(super) struct StampCounter {
    last: Option<i64>,
    interval: i64,
    before: i64,
    restarted: bool,
    /// How often the logger started again.
    pub restarts: u64,
    /// How often they wrapped.
    pub wraps: u64,
}

/// Intervals between the last row before a restart and the first one behind it, if the clock started again: nobody knows how long it stood still.
const RESTART_INTERVALS: i64 = 100;

impl StampCounter {
    /// The logger has started again before the next row.
    pub fn restart(&mut self) {
        self.restarted = true;
        self.restarts += 1;
    }

    /// Whether there was a stamp that is later than 0.
    pub fn has_begun(&self) -> bool {
        self.last.is_some_and(|last| last > 0)
    }

    /// The stamp of the next row, without wraps.
    pub fn next(&mut self, stamp: Stamp) -> Stamp {
        let whole = stamp.whole();
        let last = self.last.replace(whole).unwrap_or(whole);
        let step = |size: i64| whole + size - last;
        let wrapped = |size: &i64| {
            last < *size && (1..=NEAR_INTERVALS * self.interval).contains(&step(*size))
        };
        if std::mem::take(&mut self.restarted) && whole < last {
            self.before += last - whole + RESTART_INTERVALS * self.interval.max(1);
        } else if whole < last
            && let Some(size) = STAMP_SIZES.into_iter().find(wrapped)
        {
            self.before += size;
            self.wraps += 1;
        } else if whole > last {
            self.interval = whole - last;
        }
        stamp.plus(self.before)
    }
}

impl Counter {
    /// The number of the next row, without wraps.
    pub fn next(&mut self, number: f64) -> f64 {
        let last = self.last.replace(number).unwrap_or(number);
        let wrapped = |(size, near): &(f64, f64)| {
            let ends = self.highest < *size && *size - near <= last;
            ends && number < last && number < *near
        };
        if let Some((size, _)) = SIZES.into_iter().find(wrapped) {
            self.before += size;
            self.wraps += 1;
        }
        self.highest = self.highest.max(number);
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

    #[test]
    fn stamps_of_16_24_and_32_bits_go_on_across_their_end_and_a_clock_that_is_set_back_does_not() {
        for (size, step) in [
            (1_i64 << 16, 10),
            (1 << 24, 10_000),
            (1 << 32, 5_000_000),
            (86_400, 1),
            (604_800_000, 10),
        ] {
            let mut counter = StampCounter::default();
            let first = size - 25 * step;
            for i in 0..60 {
                let stamp = Stamp::from((first + i * step) % size);
                assert_eq!(counter.next(stamp).whole(), first + i * step);
            }
            assert_eq!(counter.wraps, 1);
        }
        let mut counter = StampCounter::default();
        let back = [40_000, 40_010, 40_020, 0, 10].map(|n| counter.next(Stamp::from(n)).whole());
        assert_eq!(back, [40_000, 40_010, 40_020, 0, 10]);
        assert_eq!(counter.wraps, 0);
    }
}
