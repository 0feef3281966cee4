//! Commands to a table or a person, instead of a plan.

use crate::motion::Carrier;
use crate::plan::Turn;
use crate::rotation::Vector;

/// Commands to what holds the unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Move to a pose and rest.
    Move {
        /// Body direction that must point up, unit vector.
        up: Vector,
        /// Rotation about the vertical from the body's nominal heading, rad. If it is missing, a table takes 0 and a person any.
        heading: Option<f64>,
    },
    /// Rate about the vertical by the outer axis, rad/s, kept until the next rate or move.
    Rate(f64),
    /// Rate about the body's z axis by the inner axis, rad/s, kept in the same way.
    Spin(f64),
    /// Turn one axis of a table by an angle, from rest.
    Turn(Turn),
    /// Stop at the present position.
    Stop,
    /// From now on the hand moves once in every so many-th pose, some seconds after it has come to rest; 0 is never.
    Fidget(u32),
    /// Whether the hand holds the board during poses from now on.
    Hold(bool),
}

/// Commanded target, without errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position {
    /// Body direction that points up, unit vector.
    pub up: Vector,
    /// Rotation about the vertical, rad, from -π to π. `None`: a person was given none.
    pub heading: Option<f64>,
}

/// A table or a person under command. It starts in the first pose of a plan and has no end.
pub trait Commanded: Carrier {
    /// Carries out a command from `t_s` on, which must not be before the last time requested: attitude and rate continue without a jump.
    ///
    /// Errors: the command is impossible; one line gives the remedy.
    fn command(&mut self, t_s: f64, command: Command) -> Result<(), String>;
    /// Whether it still moves, ramps or settles at a time.
    fn busy(&self, t_s: f64) -> bool;
    /// Its commanded position: the pose that it is moving to or, after the move, the angles that its axes have reached at this time.
    fn position(&self, t_s: f64) -> Position;
}
