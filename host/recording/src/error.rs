//! Errors: kind, place, problem and remedy.

use std::fmt::{self, Display};
use std::path::Path;

use serde::Serialize;

/// What was refused, shown as one line: `PLACE: PROBLEM; REMEDY`. A user needs all three parts, so none can be left out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Refused {
    /// File with row and column, or step, axis, parameter: as narrow as is known.
    pub place: String,
    /// What is wrong there, with the offending value.
    pub problem: String,
    /// What the reader can do about it.
    pub remedy: String,
    /// Settings that the caller can change; a command adds the names of its flags.
    #[serde(skip)]
    pub arguments: Vec<Argument>,
}

/// Why something was refused.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused a file, a folder or a port.
    Io(std::io::ErrorKind, Refused),
    /// A file, its samples or a setting is invalid.
    Invalid(Refused),
    /// The experiment does not determine what was asked for.
    Undetermined(Refused),
    /// A device does not answer, or refuses.
    Device(Refused),
}

/// Makes [`Argument`] from its list: name, flags of the command that set it, what it is.
macro_rules! arguments {
    ($($name:ident, $flags:literal, $what:literal;)*) => {
        /// A setting of the caller that an error may suggest to change.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Argument {
            $(#[doc = $what] $name,)*
        }

        impl Argument {
            /// The flags of the command that set it, such as `--rate-hz`; of another command with its name, such as `mimu allan --calibration`.
            pub fn flags(self) -> &'static str {
                match self {
                    $(Self::$name => $flags,)*
                }
            }
        }
    };
}

arguments! {
    Columns, "--columns", "What each column contains.";
    SampleRate, "--rate-hz", "Samples a second.";
    TimeUnit, "--time-unit", "Unit of time stamps.";
    Scale, "--scale", "Factor of a column.";
    Offset, "--offset", "What is added to a column.";
    Reference, "--reference", "What is known of the true input.";
    Device, "--device", "Name of the unit.";
    StepsGiven, "--steps given", "Use the dwells of the step column.";
    StepsFound, "--steps found", "Find the dwells, and ignore the step column.";
    StillFactor, "--still", "Largest variance of a dwell.";
    AtRest, "--at-rest", "Whether the unit lies still throughout.";
    Only, "--only", "Which of the two sensors is calibrated.";
    Stretch, "--from, --to", "Beginning and end of a time segment.";
    Calibration, "--calibration", "A calibration to convert readings by.";
    Table, "--table", "What carries the unit.";
    Sensor, "--sensor", "Sensor that an experiment is designed for.";
    TurntableRates, "--rate-dps", "Magnitudes of a turntable's rates.";
    TurntableRateError, "--rate-error", "Uncertainty of these rates.";
    WholeTurns, "--whole-turns and --placement", "Turns by hand that end where they began.";
    Replace, "--replace", "Whether an existing result is replaced.";
    Port, "--port", "Serial port.";
    OtherUnit, "--other-unit", "Whether a calibration of another unit is stored.";
    TrustClock, "--trust-clock", "Whether a clock is used although it differs from the computer's.";
    Topic, "--topic", "Topic of a bag.";
    Instance, "--instance", "Which of several sensors in a log.";
    Where, "--where", "Which rows of a foreign file are read, by the value of a column.";
    Comment, "--comment", "Characters that begin a comment.";
    Separator, "--separator", "What separates the cells of a text file.";
    TwosComplement, "--twos-complement", "Columns of unsigned codes in two's complement.";
    Rows, "--rows", "The first and the last data row that are read.";
    Preset, "--preset", "Software or device whose files are read.";
    Means, "--means", "Whether rows are means instead of samples.";
    SkipBroken, "--skip-broken", "How many rows that cannot be read are left out.";
    TrustReadings, "--trust-readings", "Whether readings that look wrong are used.";
    SignedLowByte, "--signed-low-byte", "Columns whose low byte a firmware took for a signed number.";
    Force, "--force", "Writing a calibration that is judged a misfit.";
    Base, "--base", "The calibration at one temperature that curves are added to.";
    Range, "--range", "Temperatures that a plan covers.";
    Curves, "--curves line", "Shape of curves over temperature.";
    SetPoints, "--points", "Set points of a soak.";
    Soak, "--soak", "Time at a set point.";
    StepTimes, "--step-every", "When the dwells of a recording begin and end.";
    RawUnit, "--raw-unit", "Unit of the readings.";
    Units, "--units", "Units of the readings in a file.";
    TextColumns, "--text", "Names of the numbers in a line of text.";
    Baud, "--baud", "Bits a second of a serial port.";
    Fixture, "--fixture", "What carries the unit.";
    Gravity, "--gravity", "Local gravity.";
    Latitude, "--latitude", "Latitude.";
    DwellLength, "--dwell", "Length of a dwell.";
    LargestRate, "--rate", "Largest rate of a table.";
    Plan, "--plan", "The plan that dwells are taken from.";
    Seed, "--seed", "Order of the planned dwells.";
    Drift, "--drift", "Largest change of temperature during a session.";
    Prior, "--prior", "The population that a unit is from.";
    Output, "-o", "Folder that is written.";
    CalibrationOfNoise, "mimu allan --calibration", "The calibration that a noise file is made with.";
    Noise, "--noise", "Noise of the unit.";
    GyroWalk, "--gyro-walk", "Rate random walk of the gyro, if its noise file shows none.";
    AccelWalk, "--accel-walk", "The same for the accelerometer.";
    GyroConversion, "--gyro-si-per-raw", "SI unit per raw unit by which a driver converts a gyro's readings.";
    AccelConversion, "--accel-si-per-raw", "The same for an accelerometer.";
    GyroZero, "--gyro-zero", "Raw reading that a driver converts to a rate of 0.";
    AccelZero, "--accel-zero", "Raw reading that a driver converts to a force of 0.";
    MagConversion, "--mag-ut-per-raw", "µT per raw unit by which a driver converts a magnetometer's readings.";
    Prefix, "--prefix", "Beginning of the names in a source file.";
}

impl Refused {
    fn new(place: &dyn Display, problem: &dyn Display, remedy: &dyn Display) -> Self {
        Self {
            place: place.to_string(),
            problem: problem.to_string(),
            remedy: remedy.to_string(),
            arguments: Vec::new(),
        }
    }
}

/// Result with [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An invalid input at `place` (file, row, column, step or axis).
    pub fn new(place: impl Display, problem: impl Display, remedy: impl Display) -> Self {
        Self::Invalid(Refused::new(&place, &problem, &remedy))
    }

    /// An experiment that does not determine what was asked for.
    pub fn undetermined(place: impl Display, problem: impl Display, remedy: impl Display) -> Self {
        Self::Undetermined(Refused::new(&place, &problem, &remedy))
    }

    /// A device that does not answer, or refuses.
    pub fn device(place: impl Display, problem: impl Display, remedy: impl Display) -> Self {
        Self::Device(Refused::new(&place, &problem, &remedy))
    }

    /// Adds `argument` to the settings that can be changed.
    pub fn about(mut self, argument: Argument) -> Self {
        self.refused_mut().arguments.push(argument);
        self
    }

    /// Changes the place, problem or remedy.
    pub fn map(mut self, change: impl FnOnce(&mut Refused)) -> Self {
        change(self.refused_mut());
        self
    }

    /// What was refused.
    pub fn refused(&self) -> &Refused {
        match self {
            Self::Io(_, refused)
            | Self::Invalid(refused)
            | Self::Undetermined(refused)
            | Self::Device(refused) => refused,
        }
    }

    fn refused_mut(&mut self) -> &mut Refused {
        match self {
            Self::Io(_, refused)
            | Self::Invalid(refused)
            | Self::Undetermined(refused)
            | Self::Device(refused) => refused,
        }
    }

    /// An error of the operating system on a file or folder.
    pub fn io(path: &Path, error: &std::io::Error) -> Self {
        let remedy = match error.kind() {
            std::io::ErrorKind::IsADirectory => "name the file in it",
            std::io::ErrorKind::NotFound => "check the path",
            std::io::ErrorKind::PermissionDenied => "check its permissions",
            std::io::ErrorKind::StorageFull => "free some space and run it again",
            _ => "check the file and the disk",
        };
        // "(os error 2)" adds nothing to the sentence before it.
        let text = error.to_string();
        let text = text
            .split(" (os error")
            .next()
            .unwrap_or_default()
            .to_lowercase();
        Self::Io(error.kind(), Refused::new(&path.display(), &text, &remedy))
    }
}

impl Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Refused {
            place,
            problem,
            remedy,
            ..
        } = self.refused();
        let line = format!("{place}: {problem}; {remedy}");
        // A file name or a cell may contain line breaks or control characters. The message stays on one line.
        let breaks = |c: char| c.is_control() || matches!(c, '\u{2028}' | '\u{2029}');
        f.write_str(&line.replace(breaks, " "))
    }
}

impl std::error::Error for Error {}
