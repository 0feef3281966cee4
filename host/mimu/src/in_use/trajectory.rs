//! Segments of a trajectory: attitude, and position if it is known, from a motion capture system, a laser tracker, or satellites.
//!
//! A position closes without the velocity, which many references lack: `p(t) - 2 p(t/2) + p(0)` does not depend on it.

use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::Experiment;
use super::closure::{Closure, Ends, by_first_attitude};
use super::dead_reckoning::DeadReckoning;
use super::estimates::Smoothed;
use super::state::{CLOCK, GRAVITY, LEVER, MOUNTING, Readings, STATES};
use super::trajectory_file::{Pose, Trajectory};
use super::walk::{Span, walk};
use mimu_recording::error::Result;

/// Lengths of the segments, s, one after the other: what grows with time is then distinguished from what does not.
pub(super) const LENGTHS_S: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// Largest interval between two poses, s, within a segment and beside its instants.
const APART_S: f64 = 0.2;

/// The closures of a recording against `trajectory`, in order of time, and the number of segments that could not be used.
pub(super) fn closures(
    experiment: &Experiment,
    trajectory: &Trajectory,
    about: &Smoothed,
    progress: &dyn Fn(f64),
) -> Result<(Vec<Closure>, usize)> {
    let Experiment {
        recording,
        calibration,
        allan: noise,
        ..
    } = experiment;
    let gravity = recording.manifest.gravity_mps2;
    let trajectory = &trajectory.of_unit(about);
    let segments = segments(&trajectory.poses);
    let spans: Vec<Span> = segments
        .iter()
        .map(|own| Span {
            start_s: own[0].t_s,
            mark_s: Some(own[1].t_s),
            end_s: own[2].t_s,
        })
        .collect();
    let begin = |k: usize, _: &[Readings]| {
        let [first, _, last] = segments[k];
        let biases = about.biases_at(0.5 * (first.t_s + last.t_s));
        DeadReckoning::new(matrix(&first.attitude), gravity, noise.squared(), biases)
    };
    let walked = walk(recording, calibration, &[], &spans, begin, progress)?;
    let matrices = super::matrices(calibration);
    let each = segments.iter().zip(&walked.spans).zip(&walked.ends);
    let mut refused = 0;
    let mut closures = Vec::new();
    for ((own, reckoned), ends) in each {
        let whole = own[2].t_s - own[0].t_s;
        match reckoned.clone() {
            Some(mut r) if (r.duration_s - whole).abs() < 1e-6 => {
                let ends = ends.map(|readings| readings.without(&r.biases));
                let ends = at_end(&mut r, own, &ends, gravity, trajectory);
                let closure = Closure::of(&r, ends, own[0].t_s, &matrices);
                closures.push(closure.about(about, &r.biases));
            }
            _ => refused += 1,
        }
    }
    Ok((closures, refused))
}

fn matrix(attitude: &UnitQuaternion<f64>) -> Matrix3<f64> {
    attitude.to_rotation_matrix().into_inner()
}

/// Poses at the beginning, the middle and the end of each segment.
fn segments(poses: &[Pose]) -> Vec<[Pose; 3]> {
    let mut all = Vec::new();
    let mut lengths = LENGTHS_S.iter().cycle();
    let mut at = 0;
    // The pose that is next to an instant.
    let near = |t: f64| {
        let after = poses.partition_point(|p| p.t_s < t).min(poses.len() - 1);
        let before = after.saturating_sub(1);
        if t - poses[before].t_s < poses[after].t_s - t {
            before
        } else {
            after
        }
    };
    while at + 1 < poses.len() {
        let length = lengths.next().unwrap_or(&LENGTHS_S[0]);
        let from = poses[at].t_s;
        if from + length > poses[poses.len() - 1].t_s {
            break;
        }
        let (middle, to) = (near(from + 0.5 * length), near(from + length));
        let dense = poses[at..=to]
            .windows(2)
            .all(|pair| pair[1].t_s - pair[0].t_s <= APART_S);
        if dense && at < middle && middle < to {
            all.push([at, middle, to].map(|k| poses[k]));
        }
        // The next one shares no pose: its errors are then independent.
        at = to.max(at) + 1;
    }
    all
}

/// The errors against the poses `own`, by everything that the reference may be wrong in.
fn at_end(
    reckoned: &mut DeadReckoning,
    own: &[Pose; 3],
    ends: &[Readings; 2],
    gravity: f64,
    trajectory: &Trajectory,
) -> Ends {
    let rotations = own.map(|p| matrix(&p.attitude));
    let marked_s = own[1].t_s - own[0].t_s;
    let t = reckoned.duration_s;
    let first = by_first_attitude(reckoned, gravity, marked_s);
    // How the reference is mounted, and its clock, turn the first attitude ...
    let mut mount = DMatrix::zeros(3, STATES);
    mount
        .columns_mut(MOUNTING.start, 3)
        .copy_from(&rotations[0]);
    mount.set_column(CLOCK, &(rotations[0] * ends[0].rate));
    let by_first = &first * &mount;
    // ... and gravity is not where the frame of the reference has it.
    let mut errors_by = DMatrix::zeros(12, STATES);
    errors_by += by_first;
    for k in 0..3 {
        for (row, times) in [(3, t), (6, 0.5 * t * t), (9, 0.5 * marked_s * marked_s)] {
            errors_by[(row + k, GRAVITY.start + k)] += times;
        }
    }
    let rows = if trajectory.has_positions { 6 } else { 3 };
    let mut of = DMatrix::zeros(rows, 12);
    let mut residual = DVector::zeros(rows);
    let mut by = DMatrix::zeros(rows, STATES);
    let mut reference = [DMatrix::zeros(rows, rows), DMatrix::zeros(rows, rows)];
    let turned = Rotation3::from_matrix_unchecked(reckoned.rotation * rotations[2].transpose());
    residual.rows_mut(0, 3).copy_from(&turned.scaled_axis());
    let clock = rotations[2] * ends[1].rate;
    for i in 0..3 {
        of[(i, i)] = 1.0;
        reference[0][(i, i)] += 1.0;
        by[(i, CLOCK)] -= clock[i];
        for j in 0..3 {
            by[(i, MOUNTING.start + j)] -= rotations[2][(i, j)];
        }
    }
    if trajectory.has_positions {
        // The poses need not be evenly spaced.
        let ratio = t / marked_s;
        let second = |of: [Vector3<f64>; 3]| of[2] - of[1] * ratio + of[0] * (ratio - 1.0);
        let error = reckoned.position - reckoned.marked * ratio - second(own.map(|p| p.position));
        residual.rows_mut(3, 3).copy_from(&error);
        let lever = rotations[2] - rotations[1] * ratio + rotations[0] * (ratio - 1.0);
        let moved = second(own.map(|p| trajectory.velocity_at(&p)));
        for i in 0..3 {
            of[(3 + i, 6 + i)] = 1.0;
            of[(3 + i, 9 + i)] = -ratio;
            reference[1][(3 + i, 3 + i)] = 1.0 + ratio * ratio + (ratio - 1.0).powi(2);
            by[(3 + i, CLOCK)] -= moved[i];
            for j in 0..3 {
                by[(3 + i, LEVER.start + j)] -= lever[(i, j)];
            }
        }
    }
    let of_first = &of * &first;
    reference[0] += &of_first * of_first.transpose();
    Ends {
        by: by + &of * errors_by,
        known: DMatrix::zeros(rows, rows),
        of,
        residual,
        reference,
    }
}
