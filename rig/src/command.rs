//! A table or a person under command, instead of a plan.

use crate::motion::Carrier;
use crate::plan::Turn;
use crate::rotation::Vector;

/// Commands of a carrier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// To a pose at rest.
    Move {
        /// Body direction that is to point up, unit vector.
        up: Vector,
        /// Turn about the vertical from the body's nominal heading, rad. Left out, a table takes 0 and a person any.
        heading: Option<f64>,
    },
    /// Rate about the vertical by the outer axis, rad/s, kept until the next rate or move.
    Rate(f64),
    /// Rate about the body's z axis by the inner axis, rad/s, kept likewise.
    Spin(f64),
    /// From rest, one axis of a table by an angle.
    Turn(Turn),
    /// To rest where it is.
    Stop,
    /// In every so many-th pose from now on a hand moves once, some seconds after it has come to rest; 0 is never.
    Fidget(u32),
    /// Whether a hand keeps hold of the board in the poses from now on.
    Hold(bool),
}

/// Commanded target of a carrier, without its errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position {
    /// Body direction that points up, unit vector.
    pub up: Vector,
    /// Turn about the vertical, rad, from -π to π. `None`: none was given to a person.
    pub heading: Option<f64>,
}

/// A carrier under command. It starts in the first pose of a plan and has no end.
pub trait Commanded: Carrier {
    /// Does as it is told from `t_s` on, which must not be before the last instant that it was asked for: attitude
    /// and rate go on from there without a jump.
    ///
    /// Errors: the carrier cannot do that; one line gives the remedy.
    fn command(&mut self, t_s: f64, command: Command) -> Result<(), String>;
    /// Whether it still moves, ramps or settles at an instant.
    fn busy(&self, t_s: f64) -> bool;
    /// Where it was told to be: the pose that it is on its way to or, once it is there, where its axes have been
    /// turned to at the instant.
    fn position(&self, t_s: f64) -> Position;
}
