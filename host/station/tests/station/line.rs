//! A line of production: how many good units are rejected, and how many bad ones accepted.

use std::fmt::Write as _;

use mimu_rig::random::Random;
use mimu_station::document::Verdict;

use super::bench::{GRAVITY, Unit, judge, measured};

/// Units of the line.
const UNITS: u64 = 200;
/// Limits: offsets in deg/s, gravity in mg, density of the gyro in deg/s/√Hz.
const OFFSET: f64 = 1.0;
const GRAVITY_MG: f64 = 25.0;
const DENSITY: f64 = 0.0065;

fn limits(decision: &str) -> String {
    let mut text = format!("format = \"mimu-limits/1\"\nup = \"+z\"\n{decision}\nrows = [\n");
    for (name, lower, upper, unit) in [
        ("gyro_offset", Some(-OFFSET), OFFSET, "deg/s"),
        ("gravity_error", Some(-GRAVITY_MG), GRAVITY_MG, "mg"),
        ("gyro_noise_density", None, DENSITY, "deg/s/√Hz"),
    ] {
        let lower = lower.map_or(String::new(), |l| format!("lower = {l:?}, "));
        let _ = writeln!(
            text,
            "{{ name = \"{name}\", {lower}upper = {upper:?}, unit = \"{unit}\" }},"
        );
    }
    text + "]\n"
}

/// A unit of the line, and whether its true values keep the limits. One in ten has a fault of its digital side.
fn unit(seed: u64) -> (Unit, Option<u64>, bool) {
    let mut random = Random::new(seed, "line");
    // One in twelve is noisy, from the limit on.
    let density = match seed % 12 == 5 {
        true => DENSITY * (1.0 + 0.15 * random.normal().abs()),
        false => 0.005 * (0.05 * random.normal()).exp(),
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
        && unit.density[0] <= DENSITY
        && unit.lost == 0.0
        && fault.is_none();
    (unit, fault, good)
}

#[test]
fn few_good_units_are_rejected_and_by_the_guard_band_hardly_any_bad_one_is_accepted() {
    let rules = [
        ("guarded acceptance, k = 2", "decision = \"guarded\""),
        ("simple acceptance", "decision = \"simple\""),
    ];
    let mut counts = [[0u32; 2]; 2];
    let (mut good_units, mut not_measured, mut missed_faults) = (0, 0, 0);
    for seed in 1..=UNITS {
        let (unit, fault, good) = unit(seed);
        let mut samples = unit.samples(seed);
        match fault {
            Some(0) => samples.batch.raw[4]
                .iter_mut()
                .for_each(|v| *v = (*v as i64 & !2) as f64),
            Some(_) => samples.batch.raw[2]
                .iter_mut()
                .for_each(|v| *v = (*v as i64 | 1) as f64),
            None => {}
        }
        good_units += u32::from(good);
        let measured = measured(&samples);
        for (k, (_, decision)) in rules.iter().enumerate() {
            let document = judge(&samples, &measured, &limits(decision));
            not_measured += u32::from(document.verdict == Verdict::NotMeasured);
            let passed = document.verdict == Verdict::Passed;
            counts[k][0] += u32::from(good && !passed);
            counts[k][1] += u32::from(!good && passed);
            missed_faults += u32::from(passed && (fault.is_some() || unit.lost > 0.0));
        }
    }
    let bad = UNITS as u32 - good_units;
    for ((name, _), [rejects, accepts]) in rules.iter().zip(counts) {
        println!(
            "{name}: {rejects} of {good_units} good units rejected, {accepts} of {bad} bad units accepted"
        );
    }
    assert_eq!((not_measured, missed_faults), (0, 0));
    let [
        [guarded_rejects, guarded_accepts],
        [simple_rejects, simple_accepts],
    ] = counts;
    // A unit at a limit is accepted in 2.3 %; few are near it.
    assert!(guarded_accepts <= 2, "{counts:?}");
    assert!(
        guarded_rejects >= simple_rejects && simple_accepts >= guarded_accepts,
        "{counts:?}"
    );
    assert!(simple_rejects * 10 <= good_units, "{counts:?}");
}
