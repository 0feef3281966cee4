//! mimu beside IMU-TK's method on the same rests of single units: errors on a recording that neither has seen.

use mimu::fit::{Fit, Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::Recording;
use mimu_tests::by_hand::{Grade, plan, unit};
use mimu_tests::imu_tk::calibrated;
use mimu_tests::recordings::{
    Samples, Verification, dwell_rows, mikoff_session, rms, verdict, xsens_session,
};
use rayon::prelude::*;

/// mimu and IMU-TK by `seen`, judged by `unseen`.
fn judged((seen, samples): &(Prepared, Samples), unseen: &Prepared) -> [Verification; 2] {
    let fitted = |of: &Prepared| fit(of.clone(), Options::IN_SAMPLE).expect("a fit");
    let [own, judge]: [Fit; 2] = [seen, unseen].map(fitted);
    let mimu =
        [Sensor::Accel, Sensor::Gyro].map(|s| own.sensor(s).unwrap().estimated.triad.inverse);
    let imu_tk = calibrated(samples, &dwell_rows(&own), seen.manifest.gravity_mps2);
    [mimu, imu_tk].map(|[accel, gyro]| verdict(&judge, &accel, &gyro).expect("judged"))
}

/// Errors of mimu and of IMU-TK, rms over pairs of recordings: of the size of gravity, mm/s², and of its direction after a turn, degrees.
fn side_by_side(what: &str, pairs: &[[Verification; 2]]) -> [[f64; 2]; 2] {
    let all = [0, 1].map(|by| {
        let each = || pairs.iter().map(|of| of[by]);
        [
            1e3 * rms(each().map(|v| v.size_mps2)),
            rms(each().map(|v| v.direction_rad)).to_degrees(),
        ]
    });
    for (name, [size, direction]) in ["mimu", "IMU-TK"].iter().zip(all) {
        println!("{what}: {name} errs by {size:.2} mm/s² and {direction:.3} deg");
    }
    all
}

/// Each half of the session judged by the other.
fn by_halves(halves: [(Prepared, Samples); 2]) -> [[Verification; 2]; 2] {
    let [a, b] = &halves;
    [judged(a, &b.0), judged(b, &a.0)]
}

#[test]
fn on_halves_of_real_sessions_directions_err_no_more_than_by_imu_tk() {
    let Some(xsens) = xsens_session() else { return };
    let [ours, theirs] = side_by_side("Xsens", &by_halves(xsens.halves()));
    assert!(ours[1] <= theirs[1]);
    let mikoff: Vec<_> = (0..5).filter_map(mikoff_session).collect();
    let pairs: Vec<_> = mikoff
        .iter()
        .flat_map(|of| by_halves(of.halves()))
        .collect();
    let [ours, theirs] = side_by_side("five MPU-9150", &pairs);
    assert!(ours[1] <= theirs[1]);
}

#[test]
fn on_second_recordings_of_the_bench_directions_err_no_more_than_by_imu_tk() {
    let one = |seed: u64| {
        let file = unit(&[], Grade::Consumer, seed);
        let recorded = |noise: u64| {
            let folder = mimu_tests::bench::written(&plan(seed), &file, noise);
            let recording = Recording::open(&folder.path().join("recording")).expect("a recording");
            let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).expect("readable");
            (prepared, Samples::of(&recording))
        };
        judged(&recorded(seed), &recorded(1000 + seed).0)
    };
    let pairs: Vec<_> = (0..8).into_par_iter().map(one).collect();
    let [ours, theirs] = side_by_side("the bench", &pairs);
    assert!(ours[1] <= theirs[1]);
}
