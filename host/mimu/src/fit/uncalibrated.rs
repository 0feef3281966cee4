//! Readings in SI without a calibration, judged like one.
//!
//! A unit with readings in SI is calibrated already, and a new calibration has to improve its readings. Ten poses by hand once gave a calibration
//! whose direction of gravity was 1.65 degrees off in sample, while that of the readings themselves was 0.44 degrees off.

use super::sensor::SensorFit;
use crate::quantity::Figure;
use crate::warning::Warning;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

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
    let worse = exceeds(calibrated, uncalibrated, fit.figure, count);
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

/// Whether an rms significantly exceeds another one of as many errors (`count` dwells or turns), by the ratio of the two variances. Three errors that are 3.6 times
/// as large show nothing. Errors of the same dwells are correlated, which makes the test conservative.
pub(crate) fn exceeds(rms: f64, other: f64, figure: Figure, count: usize) -> bool {
    let dof = (count * figure.components()) as f64;
    let by_chance = FisherSnedecor::new(dof, dof).map_or(1.0, |f| f.sf((rms / other).powi(2)));
    rms > other && by_chance < BY_CHANCE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_few_errors_say_is_no_comparison() {
        // The 97.5 % quantiles of F: 15.44 for 3 and 3, 1.75 for 50 and 50.
        assert!(!exceeds(3.63, 1.0, Figure::RateMagnitude, 3));
        assert!(exceeds(3.94, 1.0, Figure::RateMagnitude, 3));
        assert!(!exceeds(1.32, 1.0, Figure::RateMagnitude, 50));
        assert!(exceeds(1.33, 1.0, Figure::RateMagnitude, 50));
        assert!(!exceeds(1.0, 3.0, Figure::RateMagnitude, 50));
    }
}
