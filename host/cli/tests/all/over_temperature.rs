//! `mimu verify` and `mimu apply` with a calibration over temperature, on a unit whose forward model is written here: cubics of the temperature of
//! dies that lag the thermometer.

use std::path::Path;

use mimu::calibration::{Calibration, DieTable, NodeTable, OverTemperature, TemperatureNode};
use mimu::fit::{Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::PerSensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::Recording;
use nalgebra::{Matrix3, Vector3};

use super::effects::applied::read;
use super::effects::{mimu, unit};

/// Of a dwell.
const ROWS: usize = (unit::DWELL_S * unit::RATE_HZ) as usize;
/// Lags of the dies of gyro and accelerometer, s, and the ramp of the thermometer, °C/s from 0 °C.
const LAGS_S: [f64; 2] = [20.0, 8.0];
const RAMP: f64 = 0.35;

/// Forward model at a temperature of the dies, V per SI: rows are sensors.
fn forward(sensor: usize, die_c: f64) -> (Matrix3<f64>, Vector3<f64>) {
    let (p, b) = unit::forward(sensor);
    let w = die_c - 25.0;
    let gain = |k: f64| 1.0 + 4e-4 * k * w + 3e-6 * w * w - 2e-8 * k * w * w * w;
    let drift = |k: f64| 1e-3 * k * w - 2e-5 * w * w + 4e-7 * k * w * w * w;
    let gains = Matrix3::from_diagonal(&Vector3::new(gain(1.0), gain(-1.0), gain(2.0)));
    (
        gains * p,
        b + Vector3::new(drift(1.0), drift(-2.0), drift(0.5)),
    )
}

/// Inverse model, raw to SI.
fn inverse(sensor: usize, die_c: f64) -> (Matrix3<f64>, Vector3<f64>) {
    let (p, b) = forward(sensor, die_c);
    let c = p.try_inverse().unwrap();
    (c, -c * b)
}

fn thermometer_c(t_s: f64) -> f64 {
    RAMP * t_s
}

/// Solutions of the lags for the ramp.
fn dies_c(t_s: f64) -> [f64; 2] {
    LAGS_S.map(|lag_s| RAMP * (t_s - lag_s * (1.0 - (-t_s / lag_s).exp())))
}

/// Records the unit on a table: at 25 °C, or over the ramp.
fn record(folder: &Path, ramp: bool) {
    let shown = |t: f64| if ramp { thermometer_c(t) } else { 25.0 };
    unit::record_with(folder, 11, Some(&shown), |sensor, t, inputs| {
        let dies = if ramp { dies_c(t) } else { [25.0; 2] };
        let (p, b) = forward(sensor, dies[sensor]);
        p * inputs[sensor] + b
    });
}

/// A node with the truth at a temperature, and its derivative from neighbouring temperatures.
fn node(temp_c: f64) -> TemperatureNode {
    let table = |sensor: usize| {
        let (c, o) = inverse(sensor, temp_c);
        let h = 1e-3;
        let ((c1, o1), (c2, o2)) = (inverse(sensor, temp_c - h), inverse(sensor, temp_c + h));
        let rows = |m: &Matrix3<f64>| [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)]));
        Some(NodeTable {
            C: rows(&c),
            o: o.into(),
            slope_C: rows(&((c2 - c1) / (2.0 * h))),
            slope_o: ((o2 - o1) / (2.0 * h)).into(),
            sigma_C: None,
            sigma_o: None,
            sigma_scale_factor: None,
            sigma_bias: None,
        })
    };
    TemperatureNode {
        temp_c,
        gyro: table(0),
        accel: table(1),
    }
}

/// Fits the recording at 25 °C and writes this calibration, and the same with the true curves.
fn calibrations(folder: &Path) {
    record(&folder.join("even"), false);
    let recording = Recording::open(&folder.join("even")).unwrap();
    let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).unwrap();
    let fit = fit(prepared, Options::IN_SAMPLE).unwrap();
    let mut calibration = Calibration::of(&fit, &[], "2026-01-01T00:00:00Z").unwrap();
    assert_eq!(calibration.recording.temp_range_c, Some([25.0, 25.0]));
    std::fs::write(folder.join("one.toml"), calibration.to_toml()).unwrap();
    calibration.format = Calibration::format_of(true).into();
    calibration.temperature = Some(OverTemperature {
        range_c: [10.0, 40.0],
        biases_only: false,
        dies: PerSensor::from(LAGS_S).map(|lag_s| DieTable {
            lag_s: Some(lag_s),
            interval_lag_s: Some([lag_s - 1.0, lag_s + 1.0]),
            ..DieTable::default()
        }),
        nodes: (0..7).map(|k| node(10.0 * f64::from(k) - 5.0)).collect(),
    });
    std::fs::write(folder.join("curves.toml"), calibration.to_toml()).unwrap();
}

fn verified(folder: &Path, calibration: &str) -> serde_json::Value {
    let [rec, cal] = ["ramp", calibration].map(|name| folder.join(name).display().to_string());
    let (done, text) = mimu(&["verify", &rec, "--calibration", &cal, "--json", "-"]);
    assert!(done, "{text}");
    serde_json::from_str(&text).unwrap()
}

/// Number and distance in the warning about temperatures.
fn outside(json: &serde_json::Value) -> (f64, f64) {
    let all: Vec<&str> = json["warnings"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|w| w["text"].as_str())
        .collect();
    let of: Vec<&&str> = all
        .iter()
        .filter(|w| w.contains("samples are outside"))
        .collect();
    let [warning] = of[..] else { panic!("{all:?}") };
    let count = warning.split(' ').next().unwrap().parse().unwrap();
    let by = warning
        .split("by up to ")
        .nth(1)
        .unwrap()
        .split(' ')
        .next()
        .unwrap();
    (count, by.parse().unwrap())
}

#[test]
fn curves_and_lag_leave_the_noise_and_the_model_of_one_temperature_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    calibrations(folder);
    record(&folder.join("ramp"), true);
    let (one, curves) = (
        verified(folder, "one.toml"),
        verified(folder, "curves.toml"),
    );
    for sensor in ["gyro", "accel"] {
        let figure =
            |json: &serde_json::Value, name: &str| json["sensors"][sensor][name].as_f64().unwrap();
        let floor = figure(&curves, "noise_floor");
        assert!(figure(&curves, "rms") < 2.0 * floor, "{curves}");
        assert!(figure(&one, "rms") > 50.0 * floor, "{one}");
    }
    // The count is by blocks, so it is accurate to a block at either end.
    let seconds = |inside: &dyn Fn(f64) -> bool| {
        let all = (0..unit::DWELLS * ROWS).map(|k| k as f64 / unit::RATE_HZ);
        all.filter(|t| !inside(*t)).count() as f64
    };
    let (count, by) = outside(&curves);
    let inside = |die_c: f64| (10.0..=40.0).contains(&die_c);
    let expected = seconds(&|t| dies_c(t).into_iter().all(inside));
    assert!(
        (count - expected).abs() <= 2.0 * ROWS as f64,
        "{count} {expected}"
    );
    assert!((by - 10.0).abs() < 0.5, "{by}");
    let (count, by) = outside(&one);
    let expected = seconds(&|t| (20.0..=30.0).contains(&thermometer_c(t)));
    assert!(
        (count - expected).abs() <= 2.0 * ROWS as f64,
        "{count} {expected}"
    );
    assert!((by - 25.0).abs() < 0.5, "{by}");
}

#[test]
fn a_compensated_recording_follows_the_dies() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    calibrations(folder);
    record(&folder.join("ramp"), true);
    let [rec, cal, out] =
        ["ramp", "curves.toml", "out"].map(|name| folder.join(name).display().to_string());
    let (done, text) = mimu(&[
        "apply",
        &rec,
        "--calibration",
        &cal,
        "-o",
        &out,
        "--json",
        "-",
    ]);
    assert!(done, "{text}");
    outside(&serde_json::from_str(&text).unwrap());
    let (_, all) = read(Path::new(&out));
    for c in 0..6 {
        let unit = if c < 3 { 1.0_f64.to_radians() } else { 1.0 };
        let errors: Vec<f64> = all.raw[c]
            .iter()
            .zip(&all.reference[c])
            .map(|(x, input)| x - input * unit)
            .collect();
        for (k, dwell) in errors.chunks(ROWS).enumerate() {
            let mean = dwell.iter().sum::<f64>() / ROWS as f64;
            // Six sigmas of a mean: 1e-4 V and 2e-4 V of noise, 0.3 V/(rad/s) and 0.07 V/(m/s²).
            let bound = if c < 3 { 2.5e-4 } else { 2e-3 };
            assert!(mean.abs() < bound, "channel {c}, dwell {k}: {mean}");
        }
    }
}
