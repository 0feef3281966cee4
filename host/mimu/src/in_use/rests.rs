//! Segments between rests. At a rest the velocity is zero and gravity gives the attitude but for the heading.

use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, UnitVector3, Vector3};

use super::closure::{Closure, Ends, by_first_attitude, rows_of};
use super::dead_reckoning::DeadReckoning;
use super::estimates::Smoothed;
use super::state::{By, Readings, STATES};
use super::walk::{Span, Walked, walk};
use super::{AllanNoise, Experiment};
use crate::estimate::earth;
use crate::prepared::Prepared;
use crate::quantity::{PerSensor, Sensor};
use mimu_recording::error::Result;

/// Shorter dwells show neither gravity nor the gyro's bias, s.
const SHORTEST_REST_S: f64 = 0.3;
/// Shortest and longest segment, s. Over a longer one consumer gyros lose the attitude by degrees, and the linearisation with it.
const SEGMENT_S: [f64; 2] = [0.2, 120.0];

/// The closures of a recording: its rests, and the segments between them, in order of time; and the number of segments that could not be used.
pub(super) fn closures(
    experiment: &Experiment,
    prepared: &Prepared,
    about: &Smoothed,
    progress: &dyn Fn(f64),
) -> Result<(Vec<Closure>, usize)> {
    let Experiment {
        recording,
        calibration,
        allan: noise,
        ..
    } = experiment;
    let dwells = prepared.dwells.list.iter().filter(|d| {
        let sound = Sensor::BOTH.iter().all(|s| d.faults[*s].is_none());
        sound && !d.turn && !d.turns_slowly && !d.spins() && d.duration_s >= SHORTEST_REST_S
    });
    let rests: Vec<[f64; 2]> = dwells.map(|d| [d.start_s, d.last_s]).collect();
    let gravity = prepared.manifest.gravity_mps2;
    let spans: Vec<Span> = rests
        .windows(2)
        .map(|pair| Span {
            start_s: pair[0][1],
            mark_s: None,
            end_s: pair[1][0],
        })
        .collect();
    let begin = |k: usize, before: &[Readings]| {
        let rest = before.last().map_or(Readings::default(), Readings::mean);
        let biases = about.biases_at(0.5 * (spans[k].start_s + spans[k].end_s));
        begun(&rest, gravity, noise, biases)
    };
    let walked = walk(recording, calibration, &rests, &spans, begin, progress)?;
    let matrices = super::matrices(calibration);
    let Walked {
        rests: means,
        spans: reckoned,
        ..
    } = walked;
    let latitude = prepared.manifest.latitude_deg;
    let vertical = latitude.map_or(0.0, |deg| earth::RATE * deg.to_radians().sin());
    let mut closures = Vec::new();
    let mut refused = 0;
    for (k, mean) in means.iter().enumerate() {
        if mean.duration_s > 0.0 {
            let biases = about.biases_at(0.5 * (rests[k][0] + rests[k][1]));
            let closure = at_rest(&mean.without(&biases), rests[k], noise, vertical);
            closures.push(closure.about(about, &biases));
        }
        let Some(after) = means.get(k + 1) else { break };
        match &reckoned[k] {
            Some(r)
                if (SEGMENT_S[0]..SEGMENT_S[1]).contains(&r.duration_s)
                    && mean.duration_s > 0.0
                    && after.duration_s > 0.0 =>
            {
                let ends = at_end(r, &after.without(&r.biases), gravity, noise);
                let closure = Closure::of(r, ends, rests[k][1], &matrices);
                closures.push(closure.about(about, &r.biases));
            }
            _ => refused += 1,
        }
    }
    Ok((closures, refused))
}

/// Dead reckoning from a rest: the mean force without the `biases` points up.
fn begun(
    rest: &Readings,
    gravity: f64,
    noise: &AllanNoise,
    biases: PerSensor<Vector3<f64>>,
) -> DeadReckoning {
    let rest = rest.without(&biases);
    let up = Vector3::z();
    let rotation = Rotation3::rotation_between(&rest.force, &up)
        .unwrap_or_else(|| {
            Rotation3::from_axis_angle(
                &UnitVector3::new_unchecked(Vector3::x()),
                std::f64::consts::PI,
            )
        })
        .into_inner();
    let mut reckoned = DeadReckoning::new(rotation, gravity, noise.squared(), biases);
    let tilt = -up.cross_matrix() / gravity;
    let mut force = By::zeros();
    rest.add_errors(&mut force, Sensor::Accel, &rotation, 1.0);
    let by = tilt * force;
    reckoned.by.fixed_rows_mut::<3>(0).copy_from(&by);
    // A rest has the noise at rest; what motion adds begins with the motion.
    let density = Matrix3::from_diagonal(&noise.squared().accel);
    let known = rotation * density * rotation.transpose() / rest.duration_s;
    let mut tilted = reckoned.gramians[0].fixed_view_mut::<3, 3>(0, 0);
    tilted.copy_from(&(tilt * known * tilt.transpose()));
    reckoned
}

/// At the rest `after`: the force that was carried along points up, and the velocity is zero.
fn at_end(reckoned: &DeadReckoning, after: &Readings, gravity: f64, noise: &AllanNoise) -> Ends {
    let rotation = reckoned.rotation;
    let up = (rotation * after.force).normalize();
    let residual = DVector::from_iterator(
        5,
        [up.x, up.y]
            .into_iter()
            .chain(reckoned.velocity.iter().copied()),
    );
    let mut of = DMatrix::zeros(5, 12);
    // An attitude error φ moves what points up by φ x up.
    of[(0, 1)] = 1.0;
    of[(1, 0)] = -1.0;
    for k in 0..3 {
        of[(2 + k, 3 + k)] = 1.0;
    }
    let mut force = By::zeros();
    after.add_errors(&mut force, Sensor::Accel, &rotation, 1.0 / gravity);
    let by = rows_of(&force, &[0, 1], 0, 5);
    let density = Matrix3::from_diagonal(&noise.squared().accel);
    let level = rotation * density * rotation.transpose() / (gravity * gravity * after.duration_s);
    // The tilt of both rests is that of their mean; what a hand trembles is on top, independently.
    let first = &of * by_first_attitude(reckoned, gravity, 0.0).columns(0, 2);
    let mut attitude = &first * first.transpose();
    attitude[(0, 0)] += 1.0;
    attitude[(1, 1)] += 1.0;
    let velocity = DMatrix::from_fn(5, 5, |i, j| if i == j && i >= 2 { 2.0 } else { 0.0 });
    Ends {
        of,
        residual,
        by,
        known: DMatrix::from_fn(
            5,
            5,
            |i, j| if i < 2 && j < 2 { level[(i, j)] } else { 0.0 },
        ),
        reference: [attitude, velocity],
    }
}

/// The rate in a rest, which is zero but for the Earth's; `vertical` is that about the vertical, rad/s.
fn at_rest(rest: &Readings, [from, to]: [f64; 2], noise: &AllanNoise, vertical: f64) -> Closure {
    let t = rest.duration_s;
    let mut by = By::zeros();
    rest.add_errors(&mut by, Sensor::Gyro, &Matrix3::identity(), 1.0);
    let error = rest.rate - rest.force.normalize() * vertical;
    let one = DMatrix::<f64>::identity(3, 3);
    let none = DMatrix::zeros(3, 3);
    let density = noise.squared().gyro;
    let known = DMatrix::from_fn(3, 3, |i, j| {
        if i == j {
            density[i] / t + earth::RATE * earth::RATE / 3.0
        } else {
            0.0
        }
    });
    Closure {
        at_s: 0.5 * (from + to),
        duration_s: t,
        moves: false,
        residual: DVector::from_column_slice(error.as_slice()),
        by: DMatrix::from_column_slice(3, STATES, by.as_slice()),
        known,
        shares: vec![
            none.clone(),
            none.clone(),
            &one * (rest.vibration / t),
            none.clone(),
            none.clone(),
            none.clone(),
            &one * (2.0 / (t * t)),
            none,
        ],
        turned: 0.0,
        vibration: rest.vibration,
    }
}
