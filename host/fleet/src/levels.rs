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
pub struct Units {
    /// Parameters of each measurement; `None` where a triad was not measured.
    pub values: Vec<Option<DVector<f64>>>,
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
    /// The change of all parameters.
    all: DVector<f64>,
}

/// Levels of a label, with the numbers of their measurements.
pub type Levels = std::collections::BTreeMap<String, Vec<usize>>;

impl Units {
    /// Removes what a level, with these `members`, differs by. The other labels are then judged without it: a batch that differs widens the scatter of the units of each
    /// fixture, and hides a fixture that differs too.
    pub fn without(&mut self, one: &Different, members: &[usize]) {
        let before = self.scales();
        for m in members {
            if let Some(value) = &mut self.values[*m] {
                *value -= &one.all;
            }
        }
        let narrower = self
            .scales()
            .component_div(&before)
            .map(|ratio| ratio.min(1.0));
        let by = DMatrix::from_diagonal(&narrower);
        self.covariance = &by * &self.covariance * &by;
    }

    /// Robust standard deviations of the parameters.
    fn scales(&self) -> DVector<f64> {
        DVector::from_fn(self.covariance.nrows(), |i, _| {
            let measured = self.values.iter().flatten().map(|v| v[i]);
            robust::location_and_scale(measured).1
        })
    }
}

/// The level that differs most certainly from the others; `tried` is the number of all comparisons.
pub fn different(units: &Units, levels: &Levels, tried: usize) -> Option<Different> {
    let usable: Vec<(&String, &Vec<usize>)> =
        levels.iter().filter(|(_, m)| m.len() >= FEWEST).collect();
    if usable.len() < 2 {
        return None;
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
            all: change,
        })
    });
    each.filter(|d| d.p * (tried as f64) < FALSE_FINDING && d.sigmas.abs() > RELEVANT)
        .min_by(|a, b| a.p.total_cmp(&b.p))
}

/// Medians of the parameters of some measurements, and their covariance: that of the medians of a normal distribution is `asin(ρ) σ σ / n`.
fn median(units: &Units, members: &[usize]) -> Estimates {
    let n = units.covariance.nrows();
    let count = members.len() as f64;
    let values = DVector::from_fn(n, |i, _| {
        let measured = members.iter().filter_map(|m| units.values[*m].as_ref());
        let mut all: Vec<f64> = measured.map(|v| v[i]).collect();
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

#[cfg(test)]
mod tests {
    use super::*;
    use mimu_rig::random::Random;

    /// Labels that differ among 96 units of two parameters: half of them are of batch 2, off by `batch` in both; of the four fixtures D is off by `fixture` in the first,
    /// and has batch 1 three times as often as batch 2.
    fn named(seed: u64, batch: f64, fixture: f64) -> Vec<String> {
        let mut random = Random::new(seed, "levels");
        let mut levels = [Levels::new(), Levels::new()];
        let mut values = Vec::new();
        for k in 0..96 {
            let of_d = k % 4 == 3;
            let second = if of_d { k % 16 == 3 } else { k % 8 > 2 };
            let own = DVector::from_fn(2, |i, _| {
                let by_batch = if second { batch } else { 0.0 };
                let by_fixture = if of_d && i == 0 { fixture } else { 0.0 };
                random.normal() + by_batch + by_fixture
            });
            values.push(Some(own));
            let names = [["1", "2"][usize::from(second)], ["A", "B", "C", "D"][k % 4]];
            for (levels, name) in levels.iter_mut().zip(names) {
                levels.entry(name.into()).or_default().push(k);
            }
        }
        let all: Vec<DVector<f64>> = values.iter().flatten().cloned().collect();
        let (_, covariance) = robust::first(&all, None, true);
        let mut units = Units { values, covariance };
        let mut named = Vec::new();
        loop {
            let each = levels.iter().enumerate();
            let each = each.filter_map(|(l, levels)| Some((l, different(&units, levels, 6)?)));
            let Some((l, one)) = each.min_by(|a, b| a.1.p.total_cmp(&b.1.p)) else {
                return named;
            };
            units.without(&one, &levels[l][&one.level]);
            named.push(one.level);
            assert!(named.len() < 10, "{named:?}");
        }
    }

    #[test]
    fn a_fixture_that_differs_is_found_beside_a_batch_that_differs_more() {
        let found = |batch, fixture| -> [usize; 2] {
            let all: Vec<Vec<String>> = (0..40).map(|s| named(s, batch, fixture)).collect();
            let of = |level: &str| all.iter().filter(|n| n.iter().any(|l| l == level)).count();
            [
                of("D"),
                all.iter()
                    .filter(|n| n.iter().any(|l| ["A", "B", "C"].contains(&&l[..])))
                    .count(),
            ]
        };
        let (alone, beside, none) = (found(0.0, 1.5), found(4.0, 1.5), found(4.0, 0.0));
        println!("alone {alone:?}, beside {beside:?}, none {none:?}");
        assert!(beside[0] + 4 >= alone[0], "{beside:?} {alone:?}");
        assert!(none[0] + none[1] <= 2, "{none:?}");
    }
}
