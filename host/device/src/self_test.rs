//! The device's self-test, and whether the unit stood still for it.
//!
//! The device deflects its sensors one state after the other and compares the means, so that a unit that begins to turn in
//! between fails like one whose self-test pins are open. The raw stream before and after tells the two apart.

use std::time::Duration;

use mimu::quantity::AXES;
use mimu_core::wire::Request;
use serde::Serialize;

use super::heard::Answer;
use super::session::Session;
use super::stream::{Moments, Stream, Streamed, stream};
use mimu_recording::error::Result;

/// The self-test takes a second; a device that is slow to start it gets as much again, and then some.
const PATIENCE: Duration = Duration::from_secs(5);
/// What is looked at before and after.
const LOOK: Duration = Duration::from_millis(250);
/// Most that a gyro moves while it stands still, V, as a standard deviation and as a change of the mean: 4 deg/s. Its noise is
/// 3.5 mV, and what decides the test is 180 mV.
const STILL_GYRO_V: f64 = 0.02;
/// The same of the accelerometer, V: 50 mg, or a tilt by 3 degrees. Its noise is 5 mV, and what decides is 350 mV.
const STILL_ACCEL_V: f64 = 0.04;

/// What a self-test has found: the result of `mimu device self-test`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelfTested {
    /// As the device judges it.
    pub passed: Passed,
    /// Change of the gyros' outputs x, y, z by ST1, V at the gyro.
    pub gyro_st1_v: [f32; 3],
    /// The same by ST2.
    pub gyro_st2_v: [f32; 3],
    /// Outputs of the accelerometer in its finest range, V.
    pub accel_fine_v: [f32; 3],
    /// The same in its coarsest.
    pub accel_coarse_v: [f32; 3],
    /// The sensor that moved most of all, in a few words, if the unit did not stand still.
    pub moved: Option<String>,
}

/// Whether the sensors answered as their data sheets state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Passed {
    /// Gyro x.
    pub gyro_x: bool,
    /// Gyro y.
    pub gyro_y: bool,
    /// Gyro z.
    pub gyro_z: bool,
    /// All axes of the accelerometer.
    pub accel: bool,
}

impl Passed {
    /// Each with the name of the sensor.
    pub fn sensors(self) -> [(&'static str, bool); 4] {
        [
            ("gyro x", self.gyro_x),
            ("gyro y", self.gyro_y),
            ("gyro z", self.gyro_z),
            ("accel", self.accel),
        ]
    }
}

/// Deflects the sensors and measures what comes of it. Takes two seconds.
pub fn self_test(session: &mut Session) -> Result<SelfTested> {
    let before = look(session)?;
    let purpose = "to test its sensors";
    let test = match session.call(Request::SelfTest, purpose, PATIENCE)? {
        Answer::SelfTest(test) => test,
        _ => return Err(session.unexpected(purpose)),
    };
    let after = look(session)?;
    let [gyro_x, gyro_y, gyro_z, accel] = [0, 1, 2, 3].map(|bit| test.passed >> bit & 1 == 1);
    Ok(SelfTested {
        passed: Passed {
            gyro_x,
            gyro_y,
            gyro_z,
            accel,
        },
        gyro_st1_v: test.gyro_st1_v,
        gyro_st2_v: test.gyro_st2_v,
        accel_fine_v: test.accel_fine_v,
        accel_coarse_v: test.accel_coarse_v,
        moved: moved([&before.gyro, &before.accel], [&after.gyro, &after.accel]),
    })
}

fn look(session: &mut Session) -> Result<Streamed> {
    stream(session, Stream::Raw, Some(LOOK), || false, |_, _, _| Ok(()))
}

/// `before` and `after`: gyro and accelerometer, V.
fn moved(before: [&Moments; 2], after: [&Moments; 2]) -> Option<String> {
    let mut worst = (1.0, None);
    for (triad, (name, limit)) in [("gyro", STILL_GYRO_V), ("accel", STILL_ACCEL_V)]
        .into_iter()
        .enumerate()
    {
        let (before, after) = (before[triad], after[triad]);
        for (i, axis) in AXES.iter().enumerate() {
            let (from, to) = (before.mean[i], after.mean[i]);
            let swing = before.deviation[i].max(after.deviation[i]);
            let told = [
                (
                    (to - from).abs() / limit,
                    format!("{name} {axis} was at {from:.3} V before and at {to:.3} V after"),
                ),
                (
                    swing / limit,
                    format!("{name} {axis} moved by {swing:.3} V (one sigma)"),
                ),
            ];
            for (share, words) in told {
                if share > worst.0 {
                    worst = (share, Some(words));
                }
            }
        }
    }
    worst.1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(gyro_x: f64, accel_z: f64, deviation: f64) -> [Moments; 2] {
        [[gyro_x, 2.5, 2.5], [1.65, 1.65, accel_z]].map(|mean| Moments {
            unit: "V",
            mean,
            deviation: [deviation; 3],
        })
    }

    #[test]
    fn noise_is_no_motion_and_the_sensor_that_moved_is_named() {
        let rest = seen(2.5, 2.45, 0.0035);
        let told = |after: [Moments; 2]| moved(rest.each_ref(), after.each_ref());
        assert_eq!(told(seen(2.51, 2.44, 0.005)), None);
        let turned = told(seen(2.6, 2.35, 0.005)).unwrap();
        assert!(turned.starts_with("gyro x was at 2.500 V"), "{turned}");
        let tilted = told(seen(2.5, 1.65, 0.005)).unwrap();
        assert!(tilted.starts_with("accel z"), "{tilted}");
        let shaken = told(seen(2.5, 2.45, 0.1)).unwrap();
        assert!(shaken.contains("sigma"), "{shaken}");
    }
}
