//! The program of mimu-core's README against `mimu apply`, on the same samples.

use super::applied::read;
use super::mimu;
use super::unit::{RATE_HZ, calibrated, flaws};

#[rustfmt::skip]
#[path = "../../../../../core/examples/stream/calibrate.rs"]
mod readme;

#[test]
fn the_program_of_the_readme_of_core_gives_what_apply_gives() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let text = |name: &str| path(name).to_str().unwrap().to_string();
    calibrated(folder.path(), &flaws());
    let (cal, core) = (text("cal.toml"), text("unit.mimc"));
    let (done, said) = mimu(&["export", "core", "--calibration", &cal, "-o", &core]);
    assert!(done, "{said}");
    let (done, said) = mimu(&[
        "apply",
        &text("flawed"),
        "--calibration",
        &cal,
        "-o",
        &text("out"),
    ]);
    assert!(done, "{said}");

    let (_, raw) = read(&path("flawed"));
    let (_, si) = read(&path("out"));
    let temp_c = |t_s: f64| super::unit::temp_c(t_s) as f32;
    let samples = (0..raw.len()).map(|row| {
        let of = |from: usize| [0, 1, 2].map(|axis| raw.raw[from + axis][row] as f32);
        (of(0), of(3), temp_c(raw.t_s[row]))
    });
    let bytes = std::fs::read(path("unit.mimc")).unwrap();
    let (mut row, mut off, mut largest) = (0, [0.0_f64; 2], [0.0_f64; 2]);
    readme::calibrate(&bytes, RATE_HZ as f32, samples, |sample, _| {
        for (sensor, of) in [sample.gyro, sample.accel].iter().enumerate() {
            for axis in 0..3 {
                let by_apply = si.raw[3 * sensor + axis][row];
                off[sensor] = off[sensor].max((f64::from(of[axis]) - by_apply).abs());
                largest[sensor] = largest[sensor].max(by_apply.abs());
            }
        }
        row += 1;
    })
    .unwrap();
    assert_eq!(row, si.len());
    // Readings of up to 3.3 V in single precision have an error of 1.2e-7 V, up to 4e-7 rad/s and 2e-6 m/s²; nine products add as much again. `apply`
    // uses one temperature per 0.1 s; the 0.015 K here are 4e-6 rad/s of this thermal bias.
    assert!(off[0] < 1e-5 && off[1] < 1e-5, "{off:?} of {largest:?}");
    assert!(largest[0] > 1.0 && largest[1] > 9.0, "{largest:?}");
}
