//! Converts lines that arrive irregularly into samples at a regular rate.
//!
//! A board samples at a steady rate, but USB and both systems delay its lines. Some arrive together, but none arrives early. The rate and the
//! sampling times are therefore taken from the least delayed lines. If even the least delayed line of the next half second is late by a period or
//! more, lines are missing. If the board sends its own clock, its times are treated in the same way, with almost no delay.

use std::collections::VecDeque;

use mimu::signal::increment::pause_periods;
use mimu_recording::units::median;

/// Time from which the rate is found, s. If the least delay varies by half a millisecond, the rate is known to 100 ppm: a twentieth of the target of
/// a gyro's scale factor by hand.
const FOUND_S: f64 = 5.0;
/// Number of parts of this time; the least delayed line of each is used.
const PARTS: usize = 10;
/// Fewest lines to find the rate.
const FEWEST: usize = 4 * PARTS;
/// Wait for a less delayed line, s. USB to serial converters buffer bytes for 16 ms, and a busy computer for 200.
const WINDOW_S: f64 = 0.5;
/// Time constant with which a drift between the clocks is followed, s.
const SMOOTHED_S: f64 = 2.0;
/// Delay that shows that a line is missing, in periods.
const LATE: f64 = 0.75;
/// Least such delay by the computer's clock, s: a system may be late by this much for half a second.
const JITTER_S: f64 = 2e-3;
/// If the clock advances by more than this, s, or goes back, three consecutive lines have to agree before it is believed.
const LEAP_S: f64 = 1.0;
/// See [`LEAP_S`].
const BELIEVED: usize = 3;

/// A line with its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timed {
    /// Time of arrival or, with a clock of the board, of sampling, s.
    pub t_s: f64,
    /// Gyro x, y, z, accelerometer x, y, z, raw.
    pub raw: [f64; 6],
    /// Magnetometer x, y, z, raw, if there is one.
    pub mag: Option<[f64; 3]>,
    /// Temperature, °C; NaN if unknown.
    pub temp_c: f64,
}

/// Assigns ticks to lines by their times.
#[derive(Debug)]
pub struct Regular {
    period_s: Option<f64>,
    /// Whether times are by the board's clock.
    own_clock: bool,
    waiting: VecDeque<Timed>,
    /// Tick of the next line if none is missing, and the earliest time at which it may come.
    tick: u64,
    due_s: Option<f64>,
    last_s: Option<f64>,
    odd: Vec<Timed>,
    garbled: u64,
}

impl Regular {
    /// With a known rate, or with one that is to be found. `tick`: tick of the first sample.
    pub fn new(rate_hz: Option<f64>, own_clock: bool, tick: u64) -> Self {
        Self {
            period_s: rate_hz.map(f64::recip),
            own_clock,
            waiting: VecDeque::new(),
            tick,
            due_s: None,
            last_s: None,
            odd: Vec::new(),
            garbled: 0,
        }
    }

    /// Sample rate, Hz, once it is known.
    pub fn rate_hz(&self) -> Option<f64> {
        self.period_s.map(f64::recip)
    }

    /// Lines that were discarded because their time is impossible.
    pub fn garbled(&self) -> u64 {
        self.garbled
    }

    /// Takes a line. Returns true if the board's clock has restarted: then all earlier samples are to be taken with [`Regular::rest`], and
    /// [`Regular::begin_anew`] continues with the later ones.
    pub fn take(&mut self, line: Timed) -> bool {
        let leaps = |last: f64, t: f64| self.own_clock && !(t > last && t <= last + LEAP_S);
        if self.last_s.is_some_and(|last| leaps(last, line.t_s)) {
            if self.odd.last().is_some_and(|odd| leaps(odd.t_s, line.t_s)) {
                self.garbled += self.odd.len() as u64;
                self.odd.clear();
            }
            self.odd.push(line);
            if self.odd.len() < BELIEVED {
                return false;
            }
            if self.odd.first().map(|o| o.t_s) <= self.last_s {
                return true;
            }
            self.waiting.extend(self.odd.drain(..));
        } else {
            self.garbled += self.odd.len() as u64;
            self.odd.clear();
            self.waiting.push_back(line);
        }
        self.last_s = Some(line.t_s);
        if self.period_s.is_none() {
            self.find();
        }
        false
    }

    /// Continues after a restart of the board. Its duration is unknown; it is assumed to be so long that no turn is integrated across it.
    pub fn begin_anew(&mut self) {
        self.waiting = self.odd.drain(..).collect();
        self.last_s = self.waiting.back().map(|l| l.t_s);
        self.due_s = None;
        self.tick += self.rate_hz().map_or(1, pause_periods);
    }

    /// The next sample with a certain tick. `now_s`: present time by the clock of the lines, if it is known without a line.
    pub fn certain(&mut self, now_s: Option<f64>) -> Option<(u64, Timed)> {
        let last = now_s.or(self.waiting.back().map(|l| l.t_s))?;
        let is = last - self.waiting.front()?.t_s >= WINDOW_S;
        is.then(|| self.settle()).flatten()
    }

    /// The next sample, certain or not.
    pub fn rest(&mut self) -> Option<(u64, Timed)> {
        self.settle()
    }

    fn settle(&mut self) -> Option<(u64, Timed)> {
        let period = self.period_s?;
        let first = *self.waiting.front()?;
        let due = self.due_s.unwrap_or(first.t_s);
        let near = self
            .waiting
            .iter()
            .take_while(|l| l.t_s <= first.t_s + WINDOW_S);
        let late = (0..)
            .zip(near)
            .map(|(k, l)| l.t_s - (due + f64::from(k) * period));
        let late = late.fold(f64::INFINITY, f64::min);
        let least = LATE * period;
        let least = if self.own_clock {
            least
        } else {
            least.max(JITTER_S)
        };
        let missing = match late > least {
            true => (late / period).round(),
            false => 0.0,
        };
        let late = late - missing * period;
        // No line arrives before it is sent. An early line shows that the others were late.
        let follow = if late < 0.0 {
            1.0
        } else {
            (period / SMOOTHED_S).min(1.0)
        };
        self.due_s = Some(due + (missing + 1.0) * period + follow * late);
        let tick = self.tick + missing as u64;
        self.tick = tick + 1;
        self.waiting.pop_front();
        Some((tick, first))
    }

    /// Finds the rate, if there are enough lines.
    fn find(&mut self) {
        let (Some(first), Some(last)) = (self.waiting.front(), self.waiting.back()) else {
            return;
        };
        if self.waiting.len() < FEWEST || last.t_s - first.t_s < FOUND_S {
            return;
        }
        let times: Vec<f64> = self.waiting.iter().map(|l| l.t_s).collect();
        self.period_s = Some(period(&times, self.own_clock));
    }
}

/// Period of lines from their times, despite delays and missing lines.
fn period(times: &[f64], own_clock: bool) -> f64 {
    match own_clock.then(|| by_intervals(times)).flatten() {
        Some(period) => period,
        None => by_least_delays(times, own_clock),
    }
}

/// Largest mean interval over the usual one, from which on the usual one is not taken for the period.
const SPARSE: f64 = 1.4;

/// Period of lines with stamps of the board: each interval is a whole number of periods, and most are one. Counted instead of divided by the number of
/// lines: 1 % of lost lines made the rate, and every scale factor of the gyro, 1 % wrong. `None` if the intervals are not alike, as of coarse
/// stamps.
fn by_intervals(times: &[f64]) -> Option<f64> {
    let intervals: Vec<f64> = times.windows(2).map(|t| t[1] - t[0]).collect();
    let mean = (times.last()? - times.first()?) / intervals.len() as f64;
    let mut period = median(intervals.clone()).unwrap_or(f64::NAN);
    if !(period > 0.0 && mean > 0.9 * period && mean < SPARSE * period) {
        return None;
    }
    for _ in 0..3 {
        // Straight line of the times over the counted periods.
        let mut count = 0.0;
        let mut points = vec![[0.0, 0.0]];
        for (interval, t) in intervals.iter().zip(&times[1..]) {
            count += (interval / period).round().max(1.0);
            points.push([count, t - times[0]]);
        }
        let n = points.len() as f64;
        let [mean_k, mean_t] = [0, 1].map(|i| points.iter().map(|p| p[i]).sum::<f64>() / n);
        let products = points.iter().map(|p| (p[0] - mean_k) * (p[1] - mean_t));
        let squares = points.iter().map(|p| (p[0] - mean_k).powi(2));
        period = products.sum::<f64>() / squares.sum::<f64>();
    }
    Some(period)
}

/// Share of the lines that may be missing.
const MISSING: f64 = 0.1;
/// Mean square distance from whole periods that supports a number of missing lines: a tenth of that of any times.
const WHOLE: f64 = 1.0 / 120.0;

/// The same by the least delayed lines.
fn by_least_delays(times: &[f64], own_clock: bool) -> f64 {
    let apart = times.len() / 5;
    let pairs = times.iter().zip(&times[apart..]);
    // A gap lies within a fifth of the pairs, and does not change their median.
    let slopes = pairs.map(|(a, b)| (b - a) / apart as f64);
    let mut period = median(slopes.collect()).unwrap_or(f64::NAN);
    let mut least = Vec::new();
    for _ in 0..3 {
        let late = |k: &usize| times[*k] - *k as f64 * period;
        let part = |n: usize| n * times.len() / PARTS..(n + 1) * times.len() / PARTS;
        least = (0..PARTS)
            .filter_map(|n| part(n).min_by(|a, b| late(a).total_cmp(&late(b))))
            .collect();
        let steps: Vec<f64> = least
            .windows(2)
            .map(|p| late(&p[1]) - late(&p[0]))
            .collect();
        let usual = median(steps.clone()).unwrap_or(f64::NAN);
        // Both ends of a step are least delays. From half a period on, a missing line is more likely than none.
        let limit = 0.5 * period + if own_clock { 0.0 } else { JITTER_S };
        let leaps = steps.iter().filter(|s| (*s - usual).abs() > limit);
        let missing: f64 = leaps.map(|s| ((s - usual) / period).round()).sum();
        let (first, last) = (least[0], least[PARTS - 1]);
        period = (times[last] - times[first]) / ((last - first) as f64 + missing);
    }
    if own_clock {
        return period;
    }
    // If lines are missing in most parts, their steps are alike. With the right period all least delayed lines are whole periods apart.
    let (first, last) = (least[0], least[PARTS - 1]);
    let (lines, span) = ((last - first) as f64, times[last] - times[first]);
    let off = |period: f64| {
        let each = least.iter().map(|k| (times[*k] - times[first]) / period);
        each.map(|k| (k - k.round()).powi(2)).sum::<f64>() / PARTS as f64
    };
    let missing = (0..=(MISSING * lines) as u32).map(|missing| span / (lines + f64::from(missing)));
    match missing.min_by(|a, b| off(*a).total_cmp(&off(*b))) {
        Some(best) if off(best) < WHOLE && off(best) < 0.25 * off(period) => best,
        _ => period,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Repeatable pseudo-random numbers from 0 to 1.
    fn chance(k: usize, of: f64) -> f64 {
        (k as f64 * of + (k * k) as f64 * 0.414_213_56).fract()
    }

    fn line(k: usize, t_s: f64) -> Timed {
        Timed {
            t_s,
            raw: [k as f64; 6],
            mag: None,
            temp_c: f64::NAN,
        }
    }

    /// Samples 0, 1, 2, … at this rate, lost and delayed by these functions. Returns the tick of each, minus that of the first.
    fn arrived(
        rate_hz: f64,
        count: usize,
        lost: impl Fn(usize) -> bool,
        delay_s: impl Fn(usize) -> f64,
    ) -> (f64, Vec<(usize, u64)>) {
        let mut regular = Regular::new(None, false, 0);
        let (mut all, mut now) = (Vec::new(), 0.0_f64);
        for k in (0..count).filter(|k| !lost(*k)) {
            now = now.max(k as f64 / rate_hz + delay_s(k));
            regular.take(line(k, now));
            while let Some((tick, line)) = regular.certain(None) {
                all.push((line.raw[0] as usize, tick));
            }
        }
        (regular.rate_hz().unwrap(), all)
    }

    fn holds(all: &[(usize, u64)], tolerated: u64) {
        let first = all[0].0 as u64;
        for (k, tick) in all {
            let off = (*k as u64 - first).abs_diff(*tick);
            assert!(off <= tolerated, "sample {k} has tick {tick}");
        }
    }

    #[test]
    fn lost_lines_do_not_change_the_rate() {
        for share in [0.01, 0.05] {
            let lost = |k: usize| chance(k, 0.754_877_67) < share;
            for rate in [50.0, 100.03, 400.0] {
                // Stamps in microseconds.
                let mut regular = Regular::new(None, true, 0);
                for k in (0..(6.0 * rate) as usize).filter(|k| !lost(*k)) {
                    regular.take(line(k, (1e6 * k as f64 / rate).round() / 1e6));
                }
                let found = regular.rate_hz().unwrap();
                assert!(
                    (found / rate - 1.0).abs() < 1e-5,
                    "{share} {found} of {rate}"
                );
            }
            for rate in [50.0, 100.03] {
                let delay = |k: usize| 1e-3 + 3e-3 * chance(k, 0.618).powi(2);
                let (found, all) = arrived(rate, (20.0 * rate) as usize, lost, delay);
                assert!(
                    (found / rate - 1.0).abs() < 1e-3,
                    "{share} {found} of {rate}"
                );
                holds(&all, 1);
            }
        }
    }

    #[test]
    fn lines_that_the_usb_delivers_together_are_apart_again_at_their_rate() {
        // Lines arrive in bundles every 16 ms, with a random delay, at least 4 ms.
        let bundle = |k: usize, rate: f64| {
            let t = k as f64 / rate;
            let poll = (t / 0.016).ceil();
            poll * 0.016 - t + 0.004 * chance(poll as usize, 0.618)
        };
        for rate in [23.7, 100.03, 333.0, 1000.2] {
            let count = (20.0 * rate) as usize;
            let (found, all) = arrived(rate, count, |_| false, |k| bundle(k, rate));
            assert!((found / rate - 1.0).abs() < 1e-3, "{found} of {rate}");
            holds(&all, 0);
            assert!(all.len() as f64 > 19.0 * rate);
        }
    }

    #[test]
    fn lines_that_were_dropped_are_missing_ticks_where_they_were() {
        let lost = |k: usize| [50, 250, 251, 900, 901, 902, 903].contains(&k) || k / 40 == 33;
        let (found, all) = arrived(100.0, 2000, lost, |k| 0.003 * chance(k, 0.618));
        assert!((found / 100.0 - 1.0).abs() < 1e-3, "{found}");
        holds(&all, 0);
    }

    #[test]
    fn a_computer_that_is_busy_for_a_while_loses_no_sample_and_no_time() {
        // Nothing is read for 0.3 s, four times.
        let busy = |k: usize| match k % 500 {
            k @ 0..30 => (30 - k) as f64 / 100.0,
            _ => 0.001 * chance(k, 0.618),
        };
        let (_, all) = arrived(100.0, 2000, |_| false, busy);
        holds(&all, 0);
    }

    #[test]
    fn a_board_that_pauses_has_taken_no_samples_meanwhile() {
        let pause = |k: usize| if k >= 800 { 0.25 } else { 0.0 };
        let (_, all) = arrived(100.0, 1600, |_| false, pause);
        let of = |k: usize| all.iter().find(|a| a.0 == k).unwrap().1;
        assert_eq!(of(799) - of(0), 799);
        assert_eq!(of(801) - of(799), 2 + 25);
    }

    #[test]
    fn clocks_that_drift_apart_make_no_sample_missing() {
        let (_, all) = arrived(
            200.0,
            40_000,
            |_| false,
            |k| {
                // A drift of 200 ppm that begins after the rate was found.
                let t = k as f64 / 200.0;
                0.001 * chance(k, 0.618) + 2e-4 * (t - 10.0).max(0.0)
            },
        );
        holds(&all, 0);
    }

    #[test]
    fn a_clock_in_whole_milliseconds_gives_a_rate_that_is_none_of_them() {
        let mut regular = Regular::new(None, true, 7);
        let mut ticks = Vec::new();
        for k in 0..6000 {
            if k != 4000 {
                let t_s = (k as f64 / 0.4).floor() / 1000.0;
                assert!(!regular.take(line(k, t_s)));
            }
            ticks.extend(std::iter::from_fn(|| regular.certain(None)));
        }
        let rate = regular.rate_hz().unwrap();
        assert!((rate / 400.0 - 1.0).abs() < 3e-4, "{rate}");
        for (tick, line) in ticks {
            assert_eq!(tick, 7 + line.raw[0] as u64);
        }
    }

    #[test]
    fn a_time_that_was_garbled_is_left_out_and_one_that_goes_back_for_good_is_a_restart() {
        let mut regular = Regular::new(Some(100.0), true, 0);
        for k in 0..300 {
            let t_s = match k {
                100 => 0.1,
                200 => 1e9,
                _ => k as f64 / 100.0,
            };
            assert!(!regular.take(line(k, t_s)), "{k}");
        }
        assert_eq!(regular.garbled(), 2);
        let begun: Vec<bool> = (0..3)
            .map(|k| regular.take(line(k, 0.01 * k as f64)))
            .collect();
        assert_eq!(begun, [false, false, true]);
        let before = std::iter::from_fn(|| regular.rest()).last().unwrap();
        assert_eq!(before.0, 299);
        regular.begin_anew();
        assert_eq!(regular.rest().unwrap().0, 300 + pause_periods(100.0));
    }
}
