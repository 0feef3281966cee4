//! A line of production: how many good units are rejected, and how many bad ones accepted.

use std::fmt::Write as _;

use mimu_rig::random::Random;
use mimu_station::document::Verdict;

use super::bench::{GRAVITY, Unit, judge, measured};

/// Units of the line.
const UNITS: u64 = 200;
/// Limits: offsets in deg/s, gravity in mg.
const OFFSET: f64 = 1.0;
const GRAVITY_MG: f64 = 25.0;

/// The gyro's noise in a production, deg/s/√Hz.
#[derive(Clone, Copy)]
struct Production {
    /// Largest density that is good.
    limit: f64,
    /// Median of the units, and their scatter as a share.
    median: f64,
    scatter: f64,
    /// One unit in so many is noisy, from the limit on; 0 for none.
    noisy: u64,
}

fn limits(decision: &str, density: f64) -> String {
    let mut text = format!("format = \"mimu-limits/1\"\nup = \"+z\"\n{decision}\nrows = [\n");
    for (name, lower, upper, unit) in [
        ("gyro_offset", Some(-OFFSET), OFFSET, "deg/s"),
        ("gravity_error", Some(-GRAVITY_MG), GRAVITY_MG, "mg"),
        ("gyro_noise_density", None, density, "deg/s/√Hz"),
    ] {
        let lower = lower.map_or(String::new(), |l| format!("lower = {l:?}, "));
        let _ = writeln!(
            text,
            "{{ name = \"{name}\", {lower}upper = {upper:?}, unit = \"{unit}\" }},"
        );
    }
    text + "]\n"
}

/// A unit of the line, which of its bits is stuck if one is, and whether its true values keep the limits. One in twenty has a stuck bit, one in forty loses
/// samples.
fn unit(seed: u64, of: Production) -> (Unit, Option<u64>, bool) {
    let mut random = Random::new(seed, "line");
    let density = match of.noisy > 0 && seed % of.noisy == 5 {
        true => of.limit * (1.0 + 0.15 * random.normal().abs()),
        false => of.median * (of.scatter * random.normal()).exp(),
    };
    let unit = Unit {
        density: [density, 250.0],
        lost: if seed % 40 == 7 { 0.03 } else { 0.0 },
        ..Unit::drawn(seed)
    };
    let fault = (seed % 20 == 3).then_some(seed / 20 % 2);
    let force: [f64; 3] = [0, 1, 2].map(|axis| {
        let up = f64::from(u8::from(axis == 2)) * GRAVITY / 9.80665;
        1e-3 * unit.accel_offset_mg[axis] + unit.accel_scale[axis] * up
    });
    let gravity = force.iter().map(|g| g * g).sum::<f64>().sqrt() - GRAVITY / 9.80665;
    let good = unit.gyro_offset_dps.iter().all(|o| o.abs() <= OFFSET)
        && (1e3 * gravity).abs() <= GRAVITY_MG
        && density <= of.limit
        && unit.lost == 0.0
        && fault.is_none();
    (unit, fault, good)
}

/// Good units that are rejected and bad ones that are accepted, by guarded and by simple acceptance; and the number of good ones.
fn errors(of: Production) -> ([[u32; 2]; 2], u32) {
    let rules = [
        ("guarded acceptance, k = 2", "decision = \"guarded\""),
        ("simple acceptance", "decision = \"simple\""),
    ];
    let (mut counts, mut good_units) = ([[0u32; 2]; 2], 0);
    for seed in 1..=UNITS {
        let (unit, fault, good) = unit(seed, of);
        let mut samples = unit.samples(seed);
        let mut force = |c: usize, code: fn(i64) -> i64| {
            let readings = samples.batch.raw[c].iter_mut();
            readings.for_each(|v| *v = code(*v as i64) as f64);
        };
        match fault {
            Some(0) => force(4, |v| v & !2),
            Some(_) => force(2, |v| v | 1),
            None => {}
        }
        good_units += u32::from(good);
        let measured = measured(&samples);
        for (k, (_, decision)) in rules.iter().enumerate() {
            let document = judge(&samples, &measured, &limits(decision, of.limit));
            assert_ne!(
                document.verdict,
                Verdict::NotMeasured,
                "{seed}: {document:?}"
            );
            let passed = document.verdict == Verdict::Passed;
            assert!(!passed || fault.is_none() && unit.lost == 0.0, "{seed}");
            counts[k][0] += u32::from(good && !passed);
            counts[k][1] += u32::from(!good && passed);
        }
    }
    let bad = UNITS as u32 - good_units;
    for ((name, _), [rejects, accepts]) in rules.iter().zip(counts) {
        println!(
            "{name}: {rejects} of {good_units} good units rejected, {accepts} of {bad} bad units accepted"
        );
    }
    (counts, good_units)
}

#[test]
fn few_good_units_are_rejected_and_by_the_guard_band_hardly_any_bad_one_is_accepted() {
    let production = Production {
        limit: 0.0065,
        median: 0.005,
        scatter: 0.05,
        noisy: 12,
    };
    let ([guarded, simple], good) = errors(production);
    // A unit at a limit is accepted in 2.3 %; few are near it.
    assert!(guarded[1] <= 2 && 20 * guarded[0] <= good, "{guarded:?}");
    assert!(
        simple[0] <= guarded[0] && simple[1] >= guarded[1],
        "{simple:?}"
    );
}

#[test]
#[ignore = "nightly: a minute"]
fn amid_the_production_a_limit_costs_units_by_the_guard_band() {
    let production = Production {
        limit: 0.006,
        median: 0.0055,
        scatter: 0.09,
        noisy: 0,
    };
    let ([guarded, simple], _) = errors(production);
    assert!(
        guarded[1] <= 2 && simple[1] >= guarded[1],
        "{guarded:?} {simple:?}"
    );
    assert!(guarded[0] > simple[0], "{guarded:?} {simple:?}");
}
