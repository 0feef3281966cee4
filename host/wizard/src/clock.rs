//! Compares a board's clock with this computer's. Every rate of a gyro, and so its scale factor, errs by their ratio.

use mimu_recording::{ClockRate, Times};

/// Time over which the clocks are compared before a session begins, s.
pub(crate) const COMPARED_S: f64 = 2.0;
/// Fewest points of a comparison.
const LEAST: usize = 8;
/// Interval between two points after that, s. Each is the line of median delay.
const POINT_S: f64 = 1.0;
/// Points between two reports.
const REPORTED: usize = 10;
/// Uncertainty of the delay of a line, s: bytes wait for a USB frame, for the operating system and for the next read.
const DELAY_S: f64 = 0.02;
/// Uncertainty of the computer's own clock: its crystal keeps 50 ppm.
const COMPUTER_SHARE: f64 = 5e-5;

/// Times of lines by the board's clock and by the computer's, s.
#[derive(Debug, Default)]
pub(crate) struct Clocks {
    /// All lines of the first seconds.
    first: Vec<[f64; 2]>,
    /// A line of each second.
    points: Vec<[f64; 2]>,
    /// Lines of the present second.
    present: Vec<[f64; 2]>,
}

impl Clocks {
    /// Takes the time of a line. Returns a comparison every ten seconds.
    pub(crate) fn take(&mut self, board_s: f64, now_s: f64) -> Option<ClockRate> {
        if self.points.len() < LEAST {
            self.first.push([board_s, now_s]);
        } else {
            self.first.clear();
        }
        let begun = self.present.first().map_or(now_s, |p| p[1]);
        self.present.push([board_s, now_s]);
        if now_s - begun < POINT_S {
            return None;
        }
        // A garbled time is never the median.
        self.present
            .sort_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
        self.points.push(self.present[self.present.len() / 2]);
        self.present.clear();
        match self.points.len() % REPORTED {
            0 => self.rate(),
            _ => None,
        }
    }

    /// The comparison so far; `None` if it is too short.
    pub(crate) fn rate(&self) -> Option<ClockRate> {
        let of = match self.points.len() < LEAST {
            true => &self.first,
            false => &self.points,
        };
        let over_s = of.last()?[1] - of[0][1];
        if over_s < COMPARED_S || of.len() < LEAST {
            return None;
        }
        let later = &of[of.len() / 2..];
        let slopes = of.iter().zip(later);
        let slopes = slopes.map(|(a, b)| (b[0] - a[0]) / (b[1] - a[1]));
        let factor = quantile(slopes.collect(), 0.5)?;
        let off: Vec<f64> = of.iter().map(|p| p[0] - factor * p[1]).collect();
        let [low, high] = [0.16, 0.84].map(|share| quantile(off.clone(), share));
        // Delays of neighbours are alike: lines that arrive together shift an end by as much as they scatter, however many there are.
        let compared = (high? - low?).max(DELAY_S) / over_s;
        Some(ClockRate {
            factor,
            half_width: compared.hypot(COMPUTER_SHARE),
            over_s,
            times: Times::Board,
        })
    }
}

fn quantile(mut of: Vec<f64>, share: f64) -> Option<f64> {
    of.retain(|value| value.is_finite());
    of.sort_by(f64::total_cmp);
    let at = (share * of.len() as f64) as usize;
    of.get(at).copied()
}

#[cfg(test)]
mod tests {
    use mimu_recording::{REFUSED_SHARE, REPORTED_SHARE};

    use super::*;

    /// The rate found after `over_s` of a board with 100 lines a second, whose lines arrive up to 30 ms late and whose first second waited in a
    /// buffer. A line in a hundred has a garbled time.
    fn found(factor: f64, over_s: f64) -> Option<ClockRate> {
        let mut clocks = Clocks::default();
        for k in 0..(100.0 * over_s) as u32 {
            let written_s = 0.01 * f64::from(k);
            let late_s = 0.03 * (f64::from(k) * 0.618_034).fract();
            let board_s = match k % 100 {
                50 => 9e9,
                _ => factor * written_s,
            };
            clocks.take(board_s, written_s.max(1.0) + late_s);
        }
        clocks.rate()
    }

    #[test]
    fn the_interval_holds_the_rate_and_narrows_with_time() {
        assert_eq!(found(1.0, 1.5), None);
        for factor in [0.5, 0.97, 1.0, 1.003, 1.03, 2.5] {
            let mut widths = Vec::new();
            for over_s in [5.0, 30.0, 300.0] {
                let rate = found(factor, over_s).unwrap();
                assert!(
                    (rate.factor - factor).abs() <= rate.half_width,
                    "{factor}, {over_s} s: {}",
                    rate.words()
                );
                widths.push(rate.half_width);
            }
            assert!(
                widths[2] < 0.002 && widths[2] < 0.2 * widths[1],
                "{factor} {widths:?}"
            );
        }
    }

    #[test]
    fn a_clock_three_percent_fast_is_reported_and_one_by_six_refused_within_a_minute() {
        assert!(found(1.0, 60.0).unwrap().differs_by() == 0.0);
        let off = |factor| found(factor, 60.0).unwrap().differs_by();
        assert!(off(1.007) > REPORTED_SHARE && off(1.03) < REFUSED_SHARE);
        assert!(off(1.06) > REFUSED_SHARE && off(0.93) > REFUSED_SHARE);
        let rate = ClockRate {
            factor: 1.030_04,
            half_width: 0.000_21,
            over_s: 95.0,
            times: Times::Board,
        };
        let words = "the clock of its samples runs 1.03004 ± 0.00021 times as fast as the computer's, over 95 s";
        assert_eq!(rate.words(), words);
    }
}
