//! The device's self-test, and whether the unit stood still for it.
//!
//! The device deflects its sensors one state after the other and compares the means, so that a unit that begins to turn in
//! between fails like one whose self-test pins are open. The raw stream before and after tells the two apart.

use std::time::Duration;

use mimu_core::wire::{Request, SelfTest};

use super::heard::Answer;
use super::session::Session;
use super::stream::{Stream, Streamed, stream};
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

/// What a self-test has found.
#[derive(Debug, Clone, PartialEq)]
pub struct SelfTested {
    /// As the device judges it.
    pub test: SelfTest,
    /// The sensor that moved most of all, in a few words, if the unit did not stand still.
    pub moved: Option<String>,
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
    let moved = moved(&before, &after);
    Ok(SelfTested { test, moved })
}

fn look(session: &mut Session) -> Result<Streamed> {
    stream(session, Stream::Raw, Some(LOOK), || false, |_, _, _| Ok(()))
}

fn moved(before: &Streamed, after: &Streamed) -> Option<String> {
    let mut worst = (1.0, None);
    for i in 0..6 {
        let (name, limit) = match i {
            0..3 => ("gyro", STILL_GYRO_V),
            _ => ("accel", STILL_ACCEL_V),
        };
        let axis = ["x", "y", "z"][i % 3];
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
    worst.1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(gyro_x: f64, accel_z: f64, deviation: f64) -> Streamed {
        Streamed {
            mean: [gyro_x, 2.5, 2.5, 1.65, 1.65, accel_z],
            deviation: [deviation; 6],
            ..Streamed::default()
        }
    }

    #[test]
    fn noise_is_no_motion_and_the_sensor_that_moved_is_named() {
        let rest = seen(2.5, 2.45, 0.0035);
        assert_eq!(moved(&rest, &seen(2.51, 2.44, 0.005)), None);
        let turned = moved(&rest, &seen(2.6, 2.35, 0.005)).unwrap();
        assert!(turned.starts_with("gyro x was at 2.500 V"), "{turned}");
        let tilted = moved(&rest, &seen(2.5, 1.65, 0.005)).unwrap();
        assert!(tilted.starts_with("accel z"), "{tilted}");
        let shaken = moved(&rest, &seen(2.5, 2.45, 0.1)).unwrap();
        assert!(shaken.contains("sigma"), "{shaken}");
    }
}
