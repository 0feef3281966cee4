//! What the device computes with a sample, each between two marks, for the emulator to count instructions.
//!
//! The functions are those that the firmware calls, of `mimu_core::single`, compiled there; nothing is inlined from here.
//! `cargo run -p mimu-board-tests --bin budget` runs it, and knows the order.
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

/// In front of what is counted. Not the same as the other, or the compiler makes one of them.
#[inline(never)]
fn counted_from() {
    black_box(1);
}

/// Behind it.
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

    // What the marks cost by themselves.
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
        // The first sample is evaluated twice.
        single::remove(all, &mut state, &si);
        between(|| single::remove(all, &mut state, &si));
    };
    remove(&none());
    let term = DeviceEffect::term(Sensor::Gyro, 1, 1e-3, &TERM);
    // Those that run with every sample.
    let fast =
        |effect: &Result<DeviceEffect<f32>, EffectError>| matches!(effect, Ok(e) if !e.is_slow());
    let named = EFFECTS.iter().map(|id| named(id)).filter(fast);
    for effect in named.chain([term]) {
        let mut all = none();
        let Ok(effect) = effect else { continue };
        // Alone, it pays for what all of a triad share; the second shows what each costs.
        for _ in 0..2 {
            if all.push(effect).is_ok() {
                remove(&all);
            }
        }
    }
    // Without any, with one axis of a triad, with all of it, and with both.
    let mut all = none();
    let clean = |all: &Effects<f32, ROOM>| between(|| single::without_code_errors(all, &raw));
    clean(&all);
    for (sensor, axes) in [
        (Sensor::Gyro, 0..1),
        (Sensor::Gyro, 1..3),
        (Sensor::Accel, 0..3),
    ] {
        for axis in axes {
            // Of each axis its own.
            let weight = 1.65 + 0.1 * axis as f32;
            if let Ok(code) =
                DeviceEffect::code(sensor, Some(axis), &[1e-4; 9], weight, 0.01 * weight)
            {
                let _ = all.push(code);
            }
        }
        clean(&all);
    }
    loop {
        cortex_m::asm::wfi();
    }
}

/// Variables of a term, as many as there can be.
const TERM: [Variable; 3] = [Variable::RateX, Variable::ForceY, Variable::ForceZ];

fn named(id: &str) -> Result<DeviceEffect<f32>, EffectError> {
    match DeviceEffect::named(id, &[1e-4; 9], None) {
        Err(EffectError::Count { .. }) => DeviceEffect::named(id, &[1e-4; 3], None),
        other => other,
    }
}
