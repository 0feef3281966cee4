//! Refuses undetermined parameters, by the width of their intervals.
//!
//! A condition shows how unevenly an experiment determines its parameters. Whether it determines them depends on noise and misfit too: a scale factor
//! of 6.0 ± 9.1 came from a design whose condition of 1464 only gave a warning.

use mimu_core::compensation::Affine;
use nalgebra::Vector3;

use super::of_temperature::with_temperature;
use super::sensor::SensorFit;
use crate::estimate::{Addition, Failure};
use crate::observation::slope;
use crate::prepared::Prepared;
use crate::quantity::{AXES, Figure, Sensor, plus_minus};
use crate::readable;
use crate::triad::{Angles, Covariance, Triad};
use crate::warning::Warning;
use mimu_recording::{Argument, Reference, Result};

/// A parameter is undetermined if half of its 95 % interval exceeds this: relative for a scale factor, in rad for an angle. Data sheets promise a
/// scale factor to within ten per cent and a mounting to within some degrees, which is better than a fifth.
const WIDEST: f64 = 0.2;

/// Refuses a fit in which a scale factor or an angle is not determined. `accel` is the accelerometer if gravity is the only reference.
pub(super) fn check(prepared: &Prepared, fit: &SensorFit, accel: Option<&Triad>) -> Result<()> {
    let physical = fit.estimated.triad.physical(Angles::Exact);
    let scale_unit = crate::quantity::scale_unit(prepared.manifest.raw_unit, fit.sensor.unit());
    let mut open = Vec::new();
    let mut shown = |name: String, value: f64, half: f64, unit: &str| {
        let shown = readable::parameter(unit);
        let unit = match shown.unit.is_empty() {
            true => String::new(),
            false => format!(" {}", shown.unit),
        };
        open.push(format!(
            "{name} ({}{unit})",
            plus_minus(value * shown.factor, half * shown.factor)
        ));
    };
    for (axis, e) in AXES.iter().zip(physical.scale) {
        if !(e.interval <= WIDEST * e.value.abs()) {
            shown(
                format!("scale factor {axis}"),
                e.value,
                e.interval,
                &scale_unit,
            );
        }
    }
    let pairs = ["yz", "zy", "zx"];
    for (pair, e) in pairs.iter().zip(physical.non_orthogonality) {
        if !(e.interval <= WIDEST) {
            shown(
                format!("non-orthogonality {pair}"),
                e.value,
                e.interval,
                "rad",
            );
        }
    }
    // If only a magnitude is known, a triad's own axes are the frame.
    if !fit.figure.is_magnitude() {
        for (axis, e) in AXES.iter().zip(physical.misalignment) {
            if !(e.interval <= WIDEST) {
                shown(format!("misalignment {axis}"), e.value, e.interval, "rad");
            }
        }
    }
    if open.is_empty() || by_temperature(prepared, fit) {
        return Ok(());
    }
    let poses = accel.and_then(|accel| missing_poses(prepared, accel));
    let add = match (fit.figure, poses) {
        (Figure::GravityMagnitude, Some(poses)) => poses.into(),
        (Figure::GravityMagnitude, None) => {
            "add poses: each axis up, down and in between; hold each still".into()
        }
        (Figure::RateMagnitude, _) => "lay the unit on the turntable with each axis up, down and slanted, and record rests too".into(),
        // The turns are judged by the accelerometer's directions, so its errors are in the intervals of the gyro.
        (Figure::Direction, Some(poses)) => {
            format!("{poses}: the accelerometer gives the direction of gravity after each turn").into()
        }
        (Figure::Direction, None) => "add turns about every axis, with that axis level and slanted, between dwells that are held still".into(),
        (Figure::Input, _) => Addition::Inputs("every axis".into()),
    };
    let parameters = open.join(", ");
    let failure = Failure::Undetermined { parameters, add };
    let error = prepared.refused(failure, fit.sensor);
    Err(match prepared.manifest.reference {
        Reference::Table => error.about(Argument::Only),
        Reference::Gravity | Reference::TurntableRate => error,
    })
}

/// Whether a model with temperature explains the wide intervals; then another warning tells the person so.
fn by_temperature(prepared: &Prepared, fit: &SensorFit) -> bool {
    let with = match fit.figure {
        Figure::Input => with_temperature(prepared, fit.sensor, &fit.residuals),
        Figure::GravityMagnitude | Figure::RateMagnitude | Figure::Direction => None,
    };
    with.is_some_and(|with| with.rms < 0.5 * fit.rms())
}

/// Standard deviation of the magnitude of specific force, over gravity, from which on a direction counts as unseen.
const UNSEEN: f64 = 0.01;
/// Most poses that are named.
const NAMED: usize = 4;

/// The faces and edges of the unit that the poses leave the most open, in words.
fn missing_poses(prepared: &Prepared, triad: &Triad) -> Option<String> {
    let g = prepared.manifest.gravity_mps2;
    let open = open_poses(g, triad, UNSEEN * g);
    (!open.is_empty()).then(|| {
        let names: Vec<String> = open.into_iter().map(|(name, _)| name).collect();
        format!(
            "add poses with {} up (no pose is near), and hold each still",
            names.join(", ")
        )
    })
}

/// A pose is reported if its magnitude is uncertain by more than this many times the residual of the poses that were held, `typical`.
const OPEN: f64 = 10.0;

/// The warning about poses that were not held, if the calibration errs there by far more than where it was fitted. Six faces and eight edges, none of
/// them between x and y, left the magnitude uncertain by 35 mm/s² there: on the corners the file was worse than none.
pub(super) fn unseen_poses(gravity: f64, triad: &Triad, typical: f64) -> Option<Warning> {
    let open = open_poses(gravity, triad, OPEN * typical);
    let (_, worst) = open.first()?;
    let names = open.iter().map(|(name, _)| name.clone()).collect();
    Some(
        Warning::UnseenPoses {
            directions: names,
            worst: *worst,
            typical,
        }
        .of(Sensor::Accel),
    )
}

/// Faces and edges in which the magnitude of specific force has a standard deviation of more than `limit`, m/s², with this deviation; the worst
/// first. Each counts as measured when the next is sought.
fn open_poses(g: f64, triad: &Triad, limit: f64) -> Vec<(String, f64)> {
    let mut covariance = triad.inverse_covariance;
    let mut open: Vec<(String, f64)> = Vec::new();
    while open.len() < NAMED {
        let candidates = directions().into_iter().map(|(name, up)| {
            let by = slope(&up, &triad.forward.apply(&(up * g)));
            ((by.transpose() * covariance * by)[0], name, by)
        });
        let Some((variance, name, by)) = candidates.max_by(|a, b| a.0.total_cmp(&b.0)) else {
            break;
        };
        if !(variance.sqrt() > limit) || open.iter().any(|(known, _)| *known == name) {
            break;
        }
        open.push((name, variance.sqrt()));
        let gain = covariance * by;
        let measured: Covariance = gain * gain.transpose() / (variance + (0.1 * limit).powi(2));
        covariance -= measured;
    }
    open
}

/// Faces, then edges, by name.
fn directions() -> Vec<(String, Vector3<f64>)> {
    let mut all = Vec::new();
    for count in [1, 2] {
        for code in 0..27 {
            let up = Vector3::new(code / 9 - 1, code / 3 % 3 - 1, code % 3 - 1);
            if up.iter().filter(|c| **c != 0).count() != count {
                continue;
            }
            let signed = (0..3).filter(|k| up[*k] != 0);
            let name: String = signed
                .map(|k| format!("{}{}", if up[k] > 0 { "+" } else { "-" }, AXES[k]))
                .collect();
            all.push((name, up.map(f64::from).normalize()));
        }
    }
    all
}

/// The faces that no pose has up, to within 45 degrees, by a first guess of the accelerometer: `-x, +z`. `None` if every face was up.
pub(crate) fn faces_not_up(guess: &Affine<f64>, raw: &[Vector3<f64>]) -> Option<String> {
    let faces = directions().into_iter().take(6);
    let unseen = faces.filter(|(_, face)| {
        let near = |u: &&Vector3<f64>| guess.apply(u).normalize().dot(face) > 0.7;
        !raw.iter().any(|u| near(&u))
    });
    let names: Vec<String> = unseen.map(|(name, _)| name).collect();
    (!names.is_empty()).then(|| names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A perfect accelerometer, fitted to the magnitude of gravity in poses with a noise of `sigma`, m/s².
    fn known_by(poses: impl Iterator<Item = Vector3<f64>>, sigma: f64) -> Triad {
        let lower = [0, 3, 4, 6, 7, 8, 9, 10, 11];
        let mut information = nalgebra::SMatrix::<f64, 9, 9>::identity() * 1e-3;
        for up in poses {
            let by = slope(&up, &(up * 9.8));
            let own = nalgebra::SVector::<f64, 9>::from_fn(|i, _| by[lower[i]]);
            information += own * own.transpose() / (sigma * sigma);
        }
        let nine = information.try_inverse().unwrap();
        let mut covariance = Covariance::zeros();
        for (i, row) in lower.into_iter().enumerate() {
            for (j, column) in lower.into_iter().enumerate() {
                covariance[(row, column)] = nine[(i, j)];
            }
        }
        let one = Affine::identity();
        let part = crate::triad::Part {
            covariance,
            dof: 9.0,
            known: 1.0,
        };
        Triad::from_inverse(one, vec![part]).unwrap()
    }

    #[test]
    fn edges_that_no_pose_was_near_are_named_if_the_magnitude_is_open_there() {
        let flat = |(name, _): &(String, Vector3<f64>)| name.contains('x') && name.contains('y');
        let poses = directions().into_iter().filter(|p| !flat(p)).map(|p| p.1);
        let text = unseen_poses(9.8, &known_by(poses, 3e-3), 3e-3);
        let text = text.unwrap().to_string();
        // Only the angle between x and y is open: one of the four edges determines it.
        assert!(
            text.contains("near +x+y up")
                || text.contains("near +x-y up")
                || text.contains("near -x"),
            "{text}"
        );
        assert!(!text.contains('z'), "{text}");
        let all = directions().into_iter().map(|p| p.1);
        assert_eq!(unseen_poses(9.8, &known_by(all, 3e-3), 3e-3), None);
    }

    #[test]
    fn the_face_that_was_never_up_is_named() {
        let one = Affine::identity();
        let raw: Vec<Vector3<f64>> = directions()
            .into_iter()
            .filter(|(name, _)| !name.contains("-x"))
            .map(|(_, up)| up * 9.8)
            .collect();
        assert_eq!(faces_not_up(&one, &raw).as_deref(), Some("-x"));
        assert_eq!(directions().len(), 18);
    }
}
