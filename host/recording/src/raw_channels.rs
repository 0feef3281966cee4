//! Raw channels by name: those of a sensor, or a single one.

use std::fmt;

use crate::cell::shorten;
use crate::columns::{Column, RAW_COLUMNS};

/// `gyro`, `accel` or the name of a raw column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RawChannels(String);

impl RawChannels {
    /// The channels of this name; the error gives the reason.
    pub fn named(text: &str) -> Result<Self, String> {
        match text == "gyro" || text == "accel" || RAW_COLUMNS.contains(&text) {
            true => Ok(Self(text.to_owned())),
            false => Err(format!("{} is not a raw column", shorten(text.as_bytes()))),
        }
    }

    /// Whether `column` is among them.
    pub fn have(&self, column: Column) -> bool {
        let name = column.name();
        matches!(column, Column::Raw(_))
            && (name == self.0 || name.split('_').next() == Some(&self.0))
    }
}

impl fmt::Display for RawChannels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
