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
use crate::observation::{ALL, LOWER};
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
}

/// Whether anything may be left out: gravity is the only reference, and the user did not keep everything.
fn applies(prepared: &Prepared) -> bool {
    prepared.has(Sensor::Accel) && !prepared.dwells.keep.everything()
}

/// Poses whose magnitude of gravity the others contradict.
pub(super) fn poses(prepared: &Prepared) -> Outlying {
    let mut out = Outlying::default();
    if !applies(prepared) {
        return out;
    }
    let poses = prepared.observations(Sensor::Accel);
    // Of fewer poses none may be left out.
    if poses.len() < ONE_IN {
        return out;
    }
    // If the poses hardly determine the accelerometer, they contradict nothing.
    let accel = fit_poses(prepared, &poses).filter(|a| a.condition <= POOR_POSES);
    let Some(accel) = accel else { return out };
    for judged in outlying_poses(prepared, &poses, &accel.triad.inverse) {
        let index = poses[judged.row].dwell;
        let step = prepared.dwells.list[index].step;
        if prepared.dwells.keep.keeps(step) {
            continue;
        }
        if !judged.can_be_spared() {
            let (parameter, grows) = judged.grows;
            let parameter = ACCEL_PARAMETERS[parameter];
            let kept = Warning::DwellKept {
                dwell: step,
                error: judged.error,
                parameter,
                wider: grows,
            };
            out.warnings.push(kept);
            continue;
        }
        let left_out = Warning::DwellLeftOut {
            dwell: step,
            error: judged.error,
            sigmas: judged.sigmas,
        };
        out.warnings.push(left_out);
        out.left_out.push(LeftOut {
            sensor: Sensor::Accel,
            from: index,
            to: index,
            error: judged.error,
            sigmas: judged.sigmas,
        });
    }
    out.with_all = Some(accel.triad);
    out
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

fn fit_poses(prepared: &Prepared, poses: &[Observation]) -> Option<Estimated> {
    let g = prepared.manifest.gravity_mps2;
    let first = magnitude::first_guess(poses, g)?;
    let variances = prepared.magnitude_variances(&first, poses);
    let power_ons = &prepared.power_ons;
    // By the data alone: a prior that does not hold would make poses outlying.
    magnitude::by_gravity(poses, &variances, g, None, power_ons).ok()
}

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
    let mut out = Outlying::default();
    if !applies(prepared) || !prepared.has(Sensor::Gyro) {
        return out;
    }
    let poses = prepared.observations(Sensor::Accel);
    if poses.len() + prepared.dwells.left_out.len() < ONE_IN {
        return out;
    }
    let accel = fit_poses(prepared, &poses).filter(|a| a.condition <= POOR_POSES);
    let Some(accel) = accel else { return out };
    let g = prepared.manifest.gravity_mps2;
    let model = &accel.triad.inverse;
    let (turns, _) = prepared.turns(model);
    if turns.len() < ONE_IN {
        return out;
    }
    let rest = prepared.rest(&accel.triad.inverse);
    let motions = prepared.motions(model);
    let data = Data {
        turns: &turns,
        rest: &rest,
        accel: &accel.triad,
        motions: &motions,
        start: None,
        gravity: g,
        prior: None,
        power_ons: &prepared.power_ons,
    };
    let Ok(gyro) = by_turns(prepared, &data) else {
        return out;
    };
    let mut factors = Factors::of_turns(&turns);
    factors.rests(&rest);
    let rows = Row::of(&factors, (Sensor::Gyro, &gyro.triad.inverse), &ALL);
    let Some(found) = against_others(&rows, turns.len(), 2.0) else {
        return out;
    };
    let suspects = outlying(&found, turns.len() / ONE_IN);
    let step = |dwell: usize| prepared.dwells.list[dwell].step;
    for judged in contradicted(&rows, turns.len(), 2.0, &suspects) {
        let turn = &turns[judged.row];
        if prepared.dwells.keep.keeps(step(turn.to)) {
            continue;
        }
        if !judged.can_be_spared() {
            let (parameter, grows) = judged.grows;
            let name = match parameter {
                0..9 => format!(
                    "C_{}{} of the gyro",
                    AXES[parameter / 3],
                    AXES[parameter % 3]
                ),
                _ => format!("the bias of gyro {}", AXES[parameter - 9]),
            };
            out.warnings.push(Warning::TurnKept {
                from: step(turn.from),
                to: step(turn.to),
                parameter: name,
                wider: grows,
            });
            continue;
        }
        out.left_out.push(LeftOut {
            sensor: Sensor::Gyro,
            from: turn.from,
            to: turn.to,
            error: judged.error,
            sigmas: judged.sigmas,
        });
    }
    out.with_all = Some(gyro.triad);
    out
}
