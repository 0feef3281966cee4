//! Scale factors of a gyro by whole turns, beside what other programs find in the same recordings.

use mimu::fit::{Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::{Recording, WholeTurns};
use mimu_tests::bench;
use mimu_tests::by_hand::{Grade, unit};
use mimu_tests::peers::{Samples, imu_tk, sens_auto};
use mimu_tests::whole_turns::Session;
use nalgebra::Matrix3;
use rayon::prelude::*;

const WAYS: [&str; 5] = [
    "`sens auto` of SlimeNRF, one spin for each axis",
    "the same from rest on, whatever the axis does",
    "IMU-TK's method",
    "mimu, turns between rests",
    "mimu, whole turns",
];

/// Relative errors of the three scale factors by each way; NaN if it refuses.
fn errors(grade: Grade, seed: u64) -> [[f64; 3]; 5] {
    let file = unit(&[], grade, seed);
    // As fast as IMU-TK's own recording, and half the time of this test.
    let plan = Session::UNSTATED.plan().replace("200.0", "100.0");
    let folder = bench::written(&plan, &file, seed);
    let recording = Recording::open(&folder.path().join("recording")).unwrap();
    let samples = Samples::read(&recording);
    let truth = file.unit.gyro_affine.as_ref().unwrap().matrix;
    let truth = Matrix3::from_fn(|i, j| truth[i][j]);
    let per_dps = match grade {
        Grade::Analog => 5e-3,
        _ => 65.5,
    };
    let slime = |as_published: bool| {
        // Ten poses; then for each axis a pose and two spins.
        [0, 1, 2].map(|axis| {
            let step = 10 + 3 * axis as i32;
            let scale = sens_auto(&samples, step, axis, 10, per_dps, as_published);
            // `truth` is raw by rad/s.
            let right = per_dps.to_degrees() / truth[(axis, axis)];
            scale.map_or(f64::NAN, |scale| scale / right - 1.0)
        })
    };
    let tk = imu_tk(
        &samples,
        recording.manifest.gravity_mps2,
        per_dps.to_degrees(),
    );
    let tk = tk.and_then(|c| c.try_inverse());
    let norms = |m: &Matrix3<f64>| [0, 1, 2].map(|i| m.row(i).norm());
    let tk = tk.map_or([f64::NAN; 3], |forward| {
        let (found, right) = (norms(&forward), norms(&truth));
        [0, 1, 2].map(|i| found[i] / right[i] - 1.0)
    });
    let own = |stated: Option<WholeTurns>| {
        let mut recording = Recording::open(&folder.path().join("recording")).unwrap();
        recording.manifest.whole_turns = stated;
        let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).unwrap();
        // A unit that is refused counts as not found, as with the others.
        let Ok(fitted) = fit(prepared, Options::IN_SAMPLE) else {
            return [f64::NAN; 3];
        };
        let triad = &fitted.sensor(Sensor::Gyro).unwrap().estimated.triad;
        let forward = triad.inverse.matrix.try_inverse().unwrap();
        let (found, right) = (norms(&forward), norms(&truth));
        [0, 1, 2].map(|i| found[i] / right[i] - 1.0)
    };
    [
        slime(true),
        slime(false),
        tk,
        own(None),
        own(Some(WholeTurns::default())),
    ]
}

/// Prints a row for each way; returns the median errors, %.
fn table(grade: Grade, seeds: std::ops::Range<u64>) -> [f64; 5] {
    let all: Vec<_> = seeds
        .into_par_iter()
        .map(|seed| errors(grade, seed))
        .collect();
    std::array::from_fn(|way| {
        let each = all.iter().flat_map(|errors| errors[way]);
        let mut sorted: Vec<f64> = each.filter(|e| e.is_finite()).map(f64::abs).collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().saturating_sub(1) as f64;
        let at = |share: f64| 100.0 * sorted.get((share * last) as usize).unwrap_or(&f64::NAN);
        println!(
            "| {grade:?} | {} | {:.4} | {:.4} | {} of {} |",
            WAYS[way],
            at(0.5),
            at(0.95),
            sorted.len(),
            3 * all.len()
        );
        at(0.5)
    })
}

const HEAD: &str = "| grade | way | error, median % | 95 % of errors below, % | found |";

#[test]
#[ignore = "a minute"]
fn whole_turns_are_closer_to_the_truth_than_what_others_find_in_the_same_recordings() {
    println!("{HEAD}");
    let [slime, from_rest, tk, rests, whole] = table(Grade::Consumer, 0..4);
    // `min` passes over ways that refuse every spin.
    let others = slime.min(from_rest).min(tk).min(rests);
    assert!(whole < 0.5 * others, "{whole} {others}");
}

#[test]
#[ignore = "minutes; prints a table"]
fn what_others_find_in_the_same_recordings() {
    println!("{HEAD}");
    for grade in [Grade::Consumer, Grade::Tactical, Grade::Analog] {
        table(grade, 0..100);
    }
}
