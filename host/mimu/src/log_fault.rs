//! A row of a log from which on its readings mean something else.

use std::fmt;

use mimu_recording::RAW_COLUMNS;
use mimu_recording::error::{Argument, Error};

/// What changed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Change {
    /// The accelerometer's readings at rest have another magnitude, this many times that before.
    Range(f64),
    /// The channel (0..6) reads what another read before.
    Columns(usize, usize),
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Range(ratio) => write!(
                f,
                "the accelerometer reads {ratio} times as much at rest as before, so its range has changed"
            ),
            Self::Columns(now, before) => {
                let [now, before] = [now, before].map(|c| RAW_COLUMNS[c]);
                write!(
                    f,
                    "{now} reads what {before} read before, so the columns have changed places"
                )
            }
        }
    }
}

impl LogFault {
    /// Why a recording with this fault is refused.
    pub(crate) fn refusal(&self, place: &str) -> Error {
        let row = self.row + 1;
        let place = format!("{place}, data row {row}");
        let problem = format!("from here on {}", self.change);
        let remedy = format!(
            "import the rows before it (..{}) or those from it on ({row}..) as a recording",
            self.row
        );
        Error::new(place, problem, remedy).about(Argument::Rows)
    }
}

/// A row from which on the readings mean something else.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogFault {
    /// First data row after the change, from 0.
    pub row: u64,
    /// Block that contains it.
    pub(crate) block: usize,
    /// What changed.
    pub change: Change,
}
