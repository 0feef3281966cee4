//! The errors of all pairs of a body after its turns, by the fit of each pair.

use mimu::fit::Fit;
use mimu::observable::Observable;
use mimu::observation::turn::{Path, Turn, TurnError};
use mimu::signal::dwell::Dwell;
use mimu::{Affine, Sensor};
use nalgebra::{Matrix3, Rotation3, Vector3};

use super::{PairErrors, TurnErrors};

/// The errors of all pairs of one recording by their fits, the reference first. A rotation transforms a vector from the frame of a pair's calibrated readings into that
/// of the reference. A turn of a pair is the turn of the reference whose two dwells overlap its own. `None` if a fit has no turns.
pub fn turn_errors(fits: &[(u8, &Fit, Rotation3<f64>)]) -> Option<TurnErrors> {
    let (_, reference, _) = fits.first()?;
    let gyro = model(reference, Sensor::Gyro)?;
    let (turns, _) = reference.prepared.turns(&model(reference, Sensor::Accel)?);
    let own: Vec<_> = turns.iter().map(|turn| ends(reference, turn)).collect();
    let pairs = fits.iter().map(|(pair, fit, rotation)| {
        let gyro = model(fit, Sensor::Gyro)?;
        let square = gyro.matrix.norm_squared() / 3.0;
        let (turns, _) = fit.prepared.turns(&model(fit, Sensor::Accel)?);
        let mut of = PairErrors {
            pair: *pair,
            errors: vec![Vector3::repeat(f64::NAN); own.len()],
            noise: vec![Matrix3::zeros(); own.len()],
            left: left(fit, turns.len())?,
        };
        let mut places = vec![None; own.len()];
        for turn in &turns {
            let [from, to] = ends(fit, turn);
            let same = |own: &[[f64; 2]; 2]| overlap(&own[0], &from) && overlap(&own[1], &to);
            let Some(j) = own.iter().position(same) else {
                continue;
            };
            let up = rotation * turn.after.normalize();
            let across = Matrix3::identity() - up * up.transpose();
            of.errors[j] = rotation * TurnError::at(turn, &gyro).vector();
            places[j] = Some(turn.to);
            of.noise[j] = across * (turn.variance(square) - turn.earth_variance);
        }
        Some((of, places))
    });
    let (pairs, places) = pairs.collect::<Option<Vec<_>>>()?.into_iter().unzip();
    let each = turns.iter().zip(&own);
    Some(TurnErrors {
        pairs,
        places,
        conditions: each
            .map(|(turn, ends)| conditions(turn, &gyro, ends[1][0]))
            .collect(),
        shared: turns.iter().map(|turn| 2.0 * turn.earth_variance).collect(),
    })
}

fn model(fit: &Fit, sensor: Sensor) -> Option<Affine<f64>> {
    Some(fit.sensor(sensor)?.estimated.triad.inverse)
}

/// Share of the degrees of freedom of so many turns that the fit of the gyro has left.
fn left(fit: &Fit, turns: usize) -> Option<f64> {
    let groups = fit.sensor(Sensor::Gyro)?.estimated.scatter.iter();
    let of_turns =
        groups.filter(|of| matches!(of.0, Observable::Turns | Observable::AfterWholeTurns));
    let left = of_turns.map(|of| of.1.dof).sum::<f64>() / (2 * turns) as f64;
    (left > 0.0).then(|| left.min(1.0))
}

/// First and last instant of the dwells before and after a turn, s.
fn ends(fit: &Fit, turn: &Turn) -> [[f64; 2]; 2] {
    let span = |dwell: &Dwell| [dwell.start_s, dwell.last_s];
    [turn.from, turn.to].map(|k| span(&fit.prepared.dwells.list[k]))
}

fn overlap(a: &[f64; 2], b: &[f64; 2]) -> bool {
    a[0] < b[1] && b[0] < a[1]
}

fn conditions(turn: &Turn, gyro: &Affine<f64>, time_s: f64) -> [f64; 4] {
    let path = Path::of(std::slice::from_ref(turn), gyro);
    let rates = turn.increments.iter();
    let rates = rates.map(|of| gyro.matrix * Vector3::from(of.integral) / of.duration_s);
    let rates: Vec<Vector3<f64>> = rates.collect();
    let second = rates
        .windows(3)
        .map(|w| (w[0] - w[1] * 2.0 + w[2]).norm_squared());
    [path.angle, path.fastest, second.sum::<f64>().sqrt(), time_s]
}
