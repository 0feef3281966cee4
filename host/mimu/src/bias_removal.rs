//! What firmware did to the bias of a gyro before it was recorded.

use crate::quantity::{plus_minus, significant};

/// What the firmware did to the gyro.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BiasRemoval {
    /// A first-order high-pass filter.
    HighPass(HighPass),
    /// The bias is learnt at rest and subtracted.
    Zeroed(Zeroed),
}

impl std::fmt::Display for BiasRemoval {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::HighPass(filter) => write!(
                f,
                "the firmware has a high-pass filter with a time constant of {} s; its share of the turns is restored",
                plus_minus(filter.time_constant_s, filter.half_width_s)
            ),
            Self::Zeroed(zeroed) => {
                let [x, y, z] = zeroed.bias.map(significant);
                write!(
                    f,
                    "the firmware learns the bias at rest and subtracts it: the rest from {:.1} s on begins at {x}, {y}, {z} and ends at zero, as all later ones",
                    zeroed.from_s
                )
            }
        }
    }
}

/// The filter of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HighPass {
    /// Time constant, s.
    pub time_constant_s: f64,
    /// Half-width of its 95 % interval, s.
    pub half_width_s: f64,
    /// Restored reading at rest, raw: the unknown constant, which the restored signal does not contain.
    pub(crate) level: [f64; 3],
}

/// The bias that firmware removed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Zeroed {
    /// Instant from which on the rest reads its level before the bias was learnt, s.
    pub from_s: f64,
    /// That level: the bias, raw.
    pub bias: [f64; 3],
}
