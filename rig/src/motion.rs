//! What the board feels: the one thing that passes from a table or a hand to the sensors.

use crate::rotation::{Rotation, Vector};

/// Motion of the board at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Time since the recording began, s.
    pub t_s: f64,
    /// Body axes into level axes: east, north, up.
    pub attitude: Rotation,
    /// Angular rate against inertial space (the Earth's is in it), body axes, rad/s.
    pub rate: Vector,
    /// Time derivative of `rate`, body axes, rad/s².
    pub angular_acceleration: Vector,
    /// Specific force at the board's origin, body axes, m/s². At rest it points up.
    pub force: Vector,
}

/// What an experimenter would write down of one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// The truth.
    pub motion: Motion,
    /// Dwell that the instant belongs to; `None` in transit.
    pub step: Option<u32>,
    /// Angular rate against the ground as the table's controller states it, body axes as intended, rad/s. `None` by hand.
    pub stated_rate: Option<Vector>,
    /// Specific force that follows from the stated pose, body axes as intended, m/s². `None` by hand.
    pub stated_force: Option<Vector>,
}

/// Something that carries the board through a plan.
pub trait Carrier {
    /// Length of the whole experiment, s.
    fn duration_s(&self) -> f64;
    /// The instant `t_s`. Times must not go back.
    fn at(&mut self, t_s: f64) -> Instant;
}
