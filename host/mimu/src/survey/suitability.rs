//! Whether a channel is at rest and alive: only then does its Allan curve show its noise.

use super::segment::{FEWEST, Part, Segment, longest, segments};
use crate::signal::blocks::{OF_MEDIAN, quantile};
use crate::signal::stillness::{STILL_FACTOR, WINDOW_S};
use crate::warning::Warning;
use mimu_recording::health::{Fault, Finding, channel_run_by_chance};
use mimu_recording::{Argument, Error, RAW_COLUMNS, Result};

/// Properties of a channel before it is integrated.
#[derive(Debug, Clone)]
pub(super) struct Suitability {
    /// Samples in a window.
    pub window: usize,
    /// Whether each window is disturbed.
    pub moving: Vec<bool>,
    /// Mean of each window, raw.
    pub means: Vec<f64>,
    /// Largest step between the means of two quiet windows, raw.
    pub reach: f64,
    /// Means of equal parts of the segment, raw.
    pub levels: Vec<f64>,
}

impl Suitability {
    /// Mean of the windows, raw.
    pub fn level(&self) -> f64 {
        let known = self.means.iter().filter(|mean| mean.is_finite());
        known.clone().sum::<f64>() / known.count() as f64
    }

    /// For a channel that begins `samples` later than the segment: before that nothing is known, and its means no longer are at the times of those
    /// of the temperature.
    pub fn begin_later(&mut self, samples: usize) {
        let windows = samples / self.window;
        self.moving.splice(0..0, vec![false; windows]);
        self.means.splice(0..0, vec![f64::NAN; windows]);
        self.levels.clear();
    }
}

/// Least number of samples for a variance to be distinguished from the quietest.
const FEWEST_IN_WINDOW: usize = 16;
/// A jump between the means of two windows that is not noise: ten of their sigmas.
const STEP_SIGMAS: f64 = 10.0;
/// Shorter runs of equal samples, s, are attributed to a converter coarser than the noise.
const RUN_S: f64 = 0.5;

/// Checks the raw samples of channel `c`, which are not constant; `place` names it. Refuses one that sticks for a time, because its samples before and
/// after are two records.
pub(super) fn suitability(
    raw: &[f64],
    c: usize,
    period_s: f64,
    place: &str,
) -> Result<Suitability> {
    if raw.len() < FEWEST {
        return Err(Error::new(
            place,
            format!("{} samples remain", raw.len()),
            "record for longer, or choose a longer segment",
        ));
    }
    let window = ((WINDOW_S / period_s).round() as usize)
        .clamp(FEWEST_IN_WINDOW, raw.len().max(FEWEST_IN_WINDOW));
    let (mut means, mut variances, mut shares) = (Vec::new(), Vec::new(), Vec::new());
    let (mut run, mut run_end, mut length, mut step) = (1, 0, 1, f64::INFINITY);
    for (index, part) in raw.chunks_exact(window).enumerate() {
        let n = part.len() as f64;
        let mean = part[0] + part.iter().map(|u| u - part[0]).sum::<f64>() / n;
        variances.push(part.iter().map(|u| (u - mean).powi(2)).sum::<f64>() / (n - 1.0));
        means.push(mean);
        let mut repeats = 0;
        let from = index * window;
        for i in from.max(1)..from + window {
            let change = (raw[i] - raw[i - 1]).abs();
            if change == 0.0 {
                repeats += 1;
                length += 1;
                if length > run {
                    (run, run_end) = (length, i);
                }
            } else {
                length = 1;
                step = step.min(change);
            }
        }
        shares.push(f64::from(repeats) / n);
    }
    let share = quantile(&mut shares, 0.5).unwrap_or(0.0);
    let lasts_s = run as f64 * period_s;
    let by_chance = channel_run_by_chance(share, raw.len() as u64);
    if by_chance.is_some_and(|chance| run as f64 > chance) && lasts_s > RUN_S {
        let value = raw[run_end];
        let (first, fault) = (run_end + 1 - run, Fault::Stuck { value, lasts_s });
        let stuck = Finding::new(RAW_COLUMNS[c], run as u64, fault).from_row(first as u64);
        return Err(Error::new(
            format!("{place}, {}", seconds_in(first as f64 * period_s)),
            stuck.problem(),
            format!("{}, or choose another segment", stuck.remedy()),
        )
        .about(Argument::Stretch));
    }
    // A converter coarser than the noise leaves some windows without variance: half a quantisation step is the least resolvable deviation.
    let least = if step.is_finite() {
        0.25 * step * step
    } else {
        0.0
    };
    let floor = quantile(&mut variances.clone(), 0.05)
        .unwrap_or(0.0)
        .max(least);
    // A slow turn does not show in the variance, but the mean jumps where it begins and ends; a drift does not jump.
    let mut steps: Vec<f64> = means.windows(2).map(|m| (m[1] - m[0]).abs()).collect();
    let sigma = OF_MEDIAN * quantile(&mut steps.clone(), 0.5).unwrap_or(0.0);
    let reach = STEP_SIGMAS * sigma.max((floor / window as f64).sqrt());
    steps.insert(0, 0.0);
    let moving = variances
        .iter()
        .zip(&steps)
        .map(|(v, step)| *v > STILL_FACTOR * floor || *step > reach)
        .collect();
    Ok(Suitability {
        window,
        moving,
        means,
        reach,
        levels: segments(raw),
    })
}

fn seconds_in(s: f64) -> String {
    format!("{s:.2} s after the start of the segment")
}

/// Refuses a segment in which the unit moves; the error names the longest rest. For a segment that a person chose this is only a warning:
/// they may know better what a disturbance is.
pub(super) fn refuse_motion(
    channels: &[(usize, Suitability)],
    segment: &Segment,
    part: Part,
    place: &str,
    warnings: &mut Vec<Warning>,
) -> Result<()> {
    let windows = channels
        .iter()
        .map(|(_, s)| s.moving.len())
        .min()
        .unwrap_or(0);
    let moves = |k: usize| channels.iter().any(|(_, s)| s.moving[k]);
    let Some(first) = (0..windows).find(|k| moves(*k)) else {
        return Ok(());
    };
    let who = channels.iter().find(|(_, s)| s.moving[first]);
    let name = who.map_or("a channel", |(i, _)| RAW_COLUMNS[*i]);
    let window_s = channels[0].1.window as f64 * segment.period_s;
    let time = |k: usize| segment.span_s[0] + k as f64 * window_s;
    let count = (0..windows).filter(|k| moves(*k)).count();
    let problem = Warning::Moves {
        windows: [count, windows],
        window_s,
        first_s: time(first),
        channel: name,
    };
    if part != Part::Whole {
        warnings.push(problem);
        return Ok(());
    }
    let rest = longest(windows, |k| !moves(k));
    let remedy = match rest.len() {
        0 => "record at rest".to_string(),
        // The windows at both ends may contain some of the motion.
        _ => format!(
            "the longest rest is from {:.1} to {:.1} s",
            time(rest.start),
            time(rest.end)
        ),
    };
    Err(Error::new(place, problem, remedy).about(Argument::Stretch))
}
