//! What the stamps of a file say, and the time of each of its rows that follows.

use std::path::Path;

use serde::Serialize;

use super::regular::{Gap, Irregular, Jitter, Regular};
use super::stamp::{Decimal, Stamp, Unit};
use crate::error::{Argument, Error, Result};

/// From so many seconds on, stamps count from the first whole second: later ones lose digits of the steps between samples.
const FAR_S: f64 = 1e8;

/// What the stamps of a file have shown.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TimeSummary {
    /// File, without its folder.
    pub file: String,
    /// Unit of the stamps; `None` where the factor is another one.
    pub unit: Option<Decimal>,
    /// Whether the unit was found out, and not given.
    pub recognised: bool,
    /// Instant that was subtracted, in whole seconds.
    pub origin_s: i64,
    /// Rate of the straight line through count and stamp, Hz.
    pub rate_hz: f64,
    /// Whether the stamps are kept; else the time is that of the count.
    pub stamps_kept: bool,
    /// What the stamps are off that time.
    pub jitter: Jitter,
    /// Places where samples are missing, and how many in all.
    pub gaps: u64,
    /// Samples missing in them.
    pub missing: u64,
    /// Rows left out because they repeat the row before, its stamp included.
    pub repeated_rows: u64,
}

/// The times of a file's rows.
#[derive(Debug, Clone)]
pub(in super::super) struct Times {
    unit: Unit,
    origin_s: i64,
    regular: Regular,
    /// Whether rows that repeat the one before are left out.
    pub drops_repeats: bool,
    pub summary: TimeSummary,
}

/// Stamps of a file, relative to the first, in its unit.
#[derive(Default)]
pub(in super::super) struct Stamps {
    pub first: Stamp,
    pub since_first: Vec<f64>,
    /// Places in `since_first` of rows that repeat the one before.
    pub repeats: Vec<usize>,
    /// Rows with the stamp of the row before, and other values.
    pub shared: u64,
}

impl Times {
    /// Of the stamps of `path`, which are in units of `given` seconds if that is known; `rate_hz` helps to find out where it is not.
    /// `origin_s` is that of the file that it is joined to.
    pub fn of(
        path: &Path,
        mut stamps: Stamps,
        given: Option<f64>,
        rate_hz: Option<f64>,
        origin_s: Option<i64>,
    ) -> Result<Times> {
        // A logger that is faster than its sensor writes readings twice. Bursts of a sensor at rest may look like it, but have equal stamps
        // with other readings as well.
        let drops_repeats = stamps.shared == 0 && !stamps.repeats.is_empty();
        let repeated_rows = if drops_repeats {
            stamps.repeats.len()
        } else {
            0
        };
        if drops_repeats {
            let (mut row, mut repeats) = (0, stamps.repeats.iter().peekable());
            stamps.since_first.retain(|_| {
                row += 1;
                repeats.next_if_eq(&&(row - 1)).is_none()
            });
        }
        let problem = |irregular| refused(path, irregular);
        let coarse = Regular::step(&stamps.since_first).ok_or_else(|| problem(Irregular::Short))?;
        let unit = match given {
            Some(factor) => Unit::of_factor(factor),
            None => Unit::Decimal(Unit::recognise(stamps.first.value, coarse, rate_hz)),
        };
        let far = || {
            let first = unit.seconds(stamps.first.value);
            if first.abs() < FAR_S { 0 } else { first as i64 }
        };
        let origin_s = origin_s.unwrap_or_else(far);
        let first_s = unit.seconds(stamps.first.since(unit.whole(origin_s)));
        for since in &mut stamps.since_first {
            *since = unit.seconds(*since);
        }
        let mut regular = Regular::find(&stamps.since_first).map_err(problem)?;
        regular.start_s += first_s;
        let summary = TimeSummary {
            file: path
                .file_name()
                .unwrap_or(path.as_os_str())
                .to_string_lossy()
                .into_owned(),
            unit: match unit {
                Unit::Decimal(unit) => Some(unit),
                Unit::Other(_) => None,
            },
            recognised: given.is_none(),
            origin_s,
            rate_hz: tidy(1.0 / regular.period_s),
            stamps_kept: regular.exact,
            jitter: regular.jitter,
            gaps: regular.gaps.len() as u64,
            missing: regular.missing(),
            repeated_rows: repeated_rows as u64,
        };
        Ok(Times {
            unit,
            origin_s,
            regular,
            drops_repeats,
            summary,
        })
    }

    /// Instant that was subtracted, s.
    pub fn origin_s(&self) -> i64 {
        self.origin_s
    }

    /// Time between samples, s.
    pub fn period_s(&self) -> f64 {
        self.regular.period_s
    }
}

/// A rate without the digits that only the rounding of time stamps has put there.
fn tidy(rate_hz: f64) -> f64 {
    format!("{rate_hz:.7e}").parse().unwrap_or(rate_hz)
}

fn refused(path: &Path, irregular: Irregular) -> Error {
    match irregular {
        Irregular::Short => Error::new(
            path.display(),
            "the rate cannot be told from the times of fewer than two rows",
            "give it, and skip the time column",
        )
        .about(Argument::SampleRate),
        Irregular::SetBack(row) => Error::new(
            format!("{}, data row {}, column t_s", path.display(), row + 1),
            "the time goes back, and stays behind",
            "import the parts as recordings of their own, or sort the rows by time",
        ),
    }
}

/// Gives each row of a file its time.
#[derive(Debug)]
pub(in super::super) struct Clock {
    times: Times,
    next_gap: usize,
    missing: u64,
    row: u64,
}

impl Clock {
    pub fn new(times: Times) -> Self {
        Self {
            times,
            next_gap: 0,
            missing: 0,
            row: 0,
        }
    }

    /// What it goes by.
    pub fn times(&self) -> &Times {
        &self.times
    }

    /// Time of the next row, which has `stamp`, s.
    pub fn next(&mut self, stamp: &Stamp) -> f64 {
        let Times {
            unit,
            origin_s,
            regular,
            ..
        } = &self.times;
        let row = self.row;
        self.row += 1;
        if regular.exact {
            return unit.seconds(stamp.since(unit.whole(*origin_s)));
        }
        if let Some(Gap { missing, .. }) = regular.gaps.get(self.next_gap).filter(|g| g.row == row)
        {
            self.missing += missing;
            self.next_gap += 1;
        }
        regular.start_s + (row + self.missing) as f64 * regular.period_s
    }
}
