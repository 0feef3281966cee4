//! `mimu apply`: a compensated recording against the inputs of the bench.

use std::path::Path;

use mimu::calibration::Calibration;
use mimu_recording::{Batch, RawUnit, Recording};

use super::mimu;
use super::unit::{DWELLS, NOISE, RATE_HZ, calibrated, fitted, flaws, forward};

pub fn read(folder: &Path) -> (Recording, Batch) {
    let recording = Recording::open(folder).unwrap();
    let mut all = Batch::default();
    let collect = |batch: &Batch| {
        all.t_s.extend(&batch.t_s);
        for (into, from) in all.raw.iter_mut().zip(&batch.raw) {
            into.extend(from);
        }
        for (into, from) in all.reference.iter_mut().zip(&batch.reference) {
            into.extend(from);
        }
        Ok(())
    };
    recording.for_each_batch(|_| (), collect).unwrap();
    (recording, all)
}

/// The largest error of a dwell mean against the bench's input, rad/s and m/s².
fn worst(batch: &Batch) -> [f64; 2] {
    let rows = batch.len() / DWELLS;
    let mut worst = [0.0_f64; 2];
    for c in 0..6 {
        let unit = if c < 3 { 1.0_f64.to_radians() } else { 1.0 };
        let errors = batch.raw[c].iter().zip(&batch.reference[c]);
        let errors: Vec<f64> = errors.map(|(x, input)| x - input * unit).collect();
        for dwell in errors.chunks(rows) {
            let kept: Vec<f64> = dwell.iter().copied().filter(|e| e.is_finite()).collect();
            let mean = kept.iter().sum::<f64>() / kept.len() as f64;
            worst[c / 3] = worst[c / 3].max(mean.abs());
        }
    }
    worst
}

#[test]
fn a_compensated_recording_is_the_input_of_the_bench_and_keeps_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let text = |name: &str| path(name).to_str().unwrap().to_string();
    calibrated(folder.path(), &flaws());
    let affine = Calibration::of(&fitted(&path("clean")), &[], "2026-01-01T00:00:00Z").unwrap();
    std::fs::write(path("affine.toml"), affine.to_toml()).unwrap();
    // Half a second is missing, a cell is empty, and gyro x is at its rail for three samples.
    let samples = path("flawed").join("samples.csv");
    let lines: Vec<String> = std::fs::read_to_string(&samples)
        .unwrap()
        .lines()
        .map(String::from)
        .collect();
    let mut kept: Vec<String> = lines[..1011]
        .iter()
        .chain(&lines[1036..])
        .cloned()
        .collect();
    let set = |line: &mut String, cell: usize, value: &str| {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[cell] = value;
        *line = cells.join(",");
    };
    set(&mut kept[501], 7, "");
    for line in &mut kept[2001..2004] {
        set(line, 3, "3.2");
    }
    std::fs::write(&samples, kept.join("\n") + "\n").unwrap();
    let manifest = path("flawed").join("recording.toml");
    let declared = std::fs::read_to_string(&manifest).unwrap() + "[rails]\ngyro = [0.1, 3.2]\n";
    std::fs::write(&manifest, declared).unwrap();

    let run = |calibration: &str, out: &str| {
        let (from, cal, to) = (text("flawed"), text(calibration), text(out));
        mimu(&[
            "apply",
            &from,
            "--calibration",
            &cal,
            "-o",
            &to,
            "--json",
            "-",
        ])
    };
    let (done, json) = run("cal.toml", "out");
    assert!(done, "{json}");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["rows"], kept.len() - 1);
    assert_eq!(json["sensors"]["gyro"]["clipped"], 3);
    assert_eq!(json["sensors"]["accel"]["empty"], 1);
    assert_eq!(json["gaps"], 1);
    let (recording, batch) = read(&path("out"));
    assert_eq!(recording.manifest.raw_unit, RawUnit::Si);
    assert_eq!(recording.manifest.rails, None);
    assert!(batch.raw[3..].iter().all(|axis| axis[500].is_nan()));
    assert!(
        batch.raw[..3]
            .iter()
            .all(|axis| axis[500].is_finite() && axis[2000].is_nan())
    );
    assert!((batch.t_s[1010] - batch.t_s[1009] - 26.0 / RATE_HZ).abs() < 1e-9);
    // Five sigmas of the mean of the shortest dwell, 75 samples, for the noisier axis. An empty cell matters a hundred times less.
    let limit = [0, 1].map(|s| {
        let finest = forward(s)
            .0
            .row_iter()
            .map(|row| row.norm())
            .fold(f64::INFINITY, f64::min);
        5.0 * NOISE[s] / finest / 75.0_f64.sqrt()
    });
    let clean = worst(&batch);
    // A twelfth of the accelerometer's cubic (at most 0.03 m/s²) remains, because the effect is evaluated with the erroneous reading.
    assert!(
        clean[0] < limit[0] && clean[1] < limit[1] + 1e-3,
        "{clean:?} {limit:?}"
    );
    assert!(run("affine.toml", "affine").0);
    let affine = worst(&read(&path("affine")).1);
    assert!(affine[0] > 3e-3 && affine[1] > 0.02, "{affine:?}");

    // A compensated recording is not a raw recording of this unit, and the raw readings must not be lost.
    let (out, cal) = (text("out"), text("cal.toml"));
    let (done, refusal) = mimu(&["apply", &out, "--calibration", &cal, "-o", &text("again")]);
    assert!(!done && refusal.contains("raw unit is SI"), "{refusal}");
    let from = text("flawed");
    let (done, refusal) = mimu(&[
        "apply",
        &from,
        "--calibration",
        &cal,
        "-o",
        &from,
        "--replace",
    ]);
    assert!(!done && refusal.contains("would be lost"), "{refusal}");
}
