//! Joining a later file onto the times of the first one.

use super::foreign::ForeignFile;
use super::row::Row;
use crate::error::{Error, Result};

/// Two stamps nearer than this part of a sample period are the same instant.
const SAME: f64 = 0.1;

/// Longest gap, in sample periods of the later file, that is interpolated across.
const LONGEST_GAP: f64 = 3.0;

/// What became of one row of the first file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Joined {
    /// The later file has the same instant.
    Exactly,
    /// Between two rows of the later file.
    Interpolated,
    /// Before the later file's first row or after its last.
    Outside,
    /// In a gap of the later file.
    Gap,
}

/// A file that is read along with the first one.
#[derive(Debug)]
pub(super) struct Follower {
    pub file: ForeignFile,
    tolerance_s: f64,
    longest_gap_s: f64,
    /// Last row at or before the instant that was asked for.
    before: Option<Row>,
    /// First row after it.
    after: Option<Row>,
    spare: Row,
    started: bool,
    last_t_s: f64,
}

impl Follower {
    /// Follows a file whose rows are `first_period_s` apart; its own rows are `period_s` apart.
    pub fn new(file: ForeignFile, period_s: f64, first_period_s: f64) -> Follower {
        Follower {
            file,
            tolerance_s: SAME * period_s.min(first_period_s),
            // A hair more, as stamps are rounded.
            longest_gap_s: LONGEST_GAP * period_s * (1.0 + 1e-6),
            before: None,
            after: None,
            spare: Row::default(),
            started: false,
            last_t_s: f64::NEG_INFINITY,
        }
    }

    /// Appends this file's values at time `t_s` to `values` like [`Self::values_at`]. Where a file of further triads has none, its cells are empty, and no
    /// row is dropped for them: a magnetometer must not cost readings of gyro and accelerometer.
    ///
    /// A logger may write a slow sensor's last reading again in each row. Such readings are kept: without the sensor's own stamps a repeated one cannot be
    /// told from a new one of the same value.
    pub fn append_at(&mut self, t_s: f64, values: &mut Vec<f64>) -> Result<Joined> {
        let joined = self.values_at(t_s, values)?;
        if !self.file.is_further() {
            return Ok(joined);
        }
        if matches!(joined, Joined::Outside | Joined::Gap) {
            values.extend(self.file.columns().map(|_| f64::NAN));
        }
        Ok(Joined::Exactly)
    }

    /// Appends this file's values at time `t_s` to `values`; times must be asked for in order.
    fn values_at(&mut self, t_s: f64, values: &mut Vec<f64>) -> Result<Joined> {
        if !self.started {
            self.started = true;
            self.after = self.read()?;
        }
        while let Some(after) = self.after.take_if(|row| row.t_s <= t_s) {
            if let Some(old) = self.before.replace(after) {
                self.spare = old;
            }
            self.after = self.read()?;
        }
        let distance =
            |row: &Option<Row>| row.as_ref().map_or(f64::INFINITY, |r| (r.t_s - t_s).abs());
        let (to_before, to_after) = (distance(&self.before), distance(&self.after));
        let nearest = if to_before <= to_after {
            &self.before
        } else {
            &self.after
        };
        if let Some(row) = nearest
            && to_before.min(to_after) <= self.tolerance_s
        {
            values.extend_from_slice(&row.values);
            return Ok(Joined::Exactly);
        }
        let (Some(before), Some(after)) = (&self.before, &self.after) else {
            return Ok(Joined::Outside);
        };
        let gap = after.t_s - before.t_s;
        if gap > self.longest_gap_s {
            return Ok(Joined::Gap);
        }
        let part = (t_s - before.t_s) / gap;
        let pairs = before.values.iter().zip(&after.values);
        values.extend(pairs.map(|(a, b)| a + (b - a) * part));
        Ok(Joined::Interpolated)
    }

    fn read(&mut self) -> Result<Option<Row>> {
        let mut row = std::mem::take(&mut self.spare);
        if !self.file.next(&mut row)? {
            return Ok(None);
        }
        check_order(&self.file, &row, self.last_t_s)?;
        self.last_t_s = row.t_s;
        Ok(Some(row))
    }
}

/// Refuses a row whose time does not lie after `last_t_s`: two files can only be joined in order.
pub(super) fn check_order(file: &ForeignFile, row: &Row, last_t_s: f64) -> Result<()> {
    if row.t_s > last_t_s {
        return Ok(());
    }
    Err(Error::new(
        format!("{}, column t_s", file.place(row.number)),
        format!(
            "the time {} s is not later than the {last_t_s} s of the row before",
            row.t_s
        ),
        "remove the row, or sort the file by time, before you join it",
    ))
}
