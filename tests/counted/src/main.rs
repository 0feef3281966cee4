//! What the device computes with a sample, each between two marks, for the emulator to count instructions.
//!
//! The functions are those of `mimu_no_panic`: compiled on their own, called through pointers, nothing inlined from
//! here. `cargo run -p mimu-tests --bin budget` runs it, and knows the order.
#![no_std]
#![no_main]

use core::hint::black_box;

use mimu_core::compensation::{Affine, Compensation, Sample};
use mimu_core::kalman::Filter;
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
    let mut filter = Filter::with_prior([0.0, 0.0, 1.0, 0.0], [1.0, 1.0, 1.0, 1.0]);

    // What the marks cost by themselves.
    between(|| ());
    between(|| mimu_no_panic::compensation(&model, &raw));
    between(|| mimu_no_panic::filter_update(&mut filter, &raw.gyro, 2.5, 1e-3));
    loop {
        cortex_m::asm::wfi();
    }
}
