//! Why a dwell is not used.

use mimu_recording::RAW_COLUMNS;

/// A dwell that is shorter is flagged and not used, s.
pub const SHORTEST_S: f64 = 1.0;

/// Why a dwell is not used for a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// Shorter than a second.
    #[error("too short")]
    TooShort,
    /// The variance is far above that of the other dwells, and no known input explains it.
    #[error("not still")]
    NotStill,
    /// The known input moves too fast for the blocks that samples are condensed to.
    #[error("moved too fast")]
    TooFast,
    /// The unit turns evenly and does not rest.
    #[error("turning")]
    Turning,
    /// It errs by far more than the others predict.
    #[error("outlying")]
    Outlying,
    /// It turns, and the accelerometer may be off the axis.
    #[error("spinning")]
    Spinning,
    /// It turns at none of the known rates of the turntable.
    #[error("at another rate")]
    OtherRate,
    /// Samples of the channel (0..6) lie at a rail.
    #[error("{} saturated", RAW_COLUMNS[*.0])]
    Saturated(usize),
    /// The channel (0..6) repeats one value.
    #[error("{} stuck", RAW_COLUMNS[*.0])]
    Stuck(usize),
    /// The channel (0..6) has no samples.
    #[error("{} missing", RAW_COLUMNS[*.0])]
    Missing(usize),
}
