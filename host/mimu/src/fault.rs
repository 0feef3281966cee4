//! Why a dwell is not used.

use std::fmt;

use mimu_recording::RAW_COLUMNS;

/// A dwell that is shorter is flagged and not used, s.
pub const SHORTEST_S: f64 = 1.0;

/// Why a dwell is not used for a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// Shorter than a second.
    TooShort,
    /// The variance is far above that of the other dwells, and no known input explains it.
    NotStill,
    /// The known input moves too fast for the blocks that samples are condensed to.
    TooFast,
    /// The unit turns evenly and does not rest.
    Turning,
    /// It errs by far more than the others predict.
    Outlying,
    /// It turns, and the accelerometer may be off the axis.
    Spinning,
    /// It turns at none of the known rates of the turntable.
    OtherRate,
    /// Samples of the channel (0..6) lie at a rail.
    Saturated(usize),
    /// The channel (0..6) repeats one value.
    Stuck(usize),
    /// The channel (0..6) has no samples.
    Missing(usize),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooShort => f.write_str("too short"),
            Self::NotStill => f.write_str("not still"),
            Self::TooFast => f.write_str("moved too fast"),
            Self::Turning => f.write_str("turning"),
            Self::Outlying => f.write_str("outlying"),
            Self::Spinning => f.write_str("spinning"),
            Self::OtherRate => f.write_str("at another rate"),
            Self::Saturated(c) => write!(f, "{} saturated", RAW_COLUMNS[c]),
            Self::Stuck(c) => write!(f, "{} stuck", RAW_COLUMNS[c]),
            Self::Missing(c) => write!(f, "{} missing", RAW_COLUMNS[c]),
        }
    }
}
