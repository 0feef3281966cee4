//! A first pass over a foreign file, to find the times behind its stamps.

use std::path::Path;

use super::foreign::{ForeignFile, HowToRead};
use super::log::{self, is_log};
use super::per_column::Scale;
use super::row::Row;
use super::row_limit::{MOST_ROWS, too_many_rows};
use super::time::{Known, Stamps, Times};
use crate::columns::Column;
use crate::error::Result;

/// The times of the rows of `path`. `rate_hz` is the given rate, `joined_to` the times of the file to which this one is joined.
///
/// All stamps are kept in memory, 8 bytes a row: 115 MB for four hours at 1 kHz. Only later stamps show whether a sample is missing or late, and only
/// all of them show the rate.
pub(super) fn times(
    path: &Path,
    how: &HowToRead<'_>,
    rate_hz: Option<f64>,
    joined_to: Option<&Times>,
) -> Result<Times> {
    let mut file = ForeignFile::open(path, how)?;
    let stamps = read(path, &mut file)?;
    let (name, counter) = (file.time_name(), file.counts_samples());
    let known = Known {
        factor: match file.noticed().calendar {
            true => Some(1.0),
            false => how.time_factor(path),
        },
        counter,
        native: log::unit(path),
        // A counter without a given rate has that of the file to which it is joined.
        rate_hz: if counter { how.rate_hz } else { rate_hz },
        name: name.as_deref(),
        joined_to,
    };
    Times::of(path, stamps, &known)
}

fn read(path: &Path, file: &mut ForeignFile) -> Result<Stamps> {
    let (mut row, mut before) = (Row::default(), Row::default());
    let mut stamps = Stamps::default();
    while file.next(&mut row)? {
        if stamps.since_first.len() as u64 == MOST_ROWS {
            return Err(too_many_rows(path, "more"));
        }
        if stamps.since_first.is_empty() {
            stamps.first = row.stamp;
        } else if row.stamp == before.stamp {
            match row.repeats(&before) {
                true => stamps.repeats.push(stamps.since_first.len()),
                false => stamps.shared += 1,
            }
        }
        let since = match stamps.first.whole() {
            0 => row.stamp.value - stamps.first.value,
            whole => row.stamp.since(whole) - stamps.first.since(whole),
        };
        stamps.since_first.push(since);
        std::mem::swap(&mut row, &mut before);
    }
    stamps.wraps = file.stamp_wraps();
    // Checked before the times, as rows that were left out have none.
    file.seen.check(&path.display().to_string())?;
    Ok(stamps)
}

impl HowToRead<'_> {
    /// Seconds per unit of the stamps, if it was given or the kind of file determines it.
    fn time_factor(&self, path: &Path) -> Option<f64> {
        let own = match (is_log(path), self.list) {
            (true, _) => Some(1e-9),
            (false, None) => Some(1.0),
            (false, Some(_)) => None,
        };
        let unit = self
            .log
            .time_unit
            .map(|unit| 1.0 / unit.per_second() as f64);
        let mut scales = Scale::given(&self.log.scale, Column::Time).peekable();
        let scaled = scales.peek().is_some().then(|| scales.product());
        unit.or(scaled).or(own)
    }
}
