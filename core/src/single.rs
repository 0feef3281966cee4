//! What runs with every sample, in single precision and compiled here.
//!
//! Generic code is compiled, and inlined, where it is used. These have names of their own in every image, by which their instructions
//! can be counted.

use nalgebra::Vector3;

use crate::compensation::{Compensation, Sample};
use crate::effects::{Effects, State};
use crate::kalman::{Bank, Rejected};
use crate::stored::ROOM;

/// [`Compensation::apply`].
#[inline(never)]
pub fn compensate(model: &Compensation<f32>, raw: &Sample<f32>) -> Sample<f32> {
    model.apply(raw)
}

/// [`Effects::without_code_errors`].
#[inline(never)]
pub fn without_code_errors(effects: &Effects<f32, ROOM>, raw: &Sample<f32>) -> Sample<f32> {
    effects.without_code_errors(raw)
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
