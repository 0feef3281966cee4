//! Which of several sensors in a log are read.

use std::fmt;
use std::str::FromStr;

use crate::cell::shorten;
use crate::error::{Argument, Error, Result};

/// Sensors of a log that has several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Instance {
    /// The one with this number, from 0.
    Number(u32),
    /// All: the first is the pair of the recording, and the others get numbers from 2.
    All,
}

impl FromStr for Instance {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if text == "all" {
            return Ok(Self::All);
        }
        text.parse().map(Self::Number).map_err(|_| {
            let problem = format!("{} is not the number of a sensor", shorten(text.as_bytes()));
            Error::new("instance", problem, "write its number, from 0, or all")
                .about(Argument::Instance)
        })
    }
}

impl fmt::Display for Instance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => number.fmt(f),
            Self::All => f.write_str("all"),
        }
    }
}
