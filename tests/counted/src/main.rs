//! The device's computations for a sample, each between two marks, so that the emulator can count instructions.
//!
//! These are the firmware's own functions, of `mimu_core::single`, compiled there; nothing is inlined into this crate.
//! `cargo run -p mimu-board-tests --bin budget` runs this program and relies on its order.
#![no_std]
#![no_main]

use core::hint::black_box;

use mimu_core::compensation::{Affine, Compensation, Sample};
use mimu_core::effects::{DeviceEffect, Directions, EffectError, Effects, State, Variable};
use mimu_core::kalman::Bank;
use mimu_core::single;
use mimu_core::stored::ROOM;
use mimu_core::wire::EFFECTS;
use mimu_core::{PerSensor, Sensor};
use nalgebra::{Matrix3, Vector3};
use panic_halt as _;

/// Precedes the counted code. It must differ from [`counted_to`], or the compiler merges the two.
#[inline(never)]
fn counted_from() {
    black_box(1);
}

/// Follows the counted code.
#[inline(never)]
fn counted_to() {
    black_box(2);
}

fn between<T>(what: impl FnOnce() -> T) {
    counted_from();
    let result = what();
    counted_to();
    black_box(result);
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let affine = |scale: f32| Affine {
        matrix: Matrix3::from_fn(|i, j| if i == j { scale } else { 0.01 * scale }),
        offset: Vector3::repeat(-2.5 * scale),
    };
    let model = black_box(Compensation {
        gyro: affine(3.5),
        accel: affine(12.5),
    });
    let raw = black_box(Sample {
        gyro: Vector3::new(2.4, 2.5, 2.6),
        accel: Vector3::new(1.6, 1.7, 2.4),
    });
    let si = Sample {
        gyro: Vector3::new(0.3, -0.2, 0.1),
        accel: Vector3::new(1.0, -2.0, 9.0),
    };
    let noise = Vector3::repeat(1e-3);
    let mut bank = Bank::diffuse(&noise, 10.0);

    // The cost of the marks.
    between(|| ());
    between(|| single::compensate(&model, &raw));
    between(|| single::update(&mut bank, &si.accel, &raw.accel, &noise));

    let directions = Directions {
        sensed: Matrix3::identity(),
        to_body: Matrix3::identity(),
    };
    let none = || black_box(Effects::of(PerSensor::both(directions)));
    let remove = |all: &Effects<f32, ROOM>| {
        let mut state = State::new(1000.0);
        // For the first sample, the effects are evaluated twice.
        single::remove(all, &mut state, &si);
        between(|| single::remove(all, &mut state, &si));
    };
    remove(&none());
    let term = DeviceEffect::term(Sensor::Gyro, 1, 1e-3, &TERM);
    // Effects that are evaluated at every sample.
    let fast =
        |effect: &Result<DeviceEffect<f32>, EffectError>| matches!(effect, Ok(e) if !e.is_slow());
    let named = EFFECTS.iter().map(|id| named(id)).filter(fast);
    for effect in named.chain([term]) {
        let mut all = none();
        let Ok(effect) = effect else { continue };
        // The first push includes the cost that all effects of a triad share; the second shows the cost of one more.
        for _ in 0..2 {
            if all.push(effect).is_ok() {
                remove(&all);
            }
        }
    }
    // xu's claim: what the forward model `u = P x + b` of both triads costs, with P⁻¹ kept and with an inverse for every sample.
    let forward = black_box(Compensation {
        gyro: affine(0.29),
        accel: affine(0.08),
    });
    between(|| by_kept_inverse(&forward, &raw));
    between(|| by_inverse(&forward, &raw));
    loop {
        cortex_m::asm::wfi();
    }
}

/// `P⁻¹ (u - b)` with `P⁻¹` in place of the matrix and `b` in place of the offset.
#[inline(never)]
fn by_kept_inverse(model: &Compensation<f32>, raw: &Sample<f32>) -> Sample<f32> {
    Sample {
        gyro: model.gyro.matrix * (raw.gyro - model.gyro.offset),
        accel: model.accel.matrix * (raw.accel - model.accel.offset),
    }
}

/// `P⁻¹ (u - b)` with `P` in place of the matrix, inverted here.
#[inline(never)]
fn by_inverse(model: &Compensation<f32>, raw: &Sample<f32>) -> Sample<f32> {
    let inverse = |p: &Matrix3<f32>| p.try_inverse().unwrap_or_default();
    Sample {
        gyro: inverse(&model.gyro.matrix) * (raw.gyro - model.gyro.offset),
        accel: inverse(&model.accel.matrix) * (raw.accel - model.accel.offset),
    }
}

/// Variables of a term, the maximum number.
const TERM: [Variable; 3] = [Variable::RateX, Variable::ForceY, Variable::ForceZ];

fn named(id: &str) -> Result<DeviceEffect<f32>, EffectError> {
    match DeviceEffect::named(id, &[1e-4; 9], None) {
        Err(EffectError::Count { .. }) => DeviceEffect::named(id, &[1e-4; 3], None),
        other => other,
    }
}
