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
//! | `sixteen_bits` | unsigned codes, overflows, a low byte that was read with a sign |
//! | `temperatures` | values that are no temperatures, a thermometer that is absent or silent |
//!
//! Limits are for complete recordings and for streams alike. Where a stream has to be judged before its end, the detector says what differs.

mod magnitude;
mod rails;
mod repeats;
mod sixteen_bits;
mod temperatures;
mod words;
mod zeros;

pub(crate) use magnitude::LARGEST_BIAS;
pub use magnitude::{
    Against, GAIN, accel_at_rest, accel_gain, gyro_at_rest, gyro_gain, not_counts,
};
pub use rails::{Extreme, StreamRails};
pub use repeats::{
    Constant, HeldReadings, Repetition, StuckChannel, Unanswered, channel_run_by_chance, is_coarse,
};
pub use sixteen_bits::SignedLowByteFinder;
pub(crate) use sixteen_bits::across_16_bits;
pub(crate) use temperatures::impossible_temperature;
pub use temperatures::{At, Temperatures, unusual_temperatures};
pub use words::Cause;
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
    /// The first one, counted from 1; `None` if it is unknown.
    pub first: Option<u64>,
    /// How many; 0 if they were not counted.
    pub count: u64,
}

/// Kinds of faults. Values are raw readings.
#[expect(
    missing_docs,
    reason = "the comment of a variant says what its fields are"
)]
#[derive(Debug, Clone, Copy, PartialEq, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum Fault {
    /// A logger faster than the sensor writes each reading several times: the rows in all, the mean number for each reading, and rows a second.
    Held {
        of: u64,
        rows_per_reading: f64,
        rate_hz: f64,
    },
    /// A board sends its last readings again, because its sensor does not answer.
    Unanswered,
    /// A channel has this value in all rows.
    Dead { value: f64 },
    /// The same in a rest in which the other channels of the sensor change by single quantisation steps of this size.
    DeadOrCoarse { value: f64, step: f64 },
    /// A channel has this value for longer than chance explains, s, and changes before or after.
    Stuck { value: f64, lasts_s: f64 },
    /// A channel reads this value, the end of a 16-bit converter.
    EndOfConverter { value: f64 },
    /// A channel in SI ends at this value, the full scale of a part.
    FullScale { value: f64 },
    /// A channel stays at its extreme: whether it is the highest value, that value, how often it occurs in a row, and how often chance explains.
    RunAtEnd {
        high: bool,
        value: f64,
        longest: f64,
        by_chance: f64,
    },
    /// The noise of a channel ends at the highest values or the lowest, and from which one on.
    CalmEnd { high: bool, from: f64 },
    /// A reading of the last second is at a rail.
    AtEnd,
    /// Rows with nothing but zeros.
    AllZero,
    /// Rows whose six readings are one number.
    NoAnswer,
    /// Rows in which the accelerometer alone has zeros.
    NoForce,
    /// A sensor has zeros in all rows.
    NotConnected,
    /// So many rows of gyro and accelerometer have one of the two alone.
    SeparateRows { gyro: u64, accel: u64 },
    /// The usual specific force, m/s², has no gravity.
    NoGravity { size: f64 },
    /// Readings declared as SI: whether they are at rest (and include biases), how many times their input they are, and why.
    NotSi {
        at_rest: bool,
        times: f64,
        cause: Cause,
    },
    /// Reading of a gyro at rest, rad/s, that is larger than any bias.
    Turning { rate: f64 },
    /// Readings declared as counts that are fractions and have the scale factor of a unit: their number per SI unit, the unit, and how to import
    /// them.
    NotCounts {
        per_si: f64,
        unit: &'static str,
        import: &'static str,
    },
    /// Negative readings are written as unsigned codes of 16 bits.
    Unsigned,
    /// Signed readings of 16 bits overflow.
    Overflow,
    /// A firmware takes the low byte for a signed number.
    SignedLowByte,
    /// Of so many readings some cannot be temperatures in °C: the first of them, and where it is if there are several.
    NoTemperatures {
        of: u64,
        first_c: f64,
        at: Option<At>,
    },
    /// Temperatures, °C, at which no board is used.
    #[strum(serialize = "temperatures")]
    UnusualTemperatures { low_c: f64, high_c: f64 },
    /// The column of the thermometer has zeros only.
    NoThermometer,
    /// Zeros of a thermometer that did not answer.
    SilentThermometer,
    /// From a row on the accelerometer has another range, and reads so many times as much.
    #[strum(serialize = "log_fault")]
    RangeChanged { ratio: f64 },
    /// From a row on a column reads what another one read before.
    #[strum(serialize = "log_fault")]
    ColumnsMoved {
        now: &'static str,
        before: &'static str,
    },
    /// The gyro's readings follow the pose, and the accelerometer's do not.
    Exchanged,
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

    /// `fault` of all channels in `count` rows.
    pub fn of_all(count: u64, fault: Fault) -> Self {
        Self {
            about: None,
            ..Self::new("", count, fault)
        }
    }

    /// The same, with its first row.
    pub fn from_row(mut self, first: u64) -> Self {
        self.rows.first = Some(first);
        self
    }

    /// Name of its kind, for scripts.
    pub fn kind(&self) -> &'static str {
        self.fault.into()
    }

    /// Why the recording at `place` is refused for it.
    pub fn refusal(&self, place: impl Display) -> Error {
        let place = match self.about {
            Some(about) => format!("{place}, column {about}"),
            None => place.to_string(),
        };
        let mut remedy = self.remedy();
        if self.is_suspicion() {
            remedy += "; if the readings are right, say so";
        }
        let error = Error::new(place, self.problem(), remedy);
        let settings = self.settings().iter();
        settings.fold(error, |error, setting| error.about(*setting))
    }

    /// Whether sound readings may look like this too, so that only a person can say whether it is a fault.
    pub fn is_suspicion(&self) -> bool {
        self.settings().contains(&Argument::TrustReadings)
    }

    /// Settings of an import that its remedy is about.
    fn settings(&self) -> &'static [Argument] {
        use Argument::{Columns, Rows, TrustReadings, TwosComplement};
        match self.fault {
            Fault::AllZero => &[Columns],
            Fault::Unsigned => &[TwosComplement, TrustReadings],
            Fault::RangeChanged { .. } | Fault::ColumnsMoved { .. } => &[Rows, TrustReadings],
            Fault::SignedLowByte => &[Argument::SignedLowByte, TrustReadings],
            Fault::NoTemperatures { .. } => &[Argument::Scale, Argument::Offset],
            _ => &[],
        }
    }
}
