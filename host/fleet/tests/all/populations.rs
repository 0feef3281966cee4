//! The population with the uncertainty of the fits removed, and units that do not belong.

use mimu::nalgebra::{DMatrix, DVector};
use mimu::sessions::between::Estimates;
use mimu_fleet::population::{self, JOINTLY};
use mimu_rig::random::Random;

/// Units of a population with unit variances and the correlation 0.6 between neighbours, whose fits have `errors` as standard deviations on average.
fn units(random: &mut Random, count: usize, n: usize, errors: f64) -> Vec<Estimates> {
    let between = DMatrix::from_fn(n, n, |i, j| 0.6f64.powi(i.abs_diff(j) as i32));
    let factor = between.cholesky().unwrap().l();
    let normal = |random: &mut Random, n: usize| DVector::from_fn(n, |_, _| random.normal());
    let of = |_| {
        let quality = errors * 2f64.powf(random.within(1.0));
        let root = DMatrix::from_fn(n, n + 4, |_, _| {
            quality * random.normal() / ((n + 4) as f64).sqrt()
        });
        let error = &root * normal(random, n + 4);
        Estimates {
            values: &factor * normal(random, n) + error,
            covariance: &root * root.transpose(),
        }
    };
    (0..count).map(of).collect()
}

#[test]
fn mean_and_covariance_are_those_of_the_units_without_the_errors_of_their_fits() {
    for errors in [0.1, 1.0, 2.0] {
        let mut random = Random::new(1, "population");
        let found = population::fit(&units(&mut random, 4000, 9, errors), None).unwrap();
        assert!(found.jointly);
        let expected = DMatrix::from_fn(9, 9, |i, j| 0.6f64.powi(i.abs_diff(j) as i32));
        // The error of a variance of 4000 units is 2.2 % of that of units and fits, which is 1 + errors².
        let far = (&found.covariance - expected).abs().max() / (1.0 + errors * errors);
        assert!(
            far < 0.08,
            "errors {errors}: {far}\n{:.3}",
            found.covariance
        );
        let z = found
            .mean
            .iter()
            .enumerate()
            .map(|(i, m)| m / found.mean_covariance[(i, i)].sqrt());
        let z: f64 = z.map(|z| z * z).sum();
        assert!(z < 30.0, "chi-square of nine means {z}");
        let used = found.used.iter().filter(|u| **u).count();
        assert!((3800..=3960).contains(&used), "{used}");
    }
}

/// Share of fleets without a stranger in which one is named, and of fleets with three alike ones at a distance of `far` how many of these are.
fn named(count: usize, n: usize, fleets: u64, far: f64) -> (f64, f64) {
    let (mut false_alarms, mut found) = (0, 0);
    for seed in 0..fleets {
        let mut random = Random::new(seed, "strangers");
        let mut all = units(&mut random, count, n, 0.3);
        let is_named = |all: &[Estimates]| -> Vec<usize> {
            let fit = population::fit(all, None).unwrap();
            let of = fit.distances.iter().enumerate();
            of.filter(|(_, d)| d.p * (count as f64) < 0.01)
                .map(|(k, _)| k)
                .collect()
        };
        false_alarms += usize::from(!is_named(&all).is_empty());
        // Of the same kind, so that each would hide the others.
        for one in all.iter_mut().take(3) {
            one.values[n / 2] += far;
        }
        found += is_named(&all).iter().filter(|k| **k < 3).count();
    }
    (
        false_alarms as f64 / fleets as f64,
        found as f64 / (3 * fleets) as f64,
    )
}

#[test]
fn three_strangers_of_one_kind_are_found_and_few_fleets_without_any_have_one() {
    // Nine units know a standard deviation to a quarter, and the probability is that of the most distant of twelve in nine parameters.
    for (count, fleets, far) in [(12, 100, 25.0), (JOINTLY * 9, 60, 15.0), (200, 20, 15.0)] {
        let (false_alarms, found) = named(count, 9, fleets, far);
        assert!(found > 0.9, "{count} units: {found} found");
        // 1 % are meant; of a hundred fleets five have a probability of 0.3 %.
        assert!(
            false_alarms <= 0.05,
            "{count} units: {false_alarms} false alarms"
        );
    }
}

#[test]
fn fewer_than_five_units_are_no_population() {
    let mut random = Random::new(3, "few");
    assert!(population::fit(&units(&mut random, 4, 3, 0.1), None).is_none());
    let five = population::fit(&units(&mut random, 5, 3, 0.1), None).unwrap();
    assert!(!five.jointly && five.covariance[(0, 1)] == 0.0);
}
