//! Readings in SI without a calibration, judged like one.
//!
//! A unit with readings in SI is calibrated already, and a new calibration has to improve its readings. Ten poses by hand once gave a calibration
//! whose direction of gravity was 1.65 degrees off in sample, while that of the readings themselves was 0.44 degrees off.

use mimu_core::compensation::Affine;
use nalgebra::Vector3;

use super::sensor::{SensorFit, rms};
use crate::estimate::Observation;
use crate::observation::magnitude::Magnitude;
use crate::observation::turn::{Turn, TurnError};
use crate::prepared::Prepared;
use crate::quantity::Figure;
use crate::warning::Warning;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// Error of readings in SI whose inputs are known.
pub(super) fn inputs<'a>(
    prepared: &Prepared,
    observations: impl Iterator<Item = &'a Observation>,
) -> Option<f64> {
    prepared
        .is_in_si()
        .then(|| rms(Figure::Input, observations.map(|o| o.raw - o.input)))
}

/// Error of the magnitudes of readings in SI; `known` has each with its known magnitude.
pub(super) fn magnitudes(
    prepared: &Prepared,
    figure: Figure,
    known: &[(&Observation, f64)],
) -> Option<f64> {
    let errors = known.iter().map(|(o, known)| {
        let error = Magnitude::at(&Affine::identity(), &o.raw, *known);
        Vector3::new(error.residual(), 0.0, 0.0)
    });
    prepared.is_in_si().then(|| rms(figure, errors))
}

/// Error of the directions after turns, both sensors uncalibrated.
pub(super) fn directions(prepared: &Prepared, turns: &[Turn]) -> Option<f64> {
    let errors = turns.iter().map(|turn| {
        let [before, after] = turn.raw;
        let turn = Turn {
            before,
            after,
            ..*turn
        };
        TurnError::at(&turn, &Affine::identity()).vector()
    });
    prepared.is_in_si().then(|| rms(Figure::Direction, errors))
}

/// Warns of a calibration that does no better than the uncalibrated readings.
pub(super) fn compare(fit: &mut SensorFit) {
    let Some(uncalibrated) = fit.uncalibrated_rms else {
        return;
    };
    let held_out = fit.held_out_rms();
    let calibrated = held_out.unwrap_or_else(|| fit.rms());
    if calibrated < uncalibrated {
        return;
    }
    let (factor, unit) = fit.figure.readable(fit.sensor);
    let count = fit.residuals.len();
    let worse = exceeds(calibrated, uncalibrated, errors(fit.figure, count));
    let errors = [uncalibrated, calibrated].map(|error| error * factor);
    let undecided = (!worse).then_some(count);
    let warning = Warning::NoBetter {
        errors,
        unit,
        held_out: held_out.is_some(),
        undecided,
    };
    fit.warnings.push(warning.of(fit.sensor));
}

/// Probability that a reported difference is chance.
const BY_CHANCE: f64 = 0.025;

/// Number of components of `count` errors of a figure.
pub(crate) fn errors(figure: Figure, count: usize) -> usize {
    count
        * match figure {
            Figure::Input => 3,
            Figure::Direction => 2,
            Figure::GravityMagnitude | Figure::RateMagnitude => 1,
        }
}

/// Whether an rms significantly exceeds another one of as many `errors`, by the ratio of the two variances. Three errors that are 3.6 times as large
/// show nothing. Errors of the same dwells are correlated, which makes the test conservative.
pub(crate) fn exceeds(rms: f64, other: f64, errors: usize) -> bool {
    let dof = errors as f64;
    let by_chance = FisherSnedecor::new(dof, dof).map_or(1.0, |f| f.sf((rms / other).powi(2)));
    rms > other && by_chance < BY_CHANCE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_few_errors_say_is_no_comparison() {
        // The 97.5 % quantiles of F: 15.44 for 3 and 3, 1.75 for 50 and 50.
        assert!(!exceeds(3.63, 1.0, 3));
        assert!(exceeds(3.94, 1.0, 3));
        assert!(!exceeds(1.32, 1.0, 50));
        assert!(exceeds(1.33, 1.0, 50));
        assert!(!exceeds(1.0, 3.0, 50));
    }
}
