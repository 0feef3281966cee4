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

impl Decimal {
    /// All of them.
    pub const ALL: [Decimal; 4] = [
        Decimal::Second,
        Decimal::Millisecond,
        Decimal::Microsecond,
        Decimal::Nanosecond,
    ];

    /// Its size, s.
    pub fn seconds(self) -> f64 {
        1.0 / self.per_second() as f64
    }

    /// Its symbol, as it is written on the command line.
    pub fn symbol(self) -> &'static str {
        match self {
            Decimal::Second => "s",
            Decimal::Millisecond => "ms",
            Decimal::Microsecond => "us",
            Decimal::Nanosecond => "ns",
        }
    }

    /// How many make a second.
    pub fn per_second(self) -> i64 {
        match self {
            Decimal::Second => 1,
            Decimal::Millisecond => 1_000,
            Decimal::Microsecond => 1_000_000,
            Decimal::Nanosecond => 1_000_000_000,
        }
    }
}

impl FromStr for Decimal {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let text = if text == "µs" { "us" } else { text };
        let known = Decimal::ALL.into_iter().find(|unit| unit.symbol() == text);
        known.ok_or_else(|| {
            let problem = format!("{} is not a unit of time stamps", shorten(text.as_bytes()));
            Error::new("unit of the times", problem, "give s, ms, us or ns")
        })
    }
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Decimal::Second => "seconds",
            Decimal::Millisecond => "milliseconds",
            Decimal::Microsecond => "microseconds",
            Decimal::Nanosecond => "nanoseconds",
        })
    }
}
