//! Leaves out dwells and turns that err by far more than the others predict, before anything is concluded from them.
//!
//! One turn in which samples were lost, or one dwell against a soft cushion, falsifies all parameters, and its error then passes for an effect. A
//! robust fit (iteratively reweighted, with Cauchy's weights) names suspects. A suspect is left out if the fit of the others contradicts it, by its
//! studentised deletion residual, and if the others determine all parameters without it ([`deletion`]).

mod deletion;

use mimu_core::compensation::Affine;
use nalgebra::Vector3;

use super::by_gravity::{POOR_POSES, by_turns};
use crate::estimate::rotation::Data;
use crate::estimate::{Estimated, Observation, magnitude};
use crate::factor::Factors;
use crate::observation::{ALL, LOWER, place};
use crate::prepared::Prepared;
use crate::quantity::{AXES, Sensor};
use crate::signal::blocks::quantile;
use crate::signal::dwell::LeftOut;
use crate::triad::Triad;
use crate::warning::Warning;
use deletion::{Judged, Row, against_others, contradicted};

/// Standard deviations from which on something is outlying, by the noise or, if larger, by the scatter of the others.
const SIGMAS: f64 = 5.0;
/// It also has to exceed the error that one in ten exceeds by this factor: if the model lacks an effect, many errors are large and none stands out.
const OVER_TENTH: f64 = 2.0;
/// At most one in so many is left out: if more are outlying, the model is wrong.
const ONE_IN: usize = 10;
/// Cosine of the angle within which two poses are near the same axis, whichever end is up.
const NEAR: f64 = 0.9;
/// If another pose near the same axis errs by more standard deviations than this, both show an effect.
const WITNESS: f64 = 3.0;

/// Indices of the outlying ones, worst first, at most `most`.
fn outlying(found: &[(f64, f64)], most: usize) -> Vec<usize> {
    let mut sigmas: Vec<f64> = found.iter().map(|f| f.1).collect();
    let tenth = quantile(&mut sigmas, 0.9).unwrap_or(f64::INFINITY);
    let far = |k: &usize| found[*k].1 > SIGMAS && found[*k].1 > OVER_TENTH * tenth;
    let mut all: Vec<usize> = (0..found.len()).filter(far).collect();
    all.sort_by(|a, b| found[*b].1.total_cmp(&found[*a].1));
    all.truncate(most);
    all
}

/// Dwells or turns of one sensor that the others of the recording contradict.
#[derive(Debug, Default)]
pub(super) struct Outlying {
    /// Dwells of the accelerometer, or turns of the gyro, to be left out.
    pub left_out: Vec<LeftOut>,
    /// Warnings about these, and about those that cannot be spared.
    pub warnings: Vec<Warning>,
    /// The triad fitted with everything.
    with_all: Option<Triad>,
}

impl Outlying {
    /// The triad fitted with everything, if something is left out.
    pub fn with_all(self) -> Option<Triad> {
        self.with_all.filter(|_| !self.left_out.is_empty())
    }

    /// Those of `found` that the user does not keep; `ends` gives the first and last dwell of a row.
    fn of(
        prepared: &Prepared,
        sensor: Sensor,
        (found, with_all): (Vec<Judged>, Triad),
        ends: impl Fn(usize) -> [usize; 2],
    ) -> Self {
        let mut out = Self {
            with_all: Some(with_all),
            ..Self::default()
        };
        for judged in found {
            let [from, to] = ends(judged.row);
            let steps = [from, to].map(|dwell| prepared.dwells.list[dwell].step);
            if prepared.dwells.keep.keeps(steps[1]) {
                continue;
            }
            if !judged.can_be_spared() {
                out.warnings.push(kept(sensor, steps, &judged));
                continue;
            }
            // A turn that is left out is named among those that are not used.
            out.warnings
                .extend((sensor == Sensor::Accel).then_some(Warning::DwellLeftOut {
                    dwell: steps[1],
                    error: judged.error,
                    sigmas: judged.sigmas,
                }));
            out.left_out.push(LeftOut {
                sensor,
                from,
                to,
                error: judged.error,
                sigmas: judged.sigmas,
            });
        }
        out
    }
}

/// The warning about a dwell or a turn that cannot be spared.
fn kept(sensor: Sensor, [from, to]: [i32; 2], judged: &Judged) -> Warning {
    let (parameter, wider) = judged.grows;
    match sensor {
        Sensor::Accel => Warning::DwellKept {
            dwell: to,
            error: judged.error,
            parameter: ACCEL_PARAMETERS[parameter],
            wider,
        },
        Sensor::Gyro => Warning::TurnKept {
            from,
            to,
            parameter: match place(parameter) {
                (row, Some(column)) => format!("C_{}{} of the gyro", AXES[row], AXES[column]),
                (axis, None) => format!("the bias of gyro {}", AXES[axis]),
            },
            wider,
        },
    }
}

/// The poses and the accelerometer by the data alone, if these can contradict one of them. `None` if gravity is not the only reference, or if the user keeps everything.
fn accel(prepared: &Prepared) -> Option<(Vec<Observation>, Estimated)> {
    if !prepared.has(Sensor::Accel) || prepared.dwells.keep.everything() {
        return None;
    }
    let poses = prepared.observations(Sensor::Accel);
    // Of fewer poses none may be left out.
    if poses.len() + prepared.dwells.left_out.len() < ONE_IN {
        return None;
    }
    let g = prepared.manifest.gravity_mps2;
    let first = magnitude::first_guess(&poses, g)?;
    let variances = prepared.magnitude_variances(&first, &poses);
    // A prior that does not hold would make poses outlying.
    let accel = magnitude::by_gravity(&poses, &variances, g, None, &prepared.power_ons).ok()?;
    // If the poses hardly determine the accelerometer, they contradict nothing.
    (accel.condition <= POOR_POSES).then_some((poses, accel))
}

/// Poses whose magnitude of gravity the others contradict.
pub(super) fn poses(prepared: &Prepared) -> Outlying {
    let Some((poses, accel)) = accel(prepared) else {
        return Outlying::default();
    };
    let found = outlying_poses(prepared, &poses, &accel.triad.inverse);
    let ends = |row: usize| [poses[row].dwell; 2];
    Outlying::of(prepared, Sensor::Accel, (found, accel.triad), ends)
}

/// Parameters of the accelerometer, in the order of the derivatives in the rows of poses.
const ACCEL_PARAMETERS: [&str; 9] = [
    "the scale factor of x",
    "the angle between x and y",
    "the scale factor of y",
    "the angle between x and z",
    "the angle between y and z",
    "the scale factor of z",
    "the bias of x",
    "the bias of y",
    "the bias of z",
];

fn outlying_poses(prepared: &Prepared, poses: &[Observation], accel: &Affine<f64>) -> Vec<Judged> {
    let (factors, _) = prepared.magnitudes(accel);
    let rows = Row::of(&factors, (Sensor::Accel, accel), &LOWER);
    let Some(found) = against_others(&rows, rows.len(), 1.0) else {
        return Vec::new();
    };
    let up: Vec<Vector3<f64>> = poses.iter().map(|o| accel.apply(&o.raw)).collect();
    // An effect that the model lacks shows in every pose near an axis, whichever end is up.
    let has_witness = |k: usize| {
        (0..poses.len()).any(|o| {
            let cosine = up[o].angle(&up[k]).cos().abs();
            o != k && cosine > NEAR && found[o].1 > WITNESS
        })
    };
    let all = outlying(&found, poses.len() / ONE_IN).into_iter();
    let suspects: Vec<usize> = all.filter(|k| !has_witness(*k)).collect();
    contradicted(&rows, rows.len(), 1.0, &suspects)
}

/// Turns whose direction of gravity the others contradict. They begin and end in dwells that are not left out.
pub(super) fn turns(prepared: &Prepared) -> Outlying {
    outlying_turns(prepared).unwrap_or_default()
}

fn outlying_turns(prepared: &Prepared) -> Option<Outlying> {
    if !prepared.has(Sensor::Gyro) {
        return None;
    }
    let (_, accel) = accel(prepared)?;
    let model = &accel.triad.inverse;
    let (turns, _) = prepared.turns(model);
    if turns.len() < ONE_IN {
        return None;
    }
    let (rest, motions) = (prepared.rest(model), prepared.motions(model));
    let data = Data {
        turns: &turns,
        rest: &rest,
        accel: &accel.triad,
        motions: &motions,
        start: None,
        gravity: prepared.manifest.gravity_mps2,
        prior: None,
        power_ons: &prepared.power_ons,
    };
    let gyro = by_turns(prepared, &data).ok()?;
    let mut factors = Factors::of_turns(&turns);
    factors.rests(&rest);
    let rows = Row::of(&factors, (Sensor::Gyro, &gyro.triad.inverse), &ALL);
    let found = against_others(&rows, turns.len(), 2.0)?;
    let suspects = outlying(&found, turns.len() / ONE_IN);
    let found = contradicted(&rows, turns.len(), 2.0, &suspects);
    let ends = |row: usize| [turns[row].from, turns[row].to];
    Some(Outlying::of(
        prepared,
        Sensor::Gyro,
        (found, gyro.triad),
        ends,
    ))
}
