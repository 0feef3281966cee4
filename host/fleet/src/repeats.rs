//! Several measurements of a unit: how much they differ beyond the uncertainty of their fits, which contradicts the others, and what they say together.

use std::collections::BTreeMap;

use mimu::nalgebra::{DMatrix, DVector};
use mimu::sessions::between::Estimates;
use mimu::sessions::contradiction::FALSE_FINDING;

use crate::population::{self, Distance};

/// Fewest differences between measurements of the same unit that show how much these differ.
const FEWEST: usize = 5;

/// The measurements of a triad by unit.
#[derive(Debug, Clone)]
pub struct Repeats {
    /// Measurements of each unit, as numbers in the list of measurements.
    pub units: Vec<Vec<usize>>,
    /// What the used measurements of each unit say together; their uncertainty includes [`Self::within`].
    pub estimates: Vec<Estimates>,
    /// Covariance of the measurements of one unit beyond that of their fits; `None` if too few units are measured repeatedly.
    pub within: Option<DMatrix<f64>>,
    /// Measurements that contradict the others of their unit, with their distance and the probability, all such measurements considered.
    pub contradicting: Vec<(usize, Distance, f64)>,
}

impl Repeats {
    /// Of the measurements `all`, whose units are `units`; a measurement may lack the triad.
    ///
    /// `None` if a covariance is singular.
    pub fn of(all: &[Option<Estimates>], units: &[Vec<usize>]) -> Option<Self> {
        let with = |unit: &Vec<usize>| -> Vec<usize> {
            unit.iter().copied().filter(|m| all[*m].is_some()).collect()
        };
        let units: Vec<Vec<usize>> = units.iter().map(with).filter(|u| !u.is_empty()).collect();
        let (members, differences) = differences(all, &units);
        let n = all.iter().flatten().next()?.values.len();
        let degrees: usize = units.iter().map(|u| u.len() - 1).sum();
        let mut within = None;
        let mut contradicting = Vec::new();
        if degrees >= FEWEST {
            let found = population::fit(&differences, Some(&DVector::zeros(n)))?;
            let tried = members.len() as f64;
            let each = members.iter().zip(&found.distances);
            let each = each.map(|(m, d)| (*m, *d, (tried * d.p).min(1.0)));
            contradicting = each.filter(|(.., p)| *p < FALSE_FINDING).collect();
            within = Some(found.covariance);
        }
        let bad: Vec<usize> = contradicting.iter().map(|c| c.0).collect();
        let estimate = |unit: &Vec<usize>| {
            let good: Vec<usize> = unit.iter().copied().filter(|m| !bad.contains(m)).collect();
            // Of two nobody knows which is wrong.
            let used = if unit.len() < 3 || good.is_empty() {
                unit
            } else {
                &good
            };
            together(
                used.iter().filter_map(|m| all[*m].as_ref()),
                within.as_ref(),
            )
        };
        let estimates = units.iter().map(estimate).collect::<Option<_>>()?;
        Some(Self {
            units,
            estimates,
            within,
            contradicting,
        })
    }
}

/// For each measurement of a unit with several its difference from the mean of the unit's others, scaled to the variance of one measurement.
fn differences(all: &[Option<Estimates>], units: &[Vec<usize>]) -> (Vec<usize>, Vec<Estimates>) {
    let mut members = Vec::new();
    let mut differences = Vec::new();
    for unit in units.iter().filter(|u| u.len() > 1) {
        let own: Vec<&Estimates> = unit.iter().filter_map(|m| all[*m].as_ref()).collect();
        let others = (own.len() - 1) as f64;
        for (k, one) in own.iter().enumerate() {
            let rest = own.iter().enumerate().filter(|(j, _)| *j != k);
            let (mut mean, mut covariance) = (one.values.clone(), one.covariance.clone());
            for (_, other) in rest {
                mean -= &other.values / others;
                covariance += &other.covariance / (others * others);
            }
            // The variance of a difference from the mean of k others is 1 + 1/k of that of one.
            let by = 1.0 / (1.0 + 1.0 / others);
            members.push(unit[k]);
            differences.push(Estimates {
                values: mean * by.sqrt(),
                covariance: covariance * by,
            });
        }
    }
    (members, differences)
}

/// What several measurements say together, each weighted by its uncertainty.
fn together<'a>(
    all: impl Iterator<Item = &'a Estimates>,
    within: Option<&DMatrix<f64>>,
) -> Option<Estimates> {
    let all: Vec<&Estimates> = all.collect();
    let total = |e: &Estimates| match within {
        Some(within) => &e.covariance + within,
        None => e.covariance.clone(),
    };
    if let [one] = all[..] {
        return Some(Estimates {
            values: one.values.clone(),
            covariance: total(one),
        });
    }
    let n = all.first()?.values.len();
    let (mut normal, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
    // Units of the largest error of each parameter keep the inverse regular.
    let unit = DVector::from_fn(n, |i, _| {
        all.iter()
            .map(|e| total(e)[(i, i)])
            .fold(0.0, f64::max)
            .sqrt()
    });
    for e in &all {
        let own = total(e);
        let own = DMatrix::from_fn(n, n, |i, j| own[(i, j)] / (unit[i] * unit[j]));
        let weight = own.cholesky()?.inverse();
        right += &weight * (&e.values - &all[0].values).component_div(&unit);
        normal += weight;
    }
    let covariance = normal.cholesky()?.inverse();
    let mean = &covariance * right;
    Some(Estimates {
        values: &all[0].values + mean.component_mul(&unit),
        covariance: DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] * unit[i] * unit[j]),
    })
}

/// Numbers of the measurements of each unit, by its name.
pub fn by_unit<'a>(names: impl Iterator<Item = &'a str>) -> BTreeMap<&'a str, Vec<usize>> {
    let mut units: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (k, name) in names.enumerate() {
        units.entry(name).or_default().push(k);
    }
    units
}
