//! A part of a file by its data rows, such as that before a fault.

use std::fmt;
use std::str::FromStr;

use crate::cell::shorten;
use crate::error::{Argument, Error, Result};

/// Data rows from a first to a last one, both included and counted from 1: `..8799`, `8800..` or `100..5000`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RowRange {
    first: u64,
    last: Option<u64>,
}

impl RowRange {
    /// Whether the row with this number is in the range.
    pub fn contains(&self, number: u64) -> bool {
        number >= self.first && self.last.is_none_or(|last| number <= last)
    }
}

impl FromStr for RowRange {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || {
            Error::new(
                "range of rows",
                format!("{} is not a range of data rows", shorten(text.as_bytes())),
                "write the first and the last row, counted from 1: ..8799, 8800.. or 100..5000",
            )
            .about(Argument::Rows)
        };
        let number = |text: &str| match text.trim() {
            "" => Ok(None),
            digits => digits.parse::<u64>().map(Some).map_err(|_| wrong()),
        };
        let (first, last) = text.split_once("..").ok_or_else(wrong)?;
        let (first, last) = (number(first)?, number(last)?);
        let range = Self {
            first: first.unwrap_or(1),
            last,
        };
        let is_empty = last.is_some_and(|last| last < range.first);
        match (first, last) {
            (None, None) => Err(wrong()),
            _ if range.first == 0 || is_empty => Err(wrong()),
            _ => Ok(range),
        }
    }
}

impl fmt::Display for RowRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.first > 1 {
            write!(f, "{}", self.first)?;
        }
        f.write_str("..")?;
        self.last.map_or(Ok(()), |last| write!(f, "{last}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_contains_its_ends_and_is_written_as_it_was_read() {
        for (text, inside, outside) in [
            ("..8799", vec![1, 8799], vec![8800]),
            ("8800..", vec![8800, 90_000], vec![8799]),
            ("2..3", vec![2, 3], vec![1, 4]),
        ] {
            let range: RowRange = text.parse().unwrap();
            assert!(inside.iter().all(|n| range.contains(*n)), "{text}");
            assert!(!outside.iter().any(|n| range.contains(*n)), "{text}");
            assert_eq!(range.to_string(), text);
        }
        for wrong in ["..", "5", "0..3", "4..3", "a..3", "-1..3"] {
            assert!(wrong.parse::<RowRange>().is_err(), "{wrong}");
        }
    }
}
