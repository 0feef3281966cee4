//! What a unit was turned between two rests, judged while it still lies there, so that a person can complete or repeat it.

use mimu_core::compensation::Affine;
use nalgebra::Vector3;

use crate::estimate::whole_turns::Ended;
use crate::observation::ByTriad;
use crate::observation::turn::Path;
use crate::prepared::Prepared;
use crate::signal::dwell::Fault;
use crate::triad::Triad;
use crate::warning::Warning;

/// The turn between the last two dwells of a recording whose whole turns are stated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spun {
    /// How many turns, about the mean axis.
    pub turns: f64,
    /// Mean axis, unit vector in the body; the turns are by the right-hand rule about it.
    pub axis: Vector3<f64>,
    /// The fastest rate over some 10 ms, rad/s.
    pub fastest: f64,
    /// How it ended.
    pub end: End,
}

/// How a turn ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum End {
    /// Where it began: the turns are whole.
    Whole,
    /// So far from there, rad.
    Off(f64),
    /// The gyro's scale factor is not known well enough to tell.
    Open,
}

impl Prepared {
    /// What the unit was turned between the last two dwells, by the calibrations so far.
    ///
    /// # Errors
    /// The turn cannot be used, for example because readings of it are at the end of a range.
    pub fn spun(&self, gyro: &Triad, accel: &Affine<f64>) -> Result<Option<Spun>, Box<Warning>> {
        let (turns, mut refused) = self.turns(accel);
        let (Some(stated), Some(turn)) = (self.whole_turns(), turns.last()) else {
            return refused.pop().map_or(Ok(None), |why| Err(Box::new(why)));
        };
        let path = Path::of(&[*turn], &gyro.inverse);
        let sigma = |by: &ByTriad| gyro.variance(by).sqrt();
        let end = stated.ended(&[*turn], &gyro.inverse, &sigma);
        Ok(end.map(|end| Spun {
            turns: path.turns(),
            axis: path.axis,
            fastest: path.fastest,
            end: match end {
                Ended::Whole => End::Whole,
                Ended::Off(off) => End::Off(off),
                Ended::Open(_) => End::Open,
            },
        }))
    }
}

/// Whether a turn was refused because readings are at the end of the range of a gyro.
pub fn is_clipped(refused: &Warning) -> bool {
    let fault = match refused {
        Warning::TurnNotUsed { fault, .. } => fault,
        _ => &None,
    };
    matches!(fault, Some(Fault::Saturated(axis)) if *axis < 3)
}
