//! The turns of each pair without the part that all share.

use std::sync::Arc;

use mimu::Sensor;
use mimu::fit::Fit;
use mimu::prepared::Prepared;
use nalgebra::{Rotation3, Vector3};

use super::{TurnErrors, is_known};

/// Fewest pairs: of two, the error of each is the other's negative as soon as their mean is taken out.
const FEWEST: usize = 3;

/// The recordings of these pairs, from whose turns the mean error of the other pairs is taken out: what a fit of one leaves is then its own. Empty for two pairs.
pub fn own_turns(fits: &[(u8, &Fit, Rotation3<f64>)], of: &TurnErrors) -> Vec<(u8, Prepared)> {
    if fits.len() < FEWEST {
        return Vec::new();
    }
    let own = of.own();
    let pairs = fits.iter().enumerate();
    let pairs = pairs.filter_map(|(i, (pair, fit, rotation))| {
        let gyro = fit.sensor(Sensor::Gyro)?.estimated.triad.inverse;
        let forward = gyro.matrix.try_inverse()?;
        let mut prepared = fit.prepared.clone();
        let accel = fit.sensor(Sensor::Accel)?.estimated.triad.inverse;
        let ends = fit.prepared.turns(&accel).0;
        let ends = ends.iter().map(|turn| (turn.to, turn.increments.last()));
        let ends: Vec<(usize, f64)> = ends
            .filter_map(|(to, last)| Some((to, last?.end_s)))
            .collect();
        let increments = &mut Arc::make_mut(&mut prepared.condensed).increments;
        for (j, place) in of.places[i].iter().enumerate() {
            let Some((common, variance)) = of.of_others(i, j, &own) else {
                continue;
            };
            let end = ends.iter().find(|(to, _)| Some(*to) == *place);
            let last = end.and_then(|(_, end)| increments.iter_mut().find(|of| of.end_s == *end));
            let Some(last) = last else {
                continue;
            };
            // What turns the predicted direction into the measured one is missing in the turn, with the opposite sign: a body that turns left sees gravity turn right.
            let added = forward * -(rotation.inverse() * common);
            last.integral = (Vector3::from(last.integral) + added).into();
            last.lost_variance += variance / (gyro.matrix.norm_squared() / 3.0);
        }
        Some((*pair, prepared))
    });
    pairs.collect()
}

impl TurnErrors {
    /// Weighted mean of the errors of all pairs but `i` after the turn `j`, and the variance of a component of it by their own parts. `None` if pair `i` lacks the turn, or all others.
    fn of_others(&self, i: usize, j: usize, own: &[f64]) -> Option<(Vector3<f64>, f64)> {
        is_known(&self.pairs[i].errors[j]).then_some(())?;
        let others = self.pairs.iter().zip(own).enumerate();
        let others = others.filter(|(k, (pair, _))| *k != i && is_known(&pair.errors[j]));
        let (mut sum, mut weights) = (Vector3::zeros(), 0.0);
        for (_, (pair, own)) in others {
            // A pair that agrees with the others by chance is taken to err by at least a hundredth of what it shows.
            let least = 1e-4 * pair.errors[j].norm_squared();
            let weight = own.max(pair.noise[j].trace()).max(least).recip();
            sum += weight * pair.errors[j];
            weights += weight;
        }
        (weights > 0.0 && weights.is_finite()).then(|| (sum / weights, 0.5 / weights))
    }
}
