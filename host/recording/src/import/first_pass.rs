//! A first pass over a foreign file, for the time that its stamps stand for.

use std::path::Path;

use super::assignment::Scale;
use super::foreign::{ForeignFile, HowToRead, Row};
use super::ros::is_bag;
use super::time::{Stamps, Times};
use crate::columns::Column;
use crate::error::Result;

/// The times of the rows of `path`. `origin_s` is that of the file that it is joined to.
///
/// The stamps are held, 8 bytes a row: 115 MB for four hours at 1 kHz. Whether a sample is missing or late is only seen by what comes
/// later, and the rate only at the end.
pub(super) fn times(path: &Path, how: &HowToRead<'_>, origin_s: Option<i64>) -> Result<Times> {
    let stamps = read(path, how)?;
    Times::of(path, stamps, how.time_factor(path), how.rate_hz, origin_s)
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
    Ok(stamps)
}

impl HowToRead<'_> {
    /// Seconds in the unit of the stamps, where somebody has said so or the names are those of a recording.
    fn time_factor(&self, path: &Path) -> Option<f64> {
        let own = match (is_bag(path), self.list) {
            (true, _) => Some(1e-9),
            (false, None) => Some(1.0),
            (false, Some(_)) => None,
        };
        Scale::given(self.scales, Column::Time).or(own)
    }
}
