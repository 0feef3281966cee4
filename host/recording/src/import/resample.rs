//! Regular times for the readings of a loop.
//!
//! A recording has one rate, because dwells, noise and turns are computed from blocks of a fixed number of samples. Readings that a loop took at
//! irregular times are therefore interpolated to multiples of its usual round. A round longer than [`LONGEST`] usual ones is a gap.

use super::foreign::ForeignFile;
use super::join::check_order;
use super::row::Row;
use super::time::LONGEST;
use crate::error::Result;

/// Rows of a file at regular times.
#[derive(Debug)]
pub(super) struct Resampler {
    period_s: f64,
    start_s: f64,
    /// Number of the next time.
    next: u64,
    /// Rows on both sides of it; both are the first row at the start.
    around: Option<[Row; 2]>,
}

/// Reads the next row of `file`, at regular times if there is a `resampler`; `false` at the end.
pub(super) fn next(
    file: &mut ForeignFile,
    resampler: Option<&mut Resampler>,
    row: &mut Row,
) -> Result<bool> {
    match resampler {
        Some(resampler) => resampler.next(file, row),
        None => file.next(row),
    }
}

impl Resampler {
    /// At times `period_s` apart, from the first row on.
    pub fn new(period_s: f64) -> Self {
        Self {
            period_s,
            start_s: 0.0,
            next: 0,
            around: None,
        }
    }

    /// The row of the next time; `false` after the last row of `file`.
    pub fn next(&mut self, file: &mut ForeignFile, row: &mut Row) -> Result<bool> {
        let [before, after] = match &mut self.around {
            Some(around) => around,
            None => {
                let mut first = Row::default();
                if !file.next(&mut first)? {
                    return Ok(false);
                }
                self.start_s = first.t_s;
                self.around.insert([first.clone(), first])
            }
        };
        loop {
            let t_s = self.start_s + self.next as f64 * self.period_s;
            while after.t_s < t_s {
                std::mem::swap(before, after);
                if !file.next(after)? {
                    return Ok(false);
                }
                check_order(file, after, before.t_s)?;
            }
            let step_s = after.t_s - before.t_s;
            if step_s > LONGEST * self.period_s && before.t_s < t_s && t_s < after.t_s {
                let behind = ((after.t_s - self.start_s) / self.period_s).ceil() as u64;
                self.next = behind.max(self.next + 1);
                continue;
            }
            let part = match step_s > 0.0 {
                true => (t_s - before.t_s) / step_s,
                false => 1.0,
            };
            row.clone_from(if part < 0.5 { before } else { after });
            row.t_s = t_s;
            for ((value, a), b) in row.values.iter_mut().zip(&before.values).zip(&after.values) {
                *value = a + (b - a) * part;
            }
            self.next += 1;
            return Ok(true);
        }
    }
}
