//! Finds readings at the end of a sensor's range, where nobody has said what that range is: a reading that stays exactly at its extreme.

/// Equal readings in a row at the extreme that are clipped. With a noise of a step or more, four equal ones at the extreme do not occur by chance.
const RUN: u32 = 4;
/// Share of repeated readings away from the extremes from which on a channel's steps are too coarse to tell.
const COARSE: f64 = 0.2;
/// Fewest readings before that is known.
const ENOUGH: f64 = 200.0;

/// Extremes of one channel.
#[derive(Debug, Clone, Copy)]
struct Channel {
    last: f64,
    extremes: [f64; 2],
    run: u32,
    /// Readings away from the extremes, and those of them that repeat the one before.
    others: [f64; 2],
}

impl Channel {
    /// Whether this reading is clipped.
    fn take(&mut self, value: f64) -> bool {
        let [low, high] = &mut self.extremes;
        (*low, *high) = (low.min(value), high.max(value));
        let repeats = value == self.last;
        self.last = value;
        if value > *low && value < *high {
            self.run = 1;
            self.others[0] += 1.0;
            self.others[1] += f64::from(repeats);
            return false;
        }
        self.run = if repeats { self.run + 1 } else { 1 };
        let [others, repeated] = self.others;
        self.run >= RUN && others > ENOUGH && repeated < COARSE * others
    }
}

/// Extremes of the six channels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rails([Channel; 6]);

impl Default for Rails {
    fn default() -> Self {
        Self(
            [Channel {
                last: f64::NAN,
                extremes: [f64::INFINITY, f64::NEG_INFINITY],
                run: 0,
                others: [0.0; 2],
            }; 6],
        )
    }
}

impl Rails {
    /// Whether a channel of this row is clipped. A row that repeats the row before in all channels is one that the board has sent again.
    pub(crate) fn take(&mut self, row: &[f64; 6]) -> bool {
        if (0..6).all(|c| self.0[c].last == row[c]) {
            return false;
        }
        // All channels are to be followed.
        let clipped = self
            .0
            .iter_mut()
            .zip(row)
            .filter_map(|(channel, value)| channel.take(*value).then_some(()));
        clipped.count() > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise of a few steps about `level`.
    fn noisy(k: u32, c: u32, level: f64) -> f64 {
        (level + 3.0 * ((f64::from(k + 7 * c) * 0.618_034).fract() - 0.5)).round()
    }

    /// Number of clipped rows of 2000, in which channel 2 swings and its range ends at `end`; `step` is the size of all steps.
    fn clipped(end: f64, step: f64) -> usize {
        let mut rails = Rails::default();
        let rows = (0..2000).filter(|k| {
            let swing = 900.0 * (f64::from(*k) / 40.0).sin();
            let mut row: [f64; 6] = std::array::from_fn(|c| noisy(*k, c as u32, 100.0));
            row[2] = noisy(*k, 2, swing).clamp(-end, end);
            rails.take(&row.map(|value| (value / step).round() * step))
        });
        rows.count()
    }

    #[test]
    fn a_range_that_ends_before_that_of_16_bits_is_found() {
        assert!(clipped(500.0, 1.0) > 500, "{}", clipped(500.0, 1.0));
        assert_eq!(clipped(2000.0, 1.0), 0);
    }

    #[test]
    fn steps_coarser_than_the_noise_are_no_end() {
        assert_eq!(clipped(2000.0, 300.0), 0);
    }

    #[test]
    fn a_row_that_is_sent_again_is_no_end() {
        let mut rails = Rails::default();
        for k in 0..1000 {
            rails.take(&std::array::from_fn(|c| noisy(k, c as u32, 100.0)));
        }
        let highest = [200.0; 6];
        assert!((0..50).all(|_| !rails.take(&highest)));
    }
}
