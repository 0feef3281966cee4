//! Errors: kind, place, problem and remedy.

use std::fmt;
use std::path::Path;

/// What was refused, shown as one line: `PLACE: PROBLEM; REMEDY`. A user needs all three parts, so none can be left out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    /// File with row and column, or step, axis, parameter: as narrow as is known.
    pub place: String,
    /// What is wrong there, with the offending value.
    pub problem: String,
    /// What the reader can do about it.
    pub remedy: String,
    /// Settings that the caller can change; a command adds the names of its flags.
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

/// A setting of the caller that an error may suggest to change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Argument {
    /// What each column contains.
    Columns,
    /// Samples a second.
    SampleRate,
    /// Unit of time stamps.
    TimeUnit,
    /// Factor of a column.
    Scale,
    /// What is added to a column.
    Offset,
    /// What is known of the true input.
    Reference,
    /// Name of the unit.
    Device,
    /// Use the dwells of the step column.
    StepsGiven,
    /// Find the dwells, and ignore the step column.
    StepsFound,
    /// Largest variance of a dwell.
    StillFactor,
    /// Whether the unit lies still throughout.
    AtRest,
    /// The estimator.
    Method,
    /// Which of the two sensors is calibrated.
    Only,
    /// Beginning and end of a time segment.
    Stretch,
    /// A calibration to convert readings by.
    Calibration,
    /// What carries the unit.
    Table,
    /// Sensor that an experiment is designed for.
    Sensor,
    /// Magnitudes of a turntable's rates.
    TurntableRates,
    /// Uncertainty of these rates.
    TurntableRateError,
    /// Turns by hand that end where they began.
    WholeTurns,
    /// Whether an existing result is replaced.
    Replace,
    /// Serial port.
    Port,
    /// Whether a calibration of another unit is stored.
    OtherUnit,
    /// Whether a clock is used although it differs from the computer's.
    TrustClock,
    /// Topic of a bag.
    Topic,
    /// Which of several sensors in a log.
    Instance,
    /// Which rows of a foreign file are read, by the value of a column.
    Where,
    /// Characters that begin a comment.
    Comment,
    /// What separates the cells of a text file.
    Separator,
    /// Columns of unsigned codes in two's complement.
    TwosComplement,
    /// The first and the last data row that are read.
    Rows,
    /// Software or device whose files are read.
    Preset,
    /// Whether rows are means instead of samples.
    Means,
    /// How many rows that cannot be read are left out.
    SkipBroken,
    /// Whether readings that look wrong are used.
    TrustReadings,
    /// Columns whose low byte a firmware took for a signed number.
    SignedLowByte,
    /// Products that are accepted on the evidence of one recording.
    Accept,
    /// Writing a calibration that is judged a misfit.
    Force,
    /// The calibration at one temperature that curves are added to.
    Base,
    /// The estimator of curves over temperature.
    Estimator,
    /// Temperatures that a plan covers.
    Range,
    /// Shape of curves over temperature.
    Curves,
    /// Set points of a soak.
    SetPoints,
    /// Time at a set point.
    Soak,
    /// When the dwells of a recording begin and end.
    StepTimes,
    /// Unit of the readings.
    RawUnit,
    /// Names of the numbers in a line of text.
    TextColumns,
    /// Bits a second of a serial port.
    Baud,
    /// What turns or warms the unit.
    Driver,
    /// What carries the unit.
    Fixture,
    /// Local gravity.
    Gravity,
    /// Latitude.
    Latitude,
    /// Length of a dwell.
    DwellLength,
    /// Largest rate of a table.
    LargestRate,
    /// The plan that dwells are taken from.
    Plan,
    /// Order of the planned dwells.
    Seed,
    /// Largest change of temperature during a session.
    Drift,
    /// The population that a unit is from.
    Prior,
    /// Whether the PC or the device estimates the calibration.
    EstimatedBy,
    /// Folder that is written.
    Output,
    /// The calibration that a noise file is made with.
    CalibrationOfNoise,
    /// Noise of the unit.
    Noise,
    /// Rate random walk of the gyro, if its noise file shows none.
    GyroWalk,
    /// The same for the accelerometer.
    AccelWalk,
    /// SI unit per raw unit by which a driver converts a gyro's readings.
    GyroConversion,
    /// The same for an accelerometer.
    AccelConversion,
    /// Raw reading that a driver converts to a rate of 0.
    GyroZero,
    /// Raw reading that a driver converts to a force of 0.
    AccelZero,
    /// Beginning of the names in a source file.
    Prefix,
}

/// Result with [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An invalid input at `place` (file, row, column, step or axis).
    pub fn new(
        place: impl fmt::Display,
        problem: impl fmt::Display,
        remedy: impl fmt::Display,
    ) -> Self {
        Self::Invalid(Refused {
            place: place.to_string(),
            problem: problem.to_string(),
            remedy: remedy.to_string(),
            arguments: Vec::new(),
        })
    }

    /// An experiment that does not determine what was asked for.
    pub fn undetermined(
        place: impl fmt::Display,
        problem: impl fmt::Display,
        remedy: impl fmt::Display,
    ) -> Self {
        Self::Undetermined(Self::new(place, problem, remedy).into_refused())
    }

    /// A device that does not answer, or refuses.
    pub fn device(
        place: impl fmt::Display,
        problem: impl fmt::Display,
        remedy: impl fmt::Display,
    ) -> Self {
        Self::Device(Self::new(place, problem, remedy).into_refused())
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

    fn into_refused(self) -> Refused {
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
        Self::Io(
            error.kind(),
            Self::new(path.display(), text, remedy).into_refused(),
        )
    }
}

impl fmt::Display for Error {
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
