//! How late stamps are against a count of samples, and the gaps that this shows.

use super::gap::{Gap, STALL_S, quantile};
use crate::statistics::OF_MEDIAN;

/// An interval longer than this many periods may hide missing samples.
const LONG: f64 = 1.25;
/// Quantile of lateness by which two windows are compared. It is low, because delays only make stamps late; single early stamps do not move it.
const QUANTILE: f64 = 0.25;
/// Fewest and most samples in a window.
const WINDOW: std::ops::RangeInclusive<usize> = 8..=2048;
/// Samples in a window for each period of jitter.
const WINDOW_PER_JITTER: f64 = 48.0;
/// Largest share of later samples that may return to the time before a gap.
const BACK: f64 = 0.25;
/// Fewest missing samples that windows show. Single ones are distinguished from jitter as long as it varies by less.
const SMALLEST_GAP: f64 = 0.6;
/// A gap must exceed this many standard deviations of the difference of two windows.
const SIGMAS: f64 = 6.0;
/// Number of values from which a quantile over a window is computed.
const MOST: usize = 512;

/// The gaps that stamps show if samples are `period` apart.
///
/// A gap begins with a long interval, and the stamps after it stay late by whole samples; after jitter they return. The stamps after the interval are
/// judged by a low quantile over as many samples as the jitter requires, which the next gap does not move. Then it is checked whether a share of them
/// returns within the longest stall.
pub(super) fn find_gaps(stamps: &[f64], period: f64, hidden: f64) -> Vec<Gap> {
    let late = Lateness { stamps, period };
    let window =
        ((WINDOW_PER_JITTER * late.width()) as usize).clamp(*WINDOW.start(), *WINDOW.end());
    let least = SMALLEST_GAP.max(SIGMAS * late.noise(window)).max(hidden);
    let stall = ((STALL_S / period) as usize).clamp(8 * window, 1 << 20);
    let mut gaps: Vec<Gap> = Vec::new();
    let mut level = 0_u64;
    // Lateness of the rows to which a window may look back.
    let mut before: Vec<f64> = vec![0.0; window];
    let mut ahead: Option<Gap> = None;
    // At both ends there is less than a window to judge by: the last of several delayed bursts may alone be a sample late.
    let least_at = |row: usize| {
        let there = window.min(row).min(stamps.len() - row) as f64;
        match window > 2 * WINDOW.start() {
            true => least * (window as f64 / there).sqrt(),
            false => least,
        }
    };
    for row in 1..stamps.len() {
        before[(row - 1) % window] = late.at(row - 1) - level as f64;
        let long = stamps[row] - stamps[row - 1] > LONG * period;
        if ahead.is_none() && long {
            let past = &before[..row.min(window)];
            ahead = late.gap(row, window, stall, least_at(row), past, level as f64);
        }
        if let Some(gap) = ahead.take_if(|gap| gap.row <= row as u64) {
            level += gap.missing;
            gaps.push(gap);
        }
    }
    gaps
}

/// How late stamps are, in periods, before gaps are known.
pub(super) struct Lateness<'a> {
    pub stamps: &'a [f64],
    pub period: f64,
}

impl Lateness<'_> {
    fn at(&self, row: usize) -> f64 {
        (self.stamps[row] - self.stamps[0]) / self.period - row as f64
    }

    /// Quantile over `rows`, from at most `most` of them, evenly spread.
    pub fn quantile(&self, rows: std::ops::Range<usize>, most: usize, share: f64) -> f64 {
        let rows = rows.start..rows.end.min(self.stamps.len());
        let stride = rows.len().div_ceil(most).max(1);
        let mut late: Vec<f64> = rows.step_by(stride).map(|row| self.at(row)).collect();
        quantile(&mut late, share)
    }

    /// The gap that begins at `row` or soon after it, if one does; `past` is the lateness before it, relative to `level`.
    fn gap(
        &self,
        row: usize,
        window: usize,
        stall: usize,
        least: f64,
        past: &[f64],
        level: f64,
    ) -> Option<Gap> {
        let mut past = past.to_vec();
        let was = quantile(&mut past, QUANTILE) + level;
        let more =
            |from: usize, rows: usize| self.quantile(from..from + rows, MOST, QUANTILE) - was;
        let missing = |more: f64| (more >= least).then(|| more.round().max(1.0));
        let stays = |missing: &f64| {
            let back = self.quantile(row..row + stall, MOST, BACK) - was;
            back > 0.5 * missing
        };
        let soon = missing(more(row, window))?;
        // The quantile of a long window responds before the gap begins, and fully only from here on.
        let beyond = row + (QUANTILE * window as f64) as usize;
        let soon = match window > 2 * WINDOW.start() && beyond < self.stamps.len() {
            true => missing(more(beyond, window)).unwrap_or(soon),
            false => soon,
        };
        // Some samples of a stall may be lost: then the lateness after it counts.
        let stall = || missing(more(row, stall)).filter(stays);
        let missing = Some(soon).filter(stays).or_else(stall)?;
        let centre = quantile(&mut past, 0.5) + level;
        Some(Gap {
            row: self.split(row..row + window, centre, missing) as u64,
            missing: missing as u64,
        })
    }

    /// The row from which lateness is `more` above the `centre` before it, by the cumulative sum of the deviations.
    fn split(&self, rows: std::ops::Range<usize>, centre: f64, more: f64) -> usize {
        let mut best = (0.0, rows.start);
        let mut sum = 0.0;
        for row in rows.start..rows.end.min(self.stamps.len()) {
            let off = self.at(row) - centre;
            sum += off.abs() - (off - more).abs();
            if sum < best.0 {
                best = (sum, row + 1);
            }
        }
        best.1
    }

    /// Width of the middle four fifths of lateness within short blocks: the lower quartile of all, because other blocks contain gaps.
    pub fn width(&self) -> f64 {
        const BLOCK: usize = 32;
        let blocks = self.stamps.len() / BLOCK;
        let width = |from: usize| {
            let block = || from..from + BLOCK;
            self.quantile(block(), BLOCK, 0.9) - self.quantile(block(), BLOCK, 0.1)
        };
        if blocks == 0 {
            let all = || 0..self.stamps.len();
            return self.quantile(all(), BLOCK, 0.9) - self.quantile(all(), BLOCK, 0.1);
        }
        let stride = blocks.div_ceil(500);
        let mut widths: Vec<f64> = (0..blocks)
            .step_by(stride)
            .map(|i| width(i * BLOCK))
            .collect();
        quantile(&mut widths, 0.25)
    }

    /// Standard deviation of the difference between neighbouring windows if nothing is missing.
    fn noise(&self, window: usize) -> f64 {
        let places = self.stamps.len() / window;
        let stride = places.div_ceil(2000).max(1);
        let differ = |i: usize| {
            let at = i * window;
            let [before, after] = [at - window..at, at..at + window]
                .map(|rows| self.quantile(rows, window, QUANTILE));
            (after - before).abs()
        };
        let mut all: Vec<f64> = (1..places).step_by(stride).map(differ).collect();
        match all.is_empty() {
            true => 0.0,
            false => OF_MEDIAN * quantile(&mut all, 0.5),
        }
    }
}
