//! What the uncertainty of each parameter consists of: noise, and the stated errors of the reference.

use serde::Serialize;

use crate::fit::{Cause, SensorFit};
use crate::parameter::{TriadParameter, parameters};
use crate::triad::{Part, Triad};
use mimu_recording::RawUnit;

/// What the variance of one parameter consists of.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BudgetRow {
    /// The parameter.
    #[serde(skip)]
    pub of: TriadParameter,
    /// Its name, as in the list of parameters.
    pub name: String,
    /// Its standard deviation, in [`Self::unit`].
    pub sigma: f64,
    /// Its unit.
    pub unit: String,
    /// Share of noise and scatter in its variance, 0 to 1.
    pub noise: f64,
    /// Share of each error of the reference.
    pub shares: Vec<(Cause, f64)>,
}

/// The physical parameters; empty if no error of the reference is stated.
pub(super) fn budget(found: &SensorFit, raw: RawUnit) -> Vec<BudgetRow> {
    if found.influences.is_empty() {
        return Vec::new();
    }
    let triad = &found.estimated.triad;
    let sigmas = |triad: &Triad| parameters(triad, found.sensor, raw);
    let alone: Option<Vec<(Cause, _)>> = found
        .influences
        .iter()
        .map(|influence| {
            let part = Part::known(influence.covariance);
            let triad = Triad::from_forward(triad.forward, vec![part])?;
            Some((influence.cause, sigmas(&triad)))
        })
        .collect();
    let alone = alone.unwrap_or_default();
    let rows = sigmas(triad).into_iter().enumerate();
    rows.filter(|(_, (of, ..))| TriadParameter::physical().contains(of))
        .map(|(k, (of, all, unit))| {
            let share = |sigma: f64| sigma * sigma / (all.sigma * all.sigma);
            let shares: Vec<(Cause, f64)> = alone
                .iter()
                .map(|(cause, of)| (*cause, share(of[k].1.sigma)))
                .collect();
            BudgetRow {
                of,
                name: of.to_string(),
                sigma: all.sigma,
                unit: unit.to_string(),
                noise: (1.0 - shares.iter().map(|s| s.1).sum::<f64>()).max(0.0),
                shares,
            }
        })
        .collect()
}
