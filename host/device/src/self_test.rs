//! The device's self-test, and whether the unit stood still for it.
//!
//! The device deflects its sensors one state after the other and compares the means, so that a unit that begins to turn in
//! between fails like one whose self-test pins are open. The raw stream before and after tells the two apart.

use std::time::Duration;

use mimu::quantity::AXES;
use mimu_core::wire::{Request, checks};
use serde::Serialize;

use super::heard::Answer;
use super::session::Session;
use super::stream::{Moments, Stream, Streamed, stream};
use mimu_recording::error::Result;

/// The self-test takes a second; a device that is slow to start it gets as much again, and then some.
const PATIENCE: Duration = Duration::from_secs(5);
/// What is looked at before and after.
const LOOK: Duration = Duration::from_millis(250);
/// Largest scatter of a gyro at rest, V, as a standard deviation and as a change of the mean: 4 deg/s. Its noise is
/// 3.5 mV, and what decides the test is 120 mV.
const STILL_GYRO_V: f64 = 0.02;
/// The same of the accelerometer, V: 50 mg, or a tilt by 3 degrees. Its noise is 5 mV, and what decides is 150 mV.
const STILL_ACCEL_V: f64 = 0.04;

/// Least change between its ranges by which an axis of the accelerometer has shown that it senses, V: two fifths of gravity, which is more
/// than nulls can differ by.
const SEEN_V: f32 = 0.24;

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
    /// Temperatures by the TEMP pins of gyro x, y, z, °C.
    pub gyro_temps_c: [f32; 3],
    /// Reference of the gyros, V at the gyro.
    pub reference_v: f32,
    /// Supply of converter and accelerometer, V.
    pub supply_v: f32,
    /// Axes of the accelerometer that lie across gravity: one that is stuck at its null would read the same in this pose.
    pub accel_not_shown: Vec<&'static str>,
    /// The sensor with the largest motion, in words, if the unit did not stand still.
    pub moved: Option<String>,
}

/// Whether the sensors answered as their data sheets state, and are supplied as they are to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Passed {
    /// Gyro x.
    pub gyro_x: bool,
    /// Gyro y.
    pub gyro_y: bool,
    /// Gyro z.
    pub gyro_z: bool,
    /// Accelerometer x: it follows its range, about a null that its data sheet allows.
    pub accel_x: bool,
    /// Accelerometer y.
    pub accel_y: bool,
    /// Accelerometer z.
    pub accel_z: bool,
    /// All three of them together see gravity.
    pub gravity: bool,
    /// TEMP of gyro x: in its range, and in agreement with the others.
    pub temp_x: bool,
    /// TEMP of gyro y.
    pub temp_y: bool,
    /// TEMP of gyro z.
    pub temp_z: bool,
    /// Reference of the gyros.
    pub reference: bool,
    /// Supply of converter and accelerometer.
    pub supply: bool,
}

impl Passed {
    fn of(bits: u16) -> Self {
        let on = |check: u16| bits & check == check;
        let [gyro_x, gyro_y, gyro_z] = checks::GYRO.map(on);
        let [accel_x, accel_y, accel_z] = checks::ACCEL.map(on);
        let [temp_x, temp_y, temp_z] = checks::TEMPERATURE.map(on);
        Self {
            gyro_x,
            gyro_y,
            gyro_z,
            accel_x,
            accel_y,
            accel_z,
            gravity: on(checks::GRAVITY),
            temp_x,
            temp_y,
            temp_z,
            reference: on(checks::REFERENCE),
            supply: on(checks::SUPPLY),
        }
    }

    /// Each with its name, in the order of the fields.
    pub fn all(self) -> [(&'static str, bool); 12] {
        [
            ("gyro x", self.gyro_x),
            ("gyro y", self.gyro_y),
            ("gyro z", self.gyro_z),
            ("accel x", self.accel_x),
            ("accel y", self.accel_y),
            ("accel z", self.accel_z),
            ("gravity", self.gravity),
            ("temperature x", self.temp_x),
            ("temperature y", self.temp_y),
            ("temperature z", self.temp_z),
            ("reference", self.reference),
            ("supply", self.supply),
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
    Ok(SelfTested {
        passed: Passed::of(test.passed),
        gyro_st1_v: test.gyro_st1_v,
        gyro_st2_v: test.gyro_st2_v,
        accel_fine_v: test.accel_fine_v,
        accel_coarse_v: test.accel_coarse_v,
        gyro_temps_c: test.gyro_temps_c,
        reference_v: test.reference_v,
        supply_v: test.supply_v,
        accel_not_shown: not_shown(&test.accel_fine_v, &test.accel_coarse_v),
        moved: moved([&before.gyro, &before.accel], [&after.gyro, &after.accel]),
    })
}

/// Names of the axes whose outputs, V, do not change with the range.
fn not_shown(fine: &[f32; 3], coarse: &[f32; 3]) -> Vec<&'static str> {
    let axes = AXES.into_iter().zip(fine.iter().zip(coarse));
    axes.filter(|(_, (fine, coarse))| (*fine - *coarse).abs() < SEEN_V)
        .map(|(axis, _)| axis)
        .collect()
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
    fn an_axis_across_gravity_is_one_that_the_pose_does_not_show() {
        let told = not_shown(&[1.65, 2.2, 1.2], &[1.65, 1.8, 1.54]);
        assert_eq!(told, ["x"]);
    }

    #[test]
    fn every_check_of_the_device_has_a_name_of_its_own() {
        assert!(Passed::of(checks::ALL).all().iter().all(|(_, on)| *on));
        let mut seen = [false; 12];
        for bit in 0..12 {
            let failed = Passed::of(checks::ALL & !(1 << bit)).all();
            let failed: Vec<usize> = (0..12).filter(|k| !failed[*k].1).collect();
            let [one] = failed[..] else {
                panic!("bit {bit}: {failed:?}");
            };
            assert!(!std::mem::replace(&mut seen[one], true));
        }
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
