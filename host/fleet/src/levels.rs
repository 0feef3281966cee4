//! Batches, fixtures, operators and other labels whose units differ from the others.
//!
//! A level of a label (fixture B of the fixtures A, B and C) is judged by the medians of its units' parameters, which units that do not belong hardly move. With
//! [`MANY`] levels or more, how much levels usually differ is estimated of them, so that a level is named only if it differs by more than levels do. With fewer, it is named if it differs
//! from the others by more than chance explains, and by more than [`RELEVANT`].

use mimu::nalgebra::{DMatrix, DVector};
use mimu::sessions::between::Estimates;
use mimu::sessions::contradiction::FALSE_FINDING;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::population;
use crate::robust;

/// Levels of a label from which on their usual difference is estimated.
pub const MANY: usize = 8;
/// Fewest units of a level.
pub const FEWEST: usize = 3;
/// Smallest difference that is named, in standard deviations of the population: among thousands of units every difference is significant.
pub const RELEVANT: f64 = 0.3;

/// Parameters of units, to be compared by their labels.
pub struct Units<'a> {
    /// Parameters of each measurement.
    pub values: Vec<&'a DVector<f64>>,
    /// Covariance of one measurement about the population's mean.
    pub covariance: DMatrix<f64>,
}

/// A level of a label that differs.
#[derive(Debug, Clone, PartialEq)]
pub struct Different {
    /// Level.
    pub level: String,
    /// Measurements that have it.
    pub count: usize,
    /// Probability of such a difference by chance, without regard to how many levels were tried.
    pub p: f64,
    /// The parameter that shows it most.
    pub most: usize,
    /// Its difference from the other levels.
    pub change: f64,
    /// The same in standard deviations of the population.
    pub sigmas: f64,
}

/// Levels of a label, with the numbers of their measurements.
pub type Levels = std::collections::BTreeMap<String, Vec<usize>>;

/// The levels that differ from the others; `tried` is the number of all comparisons.
pub fn different(units: &Units, levels: &Levels, tried: usize) -> Vec<Different> {
    let usable: Vec<(&String, &Vec<usize>)> =
        levels.iter().filter(|(_, m)| m.len() >= FEWEST).collect();
    if usable.len() < 2 {
        return Vec::new();
    }
    let medians: Vec<Estimates> = usable.iter().map(|(_, m)| median(units, m)).collect();
    let judged = match usable.len() >= MANY {
        true => among_many(&medians),
        false => among_few(&medians, tried),
    };
    let sigma = |i: usize| units.covariance[(i, i)].sqrt();
    let each = judged.into_iter().filter_map(|(k, p, change)| {
        let most = (0..change.len()).max_by(|a, b| {
            let of = |i: usize| (change[i] / sigma(i)).abs();
            of(*a).total_cmp(&of(*b))
        })?;
        Some(Different {
            level: usable[k].0.clone(),
            count: usable[k].1.len(),
            p,
            most,
            change: change[most],
            sigmas: change[most] / sigma(most),
        })
    });
    let mut found: Vec<Different> = each
        .filter(|d| d.p * (tried as f64) < FALSE_FINDING && d.sigmas.abs() > RELEVANT)
        .collect();
    found.sort_by(|a, b| a.p.total_cmp(&b.p));
    found
}

/// Medians of the parameters of some measurements, and their covariance: that of the medians of a normal distribution is `asin(ρ) σ σ / n`.
fn median(units: &Units, members: &[usize]) -> Estimates {
    let n = units.covariance.nrows();
    let count = members.len() as f64;
    let values = DVector::from_fn(n, |i, _| {
        let mut all: Vec<f64> = members.iter().map(|m| units.values[*m][i]).collect();
        robust::median(&mut all)
    });
    let c = &units.covariance;
    let covariance = DMatrix::from_fn(n, n, |i, j| {
        let sigmas = (c[(i, i)] * c[(j, j)]).sqrt();
        (c[(i, j)] / sigmas).clamp(-1.0, 1.0).asin() * sigmas / count
    });
    Estimates { values, covariance }
}

/// Number of each level, its probability and its change: by the population of the levels.
fn among_many(medians: &[Estimates]) -> Vec<(usize, f64, DVector<f64>)> {
    let Some(found) = population::fit(medians, None) else {
        return Vec::new();
    };
    let each = medians.iter().zip(&found.distances).enumerate();
    each.map(|(k, (m, d))| (k, d.p, &m.values - &found.mean))
        .collect()
}

/// Each level against those that remain, the least probable first; it then no longer remains.
fn among_few(medians: &[Estimates], tried: usize) -> Vec<(usize, f64, DVector<f64>)> {
    let mut remaining: Vec<usize> = (0..medians.len()).collect();
    let mut found = Vec::new();
    while remaining.len() >= 2 {
        let each = remaining.iter().filter_map(|k| {
            let others = remaining.iter().filter(|j| *j != k);
            let (p, change) = against(&medians[*k], others.map(|j| &medians[*j]))?;
            Some((*k, p, change))
        });
        // Of two levels the one with fewer units is named: its median is less certain.
        let worst = |c: &Estimates| c.covariance.trace();
        let least = each.min_by(|a, b| {
            a.1.total_cmp(&b.1)
                .then(worst(&medians[b.0]).total_cmp(&worst(&medians[a.0])))
        });
        let Some(least) = least.filter(|l| l.1 * (tried as f64) < FALSE_FINDING) else {
            break;
        };
        remaining.retain(|k| *k != least.0);
        found.push(least);
    }
    found
}

/// Probability of the difference of `one` from the weighted mean of `others`, and the difference.
fn against<'a>(
    one: &Estimates,
    others: impl Iterator<Item = &'a Estimates>,
) -> Option<(f64, DVector<f64>)> {
    let n = one.values.len();
    let unit = one.covariance.diagonal().map(f64::sqrt);
    let scaled = |c: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| c[(i, j)] / (unit[i] * unit[j]));
    let (mut normal, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for other in others {
        let weight = scaled(&other.covariance).cholesky()?.inverse();
        right += &weight * (&other.values - &one.values).component_div(&unit);
        normal += weight;
    }
    let covariance = normal.cholesky()?.inverse();
    let change = -(&covariance * right);
    let square = change.dot(
        &(covariance + scaled(&one.covariance))
            .cholesky()?
            .solve(&change),
    );
    let p = ChiSquared::new(n as f64).map_or(1.0, |d| d.sf(square));
    Some((p, change.component_mul(&unit)))
}
