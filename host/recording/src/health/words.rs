//! Findings in words: the only place with their sentences. No code may depend on them.

use std::fmt;

use super::{Fault, Finding};
use crate::digits::{duration, plural, significant, unsigned_zero};

/// What to do about a channel that never changes.
const CHECK_WIRING: &str = "check its wiring, and that the right column was imported";

impl Finding {
    /// What is wrong.
    pub fn problem(&self) -> String {
        let count = self.rows.count;
        match self.fault {
            Fault::Held {
                of,
                rows_per_reading,
                rate_hz,
            } => format!(
                "it repeats its reading in {count} of {of} rows: a new reading comes every {rows_per_reading:.2} rows, at {:.1} Hz, but the log has {rate_hz:.1} Hz. The certainty of a mean depends on the number of readings, not of rows, and faster noise is not the sensor's",
                rate_hz / rows_per_reading
            ),
            Fault::Unanswered => format!(
                "the last readings are repeated in {}, which count as missing: the sensor did not answer",
                plural(count, "row")
            ),
            Fault::Dead { value } => {
                format!(
                    "the channel is stuck at {} throughout",
                    unsigned_zero(value)
                )
            }
            Fault::DeadOrCoarse { value, step } => format!(
                "the channel reads {} throughout while the unit is at rest; the sensor's other channels change by single quantisation steps of {}, so its noise may be below one step",
                unsigned_zero(value),
                significant(step)
            ),
            Fault::Stuck { value, lasts_s } => {
                format!(
                    "the channel is stuck at {} for {}",
                    unsigned_zero(value),
                    duration(lasts_s)
                )
            }
            Fault::EndOfConverter { value } => format!(
                "{} at {value}, the end of a 16-bit converter",
                plural(count, "sample")
            ),
            Fault::FullScale { value } => format!(
                "{} at {value}, the full scale of a sensor",
                plural(count, "sample")
            ),
            Fault::RunAtEnd {
                high,
                value,
                longest,
                by_chance,
            } => format!(
                "the {} value {value} occurs {longest} times in a row, and chance explains {:.0}",
                extreme(high),
                by_chance.floor()
            ),
            Fault::CalmEnd { high, from } => format!(
                "at its {} values, from {from} on, the noise vanishes",
                extreme(high)
            ),
            Fault::AtEnd => "a reading is at the end of its range".into(),
        }
    }

    /// What to do about it.
    pub fn remedy(&self) -> &'static str {
        match self.fault {
            Fault::Held { .. } => "log each reading once",
            Fault::Unanswered => "check the wires between sensor and board",
            Fault::Dead { .. } => CHECK_WIRING,
            Fault::DeadOrCoarse { .. } => {
                "record turns as well: they distinguish a coarse channel from a stuck one"
            }
            Fault::Stuck { .. } => "check its wiring",
            Fault::EndOfConverter { .. }
            | Fault::FullScale { .. }
            | Fault::RunAtEnd { .. }
            | Fault::CalmEnd { .. } => "treated as a rail",
            Fault::AtEnd => "put it down",
        }
    }
}

fn extreme(high: bool) -> &'static str {
    if high { "highest" } else { "lowest" }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(about) = self.about {
            write!(f, "{about}: ")?;
        }
        write!(f, "{}: {}", self.problem(), self.remedy())
    }
}
