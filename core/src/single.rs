//! What runs with every sample, in single precision and compiled here.
//!
//! Generic code is compiled where it is used, and the firmware as a whole is compiled for size. These are not, and have names of
//! their own in the image, by which their instructions can be counted.

use nalgebra::Vector3;

use crate::compensation::{Affine, Compensation, Sample};
use crate::effects::{Effects, State};
use crate::kalman::{Bank, Rejected};
use crate::stored::ROOM;

/// [`Compensation::apply`], to the last bit.
///
/// Written out, because the product of matrices is a loop, which is left rolled in an image that is linked for size: 123
/// instructions, of which most run three times.
#[inline(never)]
pub fn compensate(model: &Compensation<f32>, raw: &Sample<f32>) -> Sample<f32> {
    Sample {
        gyro: affine(&model.gyro, &raw.gyro),
        accel: affine(&model.accel, &raw.accel),
    }
}

#[inline(always)]
fn affine(model: &Affine<f32>, u: &Vector3<f32>) -> Vector3<f32> {
    let (c, o) = (&model.matrix, &model.offset);
    Vector3::new(
        c.m11 * u.x + c.m12 * u.y + c.m13 * u.z + o.x,
        c.m21 * u.x + c.m22 * u.y + c.m23 * u.z + o.y,
        c.m31 * u.x + c.m32 * u.y + c.m33 * u.z + o.z,
    )
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
