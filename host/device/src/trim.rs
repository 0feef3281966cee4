//! Corrects the offsets of the stored calibration while the unit is at rest. Within a month, biases change more than any other parameter, and they
//! need no rate table.

use std::time::Duration;

use mimu_core::compensation::Sample;
use mimu_core::stored::{self, StoredError};
use serde::Serialize;

use super::identity::Hash;
use super::image::Image;
use super::session::Session;
use super::stream::{Stream, Streamed, stream};
use super::upload::{download, upload};
use mimu::quantity::{AXES, PerSensor, Sensor};
use mimu_recording::error::{Error, Result};

/// Length of the segments whose means are compared, s. The scatter of these means shows the remaining noise, whatever its spectrum within a segment.
const STRETCH_S: f64 = 0.5;
/// Shortest average, s: eight segments, which determine a standard deviation to within a quarter.
pub const SHORTEST_TRIM_S: f64 = 8.0 * STRETCH_S;
/// Limit at rest for the scatter of the segments' means and for the difference between the two halves. 0.5 deg/s, where a gyro's noise causes 0.1;
/// and 0.1 m/s², a tilt by 0.6 degrees, where the accelerometer's noise causes 0.004.
const STILL: PerSensor<f64> = PerSensor {
    gyro: 0.0087,
    accel: 0.1,
};
/// Largest correction: 10 deg/s and 2 m/s². Biases do not drift so far within the sensors' temperature range. A larger error suggests a unit that
/// turns steadily about the vertical, or a pose other than the given one.
const MOST: PerSensor<f64> = PerSensor {
    gyro: 0.175,
    accel: 2.0,
};

/// Known input of the unit at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Specific force in the body frame, m/s²: gravity along the direction that points up. If `None`, the accelerometer keeps its offsets. The
    /// magnitude of gravity alone would not suffice: it is one number for three offsets, and an error along the pose may as well be a scale-factor
    /// error.
    pub force_mps2: Option<[f64; 3]>,
}

/// Errors of a triad's output while the unit was at rest.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrimmedTriad {
    /// Whether its offsets were corrected.
    pub trimmed: bool,
    /// Mean error of the compensated output x, y, z before the trim; without a known input, the mean output.
    pub before: [f64; 3],
    /// Standard deviations of these means.
    pub sigma_before: [f64; 3],
    /// Mean error after the new offsets were stored, from new samples.
    pub after: [f64; 3],
    /// Standard deviations of these.
    pub sigma_after: [f64; 3],
    /// Correction added to o of every node.
    pub added: [f32; 3],
    /// rad/s or m/s^2.
    pub unit: &'static str,
}

/// Result of `mimu device trim`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trimmed {
    /// Results of the two triads.
    #[serde(flatten)]
    pub triads: PerSensor<TrimmedTriad>,
    /// Temperature of the dies during the trim, °C. The correction is the same at all temperatures.
    pub temp_c: f64,
    /// Averaging time before and after, s each.
    pub averaged_s: f64,
    /// Hash of the calibration before.
    pub before: Hash,
    /// Hash of the new calibration.
    pub hash: Hash,
    /// Warnings, one sentence each.
    pub warnings: Vec<String>,
}

/// Mean errors of the axes of a triad, and their standard deviations.
type Means = ([f64; 3], [f64; 3]);

/// Means of segments of the compensated stream.
struct Average {
    means: Vec<Sample<f64>>,
    summary: Streamed,
}

/// Averages the compensated output for `duration` while the unit is at rest, corrects the offsets of all nodes, stores the calibration and averages
/// again. `trimmed_s` is the present time, UTC seconds since 1970. `progress` gets the fraction done.
///
/// The calibration keeps its unit, date and recording.
pub fn trim(
    session: &mut Session,
    pose: &Pose,
    duration: Duration,
    trimmed_s: u64,
    progress: impl Fn(f64),
) -> Result<Trimmed> {
    let mut bytes = download(session)?;
    let held = Hash(stored::hash(&bytes));
    // A calibration that cannot be trimmed is refused before the averaging. The values do not matter here.
    stored::trim(&mut bytes.clone(), PerSensor::default(), trimmed_s)
        .map_err(|refused| refuse(session, &refused))?;
    let before = average(session, duration, |share| progress(0.45 * share))?;
    if let Some(motion) = before.motion() {
        let remedy = "let it lie still and trim again; the calibration is unchanged";
        return Err(Error::device(session.port(), motion, remedy));
    }
    let input = PerSensor {
        gyro: Some([0.0; 3]),
        accel: pose.force_mps2,
    };
    let errors = before.errors(input);
    check_size(session, &errors, input)?;
    let add = errors.zip(input).map(|((error, _), input)| match input {
        Some(_) => error.map(|error| -error as f32),
        None => [0.0; 3],
    });
    stored::trim(&mut bytes, add, trimmed_s).map_err(|refused| refuse(session, &refused))?;
    let image = Image::stored_before(bytes).map_err(|refused| refuse(session, &refused))?;
    // `true`: the device stores this calibration already, so its unit was accepted before.
    upload(session, &image, true, |share| progress(0.45 + 0.1 * share))?;
    let after = average(session, duration, |share| progress(0.55 + 0.45 * share))?;
    let left = after.errors(input);
    let triad = |sensor: Sensor| TrimmedTriad {
        trimmed: input[sensor].is_some(),
        before: errors[sensor].0,
        sigma_before: errors[sensor].1,
        after: left[sensor].0,
        sigma_after: left[sensor].1,
        added: add[sensor],
        unit: sensor.unit(),
    };
    Ok(Trimmed {
        triads: PerSensor::from_fn(triad),
        temp_c: before.summary.temp_c,
        averaged_s: duration.as_secs_f64(),
        before: held,
        hash: image.hash,
        warnings: warnings(&before, &after),
    })
}

fn warnings(before: &Average, after: &Average) -> Vec<String> {
    let mut all = before.summary.flagged.warnings();
    all.extend(after.summary.flagged.warnings());
    let missing = before.summary.missing + after.summary.missing;
    if missing > 0 {
        all.push(format!("{missing} samples were missing"));
    }
    if let Some(motion) = after.motion() {
        all.push(format!(
            "{motion} after the calibration was stored, so the figures after it are invalid; check with `mimu device stream compensated`"
        ));
    }
    all
}

/// Refuses a correction larger than any drift.
fn check_size(
    session: &Session,
    errors: &PerSensor<Means>,
    input: PerSensor<Option<[f64; 3]>>,
) -> Result<()> {
    for (sensor, (error, _)) in errors.iter() {
        let unit = sensor.unit();
        if input[sensor].is_none() {
            continue;
        }
        for (axis, error) in AXES.iter().zip(error) {
            if !(error.abs() <= MOST[sensor]) {
                let problem = format!(
                    "{sensor} {axis} is off by {error:.3} {unit}; a drift is at most {} {unit}",
                    MOST[sensor]
                );
                let remedy = match sensor {
                    Sensor::Gyro => {
                        "check that the unit does not turn, and that the calibration is of this unit"
                    }
                    Sensor::Accel => {
                        "check the pose that was given, and that the calibration is of this unit"
                    }
                };
                return Err(Error::device(session.port(), problem, remedy));
            }
        }
    }
    Ok(())
}

fn refuse(session: &Session, refused: &StoredError) -> Error {
    let problem = format!("its calibration cannot be trimmed: {}", refused);
    let remedy = "upload the calibration file again, then trim";
    Error::device(session.port(), problem, remedy)
}

/// Averages the compensated output of a unit at rest.
fn average(session: &mut Session, duration: Duration, progress: impl Fn(f64)) -> Result<Average> {
    let rate_hz = session.who().sample_rate_hz;
    let stretch = (STRETCH_S * rate_hz).round() as u64;
    let wanted = duration.as_secs_f64() * rate_hz;
    let (mut means, mut sum, mut count, mut taken) = (Vec::new(), zero(), 0, 0_u64);
    let summary = stream(
        session,
        Stream::Compensated,
        Some(duration),
        || false,
        |_, _, sample| {
            sum.gyro += sample.gyro.map(f64::from);
            sum.accel += sample.accel.map(f64::from);
            count += 1;
            taken += 1;
            if count == stretch {
                let n = count as f64;
                means.push(sum.map(|sum| sum / n));
                (sum, count) = (zero(), 0);
                progress(taken as f64 / wanted);
            }
            Ok(())
        },
    )?;
    Ok(Average { means, summary })
}

fn zero() -> Sample<f64> {
    Sample::both(nalgebra::Vector3::zeros())
}

impl Average {
    /// Mean errors relative to these inputs.
    fn errors(&self, input: PerSensor<Option<[f64; 3]>>) -> PerSensor<Means> {
        let values = |sensor: Sensor, axis: usize| {
            let means = self.means.iter();
            means.map(move |m| m[sensor][axis])
        };
        PerSensor::from_fn(|sensor| {
            let (mut error, mut sigma) = ([0.0; 3], [0.0; 3]);
            for axis in 0..3 {
                let n = self.means.len() as f64;
                let mean = values(sensor, axis).sum::<f64>() / n;
                let squares: f64 = values(sensor, axis).map(|v| (v - mean).powi(2)).sum();
                error[axis] = mean - input[sensor].unwrap_or_default()[axis];
                sigma[axis] = (squares / (n - 1.0).max(1.0) / n).sqrt();
            }
            (error, sigma)
        })
    }

    /// Describes the motion, if any: compares the two halves, and the scatter of all segments.
    fn motion(&self) -> Option<String> {
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
        for sensor in Sensor::BOTH {
            let unit = sensor.unit();
            for (axis, name) in AXES.iter().enumerate() {
                let all: Vec<f64> = self.means.iter().map(|m| m[sensor][axis]).collect();
                let (first, second) = all.split_at(all.len() / 2);
                let apart = mean(second) - mean(first);
                let middle = mean(&all);
                let squares: Vec<f64> = all.iter().map(|v| (v - middle).powi(2)).collect();
                let scatter = mean(&squares).sqrt();
                if !(apart.abs() <= STILL[sensor] && scatter <= STILL[sensor]) {
                    return Some(format!(
                        "the unit moved: {sensor} {name} scattered by {scatter:.4} {unit}, and changed by {apart:.4} {unit}"
                    ));
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn average(means: impl Iterator<Item = (Vector3<f64>, Vector3<f64>)>) -> Average {
        Average {
            means: means.map(|(gyro, accel)| Sample { gyro, accel }).collect(),
            summary: Streamed::new(Stream::Compensated, "V"),
        }
    }

    #[test]
    fn errors_are_means_less_the_input_with_the_scatter_of_the_stretches() {
        let alternating = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let found = average((0..16).map(|k| {
            let off = Vector3::new(0.01, 0.0, -0.02).add_scalar(0.001 * alternating(k));
            (off, Vector3::new(0.1, -0.1, 9.9))
        }));
        assert_eq!(found.motion(), None);
        let input = [[0.0; 3], [0.0, 0.0, 9.8]].map(Some);
        let errors = found.errors(input.into());
        let ((gyro, sigma), (accel, none)) = (errors.gyro, errors.accel);
        // 16 values of ±1 have a standard deviation of sqrt(16/15); that of their mean is 1/4 of it.
        let expected = 0.001 * (16.0_f64 / 15.0).sqrt() / 4.0;
        for axis in 0..3 {
            assert!((gyro[axis] - [0.01, 0.0, -0.02][axis]).abs() < 1e-12);
            assert!((sigma[axis] - expected).abs() < 1e-12);
            assert!((accel[axis] - [0.1, -0.1, 0.1][axis]).abs() < 1e-12);
            assert!(none[axis] < 1e-12);
        }
    }

    #[test]
    fn a_unit_that_tilts_or_turns_for_a_while_has_moved() {
        let still = Vector3::new(0.0, 0.0, 9.8);
        let tilted = average((0..16).map(|k| {
            let tilt = if k < 8 { 0.0 } else { 0.15 };
            (Vector3::zeros(), still + Vector3::x() * tilt)
        }));
        let motion = tilted.motion().unwrap();
        assert!(motion.contains("accel x"), "{motion}");
        let turned = average((0..16).map(|k| {
            let rate = if k == 5 { 0.05 } else { 0.0 };
            (Vector3::y() * rate, still)
        }));
        let motion = turned.motion().unwrap();
        assert!(motion.contains("gyro y"), "{motion}");
    }
}
