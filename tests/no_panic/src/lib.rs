//! Everything of `mimu-core` in the precision of the device, as functions that a compiler has to generate.
//!
//! `check.sh` compiles this for the target and looks through the assembly: no call into
//! `core::panicking` may be in it. Generic code is only compiled where it is used, so a function
//! that is missing here is not looked at.
#![no_std]

use mimu_core::compensation::{Affine, Compensation, Sample};
use mimu_core::kalman::{Bank, Filter, Innovation, Rejected};
use nalgebra::{Matrix4, Vector3, Vector4};

/// [`Affine::apply`].
#[inline(never)]
pub fn affine(model: &Affine<f32>, raw: &Vector3<f32>) -> Vector3<f32> {
    model.apply(raw)
}

/// [`Compensation::apply`].
#[inline(never)]
pub fn compensation(model: &Compensation<f32>, raw: &Sample<f32>) -> Sample<f32> {
    model.apply(raw)
}

/// [`Filter::with_prior`].
#[inline(never)]
pub fn filter_with_prior(mean: [f32; 4], variance: [f32; 4]) -> Filter<f32> {
    Filter::with_prior(mean, variance)
}

/// [`Filter::update`].
#[inline(never)]
pub fn filter_update(
    filter: &mut Filter<f32>,
    input: &Vector3<f32>,
    raw: f32,
    noise: f32,
) -> Result<Innovation<f32>, Rejected> {
    filter.update(input, raw, noise)
}

/// [`Filter::mean`], [`Filter::covariance`] and [`Filter::diagonal`].
#[inline(never)]
pub fn filter_state(filter: &Filter<f32>) -> (Vector4<f32>, Matrix4<f32>, Vector4<f32>) {
    (filter.mean(), filter.covariance(), filter.diagonal())
}

/// [`Bank::diffuse`], which calls [`Filter::diffuse`].
#[inline(never)]
pub fn bank_diffuse(noise: &Vector3<f32>, span: f32) -> Bank<f32> {
    Bank::diffuse(noise, span)
}

/// [`Bank::update`].
#[inline(never)]
pub fn bank_update(
    bank: &mut Bank<f32>,
    input: &Vector3<f32>,
    raw: &Vector3<f32>,
    noise: &Vector3<f32>,
) -> Result<(), Rejected> {
    bank.update(input, raw, noise)
}
