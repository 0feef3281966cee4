//! The self-test: deflects the sensors by their inputs, and measures what comes of it.

use embassy_stm32::gpio::Output;
use embassy_time::Timer;
use mimu_core::compensation::Sample;
use mimu_core::wire::{self, flags};
use nalgebra::Vector3;

use crate::board::SelfTestPins;
use crate::design_parameters::{
    ACCEL_NULL_V, SELF_TEST_ACCEL_TOLERANCE_V, SELF_TEST_ACCEL_V, SELF_TEST_SAMPLES,
    SELF_TEST_SETTLE_MS, SELF_TEST_ST1_V, SELF_TEST_ST2_V, SELF_TEST_TOLERANCE_V,
};
use crate::pipeline::Shared;

/// Takes about a second. The inputs are as before afterwards.
pub async fn run(pins: &mut SelfTestPins, pipeline: &Shared) -> wire::SelfTest {
    pipeline.lock(|p| p.borrow_mut().flag(flags::SELF_TEST, true));
    let rest = mean(pipeline).await;
    pins.st1.set_high();
    let st1 = mean(pipeline).await.gyro - rest.gyro;
    pins.st1.set_low();
    pins.st2.set_high();
    let st2 = mean(pipeline).await.gyro - rest.gyro;
    pins.st2.set_low();
    pins.range.iter_mut().for_each(Output::set_high);
    let coarse = mean(pipeline).await.accel;
    pins.range.iter_mut().for_each(Output::set_low);
    // The sensors have to be back before the flag goes.
    Timer::after_millis(SELF_TEST_SETTLE_MS).await;
    pipeline.lock(|p| p.borrow_mut().flag(flags::SELF_TEST, false));

    let within = |value: f32, wanted: f32, by: f32| (value - wanted).abs() <= by;
    let mut passed = 0;
    for axis in 0..3 {
        let moved = within(st1[axis], SELF_TEST_ST1_V, SELF_TEST_TOLERANCE_V)
            && within(st2[axis], SELF_TEST_ST2_V, SELF_TEST_TOLERANCE_V);
        passed |= u8::from(moved) << axis;
    }
    let length = |v: &Vector3<f32>| v.add_scalar(-ACCEL_NULL_V).norm();
    let shrunk = length(&rest.accel) - length(&coarse);
    let moved = within(shrunk, SELF_TEST_ACCEL_V, SELF_TEST_ACCEL_TOLERANCE_V);
    wire::SelfTest {
        gyro_st1_v: st1.into(),
        gyro_st2_v: st2.into(),
        accel_fine_v: rest.accel.into(),
        accel_coarse_v: coarse.into(),
        passed: passed | u8::from(moved) << 3,
    }
}

/// Mean of some samples, V, once the sensors have settled.
async fn mean(pipeline: &Shared) -> Sample<f32> {
    Timer::after_millis(SELF_TEST_SETTLE_MS).await;
    pipeline.lock(|p| p.borrow_mut().measure(SELF_TEST_SAMPLES));
    loop {
        Timer::after_millis(u64::from(SELF_TEST_SAMPLES) / 4).await;
        if let Some(mean) = pipeline.lock(|p| p.borrow().measured()) {
            return mean;
        }
    }
}
