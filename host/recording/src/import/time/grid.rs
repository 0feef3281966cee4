//! Good stamps: each interval is one period, or several where samples are missing.
//!
//! Loggers that lose samples, or that record in bursts with pauses, write stamps that need no correction. A line through the sample count would
//! spread the missing time over all samples: it made 188.5 Hz of a flight log with intervals of 4 and 8 ms, with stamps off by 17 ms.

use super::gap::{Gap, Jitter, STALL_S, quantile};

/// How far an interval may be from a multiple of the period, in periods. Stamps in ms of a sensor at 60 Hz are off by 0.06; stamps of samples that
/// were handed over late are off by much more.
const NEAR: f64 = 0.25;
/// Intervals this close to a multiple come from exact stamps.
pub(super) const EXACT: f64 = 0.02;
/// A longer interval, in periods, is a pause, after which samples may begin at any instant.
const PAUSE: f64 = 8.0;
/// Largest share of intervals that are neither multiples nor pauses.
const ODD: f64 = 0.002;
/// Least share of intervals of one period: a small enough period would divide any intervals.
const SINGLE: f64 = 0.2;
/// Low quantile of the intervals, which is one period if a fifth of the intervals are that short.
const LOW: f64 = 0.05;
/// Number of values from which a quantile over a long file is computed.
pub(super) const SAMPLED: usize = 20_000;

/// Samples closer to each other than this, in s, were fetched from a buffer.
const FETCHED_S: f64 = 1e-3;
/// Samples farther apart than this, in s, were not: a bus or a serial line hands over a sample in 0.05 to 3 ms.
const SAMPLED_S: f64 = 4e-3;
/// Long intervals in a window. If stamps are those of hand-overs, all windows last equally long.
const IN_WINDOW: usize = 16;
/// From this many windows on, one may last longer than the others.
const FEW_WINDOWS: usize = 8;

/// Stamps that are kept.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Grid {
    /// Time between samples, s.
    pub period_s: f64,
    pub gaps: Vec<Gap>,
    /// How far intervals are from multiples of the period.
    pub jitter: Jitter,
    /// Whether all are exact.
    pub exact: bool,
    /// Whether there are pauses.
    pub pauses: bool,
}

/// How to interpret the intervals of stamps.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Steps {
    /// As multiples of a period.
    Multiples(Grid),
    /// As samples that a buffer hands over in bursts, although the intervals are multiples of a period.
    HandedOver {
        /// Period within a burst, s.
        within_s: f64,
        /// Usual time between samples over several hand-overs, s.
        mean_s: f64,
        /// Time between two hand-overs, s; one in twenty is longer.
        apart_s: f64,
    },
    /// As neither.
    Irregular,
}

/// Interprets the intervals of `stamps`, s. A known `rate_hz` decides between pauses and hand-overs in bursts.
pub(super) fn read(stamps: &[f64], rate_hz: Option<f64>) -> Steps {
    let Some(period_s) = base_period(stamps) else {
        return Steps::Irregular;
    };
    // Repeated with the period of all rows, so that even a pause of a thousand periods is counted to less than one.
    let refined = multiples(stamps, period_s).and_then(|grid| multiples(stamps, grid.period_s));
    match refined {
        None => Steps::Irregular,
        Some(grid) => match handed_over(stamps, period_s, rate_hz) {
            Some([mean_s, apart_s]) => Steps::HandedOver {
                within_s: period_s,
                mean_s,
                apart_s,
            },
            None => Steps::Multiples(grid),
        },
    }
}

/// The period, s: first the mean of the shortest intervals, then also of intervals of a few periods.
fn base_period(stamps: &[f64]) -> Option<f64> {
    let stride = stamps.len().div_ceil(SAMPLED);
    let pairs = stamps.windows(2).step_by(stride);
    let mut steps: Vec<f64> = pairs.map(|w| w[1] - w[0]).filter(|s| *s > 0.0).collect();
    if steps.is_empty() {
        return None;
    }
    let mut period = quantile(&mut steps, LOW);
    for round in 0..4 {
        let most = if round < 2 { 1.0 } else { PAUSE };
        let near = if round < 2 { 0.4 } else { NEAR };
        let (mut sum, mut count) = (0.0, 0.0);
        for step in &steps {
            let whole = (step / period).round();
            if (1.0..=most).contains(&whole) && (step / period - whole).abs() <= near {
                (sum, count) = (sum + step, count + whole);
            }
        }
        if count > 0.0 {
            period = sum / count;
        }
    }
    Some(period)
}

/// The stamps as a grid of samples `period_s` apart, if they fit one.
fn multiples(stamps: &[f64], period_s: f64) -> Option<Grid> {
    let mut grid = Grid {
        period_s,
        gaps: Vec::new(),
        jitter: Jitter::default(),
        exact: true,
        pauses: false,
    };
    let (mut odd, mut single, mut near, mut squares) = (0_usize, 0_usize, 0_usize, 0.0);
    let (mut sum_s, mut periods) = (0.0, 0.0);
    // The first sample of a burst is sometimes late, because its reader had other work before it.
    let mut after_pause = true;
    for (i, pair) in stamps.windows(2).enumerate() {
        let step = (pair[1] - pair[0]) / period_s;
        if !(step > 0.0) {
            return None;
        }
        let whole = step.round();
        let off = (step - whole).abs();
        if step > PAUSE {
            grid.pauses = true;
        } else if whole >= 1.0 && off <= NEAR {
            single += usize::from(whole == 1.0);
            grid.exact &= off < EXACT;
            if !after_pause {
                near += 1;
                squares += off * off;
                (sum_s, periods) = (sum_s + pair[1] - pair[0], periods + whole);
                grid.jitter.max_s = grid.jitter.max_s.max(off * period_s);
            }
        } else {
            odd += usize::from(!(after_pause && step < 1.0));
            grid.exact = false;
        }
        if whole > 1.0 {
            grid.gaps.push(Gap {
                row: i as u64 + 1,
                missing: whole as u64 - 1,
            });
        }
        after_pause = step > PAUSE;
    }
    let steps = (stamps.len() - 1) as f64;
    if odd as f64 > ODD * steps || (single as f64) < SINGLE * steps {
        return None;
    }
    if periods > 0.0 {
        grid.period_s = sum_s / periods;
    }
    grid.jitter.rms_s = (squares / near.max(1) as f64).sqrt() * period_s;
    if grid.exact {
        grid.jitter = Jitter::default();
    }
    Some(grid)
}

/// The mean time between samples and the time between hand-overs, s, if the long intervals separate hand-overs of samples that were taken steadily,
/// and nothing is missing.
///
/// Then all segments with the same number of samples last equally long, to within one hand-over. If samples are lost or the logger pauses, segments
/// differ, or the samples of a burst are as far apart as only a sensor takes them.
fn handed_over(stamps: &[f64], period_s: f64, rate_hz: Option<f64>) -> Option<[f64; 2]> {
    let steps = || stamps.windows(2).map(|pair| pair[1] - pair[0]);
    let mut long: Vec<f64> = steps().filter(|s| *s > 1.5 * period_s).collect();
    let rows = stamps.len() - 1;
    if long.len() < 2 {
        return None;
    }
    let longest = quantile(&mut long, 0.95);
    let window = (IN_WINDOW * rows / long.len()).clamp(1, rows);
    let ends = stamps.iter().step_by(window);
    let mut lasts: Vec<f64> = ends.clone().zip(ends.skip(1)).map(|(a, b)| b - a).collect();
    let usual = quantile(&mut lasts, 0.5);
    let mean_s = usual / window as f64;
    if let Some(rate) = rate_hz {
        let off = |period: f64| (rate * period).ln().abs();
        return (off(mean_s) < off(period_s)).then_some([mean_s, longest]);
    }
    if longest > STALL_S {
        return None;
    }
    if period_s < FETCHED_S && mean_s > 2.0 * period_s {
        return Some([mean_s, longest]);
    }
    let alike = lasts
        .iter()
        .filter(|last| (*last - usual).abs() <= 1.5 * longest);
    // A lost hand-over makes one window longer; of few windows, one is more than the share.
    let odd = lasts.len() - alike.count();
    let few = usize::from(lasts.len() >= FEW_WINDOWS);
    let steady = lasts.len() >= 4 && odd <= few.max(lasts.len() / 20);
    // Alternating intervals of one and two periods come from a clock with coarse ticks.
    (steady && (period_s <= SAMPLED_S || longest < 2.5 * period_s)).then_some([mean_s, longest])
}
