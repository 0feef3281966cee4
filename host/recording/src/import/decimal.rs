//! The units that clocks count in.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use crate::cell::shorten;
use crate::error::Error;

/// Units that clocks count in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Decimal {
    /// s
    #[serde(rename = "s")]
    Second,
    /// ms
    #[serde(rename = "ms")]
    Millisecond,
    /// µs
    #[serde(rename = "us")]
    Microsecond,
    /// ns
    #[serde(rename = "ns")]
    Nanosecond,
}

/// Each in its order, with the symbol that the command line takes, its name, and how many make a second.
const TABLE: [(Decimal, &str, &str, i64); 4] = [
    (Decimal::Second, "s", "seconds", 1),
    (Decimal::Millisecond, "ms", "milliseconds", 1_000),
    (Decimal::Microsecond, "us", "microseconds", 1_000_000),
    (Decimal::Nanosecond, "ns", "nanoseconds", 1_000_000_000),
];

impl Decimal {
    /// All of them.
    pub fn all() -> impl Iterator<Item = Self> {
        TABLE.into_iter().map(|(unit, ..)| unit)
    }

    /// Its size, s.
    pub fn seconds(self) -> f64 {
        1.0 / self.per_second() as f64
    }

    /// Its symbol, as it is written on the command line.
    pub fn symbol(self) -> &'static str {
        TABLE[self as usize].1
    }

    /// How many make a second.
    pub fn per_second(self) -> i64 {
        TABLE[self as usize].3
    }
}

impl FromStr for Decimal {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let text = if text == "µs" { "us" } else { text };
        let known = Decimal::all().find(|unit| unit.symbol() == text);
        known.ok_or_else(|| {
            let problem = format!("{} is not a unit of time stamps", shorten(text.as_bytes()));
            Error::new("unit of the times", problem, "give s, ms, us or ns")
        })
    }
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(TABLE[*self as usize].2)
    }
}
