//! The population of a fleet as a prior for the calibration of one more unit.

use mimu::nalgebra::DMatrix;
use mimu::prior::{Prior, PriorTable};
use mimu::{Error, PerSensor, RawUnit, Reference};

use crate::triad::Triad;

/// Fewest units of a prior: the standard deviations of fewer are uncertain by more than a sixth.
pub const FEWEST: usize = 20;

/// The prior of a further unit: mean and covariance of the population with the error of the mean, and what its measurements differ by.
///
/// # Errors
/// Fewer than [`FEWEST`] units of every triad; readings whose reference is not known.
pub(crate) fn prior(
    tool: &str,
    triads: &[Triad],
    (raw, reference): (RawUnit, Option<Reference>),
) -> Result<Prior, Error> {
    let Some(reference) = reference else {
        let problem = "the calibrations do not say what was known of their input, so that their frame is unknown";
        return Err(Error::new(
            "the prior",
            problem,
            "use calibrations by this version of mimu",
        ));
    };
    let mut tables = PerSensor::default();
    for triad in triads {
        let used = triad.population.used.iter().filter(|u| **u).count();
        if used >= FEWEST {
            tables[triad.basis.sensor] = Some(table(triad, raw, used));
        }
    }
    if tables.present().next().is_none() {
        let most = triads
            .iter()
            .map(|t| t.repeats.units.len())
            .max()
            .unwrap_or(0);
        let problem = format!("{most} units; a prior needs {FEWEST} that belong to one population");
        return Err(Error::new(
            "the prior",
            problem,
            "name folders with more units",
        ));
    }
    Ok(Prior::new(tool.into(), raw, reference, tables))
}

fn table(triad: &Triad, raw: RawUnit, used: usize) -> PriorTable {
    let n = triad.n();
    let count = used as f64;
    let population = &triad.population;
    // The inverse of a covariance that is estimated from N units is too large by this factor on average; a fit uses the inverse.
    let dimensions = if population.jointly { n as f64 } else { 1.0 };
    let estimated = (count - 1.0) / (count - dimensions - 2.0).max(1.0);
    let mut covariance = &population.covariance * estimated + &population.mean_covariance;
    if let Some(within) = &triad.repeats.within {
        covariance += within;
    }
    let factor: Vec<f64> = (0..n).map(|i| triad.basis.to_file(i)).collect();
    let mean: Vec<f64> = (0..n)
        .map(|i| triad.basis.in_file(i, population.mean[i]))
        .collect();
    let raw_covariance = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] * factor[i] * factor[j]);
    PriorTable::new(
        triad.basis.sensor,
        raw,
        used,
        &triad.basis.free,
        &mean,
        &raw_covariance,
    )
}
