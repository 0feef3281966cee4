//! Motion of the board: the only input that the sensors get from a table or a hand.

use crate::rotation::{Rotation, Vector};

/// Motion of the board at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Time since the recording began, s.
    pub t_s: f64,
    /// Body axes into level axes: east, north, up.
    pub attitude: Rotation,
    /// Position of the board's origin on the bench, level axes, m.
    pub position: Vector,
    /// Angular rate against inertial space (including the Earth's), body axes, rad/s.
    pub rate: Vector,
    /// Time derivative of `rate`, body axes, rad/s².
    pub angular_acceleration: Vector,
    /// Specific force at the board's origin, body axes, m/s². At rest it points up.
    pub force: Vector,
}

/// Truth and an experimenter's notes at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// The truth.
    pub motion: Motion,
    /// Current dwell; `None` between dwells.
    pub step: Option<u32>,
    /// Angular rate relative to the ground as reported by the table's controller, nominal body axes, rad/s. `None` by hand.
    pub stated_rate: Option<Vector>,
    /// Specific force computed from the reported pose, nominal body axes, m/s². `None` by hand.
    pub stated_force: Option<Vector>,
}

/// A table or a person that moves the board through a plan.
pub trait Carrier {
    /// Length of the whole experiment, s.
    fn duration_s(&self) -> f64;
    /// The state at `t_s`. Times must not decrease.
    fn at(&mut self, t_s: f64) -> Instant;
}
