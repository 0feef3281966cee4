//! Self-test of a digital sensor: its response to a force of its own on the masses, compared with what the factory measured.

use mimu_core::PerSensor;
use mimu_core::compensation::Sample;
use mimu_core::wire::{TestRow, TestTable, Triad};

use crate::design_parameters::{RADIANS, STANDARD_GRAVITY};

/// Response over the factory's that passes (the maker's own driver for the family, pass and fail criteria).
const RATIO: [f32; 2] = [0.5, 1.5];

/// Response that passes where the factory stored none, dps and g (the same source; it gives no upper limit for the gyro, so this is its range).
const WITHOUT_FACTORY: PerSensor<[f32; 2]> = PerSensor {
    gyro: [60.0, 2_000.0],
    accel: [0.05, 1.2],
};

/// Largest reading of a resting gyro, dps (the same source). The data sheet's zero-rate offset is far below it: a larger one is damage.
const GYRO_OFFSET_DPS: f32 = 20.0;

/// Names of the rows of an axis.
const ROWS: [[&str; 3]; 3] = [
    ["gyro x, response", "gyro x, at rest", "accel x, response"],
    ["gyro y, response", "gyro y, at rest", "accel y, response"],
    ["gyro z, response", "gyro z, at rest", "accel z, response"],
];

/// Means of counts in the states of the test, and the factory's responses, dps and g.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Without a deflection.
    pub rest: Sample<f32>,
    /// With both triads deflected.
    pub deflected: Sample<f32>,
    /// What the factory measured, if it stored that.
    pub factory: PerSensor<[Option<f32>; 3]>,
}

/// Fills the table of results.
pub fn judge(of: &Measured, triads: &PerSensor<Triad<'_>>, table: &mut TestTable) {
    let dps = |counts: f32| counts / triads.gyro.per_si / RADIANS;
    let g = |counts: f32| counts / triads.accel.per_si / STANDARD_GRAVITY;
    for (axis, [gyro, offset, accel]) in ROWS.into_iter().enumerate() {
        let (rest, on) = (&of.rest, &of.deflected);
        let response = dps(on.gyro[axis] - rest.gyro[axis]);
        let factory = of.factory.gyro[axis];
        // There is room for all rows, which a test shows.
        table.push(&row(gyro, response, "dps", factory, WITHOUT_FACTORY.gyro));
        let limits = [-GYRO_OFFSET_DPS, GYRO_OFFSET_DPS];
        table.push(&TestRow::within(
            offset,
            dps(rest.gyro[axis]),
            "dps",
            limits,
        ));
        let response = g(on.accel[axis] - rest.accel[axis]);
        let factory = of.factory.accel[axis];
        table.push(&row(accel, response, "g", factory, WITHOUT_FACTORY.accel));
    }
}

/// A response, as a share of the factory's if there is one. Its sign is not specified.
fn row<'a>(
    name: &'a str,
    response: f32,
    unit: &'a str,
    factory: Option<f32>,
    without: [f32; 2],
) -> TestRow<'a> {
    match factory {
        Some(factory) => TestRow::within(name, response.abs() / factory, "of factory", RATIO),
        None => TestRow::within(name, response.abs(), unit, without),
    }
}

#[cfg(target_os = "none")]
mod run {
    use embassy_time::Timer;
    use mimu_core::wire::{Refusal, flags};

    use super::*;
    use crate::design_parameters::SELF_TEST_SAMPLES;
    use crate::digital::Controls;
    use crate::pipeline::Shared;
    use crate::source::Source;

    /// Time from a deflection to its measurement, ms: what the maker's driver waits.
    const SETTLE_MS: u64 = 200;

    /// The test, with what it asks the sampling task for.
    pub struct SelfTest(pub &'static Controls);

    impl SelfTest {
        /// Takes a second, and ends without a deflection. The results go into `table`.
        ///
        /// Errors: [`Refusal::Busy`] if samples do not come.
        pub async fn run<S: Source>(
            &mut self,
            pipeline: &Shared<S>,
            table: &mut TestTable,
        ) -> Result<(), Refusal> {
            pipeline.lock(|p| p.borrow_mut().flag(flags::SELF_TEST, true));
            let rest = mean(pipeline).await;
            self.0.deflect(true, true);
            Timer::after_millis(SETTLE_MS).await;
            let deflected = mean(pipeline).await;
            self.0.deflect(false, false);
            // The sensors have to settle before the flag is cleared.
            Timer::after_millis(SETTLE_MS).await;
            pipeline.lock(|p| p.borrow_mut().flag(flags::SELF_TEST, false));
            let (Some(rest), Some(deflected)) = (rest, deflected) else {
                return Err(Refusal::Busy);
            };
            let measured = Measured {
                rest,
                deflected,
                factory: self.0.factory(),
            };
            judge(&measured, &S::TRIADS, table);
            Ok(())
        }
    }

    /// Mean of some samples, counts; `None` if they do not come within a second.
    async fn mean<S: Source>(pipeline: &Shared<S>) -> Option<Sample<f32>> {
        pipeline.lock(|p| p.borrow_mut().measure(SELF_TEST_SAMPLES));
        for _ in 0..40 {
            Timer::after_millis(25).await;
            if let Some(mean) = pipeline.lock(|p| p.borrow().measured()) {
                return Some(mean);
            }
        }
        None
    }
}
#[cfg(target_os = "none")]
pub use run::SelfTest;

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::{String, ToString};
    use std::vec::Vec;

    use mimu_core::wire::Verdict;
    use nalgebra::Vector3;

    use super::*;
    use crate::chip::Part;
    use crate::icm42688p::Icm42688p;

    /// Counts of the sensor per dps and per g.
    const PER_DPS: f32 = 131.072;
    const PER_G: f32 = 8192.0;

    fn unit() -> Measured {
        let at = |dps: [f32; 3], g: [f32; 3]| Sample {
            gyro: Vector3::from(dps) * PER_DPS,
            accel: Vector3::from(g) * PER_G,
        };
        Measured {
            rest: at([0.4, -19.0, 0.0], [0.0, 0.0, 1.0]),
            deflected: at([53.9, -80.0, 74.0], [0.4, -0.5, 1.6]),
            factory: PerSensor {
                gyro: [Some(53.5), Some(61.0), Some(100.0)],
                accel: [Some(0.4), Some(0.5), Some(0.6)],
            },
        }
    }

    fn failures(of: &Measured) -> Vec<String> {
        let mut table = TestTable::new();
        judge(of, &Icm42688p::<()>::TRIADS, &mut table);
        let result = table.result();
        assert_eq!((result.rows().count(), result.is_whole()), (9, true));
        let failed = result.rows().filter(|row| row.verdict == Verdict::Failed);
        failed.map(|row| row.name.to_string()).collect()
    }

    #[test]
    fn a_sound_sensor_passes_with_and_without_what_the_factory_stored() {
        assert_eq!(failures(&unit()), [""; 0]);
        let mut of = unit();
        of.factory = PerSensor::both([None; 3]);
        // 53.5 dps are too few where nothing says that the factory saw as many.
        assert_eq!(failures(&of), ["gyro x, response"]);
    }

    #[test]
    fn an_axis_that_does_not_respond_or_rests_elsewhere_fails_by_name() {
        let mut of = unit();
        of.deflected.gyro[1] = of.rest.gyro[1];
        of.deflected.accel[2] = of.rest.accel[2] + 1.0 * PER_G;
        assert_eq!(failures(&of), ["gyro y, response", "accel z, response"]);
        let mut of = unit();
        of.rest.gyro[2] = 21.0 * PER_DPS;
        assert_eq!(failures(&of), ["gyro z, at rest"]);
        let mut of = unit();
        of.rest.accel[0] = f32::NAN;
        assert_eq!(failures(&of), ["accel x, response"]);
    }
}
