//! A first pass over a foreign file, for the time that its stamps stand for.

use std::path::Path;

use super::assignment::{ColumnList, Scale};
use super::foreign::{ForeignFile, HowToRead};
use super::log::is_log;
use super::row::Row;
use super::time::{Known, Stamps, Times};
use crate::columns::Column;
use crate::error::Result;

/// The times of the rows of `path`. `rate_hz` is the rate that somebody has given, `joined_to` are the times of the file that it is joined to.
///
/// The stamps are held, 8 bytes a row: 115 MB for four hours at 1 kHz. Whether a sample is missing or late is only seen by what comes
/// later, and the rate only at the end.
pub(super) fn times(
    path: &Path,
    how: &HowToRead<'_>,
    rate_hz: Option<f64>,
    joined_to: Option<&Times>,
) -> Result<Times> {
    let stamps = read(path, how)?;
    let known = Known {
        factor: how.time_factor(path),
        rate_hz,
        name: how.list.and_then(ColumnList::name_of_time),
        joined_to,
    };
    Times::of(path, stamps, &known)
}

fn read(path: &Path, how: &HowToRead<'_>) -> Result<Stamps> {
    let mut file = ForeignFile::open(path, how)?;
    let (mut row, mut before) = (Row::default(), Row::default());
    let mut stamps = Stamps::default();
    while file.next(&mut row)? {
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
    // Before anything is said of their times: rows that were left out have none.
    file.seen.check(&path.display().to_string())?;
    Ok(stamps)
}

impl HowToRead<'_> {
    /// Seconds in the unit of the stamps, where somebody has said so or the names are those of a recording.
    fn time_factor(&self, path: &Path) -> Option<f64> {
        let own = match (is_log(path), self.list) {
            (true, _) => Some(1e-9),
            (false, None) => Some(1.0),
            (false, Some(_)) => None,
        };
        let unit = self.time_unit.map(|unit| 1.0 / unit.per_second() as f64);
        unit.or(Scale::given(self.scales, Column::Time)).or(own)
    }
}
