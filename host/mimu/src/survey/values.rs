//! The samples of a channel for the computation: a segment without a gap, checked, with short disturbances masked.

use super::bridging::{bridge, bridges};
use super::masking::{Masked, mask};
use super::segment::{FEWEST, Part, Segment, longest};
use super::suitability::{Suitability, suitability};
use crate::survey::unit::Unit;
use crate::warning::Warning;
use mimu_recording::health::{Constant, Finding};
use mimu_recording::{Argument, Error, RAW_COLUMNS, Result};

/// What a channel is found to be.
pub(super) enum Read {
    /// Alive.
    Values(Values),
    /// Without noise.
    Dead(Finding),
}

/// One channel, prepared for the computation.
pub(super) struct Values {
    pub rates: Vec<f64>,
    pub suitability: Suitability,
    pub masked: Option<Masked>,
    /// What a person should know.
    pub warnings: Vec<Warning>,
}

impl Values {
    /// The samples of `segment` in `unit`, checked, its gaps and its empty cells bridged; if there are too many empty cells, the longest segment without any. A `part` that a person
    /// chose is used unchanged; otherwise short disturbances are masked.
    pub fn of(
        mut values: Vec<f64>,
        segment: &Segment,
        part: Part,
        i: usize,
        unit: Unit,
        place: &str,
    ) -> Result<Read> {
        let (rows, period_s) = (&segment.rows, segment.period_s);
        let place = format!("{place}, column {}", RAW_COLUMNS[i]);
        values.truncate(rows.end);
        values.drain(..rows.start);
        let (mut warnings, mut from) = (Vec::new(), 0);
        values = bridge(&values, &segment.lost);
        let empty = empty_cells(&values);
        if !empty.is_empty() && bridges(&empty, values.len()) {
            let samples = empty.iter().map(|(_, count)| count).sum();
            let (gaps, share) = (empty.len() as u64, samples as f64 / values.len() as f64);
            values.retain(|u| u.is_finite());
            values = bridge(&values, &empty);
            let bridged = Warning::Bridged {
                gaps,
                samples,
                share,
            };
            warnings.push(bridged.of_channel(i));
        }
        if let Some(first) = values.iter().position(|u| !u.is_finite()) {
            let whole = longest(values.len(), |k| values[k].is_finite());
            let row = rows.start + first + 1;
            if whole.len() < FEWEST {
                return Err(Error::new(
                    format!("{place}, data row {row}"),
                    format!("the cell is empty, and no {FEWEST} samples in a row are complete"),
                    "record again, or choose a segment",
                )
                .about(Argument::Stretch));
            }
            let length_s = whole.len() as f64 * period_s;
            let used = rows.start + whole.start + 1;
            warnings.push(
                Warning::EmptyCells {
                    row,
                    length_s,
                    from_row: used,
                }
                .of_channel(i),
            );
            from = whole.start;
            values.truncate(whole.end);
            values.drain(..from);
        }
        if values.len() >= FEWEST
            && let Some(dead) = Constant::of(values.iter().copied()).found(i, values.len() as u64)
        {
            return Ok(Read::Dead(dead));
        }
        let share = share_of_two_codes(&values);
        if share > COARSE {
            warnings.push(Warning::CoarseReadings { share }.of_channel(i));
        }
        let mut suitability = suitability(&values, i, period_s, &place)?;
        let masked = match part {
            Part::Whole => mask(&mut values, &mut suitability, period_s),
            _ => None,
        };
        warnings.extend(masked.map(|masked| {
            let first_s = segment.span_s[0] + from as f64 * period_s + masked.first_s;
            let samples = masked.samples as u64;
            Warning::Disturbed {
                samples,
                share: masked.share,
                first_s,
            }
            .of_channel(i)
        }));
        if from > 0 {
            suitability.begin_later(from);
        }
        for u in &mut values {
            *u *= unit.per_raw;
        }
        Ok(Read::Values(Self {
            rates: values,
            suitability,
            masked,
            warnings,
        }))
    }
}

/// If two codes have more than this share of the samples, noise does not smooth the steps: their size is then at least 2.6 standard deviations if the level is
/// between two codes, and 3.9 if it is on one. From four on, a level that wanders by half a step is seen with a third of its size, or with twice that.
const COARSE: f64 = 0.975;
/// Windows over which codes are counted, their length, samples: a level wanders through codes over a whole record.
const WINDOWS: usize = 64;
const WINDOW: usize = 256;

/// The share of the samples that are one of the two commonest values of their window, on average.
fn share_of_two_codes(values: &[f64]) -> f64 {
    let (all, _) = values.as_chunks::<WINDOW>();
    let windows = all.iter().step_by(all.len().div_ceil(WINDOWS).max(1));
    let (mut sum, mut count) = (0.0, 0.0);
    for window in windows {
        let mut sorted = *window;
        sorted.sort_by(f64::total_cmp);
        let mut runs: Vec<usize> = sorted.chunk_by(|a, b| a == b).map(<[f64]>::len).collect();
        runs.sort_unstable_by(|a, b| b.cmp(a));
        sum += runs.iter().take(2).sum::<usize>() as f64 / WINDOW as f64;
        count += 1.0;
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

/// Runs of empty cells, as gaps of the cells that are not: the index of the one after the run, and the length of the run.
fn empty_cells(values: &[f64]) -> Vec<(usize, usize)> {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    let mut kept = 0;
    for u in values {
        match (u.is_finite(), runs.last_mut()) {
            (true, _) => kept += 1,
            (false, Some((after, count))) if *after == kept => *count += 1,
            (false, _) => runs.push((kept, 1)),
        }
    }
    runs
}
