//! The device's self-test, and whether the unit was at rest during it.
//!
//! The device deflects its sensors one after the other and compares the means. A unit that begins to turn in between therefore fails like one with
//! open self-test pins. The raw stream before and after distinguishes the two.

use std::time::Duration;

use mimu::quantity::{AXES, PerSensor};
use mimu_core::wire::Request;
use serde::Serialize;

use super::identity::TriadInfo;
use super::received::Answer;
use super::session::Session;
use super::stream::{Moments, look};
use super::test_result::{TestResult, Verdict};
use mimu_recording::error::Result;

/// Wait for the self-test, which takes a second; that of an emulated board on a busy computer takes ten times that.
const PATIENCE: Duration = Duration::from_secs(20);
/// Length of the raw stream before and after.
const LOOK: Duration = Duration::from_millis(250);
/// Largest scatter of a gyro at rest, rad/s, as a standard deviation and as a change of the mean: 4 deg/s. The noise of an ADXRS300 is 0.7 deg/s;
/// its test's threshold is 24 deg/s.
const STILL_GYRO: f64 = 0.07;
/// The same limit for the accelerometer, m/s²: 50 mg, or a tilt by 3 degrees. The noise of an MMA7260QT is 6 mg; its test's threshold is 190 mg.
const STILL_ACCEL: f64 = 0.49;

/// Rates that no sound gyro reads at rest, deg/s: twice the offset of an analog part (ADXRS300: its null is within 0.2 V, 40 deg/s) and ten times that of a
/// digital one (ICM-42688-P: 0.5 deg/s, DS-000347, table 1).
const OFFSETS_DPS: [f64; 2] = [80.0, 5.0];

/// Result of `mimu device self-test`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelfTested {
    /// What the device measured.
    pub results: Vec<TestResult>,
    /// The sensor with the largest motion, in words, if the unit moved.
    pub moved: Option<String>,
}

impl SelfTested {
    /// Names of the results with this verdict.
    pub fn named(&self, verdict: Verdict) -> Vec<&str> {
        let of = self.results.iter().filter(|row| row.verdict == verdict);
        of.map(|row| row.name.as_str()).collect()
    }
}

/// Runs the self-test, and measures the raw stream before and after. Takes two seconds.
pub fn self_test(session: &mut Session) -> Result<SelfTested> {
    let before = look(session, LOOK)?;
    let purpose = "to test its sensors";
    let test = match session.call(Request::SelfTest, purpose, PATIENCE)? {
        Answer::SelfTest(test) => test,
        _ => return Err(session.unexpected(purpose)),
    };
    let after = look(session, LOOK)?;
    let limits = session.who().sensors.as_ref().zip(PerSensor {
        gyro: STILL_GYRO,
        accel: STILL_ACCEL,
    });
    let limits = limits.map(|(sensors, limit)| limit * sensors.per_si.abs());
    let moved = moved(
        [&before.gyro, &before.accel],
        [&after.gyro, &after.accel],
        limits,
    );
    Ok(SelfTested {
        results: test,
        moved: moved.or_else(|| turned(&before.gyro, &session.who().sensors.gyro)),
    })
}

/// Describes an even turn: a rate that exceeds what the part's data sheet allows at rest.
fn turned(seen: &Moments, gyro: &TriadInfo) -> Option<String> {
    let at_rest = match gyro.unit.as_str() {
        "V" => OFFSETS_DPS[0],
        _ => OFFSETS_DPS[1],
    };
    let rates = seen
        .mean
        .map(|mean| ((mean - gyro.null) / gyro.per_si).to_degrees());
    let fastest = AXES
        .iter()
        .zip(rates)
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    let (axis, rate) = fastest.filter(|(_, rate)| rate.abs() > at_rest)?;
    Some(format!(
        "it turned at {rate:.1} deg/s about {axis} before the test and after it"
    ))
}

/// Describes the largest motion between `before` and `after` (gyro and accelerometer, raw units), if it exceeds the limits.
fn moved(before: [&Moments; 2], after: [&Moments; 2], limits: PerSensor<f64>) -> Option<String> {
    let mut worst = (1.0, None);
    for (triad, (name, limit)) in [("gyro", limits.gyro), ("accel", limits.accel)]
        .into_iter()
        .enumerate()
    {
        let (before, after) = (before[triad], after[triad]);
        let unit = &before.unit;
        for (i, axis) in AXES.iter().enumerate() {
            let (from, to) = (before.mean[i], after.mean[i]);
            let swing = before.deviation[i].max(after.deviation[i]);
            let told = [
                (
                    (to - from).abs() / limit,
                    format!(
                        "{name} {axis} was at {from:.3} {unit} before and at {to:.3} {unit} after"
                    ),
                ),
                (
                    swing / limit,
                    format!("{name} {axis} moved by {swing:.3} {unit} (one sigma)"),
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
            unit: "V".into(),
            mean,
            deviation: [deviation; 3],
        })
    }

    #[test]
    fn an_even_turn_is_named_and_an_offset_at_rest_is_not() {
        let gyro = TriadInfo {
            part: "ICM-42688-P".into(),
            unit: "count".into(),
            bits: 19,
            range: 34.9,
            null: 0.0,
            // 131.072 counts per deg/s.
            per_si: 131.072 * 57.295_779_5,
            filter: String::new(),
        };
        let at = |dps: f64| {
            let mean = [0.0, -0.4, dps].map(|dps| 131.072 * dps);
            let unit = "count".into();
            turned(
                &Moments {
                    unit,
                    mean,
                    deviation: [5.0; 3],
                },
                &gyro,
            )
        };
        assert_eq!(at(3.0), None);
        assert!(at(-10.0).unwrap().contains("-10.0 deg/s about z"));
    }

    #[test]
    fn noise_is_no_motion_and_the_sensor_that_moved_is_named() {
        let rest = seen(2.5, 2.45, 0.0035);
        let limits = [0.02, 0.04].into();
        let told = |after: [Moments; 2]| moved(rest.each_ref(), after.each_ref(), limits);
        assert_eq!(told(seen(2.51, 2.44, 0.005)), None);
        let turned = told(seen(2.6, 2.35, 0.005)).unwrap();
        assert!(turned.starts_with("gyro x was at 2.500 V"), "{turned}");
        let tilted = told(seen(2.5, 1.65, 0.005)).unwrap();
        assert!(tilted.starts_with("accel z"), "{tilted}");
        let shaken = told(seen(2.5, 2.45, 0.1)).unwrap();
        assert!(shaken.contains("sigma"), "{shaken}");
    }
}
