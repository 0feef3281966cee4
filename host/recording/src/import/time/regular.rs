//! The regular time behind noisy stamps.
//!
//! A sensor samples by its own crystal, but the stamps come from the program that reads it: they are late when it is busy, and several come at once
//! when a buffer is handed over. The sample count is therefore the clock. The stamps show its rate, its beginning, and missing samples.
//!
//! This is done when foreign files are imported, not whenever a recording is read. Only the import knows the unit of the stamps and whether rows are
//! repeated. A recording then contains the times at which its samples were taken, so all its readers agree on its gaps. Recordings of our own device
//! have exact stamps, which must stay as they are.

use super::gap::{Gap, Jitter, quantile};
use super::grid::{self, SAMPLED, Steps};
use super::lateness::{Lateness, find_gaps};
use super::polled::{self, Rounds};

/// Missing samples up to this share of a burst cannot be detected: windows begin and end within a burst.
const HIDDEN: f64 = 0.1;
/// Fewest bursts from which a rate is computed.
const FEWEST_BURSTS: usize = 8;
/// A clock that is set back by more than this many periods is noticed.
const SET_BACK: f64 = 2.0;
/// If stamps are off the count by less than this many periods, samples are handed over one by one.
const LATE: f64 = 2.0;
/// A clock that wanders is off by less than this share of the time.
const WANDER: f64 = 1e-3;
/// Iterations of rate and gaps; each needs the other.
const ROUNDS: usize = 6;
/// Rows of a segment by which the unit of the stamps is recognised.
const SEGMENT: usize = 64;

/// Regular times of the rows of a file.
#[derive(Debug, Clone, PartialEq)]
pub(in super::super) struct Regular {
    /// Instant of the first row, s.
    pub start_s: f64,
    /// Time between samples, s.
    pub period_s: f64,
    /// In the order of their rows.
    pub gaps: Vec<Gap>,
    /// Whether the stamps are good and kept; the regular time is then not used.
    pub kept: bool,
    /// The rounds of a loop, if one read the unit once a round, however long that took. The stamps are then the times of the readings, and `period_s`
    /// is the usual round.
    pub polled: Option<Rounds>,
    /// Residuals of the stamps; for kept stamps, those of their intervals.
    pub jitter: Jitter,
    /// Period within bursts of stamps, s, if it may be the sensor's, with gaps between bursts.
    pub in_bursts_s: Option<f64>,
}

/// Why stamps have no regular time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) enum Irregular {
    /// Fewer than two rows at different times.
    Short,
    /// The clock is set back for good before that row.
    SetBack(usize),
    /// The stamps are off the sample count by this time, s, which no late hand-over explains.
    OffTheCount(f64),
}

impl Regular {
    /// The time behind `stamps`, s. A known `rate_hz` decides whether bursts are hand-overs or the samples have pauses.
    pub fn find(stamps: &[f64], rate_hz: Option<f64>) -> Result<Regular, Irregular> {
        let period_s = first_period(stamps).ok_or(Irregular::Short)?;
        if let Some(row) = set_back(stamps, period_s) {
            return Err(Irregular::SetBack(row));
        }
        let steps = grid::read(stamps, rate_hz);
        if let Steps::Multiples(grid) = &steps
            && grid.exact
        {
            return Ok(Self::of_grid(stamps, grid));
        }
        // The intervals within a burst of 32 samples are alike, but unrelated to the period.
        let (period_s, burst) = match steps {
            Steps::HandedOver {
                mean_s, apart_s, ..
            } => (mean_s, apart_s / mean_s),
            _ => (period_s, 0.0),
        };
        let mut counted = Self::by_count(stamps, period_s, HIDDEN * burst);
        if let Steps::HandedOver { apart_s, .. } = steps {
            counted.by_last_of_bursts(stamps, apart_s);
        }
        match steps {
            // Jitter of less than a period about the count is rounding, which the count removes.
            Steps::Multiples(grid) if grid.pauses || counted.jitter.max_s > grid.period_s => {
                return Ok(Self::of_grid(stamps, &grid));
            }
            Steps::HandedOver { within_s, .. } if within_s < 0.5 * counted.period_s => {
                counted.in_bursts_s = Some(within_s);
            }
            _ => {}
        }
        // After one pause of a loop, stamps are as far off the count as after a stall, but no samples come at once.
        if counted.jitter.max_s > LATE * counted.period_s
            && let Some(rounds) = polled::rounds(stamps)
        {
            return Ok(Self::of_rounds(stamps, rounds));
        }
        match counted.unexplained(stamps) {
            Some(off_s) => Err(Irregular::OffTheCount(off_s)),
            None => Ok(counted),
        }
    }

    /// The times of a counter of samples, whose `stamps` are its numbers over its rate, s. Each step of more than one period is a gap, however many
    /// there are. A counter that rises by more than 1 at least has this step as its period.
    pub fn of_counter(stamps: &[f64]) -> Result<Regular, Irregular> {
        let steps = || stamps.windows(2).map(|pair| pair[1] - pair[0]);
        let rising = steps().filter(|step| *step > 0.0);
        let period_s = rising.fold(f64::INFINITY, f64::min);
        if !period_s.is_finite() {
            return Err(Irregular::Short);
        }
        if let Some(back) = steps().position(|step| step < 0.0) {
            return Err(Irregular::SetBack(back + 1));
        }
        let gaps = (1..).zip(steps()).filter_map(|(row, step)| {
            let missing = (step / period_s).round() as u64;
            (missing > 1).then(|| Gap {
                row,
                missing: missing - 1,
            })
        });
        Ok(Self::kept(stamps, period_s, gaps.collect()))
    }

    /// Stamps that are kept.
    fn kept(stamps: &[f64], period_s: f64, gaps: Vec<Gap>) -> Regular {
        Regular {
            start_s: stamps[0],
            period_s,
            gaps,
            kept: true,
            polled: None,
            jitter: Jitter::default(),
            in_bursts_s: None,
        }
    }

    /// Stamps of a loop.
    fn of_rounds(stamps: &[f64], rounds: Rounds) -> Regular {
        Regular {
            polled: Some(rounds),
            ..Self::kept(stamps, rounds.usual_s, polled::gaps(stamps, &rounds))
        }
    }

    /// Stamps of a grid.
    fn of_grid(stamps: &[f64], grid: &grid::Grid) -> Regular {
        // After a pause the samples begin at any instant. A line through all would take the rounded number of missing samples for a change of rate.
        let period_s = match grid.pauses {
            true => grid.period_s,
            false => line(stamps, &numbers(stamps.len(), &grid.gaps), grid.period_s).1,
        };
        Regular {
            jitter: grid.jitter,
            ..Self::kept(stamps, period_s, grid.gaps.clone())
        }
    }

    /// The regular time by the count of samples, which are about `period_s` apart; a gap has more than `hidden` samples.
    ///
    /// Each false gap raises the rate, and so confirms itself: from a period that was 800 ppm off, bursts of 20 samples at 100 Hz converged to 5
    /// gaps. The line through all stamps, as if nothing were missing, is therefore a second start; the result with the smaller jitter is used.
    fn by_count(stamps: &[f64], period_s: f64, hidden: f64) -> Regular {
        let found = Self::iterate_rate_and_gaps(stamps, period_s, hidden);
        if found.gaps.is_empty() {
            return found;
        }
        let (_, whole_s) = line(stamps, &numbers(stamps.len(), &[]), period_s);
        let other = Self::iterate_rate_and_gaps(stamps, whole_s, hidden);
        match other.jitter.rms_s < found.jitter.rms_s {
            true => other,
            false => found,
        }
    }

    /// Iterates rate and gaps, each from the other, starting with `period_s`.
    fn iterate_rate_and_gaps(stamps: &[f64], mut period_s: f64, hidden: f64) -> Regular {
        let mut gaps = Vec::new();
        let mut start_s = stamps[0];
        for _ in 0..ROUNDS {
            let found = find_gaps(stamps, period_s, hidden);
            let numbers = numbers(stamps.len(), &found);
            let before = period_s;
            (start_s, period_s) = line(stamps, &numbers, before);
            let settled = found == gaps && (period_s / before - 1.0).abs() < 1e-9;
            gaps = found;
            if settled {
                break;
            }
        }
        let mut regular = Regular {
            start_s,
            kept: false,
            ..Self::kept(stamps, period_s, gaps)
        };
        regular.jitter = jitter(stamps, &regular);
        regular
    }

    /// Computes the rate and the missing samples of each gap from the last samples of bursts that are about `apart_s` apart: these samples have not
    /// waited.
    ///
    /// A line through all stamps is tilted by the lateness of half a burst at either end: 275 ppm in a minute of bursts of a second.
    fn by_last_of_bursts(&mut self, stamps: &[f64], apart_s: f64) {
        let is_last = |row: &usize| stamps[row + 1] - stamps[*row] > 0.5 * apart_s;
        let last: Vec<usize> = (0..stamps.len() - 1).filter(is_last).collect();
        if last.len() < FEWEST_BURSTS {
            return;
        }
        let lasts = |pair: &[usize]| stamps[pair[1]] - stamps[pair[0]];
        let rows = |pair: &[usize]| (pair[1] - pair[0]) as f64;
        let mut periods: Vec<f64> = last.windows(2).map(|p| lasts(p) / rows(p)).collect();
        let usual_s = quantile(&mut periods, 0.5);
        for gap in &mut self.gaps {
            let after = last.partition_point(|row| (*row as u64) < gap.row);
            if let Some(pair) = after.checked_sub(1).and_then(|k| last.get(k..k + 2)) {
                gap.missing = (lasts(pair) / usual_s - rows(pair)).round().max(0.0) as u64;
            }
        }
        self.gaps.retain(|gap| gap.missing > 0);
        let numbers = numbers(stamps.len(), &self.gaps);
        let at: Vec<f64> = last.iter().map(|row| stamps[*row]).collect();
        let of: Vec<u64> = last.iter().map(|row| numbers[*row]).collect();
        let (_, period_s) = line(&at, &of, self.period_s);
        let middle = numbers.iter().sum::<u64>() as f64 / numbers.len() as f64;
        self.start_s += (self.period_s - period_s) * middle;
        self.period_s = period_s;
        self.jitter = jitter(stamps, self);
    }

    /// Error of the stamps against the count, s, if it exceeds what late hand-overs and a wandering clock explain.
    fn unexplained(&self, stamps: &[f64]) -> Option<f64> {
        let steps = stamps.windows(2).map(|pair| pair[1] - pair[0]);
        let longest = steps.fold(0.0, f64::max);
        let span = stamps[stamps.len() - 1] - stamps[0];
        let most = (LATE * self.period_s).max(1.5 * longest).max(WANDER * span);
        (self.jitter.max_s > most).then_some(self.jitter.max_s)
    }

    /// The usual time from row to row, in the unit of the stamps: the median of the means over segments that contain a hand-over or two. Intervals
    /// between samples that are fetched together do not show the rate.
    pub fn interval(stamps: &[f64]) -> Option<f64> {
        let shortest = first_period(stamps)?;
        let rows = SEGMENT.min(stamps.len() - 1);
        let ends = (rows..stamps.len()).step_by(rows);
        let mut means: Vec<f64> = ends
            .map(|row| (stamps[row] - stamps[row - rows]) / rows as f64)
            .collect();
        let mean = quantile(&mut means, 0.5);
        Some(if mean > 0.0 { mean } else { shortest })
    }

    /// Time without samples in the longest gap of `stamps`, s: an interval minus one period.
    pub fn longest_gap_s(&self, stamps: &[f64]) -> f64 {
        let lasts = |gap: &Gap| match self.kept {
            true => {
                let row = gap.row as usize;
                stamps[row] - stamps[row - 1] - self.period_s
            }
            false => gap.missing as f64 * self.period_s,
        };
        self.gaps.iter().map(lasts).fold(0.0, f64::max)
    }

    /// How many samples are missing.
    pub fn missing(&self) -> u64 {
        self.gaps.iter().map(|gap| gap.missing).sum()
    }
}

fn jitter(stamps: &[f64], regular: &Regular) -> Jitter {
    let numbers = numbers(stamps.len(), &regular.gaps);
    let (mut sum, mut max_s) = (0.0, 0.0_f64);
    for (&t, n) in stamps.iter().zip(&numbers) {
        let off = t - (regular.start_s + *n as f64 * regular.period_s);
        sum += off * off;
        max_s = max_s.max(off.abs());
    }
    Jitter {
        rms_s: (sum / stamps.len() as f64).sqrt(),
        max_s,
    }
}

/// Numbers of the existing samples, counting the missing ones.
pub(super) fn numbers(rows: usize, gaps: &[Gap]) -> Vec<u64> {
    let mut gaps = gaps.iter().peekable();
    let mut missing = 0;
    let number = |row: u64| {
        while let Some(gap) = gaps.next_if(|gap| gap.row <= row) {
            missing += gap.missing;
        }
        row + missing
    };
    (0..rows as u64).map(number).collect()
}

/// The time between samples by the stamps alone, to a part in a thousand.
///
/// Within bursts, intervals are unrelated to the period; over many rows, some include a gap. So this is the mean interval over as few rows as make
/// the intervals agree within a quarter of a period.
fn first_period(stamps: &[f64]) -> Option<f64> {
    let mut best: Option<(f64, f64)> = None;
    let mut lag = 1;
    while lag < stamps.len() && (lag == 1 || 2 * lag < stamps.len()) {
        let count = stamps.len() - lag;
        let stride = count.div_ceil(SAMPLED);
        let steps = (0..count).step_by(stride);
        let mut steps: Vec<f64> = steps.map(|i| stamps[i + lag] - stamps[i]).collect();
        let (low, middle, high) = (
            quantile(&mut steps, 0.25),
            quantile(&mut steps, 0.5),
            quantile(&mut steps, 0.75),
        );
        let period = middle / lag as f64;
        if period > 0.0 {
            let near = |step: &&f64| (**step - middle).abs() <= 0.5 * period;
            let (mut sum, mut n) = (0.0, 0.0);
            for step in steps.iter().filter(near) {
                sum += step;
                n += 1.0;
            }
            let spread = (high - low) / lag as f64;
            if best.is_none_or(|(least, _)| spread < least) {
                best = Some((spread, sum / n / lag as f64));
            }
            if high - low < 0.25 * period {
                break;
            }
        }
        lag *= 4;
    }
    let span = stamps.last()? - stamps.first()?;
    let whole = || (span > 0.0).then(|| span / (stamps.len() - 1) as f64);
    best.map(|(_, period)| period).or_else(whole)
}

/// First row from which the clock stays behind: by more than a second, or by more than jitter explains.
///
/// Stamps that are late for a while recover at once or soon, and never fall behind the stamps before the delay.
fn set_back(stamps: &[f64], period: f64) -> Option<usize> {
    const AROUND: usize = 16;
    let behind = (20.0 * period).max(1.0);
    let late = Lateness { stamps, period };
    let drop = SET_BACK.max(8.0 * late.width());
    (1..stamps.len()).find(|&k| {
        let step = stamps[k] - stamps[k - 1];
        let (from, to) = (k.saturating_sub(AROUND), stamps.len().min(k + AROUND));
        let far = || {
            let mut before = stamps[from..k].to_vec();
            let mut after = stamps[k..to].to_vec();
            quantile(&mut after, 0.5) < quantile(&mut before, 0.5) - 0.5 * behind
        };
        let stays = || {
            let off = late.quantile(k..to, AROUND, 0.5) - late.quantile(from..k, AROUND, 0.5);
            off < -drop && off < 0.5 * step / period
        };
        let enough = k - from == AROUND && to - k == AROUND;
        step < -behind && far() || enough && step < -period && stays()
    })
}

/// Beginning and period of the straight line through sample numbers and stamps.
///
/// First Theil's line over the medians of blocks, which no single stamp moves, however late. Then the line of least squares, which is more precise,
/// without the stamps that are far off.
fn line(stamps: &[f64], numbers: &[u64], period: f64) -> (f64, f64) {
    let blocks = match stamps.len() {
        rows @ ..128 => rows,
        _ => 128,
    };
    let median = |from: usize, to: usize| {
        let stride = (to - from).div_ceil(SAMPLED / 16);
        let mut off: Vec<f64> = (from..to)
            .step_by(stride)
            .map(|i| stamps[i] - stamps[0] - numbers[i] as f64 * period)
            .collect();
        quantile(&mut off, 0.5)
    };
    let points: Vec<(f64, f64)> = (0..blocks)
        .map(|i| {
            let (from, to) = (i * stamps.len() / blocks, (i + 1) * stamps.len() / blocks);
            (
                0.5 * (numbers[from] + numbers[to - 1]) as f64,
                median(from, to),
            )
        })
        .collect();
    let half = blocks / 2;
    let mut slopes: Vec<f64> = points
        .iter()
        .zip(&points[blocks - half..])
        .map(|(a, b)| (b.1 - a.1) / (b.0 - a.0))
        .collect();
    let slope = quantile(&mut slopes, 0.5);
    let mut starts: Vec<f64> = points.iter().map(|(n, off)| off - slope * n).collect();
    let start = quantile(&mut starts, 0.5);
    let (start, slope) = least_squares(stamps, numbers, period + slope, start);
    (stamps[0] + start, slope)
}

/// The line of least squares through the stamps near the given line; both are relative to the first stamp.
fn least_squares(stamps: &[f64], numbers: &[u64], period: f64, start: f64) -> (f64, f64) {
    let off = |row: usize| stamps[row] - stamps[0] - numbers[row] as f64 * period - start;
    let stride = stamps.len().div_ceil(SAMPLED);
    let mut all: Vec<f64> = (0..stamps.len())
        .step_by(stride)
        .map(|row| off(row).abs())
        .collect();
    let far = 2.0 * quantile(&mut all, 0.9);
    let near = || (0..stamps.len()).map(|row| (numbers[row] as f64, off(row)));
    let near = || near().filter(|(_, off)| off.abs() <= far);
    let (mut count, mut mean_n, mut mean_off) = (0.0, 0.0, 0.0);
    for (n, off) in near() {
        count += 1.0;
        mean_n += (n - mean_n) / count;
        mean_off += (off - mean_off) / count;
    }
    let (mut of_squares, mut of_both) = (0.0, 0.0);
    for (n, off) in near() {
        of_squares += (n - mean_n) * (n - mean_n);
        of_both += (n - mean_n) * off;
    }
    let slope = if of_squares > 0.0 {
        of_both / of_squares
    } else {
        0.0
    };
    (start + mean_off - slope * mean_n, period + slope)
}

#[cfg(test)]
mod tests;
