//! Everything of `mimu-core` in the precision of the device, as functions that a compiler has to generate.
//!
//! `check.sh` compiles this for the target and looks through the assembly: no call into
//! `core::panicking` may be in it. Generic code is only compiled where it is used, so a function
//! that is missing here is not looked at.
#![no_std]

use mimu_core::compensation::{Affine, Compensation, Sample};
use mimu_core::effects::{Effect, Effects, Refused, Sensor, State, Variable};
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

/// [`Effect::named`]: with it all that the table of effects refers to.
#[inline(never)]
pub fn effect_named(
    id: &str,
    coefficients: &[f32],
    time_constant: Option<f32>,
) -> Result<Effect<f32>, Refused> {
    Effect::named(id, coefficients, time_constant)
}

/// [`Effect::term`].
#[inline(never)]
pub fn effect_term(
    sensor: Sensor,
    axis: usize,
    coefficient: f32,
    variables: &[Variable],
) -> Result<Effect<f32>, Refused> {
    Effect::term(sensor, axis, coefficient, variables)
}

/// [`Effects::push`].
#[inline(never)]
pub fn effects_push(effects: &mut Effects<f32, 8>, effect: Effect<f32>) -> Result<(), Refused> {
    effects.push(effect)
}

/// [`State::new`].
#[inline(never)]
pub fn effects_state(sample_rate_hz: f32) -> State<f32, 8> {
    State::new(sample_rate_hz)
}

/// [`Effects::slow`].
#[inline(never)]
pub fn effects_slow(effects: &Effects<f32, 8>, state: &mut State<f32, 8>, dt_s: f32, temp_c: f32) {
    effects.slow(state, dt_s, temp_c);
}

/// [`Effects::remove`].
#[inline(never)]
pub fn effects_remove(
    effects: &Effects<f32, 8>,
    state: &mut State<f32, 8>,
    compensated: &Sample<f32>,
) -> Sample<f32> {
    effects.remove(state, compensated)
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
