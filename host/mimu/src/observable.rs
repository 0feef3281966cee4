//! The quantity of observations that share their noise.

use std::fmt;

use crate::quantity::{AXES, Figure};

/// The quantity of observations that share their noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Observable {
    /// Means of an axis (0..3) over dwells.
    Axis(usize),
    /// How an axis follows an input that moves within dwells.
    Within(usize),
    /// Means of an axis at rest, beside others.
    AtRest(usize),
    /// Means of an axis over a second.
    Second(usize),
    /// Directions of gravity after turns.
    Turns,
    /// Directions of gravity after whole turns.
    AfterWholeTurns,
    /// Headings after whole turns.
    WholeTurns,
    /// What a data sheet says of the angles between the axes.
    AsDelivered,
    /// Rates at rest.
    Rest,
    /// Magnitudes of specific force.
    Magnitude,
    /// Specific forces in poses that turns connect.
    Force,
}

impl Observable {
    /// The quantity of its residuals.
    pub fn figure(self) -> Figure {
        match self {
            Self::Turns | Self::AfterWholeTurns | Self::WholeTurns | Self::AsDelivered => {
                Figure::Direction
            }
            Self::Magnitude => Figure::GravityMagnitude,
            Self::Axis(_)
            | Self::Within(_)
            | Self::AtRest(_)
            | Self::Second(_)
            | Self::Rest
            | Self::Force => Figure::Input,
        }
    }

    /// Number of residuals of an error: a direction has two.
    pub fn components(self) -> usize {
        match self {
            Self::Turns | Self::AfterWholeTurns => 2,
            Self::Axis(_)
            | Self::Within(_)
            | Self::AtRest(_)
            | Self::Second(_)
            | Self::WholeTurns
            | Self::AsDelivered
            | Self::Rest
            | Self::Magnitude
            | Self::Force => 1,
        }
    }
}

impl fmt::Display for Observable {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Axis(axis) => f.write_str(AXES[*axis]),
            Self::Within(axis) => write!(f, "{} within dwells", AXES[*axis]),
            Self::AtRest(axis) => write!(f, "{} at rest", AXES[*axis]),
            Self::Second(axis) => write!(f, "means of {} over a second", AXES[*axis]),
            Self::Turns => f.write_str("turns"),
            Self::AfterWholeTurns => f.write_str("directions after whole turns"),
            Self::WholeTurns => f.write_str("whole turns"),
            Self::AsDelivered => f.write_str("axes as delivered"),
            Self::Rest => f.write_str("rest"),
            Self::Magnitude => f.write_str("magnitude of specific force"),
            Self::Force => f.write_str("force"),
        }
    }
}

/// A group of observations, with the index of its recording if there are several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StratumName(pub Observable, pub Option<usize>);

impl fmt::Display for StratumName {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.1 {
            None => write!(f, "{}", self.0),
            Some(session) => write!(f, "{} of recording {}", self.0, session + 1),
        }
    }
}
