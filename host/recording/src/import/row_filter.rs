//! Rows chosen by the value of a column, such as one of several sensors in a file.

use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;
use std::str::FromStr;

use crate::cell::shorten;
use crate::error::{Argument, Error, Result};

/// Most values of a column that are listed if the requested one never occurs.
const MOST_LISTED: usize = 20;

/// The rows in which a column has a value, as in `channel=3`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RowFilter {
    column: String,
    value: String,
}

impl RowFilter {
    /// Name of the column in the header, or its number from the left.
    pub(super) fn column(&self) -> &str {
        &self.column
    }

    /// Position of the column in the header `names`.
    pub(super) fn position(&self, names: &[String]) -> Option<usize> {
        names.iter().position(|name| *name == self.column)
    }

    /// Position of the column by its number from the left, which counts from 1.
    pub(super) fn number(&self) -> Option<usize> {
        self.column.parse::<usize>().ok()?.checked_sub(1)
    }

    /// Whether a cell has the value. Numbers may be written differently: 3, 3.0 and 03 are one channel.
    fn holds(&self, cell: &str) -> bool {
        let number = |text: &str| text.parse::<f64>().ok();
        cell == self.value || number(cell).is_some_and(|n| number(&self.value) == Some(n))
    }
}

impl FromStr for RowFilter {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text.split_once('=') {
            Some((column, value)) if !column.trim().is_empty() && !value.trim().is_empty() => {
                Ok(RowFilter {
                    column: column.trim().to_owned(),
                    value: value.trim().to_owned(),
                })
            }
            _ => Err(Error::new(
                "choice of rows",
                format!("{} is not a column with a value", shorten(text.as_bytes())),
                "write it like channel=3",
            )),
        }
    }
}

impl fmt::Display for RowFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.column, self.value)
    }
}

/// Filters, with counts over the rows of a file.
#[derive(Debug, Default)]
pub(super) struct RowFilters {
    filters: Vec<Tally>,
    kept: u64,
    left_out: u64,
}

#[derive(Debug)]
struct Tally {
    filter: RowFilter,
    found: bool,
    /// Some of the values that occurred.
    met: BTreeSet<String>,
}

impl RowFilters {
    /// From these filters, before any row.
    pub fn new(filters: &[RowFilter]) -> Self {
        let tally = |filter: &RowFilter| Tally {
            filter: filter.clone(),
            found: false,
            met: BTreeSet::new(),
        };
        Self {
            filters: filters.iter().map(tally).collect(),
            ..Self::default()
        }
    }

    /// Rows that were kept, and those that were left out.
    pub fn counts(&self) -> [u64; 2] {
        [self.kept, self.left_out]
    }

    /// Whether the row `cells` is kept; `at` are the positions of the filters' columns. A row that is too short for them is kept, so that it is reported
    /// as broken.
    pub fn keep(&mut self, at: &[usize], cells: &csv::ByteRecord) -> bool {
        if at.iter().any(|at| *at >= cells.len()) {
            self.kept += 1;
            return true;
        }
        let mut all = true;
        for (tally, at) in self.filters.iter_mut().zip(at) {
            let cell = String::from_utf8_lossy(&cells[*at]);
            let cell = cell.trim();
            let holds = tally.filter.holds(cell);
            tally.found |= holds;
            all &= holds;
            if !tally.found && tally.met.len() <= MOST_LISTED && !tally.met.contains(cell) {
                tally.met.insert(cell.to_owned());
            }
        }
        match all {
            true => self.kept += 1,
            false => self.left_out += 1,
        }
        all
    }

    /// Whether [`Self::keep`] would keep the row; it is not counted.
    pub fn hold(&self, at: &[usize], cells: &csv::ByteRecord) -> bool {
        let holds = |(tally, at): (&Tally, &usize)| {
            let cell = cells.get(*at).map(String::from_utf8_lossy);
            cell.is_none_or(|cell| tally.filter.holds(cell.trim()))
        };
        self.filters.iter().zip(at).all(holds)
    }

    /// At the end of `path`: refuses a value that no row had.
    pub fn check(&self, path: &Path) -> Result<()> {
        let refuse = |problem: String, remedy: &str| {
            Err(Error::new(path.display(), problem, remedy).about(Argument::Where))
        };
        if let Some(Tally { filter, met, .. }) = self.filters.iter().find(|tally| !tally.found) {
            let listed = met.iter().take(MOST_LISTED);
            let listed: Vec<String> = listed.map(|value| shorten(value.as_bytes())).collect();
            let more = if met.len() > MOST_LISTED {
                " and others"
            } else {
                ""
            };
            let problem = format!(
                "no row has {filter}; the column has {}{more}",
                listed.join(", ")
            );
            return refuse(problem, "choose one of these values");
        }
        if !self.filters.is_empty() && self.kept == 0 {
            let all: Vec<String> = self.filters.iter().map(|t| t.filter.to_string()).collect();
            return refuse(
                format!("no row satisfies all of {}", all.join(" and ")),
                "choose values that occur in one row",
            );
        }
        Ok(())
    }
}
