//! Readings at the end of a sensor's or a converter's range, where nobody has said what that range is.

use super::repeats::{RUN_LOG_ODDS, run_by_chance};
use super::{Fault, Finding};
use crate::columns::RAW_COLUMNS;

/// Natural logarithm of the odds against an extreme that coincides by chance with the end of some converter, or with the full scale of some part.
const FULL_SCALE_LOG_ODDS: f64 = 8.0;
/// Ends of the converters of almost all digital parts, which have 16 bits.
const ENDS_OF_16_BITS: [f64; 3] = [-32_768.0, 32_767.0, 65_535.0];
/// Full scales of gyros, deg/s, and of accelerometers, g, by data sheets.
const FULL_SCALES_DPS: [f64; 13] = [
    62.5, 75.0, 125.0, 150.0, 245.0, 250.0, 300.0, 450.0, 500.0, 1000.0, 2000.0, 2400.0, 4000.0,
];
const FULL_SCALES_G: [f64; 12] = [
    1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0, 20.0, 24.0,
];
/// What drivers multiply g by, m/s².
const GRAVITIES: [f64; 4] = [9.806_65, 9.80, 9.81, 9.807];
/// Largest relative difference from a full scale: drivers and imports round their factors to six digits.
const FULL_SCALE_SHARE: f64 = 3e-6;
/// Readings away from the extremes after which a stream has shown how often neighbours are equal.
const ENOUGH: u64 = 200;

/// The largest or the smallest reading of a channel, and what shows whether it is a rail.
#[derive(Debug, Clone, Copy)]
pub struct Extreme {
    /// The channel, 0 to 5.
    pub channel: usize,
    /// Whether it is the largest.
    pub high: bool,
    /// The reading.
    pub value: f64,
    /// How often it occurs.
    pub count: u64,
    /// How often it occurs in a row.
    pub longest: f64,
    /// Share of equal neighbours while the channel works, if it is known.
    pub repeats: Option<f64>,
}

impl Extreme {
    /// The finding if a complete recording ends at a rail; readings are multiples of `step`. `axes`: lowest and highest readings of the sensor's
    /// axes, if they are in SI.
    ///
    /// Each axis with the same extreme is evidence: before its first sample a part may read its full scale on all of them.
    pub fn rail(&self, step: Option<f64>, axes: &[[f64; 2]]) -> Option<Finding> {
        let of_codes = self.codes_log_odds(step);
        if of_codes > RUN_LOG_ODDS {
            return Some(self.finding(Fault::EndOfConverter { value: self.value }));
        }
        let is_same = |end: &f64| (end.abs() / self.value.abs() - 1.0).abs() < FULL_SCALE_SHARE;
        let same = axes.iter().filter(|ends| ends.iter().any(is_same)).count();
        let of_si = match is_full_scale(self.value, self.channel) {
            true => FULL_SCALE_LOG_ODDS * same as f64,
            false => 0.0,
        };
        if of_si > RUN_LOG_ODDS || of_si > 0.0 && self.longest > 1.0 {
            return Some(self.finding(Fault::FullScale { value: self.value }));
        }
        self.run(of_codes.max(of_si))
    }

    /// The finding about a run that chance does not explain. Only runs at the extreme are tested, so the length of the recording does not matter.
    fn run(&self, full_scale_log_odds: f64) -> Option<Finding> {
        let by_chance = run_by_chance(self.repeats?, RUN_LOG_ODDS - full_scale_log_odds)?;
        let Self {
            high,
            value,
            longest,
            ..
        } = *self;
        (longest > by_chance).then(|| {
            self.finding(Fault::RunAtEnd {
                high,
                value,
                longest,
                by_chance,
            })
        })
    }

    /// Natural logarithm of the odds against an extreme by chance at the end of a converter.
    ///
    /// A motion over thousands of codes that ends exactly at an end of their range was clipped there.
    fn codes_log_odds(&self, step: Option<f64>) -> f64 {
        let codes = self.value / step.unwrap_or(1.0);
        let whole = codes.round();
        // The scale factor of an import rounds the last digits.
        if (codes - whole).abs() > 1e-6 * whole.abs() {
            return 0.0;
        }
        if ENDS_OF_16_BITS.contains(&whole) {
            return f64::INFINITY;
        }
        let is_end = |bits: i32| whole == 2f64.powi(bits) - 1.0 || whole == -(2f64.powi(bits));
        match (7..=24).any(is_end) {
            true => FULL_SCALE_LOG_ODDS,
            false => 0.0,
        }
    }

    fn finding(&self, fault: Fault) -> Finding {
        Finding::new(RAW_COLUMNS[self.channel], self.count, fault)
    }
}

/// Whether a reading in SI is the full scale of a part. Readings in SI have no codes, but a motion seldom ends at exactly 250 deg/s.
fn is_full_scale(value: f64, c: usize) -> bool {
    let is = |full: f64| (value.abs() / full - 1.0).abs() < FULL_SCALE_SHARE;
    match c < 3 {
        true => FULL_SCALES_DPS.iter().any(|dps| is(dps.to_radians())),
        false => GRAVITIES
            .iter()
            .any(|gravity| FULL_SCALES_G.iter().any(|g| is(g * gravity))),
    }
}

/// Extremes so far of one channel of a stream.
#[derive(Debug, Clone, Copy)]
struct Channel {
    last: f64,
    extremes: [f64; 2],
    run: u32,
    /// Readings away from the extremes, and those of them that repeat the one before.
    others: [u64; 2],
}

/// Finds readings at a rail in a stream.
///
/// The extreme so far passes through many values, so that it equals a full scale now and then by chance. Only the ends of 16 bits and runs count
/// here; the recording is judged again when it is complete.
#[derive(Debug, Clone, Copy)]
pub struct StreamRails {
    counts: bool,
    channels: [Channel; 6],
}

impl StreamRails {
    /// `counts`: readings are codes of a converter.
    pub fn new(counts: bool) -> Self {
        let channel = Channel {
            last: f64::NAN,
            extremes: [f64::INFINITY, f64::NEG_INFINITY],
            run: 0,
            others: [0; 2],
        };
        Self {
            counts,
            channels: [channel; 6],
        }
    }

    /// The first finding about this row. A row that repeats the row before in all channels is one that the board has sent again.
    pub fn take(&mut self, row: &[f64; 6]) -> Option<Finding> {
        let again = (0..6).all(|c| self.channels[c].last == row[c]);
        let mut first = None;
        for (c, (channel, value)) in self.channels.iter_mut().zip(row).enumerate() {
            let run = (!again).then(|| channel.take(c, *value)).flatten();
            let at_end = self.counts && ENDS_OF_16_BITS[..2].contains(value);
            let end = Fault::EndOfConverter { value: *value };
            let end = at_end.then(|| Finding::new(RAW_COLUMNS[c], 1, end));
            first = first.or(end).or(run);
        }
        first
    }
}

impl Channel {
    fn take(&mut self, channel: usize, value: f64) -> Option<Finding> {
        let [low, high] = &mut self.extremes;
        (*low, *high) = (low.min(value), high.max(value));
        let high = value >= *high;
        let repeats = value == self.last;
        self.last = value;
        if value > *low && !high {
            self.run = 1;
            self.others[0] += 1;
            self.others[1] += u64::from(repeats);
            return None;
        }
        self.run = if repeats { self.run + 1 } else { 1 };
        let [others, repeated] = self.others;
        let extreme = Extreme {
            channel,
            high,
            value,
            count: u64::from(self.run),
            longest: f64::from(self.run),
            repeats: (others > ENOUGH).then(|| repeated as f64 / others as f64),
        };
        extreme.run(0.0)
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
        let mut rails = StreamRails::new(true);
        let rows = (0..2000).filter(|k| {
            let swing = 900.0 * (f64::from(*k) / 40.0).sin();
            let mut row: [f64; 6] = std::array::from_fn(|c| noisy(*k, c as u32, 100.0));
            row[2] = noisy(*k, 2, swing).clamp(-end, end);
            rails
                .take(&row.map(|value| (value / step).round() * step))
                .is_some()
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
        let mut rails = StreamRails::new(true);
        for k in 0..1000 {
            rails.take(&std::array::from_fn(|c| noisy(k, c as u32, 100.0)));
        }
        let highest = [200.0; 6];
        assert!((0..50).all(|_| rails.take(&highest).is_none()));
    }
}
