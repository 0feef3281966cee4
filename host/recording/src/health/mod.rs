//! Health of a recording: faults of its readings, found from samples as they come.
//!
//! Whoever has samples feeds the detectors: an import its rows, a fit the blocks of a recording, the wizard the lines of a board. Each fault is then
//! judged by one limit, whose constant says why, and described in one sentence, all of them in `words.rs`. A detector has one file for a kind of
//! fault:
//!
//! | file | faults |
//! |---|---|
//! | `repeats` | a sensor slower than its log, one that does not answer, a channel that sticks or is dead |
//! | `rails` | readings at the end of a range |
//!
//! Limits are for complete recordings and for streams alike. Where a stream has to be judged before its end, the detector says what it waits for.

mod rails;
mod repeats;
mod words;

pub use rails::{Extreme, StreamRails};
pub use repeats::{
    Constant, HeldReadings, Repetition, StuckChannel, Unanswered, channel_run_by_chance, is_coarse,
};

use std::fmt::Display;

use crate::error::{Argument, Error};

/// A fault of a recording: what shows it, where, and which it is. As text it is a sentence with the remedy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Finding {
    /// `gyro` or `accel`, or a column such as `gyro_x`; `None` if it is about all channels.
    pub about: Option<&'static str>,
    /// Where it shows.
    pub rows: Rows,
    /// Which fault it is, and its size.
    pub fault: Fault,
}

/// Rows that show a fault.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Rows {
    /// The first one, counted as whoever fed the samples counts; `None` if it is unknown.
    pub first: Option<u64>,
    /// How many; 0 if they were not counted.
    pub count: u64,
}

/// Kinds of faults. Values are raw readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// A logger faster than the sensor writes each reading several times.
    Held {
        /// Rows in which the sensor was watched.
        of: u64,
        /// Mean number of rows for each reading.
        rows_per_reading: f64,
        /// Rows a second.
        rate_hz: f64,
    },
    /// A board sends its last readings again, because its sensor does not answer.
    Unanswered,
    /// A channel has one value in all rows.
    Dead {
        /// That value.
        value: f64,
    },
    /// A channel has one value in all rows of a rest, and the other channels of its sensor change by single quantisation steps.
    DeadOrCoarse {
        /// That value.
        value: f64,
        /// Their quantisation step.
        step: f64,
    },
    /// A channel has one value for longer than chance explains, and changes before or after.
    Stuck {
        /// That value.
        value: f64,
        /// For how long, s.
        lasts_s: f64,
    },
    /// A channel reads the end of a 16-bit converter.
    EndOfConverter {
        /// That value.
        value: f64,
    },
    /// A channel in SI ends at the full scale of a part.
    FullScale {
        /// That value.
        value: f64,
    },
    /// A channel stays at its extreme.
    RunAtEnd {
        /// Whether it is the highest value.
        high: bool,
        /// The extreme.
        value: f64,
        /// How often it occurs in a row.
        longest: f64,
        /// How often chance explains.
        by_chance: f64,
    },
    /// The noise of a channel ends near an extreme.
    CalmEnd {
        /// Whether that is the highest value.
        high: bool,
        /// The innermost value without noise.
        from: f64,
    },
    /// A reading of the last second is at a rail.
    AtEnd,
}

impl Finding {
    /// `fault` of the channel or sensor `about` in `count` rows, the first of which is unknown.
    pub fn new(about: &'static str, count: u64, fault: Fault) -> Self {
        Self {
            about: Some(about),
            rows: Rows { first: None, count },
            fault,
        }
    }

    /// `fault` of all channels, in the stream of a session.
    pub fn of_stream(fault: Fault) -> Self {
        Self {
            about: None,
            rows: Rows::default(),
            fault,
        }
    }

    /// The same, with its first row.
    pub fn from_row(mut self, first: u64) -> Self {
        self.rows.first = Some(first);
        self
    }

    /// Name of its kind, for scripts.
    pub fn kind(&self) -> &'static str {
        match self.fault {
            Fault::Held { .. } => "held",
            Fault::Unanswered => "unanswered",
            Fault::Dead { .. } => "dead",
            Fault::DeadOrCoarse { .. } => "dead_or_coarse",
            Fault::Stuck { .. } => "stuck",
            Fault::EndOfConverter { .. } => "end_of_converter",
            Fault::FullScale { .. } => "full_scale",
            Fault::RunAtEnd { .. } => "run_at_end",
            Fault::CalmEnd { .. } => "calm_end",
            Fault::AtEnd => "at_end",
        }
    }

    /// Why the recording at `place` is refused for it.
    pub fn refusal(&self, place: impl Display) -> Error {
        let place = match self.about {
            Some(about) => format!("{place}, column {about}"),
            None => place.to_string(),
        };
        let error = Error::new(place, self.problem(), self.remedy());
        let settings = self.settings().iter();
        settings.fold(error, |error, setting| error.about(*setting))
    }

    /// Settings of an import that its remedy is about.
    fn settings(&self) -> &'static [Argument] {
        &[]
    }
}
