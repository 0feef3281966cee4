//! Good stamps: each step is one period or, where samples are missing, several of them.
//!
//! Loggers that lose samples, or that record in bursts with pauses, write stamps that need no mending. A line through the count of
//! samples would smear what is missing over all of them: a flight log with steps of 4 and 8 ms became 188.5 Hz with stamps off by 17 ms.

use super::gap::{Gap, Jitter, STALL_S, quantile};

/// How far a step may be from a multiple of the period, in periods. Stamps in ms of a sensor at 60 Hz are off by 0.06, and stamps of
/// samples that were handed over late by much more.
const NEAR: f64 = 0.25;
/// Steps this near to a multiple are those of exact stamps.
pub(super) const EXACT: f64 = 0.02;
/// A longer step, in periods, is a pause, after which samples may begin at any instant.
const PAUSE: f64 = 8.0;
/// Share of steps that may be neither.
const ODD: f64 = 0.002;
/// Least share of steps of one period: any steps are multiples of a period that is small enough.
const SINGLE: f64 = 0.2;
/// Low quantile of the steps, which is one period where at most four fifths of the steps are longer.
const LOW: f64 = 0.05;
/// Values that a quantile over a long file is taken from.
const SAMPLED: usize = 20_000;

/// Samples nearer to each other than this were fetched from a buffer, s.
const FETCHED_S: f64 = 1e-3;
/// Those farther from each other than this were not, s: a bus or a serial line hands over a sample in 0.05 to 3 ms.
const SAMPLED_S: f64 = 4e-3;
/// Long steps in a window that has to last as long as the others if stamps are those of a hand-over.
const IN_WINDOW: usize = 16;
/// Windows of which one may last longer than the others.
const FEW_WINDOWS: usize = 8;

/// Stamps that are kept.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Grid {
    /// Time between samples, s.
    pub period_s: f64,
    pub gaps: Vec<Gap>,
    /// How far steps are from multiples of the period.
    pub jitter: Jitter,
    /// Whether all are exact.
    pub exact: bool,
    /// Whether there are pauses.
    pub pauses: bool,
}

/// How the steps of some stamps are to be read.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Steps {
    /// As multiples of a period.
    Multiples(Grid),
    /// As those of a hand-over of samples, which a buffer has kept, though they are multiples of a period.
    HandedOver {
        /// That period, s.
        within_s: f64,
        /// Time between samples as it mostly is over several hand-overs, s.
        mean_s: f64,
        /// Time between two hand-overs, s: that which one in twenty exceeds.
        apart_s: f64,
    },
    /// As neither.
    Irregular,
}

/// Reads the steps of `stamps`, s. `rate_hz` decides, where it is known, between pauses and a hand-over in bursts.
pub(super) fn read(stamps: &[f64], rate_hz: Option<f64>) -> Steps {
    let Some(period_s) = base_period(stamps) else {
        return Steps::Irregular;
    };
    // Again with the period of all rows: a pause of a thousand periods is counted to less than one.
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

/// The period that the shortest steps are, s: their mean, once with the steps of a few periods.
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

/// The stamps as those of samples `period_s` apart, if they are.
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
    // The first sample of a burst is late now and then, as whatever reads it has other work before it.
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

/// The mean time between samples and that between hand-overs, s, if long steps are those between two hand-overs of samples that were taken steadily, and nothing is missing.
///
/// Then any stretch of so many samples lasts as long as any other, but for one hand-over, however many come at once. Where
/// samples are lost or the logger pauses, it does not, or the samples of a burst are as far apart as only a sensor takes them.
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
    // A hand-over that was lost makes one window longer, and of few windows one is more than the share.
    let odd = lasts.len() - alike.count();
    let few = usize::from(lasts.len() >= FEW_WINDOWS);
    let steady = lasts.len() >= 4 && odd <= few.max(lasts.len() / 20);
    // Steps of one and two periods that take turns are those of a clock with coarse ticks.
    (steady && (period_s <= SAMPLED_S || longest < 2.5 * period_s)).then_some([mean_s, longest])
}
