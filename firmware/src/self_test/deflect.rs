//! Deflects the sensors with their test inputs, and measures the response.

use embassy_stm32::gpio::Output;
use embassy_time::Timer;
use mimu_core::compensation::Sample;
use mimu_core::wire::{Refusal, TestTable, flags};

use super::{Measured, judge};
use crate::convert::Analog;
use crate::design_parameters::{SELF_TEST_SAMPLES, SELF_TEST_SETTLE_MS};
use crate::pipeline::Shared;
use crate::supply::Supply;

/// Inputs of the sensors, and the measurement of their supply.
pub struct SelfTest {
    /// ST1 of the three gyros.
    pub st1: Output<'static>,
    /// ST2 of the three gyros.
    pub st2: Output<'static>,
    /// g-Select1 and g-Select2 of the accelerometer.
    pub range: [Output<'static>; 2],
    /// The converter that can read the internal reference.
    pub supply: Supply,
}

impl SelfTest {
    /// Takes about a second, and restores the inputs. The results go into `table`.
    pub async fn run(
        &mut self,
        pipeline: &Shared<Analog>,
        table: &mut TestTable,
    ) -> Result<(), Refusal> {
        pipeline.lock(|p| p.borrow_mut().flag(flags::SELF_TEST, true));
        let rest = mean(pipeline).await;
        self.st1.set_high();
        let st1 = mean(pipeline).await.gyro - rest.gyro;
        self.st1.set_low();
        self.st2.set_high();
        let st2 = mean(pipeline).await.gyro - rest.gyro;
        self.st2.set_low();
        self.range.iter_mut().for_each(Output::set_high);
        let coarse = mean(pipeline).await.accel;
        self.range.iter_mut().for_each(Output::set_low);
        // The sensors have to settle before the flag is cleared.
        Timer::after_millis(SELF_TEST_SETTLE_MS).await;
        pipeline.lock(|p| p.borrow_mut().flag(flags::SELF_TEST, false));

        let supply_v = self.supply.volts().await;
        let slow = pipeline.lock(|p| *p.borrow().source());
        let measured = Measured {
            gyro_st1_v: st1.into(),
            gyro_st2_v: st2.into(),
            accel_fine_v: rest.accel.into(),
            accel_coarse_v: coarse.into(),
            temperatures_c: slow.gyro_temps_c(),
            temperatures_count: slow.temperatures_that_count(),
            reference_v: slow.reference_share() * supply_v,
            supply_v,
        };
        judge(&measured, table);
        Ok(())
    }
}

/// Mean of some samples, V, once the sensors have settled.
async fn mean(pipeline: &Shared<Analog>) -> Sample<f32> {
    Timer::after_millis(SELF_TEST_SETTLE_MS).await;
    pipeline.lock(|p| p.borrow_mut().measure(SELF_TEST_SAMPLES));
    loop {
        Timer::after_millis(u64::from(SELF_TEST_SAMPLES) / 4).await;
        if let Some(mean) = pipeline.lock(|p| p.borrow().measured()) {
            return mean;
        }
    }
}
