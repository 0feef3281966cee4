//! Whether there is curvature or a drift in time: a fit to the first two thirds of a recording predicts the last one.

use mimu::quantity::Sensor;

use crate::basis::Shape;
use crate::joint::{Choice, Joint, estimate};
use crate::session::Session;

/// Share of the time that is fitted.
const FITTED: f64 = 2.0 / 3.0;

/// Rms error of the last third of the readings, relative to their noise, for straight lines and for curves that were fitted to the rest.
/// `None` if the first two thirds determine no slope.
pub fn compare(sessions: &[Session], lag_s: Option<f64>) -> Option<[f64; 2]> {
    let split = |s: &Session| s.thermometer.start_s() + FITTED * s.thermometer.duration_s();
    let mut first = sessions.to_vec();
    for session in &mut first {
        let to = split(session);
        for (_, rows) in session.rows.as_mut() {
            rows.retain(|r| r.middle_s < to);
        }
    }
    let miss = |shape| {
        let joint = estimate(&first, Choice { shape, lag_s }).ok()?;
        last_third(sessions, &joint, &split)
    };
    Some([miss(Shape::Line)?, miss(Shape::Spline)?])
}

fn last_third(
    sessions: &[Session],
    joint: &Joint,
    split: &impl Fn(&Session) -> f64,
) -> Option<f64> {
    let (mut sum, mut n) = (0.0, 0.0);
    for sensor in Sensor::BOTH {
        let Some(curves) = joint.curves[sensor].as_ref() else {
            continue;
        };
        let dies = joint.dies(sessions, sensor);
        let noise = joint.noise[sensor]?;
        let problem = curves.problem();
        for (k, session) in sessions.iter().enumerate() {
            let offset = curves.session_offset(k);
            let rows = session.rows[sensor].iter();
            for row in rows.filter(|r| r.middle_s >= split(session)) {
                let [model, _] = curves.forward(dies[k].at(row.middle_s));
                let input = match problem.biases_only {
                    true => nalgebra::Vector3::zeros(),
                    false => row.input,
                };
                let off = row.raw - offset - model.apply(&input);
                for axis in 0..3 {
                    let variance = noise[axis].white * problem.samples / row.samples;
                    sum += (off[axis] / problem.gain[axis]).powi(2) / variance;
                    n += 1.0;
                }
            }
        }
    }
    (n > 0.0).then(|| f64::sqrt(sum / n))
}
