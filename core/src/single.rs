//! The functions that run with every sample, compiled here in single precision.
//!
//! Generic code is compiled and inlined where it is used. These functions keep their names in every image, so their instructions can be
//! counted. The firmware calls [`apply`]; the others are its parts.

use nalgebra::Vector3;

use crate::compensation::{Compensation, Sample};
use crate::compensator::{self, Compensator};
use crate::effects::{Effects, State};
use crate::kalman::{Bank, Rejected};
use crate::stored::{NODES, ROOM};

/// [`Compensator::apply`].
#[inline(never)]
pub fn apply(
    compensator: &Compensator<f32, NODES, ROOM>,
    state: &mut compensator::State<f32, ROOM>,
    raw: &Sample<f32>,
) -> Sample<f32> {
    compensator.apply(state, raw)
}

/// [`Compensation::apply`].
#[inline(never)]
pub fn compensate(model: &Compensation<f32>, raw: &Sample<f32>) -> Sample<f32> {
    model.apply(raw)
}

/// [`Effects::remove`].
#[inline(never)]
pub fn remove(
    effects: &Effects<f32, ROOM>,
    state: &mut State<f32, ROOM>,
    compensated: &Sample<f32>,
) -> Sample<f32> {
    effects.remove(state, compensated)
}

/// [`Bank::update`].
#[inline(never)]
pub fn update(
    bank: &mut Bank<f32>,
    input: &Vector3<f32>,
    raw: &Vector3<f32>,
    noise: &Vector3<f32>,
) -> Result<(), Rejected> {
    bank.update(input, raw, noise)
}
