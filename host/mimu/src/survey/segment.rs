//! The samples that are used: a chosen part, whose short gaps are bridged.

use std::ops::Range;

use super::bridging::{MOST, bridges};
use super::columns::Columns;
use crate::quantity::plural;
use crate::signal::blocks::extent;
use crate::warning::Warning;
use mimu_recording::{Argument, Column, Error, Manifest, Recording, Result};

/// Least number of samples: a model needs five octaves of averaging time up to a quarter of the record, and half the record.
pub(super) const FEWEST: usize = 64;

/// Part of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Part {
    /// All of it.
    Whole,
    /// By time stamps, s.
    Span {
        /// First, from the beginning if `None`.
        from_s: Option<f64>,
        /// Last, to the end if `None`.
        to_s: Option<f64>,
    },
    /// The dwell of this number.
    Step(i32),
}

/// An interval between time stamps of this many sample periods is a gap.
const GAP_PERIODS: f64 = 1.5;
/// If more than this share of the intervals are gaps, the sample rate is wrong.
const GAP_SHARE: f64 = 0.02;
/// Relative difference from the given rate that is refused, and that causes a warning.
const RATE_OFF: [f64; 2] = [0.02, 1e-3];

/// Rows without a gap that cannot be bridged.
#[derive(Debug, Clone)]
pub(super) struct Segment {
    /// Rows from 0.
    pub rows: Range<usize>,
    /// Gaps in them: the row after, counted from the first of [`Self::rows`], and the number of lost samples.
    pub lost: Vec<(usize, usize)>,
    /// Times of the first and last, s.
    pub span_s: [f64; 2],
    /// Mean interval between time stamps, s.
    pub period_s: f64,
}

impl Segment {
    pub fn find(
        columns: &mut Columns,
        recording: &Recording,
        part: Part,
        place: &str,
        warnings: &mut Vec<Warning>,
    ) -> Result<Self> {
        let rows = match part {
            Part::Step(step) => Some(dwell(columns, recording, step, place)?),
            _ => None,
        };
        let t = columns.take(Column::Time)?;
        let rows = match (part, rows) {
            (_, Some(rows)) => rows,
            (Part::Span { from_s, to_s }, None) => span(&t, from_s, to_s, place)?,
            (_, None) => 0..t.len(),
        };
        Self::without_gap(
            &t[rows.clone()],
            rows.start,
            &recording.manifest,
            place,
            warnings,
        )
    }

    /// The longest segment of `t` without a gap that cannot be bridged; `first` is the row of the first time.
    fn without_gap(
        t: &[f64],
        first: usize,
        manifest: &Manifest,
        place: &str,
        warnings: &mut Vec<Warning>,
    ) -> Result<Self> {
        let rate_hz = manifest.sample_rate_hz;
        let at = |i: usize| format!("{place}, data row {}, t_s", first + i + 1);
        if t.len() < FEWEST {
            let had = plural(t.len() as u64, "sample");
            let problem = format!("{had}, and at least {FEWEST} are needed to compute noise");
            let remedy = "record for longer, or choose a longer segment";
            return Err(Error::new(place, problem, remedy));
        }
        let (mut gaps, mut first_gap, mut regular_s) = (0usize, None, 0.0);
        for i in 1..t.len() {
            let dt = t[i] - t[i - 1];
            if !(dt > 0.0) {
                return Err(Error::new(
                    at(i),
                    format!(
                        "time does not increase: from {:.6} s to {:.6} s",
                        t[i - 1],
                        t[i]
                    ),
                    "if the rows are in order, import again without the time column and with the sample rate",
                ).about(Argument::SampleRate));
            }
            if dt * rate_hz > GAP_PERIODS {
                gaps += 1;
                first_gap.get_or_insert(i);
            } else {
                regular_s += dt;
            }
        }
        let steps = t.len() - 1;
        let remedy = "correct sample_rate_hz, or the unit of t_s";
        if gaps as f64 > GAP_SHARE * steps as f64 {
            let i = first_gap.unwrap_or_default();
            let problem = format!(
                "{gaps} of {steps} intervals between time stamps do not fit sample_rate_hz = {rate_hz}: the first such interval is {:.6} s",
                t[i] - t[i - 1]
            );
            let remedy = "record without losing samples; if none are lost, correct sample_rate_hz, or the unit of t_s";
            return Err(Error::new(at(i), problem, remedy));
        }
        let period_s = regular_s / (steps - gaps) as f64;
        let off = 1.0 / (period_s * rate_hz) - 1.0;
        if off.abs() > RATE_OFF[0] {
            let problem = format!(
                "the rate of the time stamps is {:.3} Hz, but sample_rate_hz is {rate_hz}",
                1.0 / period_s
            );
            return Err(Error::new(format!("{place}, t_s"), problem, remedy));
        }
        if off.abs() > RATE_OFF[1] && !manifest.has_rate_of_stamps() {
            warnings.push(Warning::RateOff {
                stamps_hz: 1.0 / period_s,
                off_percent: 100.0 * off,
                manifest_hz: rate_hz,
            });
        }
        let mut used = (0..t.len(), Vec::new());
        if let Some(i) = first_gap {
            used = bridged(t, period_s);
            let (rows, lost) = &used;
            let samples: usize = lost.iter().map(|(_, count)| count).sum();
            let whole = (rows.len() + samples) as f64;
            let (bridged, gaps) = (lost.len() == gaps, gaps as u64);
            warnings.push(match bridged {
                true => Warning::Bridged {
                    gaps,
                    samples,
                    share: samples as f64 / whole,
                },
                false => Warning::LongestStretch {
                    gaps,
                    first_s: t[i] - t[i - 1],
                    row: first + i + 1,
                    length_s: whole * period_s,
                    from_s: t[rows.start],
                },
            });
            if rows.len() < FEWEST {
                return Err(Error::new(
                    at(i),
                    format!("it has no {FEWEST} samples without a gap"),
                    "record for longer without a pause",
                ));
            }
        }
        let (rows, lost) = used;
        Ok(Self {
            span_s: [t[rows.start], t[rows.end - 1]],
            rows: first + rows.start..first + rows.end,
            lost,
            period_s,
        })
    }
}

/// The rows of `t` that are used, and the gaps in them that can be bridged. A gap with more than [`MOST`] of all samples divides the record, and the
/// longest part is used; if more than that share is missing in it too, the longest segment without any gap.
fn bridged(t: &[f64], period_s: f64) -> (Range<usize>, Vec<(usize, usize)>) {
    let lost = |k: usize| ((t[k + 1] - t[k]) / period_s).round() as usize - 1;
    let steps = t.len() - 1;
    let is_gap = |k: usize| (t[k + 1] - t[k]) / period_s > GAP_PERIODS;
    let whole = longest(steps, |k| {
        !is_gap(k) || lost(k) as f64 <= MOST * t.len() as f64
    });
    let gaps = whole.clone().filter(|k| is_gap(*k));
    let gaps: Vec<_> = gaps.map(|k| (k + 1 - whole.start, lost(k))).collect();
    if bridges(&gaps, whole.len() + 1) {
        return (whole.start..whole.end + 1, gaps);
    }
    let none = longest(steps, |k| !is_gap(k));
    (none.start..none.end + 1, Vec::new())
}

/// The longest run of indices below `n` for which `good` holds.
pub(super) fn longest(n: usize, good: impl Fn(usize) -> bool) -> Range<usize> {
    let (mut best, mut start) = (0..0, 0);
    for i in 0..=n {
        if i == n || !good(i) {
            if i - start > best.len() {
                best = start..i;
            }
            start = i + 1;
        }
    }
    best
}

fn dwell(
    columns: &mut Columns,
    recording: &Recording,
    step: i32,
    place: &str,
) -> Result<Range<usize>> {
    if !recording.columns.step {
        return Err(Error::new(
            place,
            "a dwell was chosen by its number, and the recording has no column step",
            "choose a segment by its times",
        )
        .about(Argument::Stretch));
    }
    let steps = columns.take(Column::Step)?;
    let rows = longest(steps.len(), |i| steps[i] == f64::from(step));
    if rows.is_empty() {
        let last = steps.iter().copied().fold(-1.0, f64::max);
        return Err(Error::new(
            format!("{place}, column step"),
            format!("no dwell has the number {step}"),
            format!("the last number is {last}"),
        ));
    }
    Ok(rows)
}

fn span(t: &[f64], from_s: Option<f64>, to_s: Option<f64>, place: &str) -> Result<Range<usize>> {
    let from = from_s.map_or(0, |s| t.partition_point(|t| *t < s));
    let to = to_s.map_or(t.len(), |s| t.partition_point(|t| *t <= s));
    if from < to {
        return Ok(from..to);
    }
    let (first, last) = (t.first().copied(), t.last().copied());
    Err(Error::new(
        format!("{place}, t_s"),
        "the chosen segment has no sample",
        format!(
            "choose within {} to {} s",
            first.unwrap_or_default(),
            last.unwrap_or_default()
        ),
    )
    .about(Argument::Stretch))
}

/// Temperature over a segment.
pub(super) struct Temperature {
    /// Mean of the cells that are not empty, °C.
    pub mean_c: f64,
    /// [`SEGMENTS`] means; not finite where a cell is empty.
    means: Vec<f64>,
}

/// Number of means for a correlation with temperature: a chamber is slower than a hundredth of the record.
pub(super) const SEGMENTS: usize = 100;
/// A smaller change is the temperature sensor's own noise, °C.
const CHANGE_C: f64 = 0.2;
/// Correlation from which on a channel follows the temperature. Two independent random walks often reach 0.8.
const FOLLOWS: f64 = 0.9;

/// Temperature over `rows`; `None` where all its cells are empty.
pub(super) fn temperature(temp_c: &[f64], rows: &Range<usize>) -> Option<Temperature> {
    let known = temp_c[rows.clone()].iter().filter(|t| t.is_finite());
    let (sum, count) = known.fold((0.0, 0u64), |(sum, n), t| (sum + t, n + 1));
    (count > 0).then(|| Temperature {
        mean_c: sum / count as f64,
        means: segments(&temp_c[rows.clone()]),
    })
}

/// Means of [`SEGMENTS`] equal parts; empty if there are fewer samples.
pub(super) fn segments(values: &[f64]) -> Vec<f64> {
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let length = values.len() / SEGMENTS;
    match length {
        0 => Vec::new(),
        _ => values
            .chunks_exact(length)
            .take(SEGMENTS)
            .map(mean)
            .collect(),
    }
}

impl Temperature {
    /// Correlation with a channel's means, and the change of temperature, °C, where the channel follows it.
    pub fn against(&self, levels: &[f64]) -> Option<(f64, f64)> {
        let [low, high] = extent(self.means.iter().copied());
        let known = self.means.iter().all(|t| t.is_finite());
        if !known || levels.len() != self.means.len() || high - low < CHANGE_C {
            return None;
        }
        let centred = |values: &[f64]| -> Vec<f64> {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            values.iter().map(|v| v - mean).collect()
        };
        let (a, b) = (centred(levels), centred(&self.means));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let r = dot(&a, &b) / (dot(&a, &a) * dot(&b, &b)).sqrt();
        (r.abs() >= FOLLOWS).then_some((r, high - low))
    }
}
