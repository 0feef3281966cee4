//! The device's self-test, and whether the unit was at rest during it.
//!
//! The device deflects its sensors one after the other and compares the means. A unit that begins to turn in between therefore fails like one with
//! open self-test pins. The raw stream before and after distinguishes the two.

use std::time::Duration;

use mimu::quantity::AXES;
use mimu_core::wire::{Request, checks};
use serde::Serialize;

use super::received::Answer;
use super::session::Session;
use super::stream::{Moments, Stream, Streamed, stream};
use mimu_recording::error::Result;

/// Wait for the self-test, which takes a second: the rest is reserve for a slow start.
const PATIENCE: Duration = Duration::from_secs(5);
/// Length of the raw stream before and after.
const LOOK: Duration = Duration::from_millis(250);
/// Largest scatter of a gyro at rest, V, as a standard deviation and as a change of the mean: 4 deg/s. Its noise is 3.5 mV; the test's threshold is
/// 120 mV.
const STILL_GYRO_V: f64 = 0.02;
/// The same limit for the accelerometer, V: 50 mg, or a tilt by 3 degrees. Its noise is 5 mV; the test's threshold is 150 mV.
const STILL_ACCEL_V: f64 = 0.04;

/// Least change between the ranges that proves that an axis of the accelerometer responds, V: two fifths of gravity, more than nulls can differ by.
const SEEN_V: f32 = 0.24;

/// Result of `mimu device self-test`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelfTested {
    /// Verdict of the device.
    pub passed: Passed,
    /// Change of the gyros' outputs x, y, z by ST1, V at the gyro.
    pub gyro_st1_v: [f32; 3],
    /// Change of the gyros' outputs x, y, z by ST2, V at the gyro.
    pub gyro_st2_v: [f32; 3],
    /// Outputs of the accelerometer in its finest range, V.
    pub accel_fine_v: [f32; 3],
    /// Outputs of the accelerometer in its coarsest range, V.
    pub accel_coarse_v: [f32; 3],
    /// Temperatures by the TEMP pins of gyro x, y, z, °C.
    pub gyro_temps_c: [f32; 3],
    /// Reference voltage of the gyros, V at the gyro.
    pub reference_v: f32,
    /// Supply voltage of converter and accelerometer, V.
    pub supply_v: f32,
    /// Horizontal axes of the accelerometer. One that is stuck at its null would read the same in this pose.
    pub accel_not_shown: Vec<&'static str>,
    /// The sensor with the largest motion, in words, if the unit moved.
    pub moved: Option<String>,
}

/// Whether sensors and supplies are within their data sheets' limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Passed {
    /// Gyro x.
    pub gyro_x: bool,
    /// Gyro y.
    pub gyro_y: bool,
    /// Gyro z.
    pub gyro_z: bool,
    /// Accelerometer x: its output scales with the range, and its null is within the data sheet's limits.
    pub accel_x: bool,
    /// Accelerometer y.
    pub accel_y: bool,
    /// Accelerometer z.
    pub accel_z: bool,
    /// The three accelerometers together measure gravity.
    pub gravity: bool,
    /// TEMP of gyro x: within its range, and consistent with the others.
    pub temp_x: bool,
    /// TEMP of gyro y.
    pub temp_y: bool,
    /// TEMP of gyro z.
    pub temp_z: bool,
    /// Reference voltage of the gyros.
    pub reference: bool,
    /// Supply voltage of converter and accelerometer.
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

    /// Each check with its name, in the order of the fields.
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

/// Runs the self-test, and measures the raw stream before and after. Takes two seconds.
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

/// Describes the largest motion between `before` and `after` (gyro and accelerometer, V), if it exceeds the limits.
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
