//! What a calibrated gyro reads for whole turns, in degrees for each turn.

use std::f64::consts::TAU;

use mimu_core::compensation::Affine;
use nalgebra::Vector3;
use serde::Serialize;

use crate::calibration::Calibration;
use crate::calibration::verify::nominal;
use crate::estimate::whole_turns::{NEAR_AXIS, Stated};
use crate::observation::closure::{Closure, ClosureError};
use crate::observation::turn::{Path, Turn};
use crate::prepared::Prepared;
use crate::quantity::{AXES, Sensor};
use crate::warning::Warning;

/// The whole turns about an axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WholeTurnsOfAxis {
    /// The axis of the gyro, or `other` for turns about none of them.
    pub axis: &'static str,
    /// How often the unit was turned and put back.
    pub times: usize,
    /// Turns of all of them together.
    pub turns: u32,
    /// What the gyro reads for one turn less 360 degrees, mean over both directions.
    pub error_deg_per_turn: f64,
    /// Half-width of the 95 % interval of that, by the stated placement and the noise.
    pub half_width_deg_per_turn: f64,
    /// The same error of turns forwards and backwards, by the right-hand rule about the axis, and the half-width of each; absent unless it was turned both ways.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub each_way_deg_per_turn: Option<[[f64; 2]; 2]>,
    /// The same error of the readings as they came, with the rate at rest subtracted; absent if they are not in SI.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncalibrated_deg_per_turn: Option<f64>,
    /// The same error with one scale factor for all axes, the mean of the calibration's, and with the rate at rest subtracted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub one_for_all_deg_per_turn: Option<f64>,
}

impl WholeTurnsOfAxis {
    /// The errors of both ways if they differ by more than their intervals allow.
    pub fn asymmetric(&self) -> Option<[[f64; 2]; 2]> {
        let differ = |[a, b]: &[[f64; 2]; 2]| (a[0] - b[0]).abs() > a[1].hypot(b[1]);
        self.each_way_deg_per_turn.filter(differ)
    }

    /// The error without the calibration of this axis: of the readings as they came, or with one scale factor for all axes.
    pub fn before_deg_per_turn(&self) -> Option<f64> {
        self.uncalibrated_deg_per_turn
            .or(self.one_for_all_deg_per_turn)
    }
}

/// What was read for one axis, in sum: times, turns, errors (rad), their variance, and errors of the readings as they came and with one scale factor.
#[derive(Default, Clone, Copy)]
struct Sum {
    times: usize,
    turns: f64,
    error: f64,
    variance: f64,
    uncalibrated: f64,
    one_for_all: f64,
    /// Turns, error and variance forwards and backwards.
    each_way: [[f64; 3]; 2],
}

/// The whole turns of `prepared` by its gyro's `calibration`, and what could not be used. Empty unless whole turns are stated.
pub(super) fn verify(
    prepared: &Prepared,
    calibration: &Calibration,
) -> (Vec<WholeTurnsOfAxis>, Vec<Warning>) {
    let (Some(stated), Some(gyro)) = (
        prepared.whole_turns(),
        calibration
            .inverse(Sensor::Gyro)
            .filter(|_| prepared.has(Sensor::Accel)),
    ) else {
        return Default::default();
    };
    // The turn about the vertical hardly depends on the accelerometer's errors, so its readings as they came will do.
    let accel = calibration
        .inverse(Sensor::Accel)
        .unwrap_or_else(Affine::identity);
    let (turns, _) = prepared.turns(&accel);
    let covariance = calibration.covariance(Sensor::Gyro);
    let found = stated.find(&turns, &gyro, &|_, by| {
        covariance.map_or(0.0, |c| (by.transpose() * c * by)[0].max(0.0).sqrt())
    });
    let rest = prepared.rest(&accel);
    let at_rest = rest.iter().map(|r| r.raw).sum::<Vector3<f64>>() / rest.len().max(1) as f64;
    let as_came = prepared.is_in_si().then(|| Affine {
        offset: -at_rest,
        ..Affine::identity()
    });
    let one_for_all = nominal(&gyro).map(|one| Affine {
        offset: -one.matrix * at_rest,
        ..one
    });
    let c2 = gyro.matrix.norm_squared() / 3.0;
    let mut sums = [Sum::default(); 4];
    for closure in &found.closures.list {
        let own = &turns[closure.turns.clone()];
        let largest = closure.path.axis.iamax();
        let near = closure.path.axis[largest].abs() >= NEAR_AXIS;
        let sum = &mut sums[if near { largest } else { 3 }];
        let read = |model: &Affine<f64>| error_along(&stated, own, closure, model);
        let Some(error) = read(&gyro) else { continue };
        sum.times += 1;
        sum.turns += closure.path.turns().round();
        sum.error += error;
        let variance = found.closures.variance(own, c2);
        sum.variance += variance;
        let backwards = usize::from(closure.path.axis[largest] < 0.0);
        for (sum, one) in
            sum.each_way[backwards]
                .iter_mut()
                .zip([closure.path.turns().round(), error, variance])
        {
            *sum += one;
        }
        sum.uncalibrated += as_came.as_ref().and_then(read).unwrap_or(f64::NAN);
        sum.one_for_all += one_for_all.as_ref().and_then(read).unwrap_or(f64::NAN);
    }
    let names = AXES.into_iter().chain(["other"]);
    let each = names.zip(sums).filter(|(_, sum)| sum.times > 0);
    let each = each.map(|(axis, sum)| {
        let per_turn = |rad: f64| rad.to_degrees() / sum.turns;
        let each_way = sum.each_way.map(|[turns, error, variance]| {
            [error, 1.96 * variance.sqrt()].map(|rad| rad.to_degrees() / turns)
        });
        let both = axis != "other" && sum.each_way.iter().all(|way| way[0] > 0.0);
        WholeTurnsOfAxis {
            axis,
            times: sum.times,
            turns: sum.turns as u32,
            error_deg_per_turn: per_turn(sum.error),
            half_width_deg_per_turn: per_turn(1.96 * sum.variance.sqrt()),
            each_way_deg_per_turn: both.then_some(each_way),
            uncalibrated_deg_per_turn: as_came.map(|_| per_turn(sum.uncalibrated)),
            one_for_all_deg_per_turn: one_for_all.map(|_| per_turn(sum.one_for_all)),
        }
    });
    (each.collect(), found.warnings)
}

/// How much too far `gyro` turns in whole turns, rad, about their axis. The closure gives it but for whole turns, and the integral along the axis those.
fn error_along(
    stated: &Stated,
    turns: &[Turn],
    closure: &Closure,
    gyro: &Affine<f64>,
) -> Option<f64> {
    let error = ClosureError::at(turns, gyro, stated.vertical[0])?;
    let about = Path::of(turns, gyro);
    // The residual is about the vertical; along the axis of the turns, which may lean, it is the part that turning further would change.
    let up = turns.last()?.after.normalize();
    let part = up.dot(&about.axis);
    let closed = match part.abs() > 0.5 {
        true => error.block.residual[0] / part,
        false => tilted(turns, gyro)?,
    };
    let near = about.angle - TAU * closure.path.turns().round();
    Some(closed + TAU * ((near - closed) / TAU).round())
}

/// The same by gravity, about an axis that is nearer to level.
fn tilted(turns: &[Turn], gyro: &Affine<f64>) -> Option<f64> {
    let (first, last) = (turns.first()?, turns.last()?);
    let about = Path::of(turns, gyro).axis;
    let turned = ClosureError::rotation(turns, gyro)? * first.before.normalize();
    let after = last.after.normalize();
    let flat = |v: Vector3<f64>| v - about * about.dot(&v);
    let (a, b) = (flat(turned), flat(after));
    // Directions turn in the body the other way than the body does.
    Some(a.cross(&b).dot(&about).atan2(a.dot(&b)))
}
