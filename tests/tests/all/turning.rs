//! Diagnosis of units on a table that turns gravity through them within dwells.

use mimu::diagnose::{Diagnosis, diagnose};
use mimu::fit::Options;
use mimu::quantity::Sensor;
use mimu_rig::rig_file::EffectFile;
use mimu_tests::bench;
use mimu_tests::blind::{case_on, turning_plan};
use rayon::prelude::*;

const G: f64 = 9.80665;
/// deg/s per g: rows are axes that err.
const SENSITIVITY: [[f64; 3]; 3] = [[0.2, 0.1, 0.05], [0.02, -0.15, 0.0], [0.1, 0.0, 0.1]];
/// Position of the board relative to the intersection of the table's axes, mm.
const BESIDE_MM: [f64; 3] = [2.0, -3.0, 5.0];
/// Where each axis of the accelerometer senses, mm from the middle of the board. Along z they are alike: the plan turns about z and the vertical, which shows
/// no arm along z.
const ARMS_MM: [[f64; 3]; 3] = [[6.0, 0.0, 0.0], [0.0, -4.0, 0.0], [1.0, 3.0, 0.0]];

/// A unit with a g-sensitivity and a size effect, off the centre of a table without other flaws.
fn found(seed: u64) -> Diagnosis {
    let mut file = bench::drawn(seed, "unit");
    file.table.offset_mm = BESIDE_MM;
    let effect = |id: &str, name: &str, matrix: [[f64; 3]; 3]| {
        let rows = matrix.map(|row| toml::Value::Array(row.map(toml::Value::Float).to_vec()));
        let matrix = toml::Value::Array(rows.to_vec());
        EffectFile {
            id: id.into(),
            parameters: toml::Table::from_iter([(name.to_string(), matrix)]),
        }
    };
    file.effect = vec![
        effect("gyro_g_sensitivity", "matrix_dps_per_g", SENSITIVITY),
        effect("accel_size_effect", "arms_mm", ARMS_MM),
    ];
    let recorded = bench::recorded(&bench::turning_plan(seed), &file, seed);
    diagnose(recorded.into(), Options::IN_SAMPLE).expect("diagnosed")
}

/// Effects that were found.
fn ids(found: &Diagnosis) -> Vec<String> {
    let mut ids: Vec<String> = found.effects.iter().map(|e| e.candidate.id()).collect();
    ids.sort();
    ids
}

/// Coefficients of a matrix that were found for `sensor`, and their standard deviations.
fn matrix(found: &Diagnosis, sensor: Sensor) -> Vec<([usize; 2], f64, f64)> {
    let of = found.sensors.iter().find(|s| s.sensor == sensor);
    let accepted = &of.expect("recorded").decision.accepted;
    let effects = accepted.iter().map(|a| a.effect.lasting());
    let coefficients = effects.flat_map(|e| e.coefficients());
    let at = |c: &str, k: usize| "xyz".find(&c[k..=k]).expect("an axis");
    coefficients
        .map(|c| ([at(&c.name, 0), at(&c.name, 1)], c.value, c.sigma.unwrap()))
        .collect()
}

/// Errors of the g-sensitivities, in sigmas.
fn errors(found: &Diagnosis) -> Vec<f64> {
    let each = matrix(found, Sensor::Gyro).into_iter();
    each.map(|([i, j], value, sigma)| (value - SENSITIVITY[i][j].to_radians() / G) / sigma)
        .collect()
}

/// Errors of what differs between the arms of the axes, mm: where the board is on the table shows nowhere.
fn errors_of_arms(found: &Diagnosis) -> [[f64; 3]; 3] {
    let mut errors = ARMS_MM.map(|row| row.map(|truth| -truth));
    for ([i, j], value, _) in matrix(found, Sensor::Accel) {
        errors[i][j] += 1e3 * value;
    }
    let common = [0, 1, 2].map(|j| errors.iter().map(|row| row[j]).sum::<f64>() / 3.0);
    errors.map(|row| [0, 1, 2].map(|j| row[j] - common[j]))
}

#[test]
fn g_sensitivity_and_what_differs_between_the_arms_of_the_axes_are_named_beside_the_axis_of_the_table()
 {
    let found = found(1);
    assert_eq!(ids(&found), ["accel_size_effect", "gyro_g_sensitivity"]);
    let errors = errors(&found);
    assert!(errors.len() >= 7, "{errors:?}");
    assert!(errors.iter().all(|e| e.abs() < 4.5), "{errors:?}");
    let off_mm = errors_of_arms(&found);
    assert!(off_mm.concat().iter().all(|e| e.abs() < 0.7), "{off_mm:?}");
}

#[test]
#[ignore = "nightly: a plan of half an hour"]
fn noise_of_blocks_makes_no_effect_of_a_clean_unit_whose_inputs_turn() {
    let case = case_on(&turning_plan(0), &[], 0);
    assert_eq!(case.said.verdict, "clean", "{case:?}");
}

#[test]
#[ignore = "nightly: more recordings"]
fn intervals_of_coefficients_hold_the_truth_where_gravity_turns_through_the_unit() {
    let all: Vec<Diagnosis> = (0..40).into_par_iter().map(found).collect();
    let named = all
        .iter()
        .filter(|d| ids(d) == ["accel_size_effect", "gyro_g_sensitivity"]);
    let named: Vec<&Diagnosis> = named.collect();
    assert!(named.len() >= 38);
    let errors: Vec<f64> = named.iter().flat_map(|d| errors(d)).collect();
    let n = errors.len() as f64;
    let inside = errors.iter().filter(|e| e.abs() < 1.96).count() as f64 / n;
    // Four sigmas for this number of coefficients, as if they were independent.
    let margin = 4.0 * (0.07 * 0.93 / n).sqrt();
    assert!((0.93 - margin..0.97 + margin).contains(&inside), "{inside}");
    let worst = named.iter().flat_map(|d| errors_of_arms(d).concat());
    let worst = worst.fold(0.0, |most: f64, e| most.max(e.abs()));
    assert!(worst < 1.0);
}
