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
//! | `zeros` | padding, a sensor that is not connected, sensors in rows of their own |
//! | `magnitude` | another unit, readings without gravity |
//! | `two_sources` | rows of two devices or in two units |
//! | `sixteen_bits` | unsigned codes, overflows, a low byte that was read with a sign |
//! | `temperatures` | values that are no temperatures, a thermometer that is absent or silent |
//!
//! Limits are for complete recordings and for streams alike. Where a stream has to be judged before its end, the detector says what differs.

mod magnitude;
mod rails;
mod repeats;
mod sixteen_bits;
mod temperatures;
mod two_sources;
mod words;
mod zeros;

pub(crate) use magnitude::LARGEST_BIAS;
pub use magnitude::{
    Against, Cause, DeclaredUnit, GAIN, accel_at_rest, accel_gain, gyro_at_rest, gyro_gain,
    not_counts,
};
pub use rails::{Extreme, StreamRails};
pub use repeats::{
    Constant, HeldReadings, Repetition, StuckChannel, Unanswered, channel_run_by_chance, is_coarse,
};
pub use sixteen_bits::SignedLowByteFinder;
pub(crate) use temperatures::impossible_temperature;
pub use temperatures::{At, Temperatures, unusual_temperatures};
pub(crate) use two_sources::TwoSources;
pub(crate) use zeros::{RowKind, SENSORS, Zeros};

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
    /// Rows with nothing but zeros.
    AllZero,
    /// Rows in which the accelerometer alone has zeros.
    NoForce,
    /// A sensor has zeros in all rows.
    NotConnected,
    /// Gyro and accelerometer have rows of their own: how many.
    SeparateRows {
        /// Those of the gyro.
        gyro: u64,
        /// Those of the accelerometer.
        accel: u64,
    },
    /// The specific force has no gravity.
    NoGravity {
        /// Its usual magnitude, m/s².
        size: f64,
    },
    /// Readings are declared as SI, and have another magnitude than what they measure.
    NotSi {
        /// Whether biases are included.
        at_rest: bool,
        /// How many times their input they are.
        times: f64,
        /// Why.
        cause: Cause,
    },
    /// A gyro reads more at rest than any bias.
    Turning {
        /// Its reading, rad/s.
        rate: f64,
    },
    /// Readings are declared as counts, but are fractions and have the scale factor of a unit.
    NotCounts {
        /// Their number per SI unit.
        per_si: f64,
        /// The unit that they are in.
        declared: DeclaredUnit,
    },
    /// A reading jumps away and returns in the next row.
    Alternating {
        /// Share of the rows.
        share: f64,
    },
    /// The specific force has one magnitude in some rows and another one in others.
    TwoMagnitudes {
        /// The smaller.
        low: f64,
        /// The larger.
        high: f64,
        /// Rows in all.
        of: u64,
    },
    /// Negative readings are written as unsigned codes of 16 bits.
    Unsigned,
    /// Signed readings of 16 bits overflow.
    Overflow,
    /// A firmware takes the low byte for a signed number.
    SignedLowByte,
    /// Readings that cannot be temperatures in °C.
    NoTemperatures {
        /// Of so many readings.
        of: u64,
        /// The first of them.
        first_c: f64,
        /// Where it is, if there are several.
        at: Option<At>,
    },
    /// Temperatures at which no board is used.
    UnusualTemperatures {
        /// The lowest, °C.
        low_c: f64,
        /// The highest, °C.
        high_c: f64,
    },
    /// The column of the thermometer has zeros only.
    NoThermometer,
    /// Zeros of a thermometer that did not answer.
    SilentThermometer,
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
            Fault::AllZero => "all_zero",
            Fault::NoForce => "no_force",
            Fault::NotConnected => "not_connected",
            Fault::SeparateRows { .. } => "separate_rows",
            Fault::NoGravity { .. } => "no_gravity",
            Fault::NotSi { .. } => "not_si",
            Fault::Turning { .. } => "turning",
            Fault::NotCounts { .. } => "not_counts",
            Fault::Alternating { .. } => "alternating",
            Fault::TwoMagnitudes { .. } => "two_magnitudes",
            Fault::Unsigned => "unsigned",
            Fault::Overflow => "overflow",
            Fault::SignedLowByte => "signed_low_byte",
            Fault::NoTemperatures { .. } => "no_temperatures",
            Fault::UnusualTemperatures { .. } => "temperatures",
            Fault::NoThermometer => "no_thermometer",
            Fault::SilentThermometer => "silent_thermometer",
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
        match self.fault {
            Fault::AllZero => &[Argument::Columns],
            Fault::Alternating { .. } => &[Argument::Where, Argument::Columns],
            Fault::Unsigned => &[Argument::TwosComplement],
            Fault::SignedLowByte => &[Argument::SignedLowByte],
            Fault::NoTemperatures { .. } => &[Argument::Scale, Argument::Offset],
            _ => &[],
        }
    }
}
