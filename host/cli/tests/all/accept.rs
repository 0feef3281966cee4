//! `mimu accept`, from its arguments to its exit status: recordings of the bench, boards that write lines, and the golden unit.
#![cfg(unix)]

use std::fmt::Write as _;
use std::io::Write as _;
use std::net::TcpListener;
use std::path::Path;
use std::time::{Duration, Instant};

use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::record::{Row, samples};
use mimu_rig::rig_file::{RigFile, RigTruth};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

use super::command::mimu;
use super::device::calibration::text_of;
use crate::command::says;

/// Samples a second of the boards.
const RATE_HZ: f64 = 200.0;

const LIMITS: &str = r#"format = "mimu-limits/1"
product = "board, revision B"
ranges = { accel_g = 2, gyro_dps = 500 }
rows = [
    { name = "gyro_offset", lower = -2, upper = 2, unit = "deg/s" },
    { name = "gravity_error", lower = -60, upper = 60, unit = "mg" },
    { name = "gyro_noise_rms", lower = 0.01, upper = 0.2, unit = "deg/s" },
]
"#;

/// A unit of the bench: offset of its gyro z in deg/s, and of its accelerometer y in mg.
struct Unit {
    gyro_z_dps: f64,
    accel_y_mg: f64,
}

const GOOD: Unit = Unit {
    gyro_z_dps: 0.4,
    accel_y_mg: 12.0,
};
const BAD: Unit = Unit {
    gyro_z_dps: 3.1,
    accel_y_mg: 12.0,
};

/// What `unit` sends with these sides up, so many seconds each.
fn rows(unit: &Unit, sides: &[[f64; 3]], seconds: f64, seed: u64) -> Vec<Row> {
    let sides: Vec<([f64; 3], f64)> = sides.iter().map(|side| (*side, seconds)).collect();
    rows_of(unit, &sides, seed)
}

/// What `unit` sends with these sides up, each with its seconds.
fn rows_of(unit: &Unit, sides: &[([f64; 3], f64)], seed: u64) -> Vec<Row> {
    let (gyro, accel) = (65.5f64.to_degrees(), 16384.0 / 9.80665);
    let rig = format!(
        "format = \"mimu-rig/1\"\n[unit]\ngyro = \"MPU6050-gyro\"\naccel = \"MPU6050-accel\"\n\
         [unit.gyro_affine]\nmatrix = [[{gyro}, 0.0, 0.0], [0.0, {gyro}, 0.0], [0.0, 0.0, {gyro}]]\nbias = [20.0, -31.0, {}]\n\
         [unit.accel_affine]\nmatrix = [[{accel}, 0.0, 0.0], [0.0, {accel}, 0.0], [0.0, 0.0, {accel}]]\nbias = [40.0, {}, -60.0]\n\
         [thermal]\non_before_s = inf\n",
        65.5 * unit.gyro_z_dps,
        16.384 * unit.accel_y_mg
    );
    let mut plan = format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = {RATE_HZ:?}\ncarrier = \"table\"\ngravity_mps2 = 9.80665\n"
    );
    for (side, seconds) in sides {
        let _ = write!(plan, "[[step]]\nup = {side:?}\ndwell_s = {seconds:?}\n");
    }
    let file = RigFile::parse(&Source::new("RIG.toml", rig)).unwrap();
    let truth = RigTruth::resolve(&file, 1).unwrap();
    let plan = Plan::parse(Source::new("PLAN.toml", plan)).unwrap();
    samples(&plan, &truth, seed).unwrap().collect()
}

const UP: [f64; 3] = [0.0, 0.0, 1.0];

/// Writes the recording `name` of the unit `device`.
fn record(folder: &Path, name: &str, device: &str, rows: &[Row]) {
    let folder = folder.join(name);
    std::fs::create_dir_all(&folder).unwrap();
    let manifest = format!(
        "format = \"mimu-recording/1\"\ndevice = \"{device}\"\nsample_rate_hz = {RATE_HZ:?}\n\
         gravity_mps2 = 9.80665\nraw_unit = \"count\"\nreference = \"gravity\"\n"
    );
    std::fs::write(folder.join("recording.toml"), manifest).unwrap();
    let mut csv = "t_s,temp_c,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n".to_string();
    for row in rows {
        let [gx, gy, gz] = row.readings.gyro;
        let [ax, ay, az] = row.readings.accel;
        let (t, c) = (row.stamp_s, row.readings.temp_c);
        let _ = writeln!(csv, "{t},{c:.2},{gx},{gy},{gz},{ax},{ay},{az}");
    }
    std::fs::write(folder.join("samples.csv"), csv).unwrap();
}

/// A folder with limits and recordings of a good unit, a bad one, and one that was turned meanwhile.
fn place() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("limits.toml"), LIMITS).unwrap();
    record(
        folder.path(),
        "good",
        "unit-1",
        &rows(&GOOD, &[UP], 10.0, 1),
    );
    record(folder.path(), "bad", "unit-2", &rows(&BAD, &[UP], 10.0, 2));
    let turned = rows(&GOOD, &[UP, [1.0, 0.0, 0.0]], 4.0, 3);
    record(folder.path(), "turned", "unit-3", &turned);
    folder
}

/// The measurement of this name.
fn measurement<'a>(document: &'a Value, name: &str) -> &'a Value {
    let all = document["measurements"].as_array().unwrap();
    let found = all.iter().find(|m| m["name"] == name);
    found.unwrap_or_else(|| panic!("{name}: {document}"))
}

#[test]
fn the_exit_status_says_whether_a_unit_passed_failed_or_was_not_measured() {
    let folder = place();
    for (name, status, verdict) in [
        ("good", 0, "passed"),
        ("bad", 3, "failed"),
        ("turned", 1, "not_measured"),
    ] {
        let ran = mimu(
            folder.path(),
            &format!("accept {name} --limits limits.toml --json -"),
        );
        assert_eq!(
            ran.status,
            Some(status),
            "{name}: {}{}",
            ran.stdout,
            ran.stderr
        );
        let document: Value = serde_json::from_str(&ran.stdout).unwrap();
        assert_eq!(document["format"], "mimu-measurements/1");
        assert_eq!(document["verdict"], verdict, "{name}");
        assert_eq!(document["product"], "board, revision B");
        let text = mimu(
            folder.path(),
            &format!("accept {name} --limits limits.toml"),
        );
        assert_eq!(text.status, Some(status));
        match name {
            "turned" => assert!(text.stderr.contains("moved"), "{}", text.stderr),
            "bad" => {
                let row = measurement(&document, "gyro_z_offset");
                assert_eq!(
                    (&row["passed"], &row["unit"]),
                    (&false.into(), &"deg/s".into())
                );
                assert!((row["value"].as_f64().unwrap() - 3.1).abs() < 0.02, "{row}");
                assert!(row["sigma"].as_f64().unwrap() > 0.0);
                assert!(text.stdout.contains("gyro_z_offset"), "{}", text.stdout);
            }
            _ => {
                let unlimited = measurement(&document, "accel_x_noise_rms");
                assert!(unlimited["passed"].is_null() && unlimited["lower"].is_null());
            }
        }
    }
}

/// The population of such units: the rate of z at rest is 0.5 deg/s with a scatter of `dps`.
fn population(folder: &Path, dps: f64) {
    let gyro = 65.5f64.to_degrees();
    let mean = [gyro, gyro, gyro, 20.0, -31.0, 65.5 * 0.5];
    let sigma = [
        0.01 * gyro,
        0.01 * gyro,
        0.01 * gyro,
        20.0,
        20.0,
        65.5 * dps,
    ];
    let row = |i: usize| {
        let of: Vec<f64> = (0..6)
            .map(|j| if i == j { sigma[i] * sigma[i] } else { 0.0 })
            .collect();
        format!("{of:?}")
    };
    let rows: Vec<String> = (0..6).map(row).collect();
    let text = format!(
        "format = \"mimu-prior/1\"\ntool = \"test\"\nraw_unit = \"count\"\nreference = \"gravity\"\nbiases = true\n[gyro]\nunits = 40\n\
         parameters = [\"scale_x\", \"scale_y\", \"scale_z\", \"bias_x\", \"bias_y\", \"bias_z\"]\n\
         parameter_units = [\"\", \"\", \"\", \"\", \"\", \"\"]\nmean = {mean:?}\nsigma = {sigma:?}\ncovariance = [{}]\n",
        rows.join(", ")
    );
    std::fs::write(folder.join("fleet.toml"), text).unwrap();
}

#[test]
fn a_unit_far_from_its_kind_fails_although_it_keeps_the_data_sheet() {
    let place = place();
    let command = "accept bad --part mpu6050 --range 2,500 --json -";
    assert_eq!(mimu(place.path(), command).status, Some(0));
    // Twelve standard deviations of 0.2 deg/s off.
    population(place.path(), 0.2);
    let command = "accept bad --part mpu6050 --range 2,500 --prior fleet.toml --json -";
    let ran = mimu(place.path(), command);
    assert_eq!(ran.status, Some(3), "{}", ran.stderr);
    let document: Value = serde_json::from_str(&ran.stdout).unwrap();
    let offset = measurement(&document, "gyro_z_offset");
    assert_eq!(offset["passed"], false, "{offset}");
    assert!(
        offset["limits_of"]
            .as_str()
            .unwrap()
            .starts_with("fleet.toml"),
        "{offset}"
    );
    // Of 40 units, 0.1 % are beyond 3.56 sigma: 0.5 - 0.71 to 0.5 + 0.71.
    assert!(
        (offset["upper"].as_f64().unwrap() - 1.21).abs() < 0.01,
        "{offset}"
    );
    // In a kind that scatters by a degree it is no stranger, and alone the population suffices.
    population(place.path(), 1.0);
    let alone = mimu(place.path(), "accept bad --range 2,500 --prior fleet.toml");
    assert_eq!(alone.status, Some(0), "{} {}", alone.stdout, alone.stderr);
}

#[test]
fn several_units_have_a_line_and_a_file_each() {
    let folder = place();
    let ran = mimu(
        folder.path(),
        "accept good bad turned --limits limits.toml -o results",
    );
    assert_eq!(ran.status, Some(1), "{}{}", ran.stdout, ran.stderr);
    let lines: Vec<&str> = ran.stdout.lines().collect();
    assert_eq!(lines.len(), 3, "{}", ran.stdout);
    for (line, words) in lines.iter().zip([
        ["unit-1", "passed", "limits kept"],
        ["unit-2", "FAILED", "gyro_z_offset"],
        ["turned", "not measured", "moved"],
    ]) {
        assert!(words.iter().all(|w| line.contains(w)), "{line}");
    }
    says(&ran.stderr, &["1 of 3 units could not be measured"]);
    assert_eq!(
        std::fs::read_dir(folder.path().join("results"))
            .unwrap()
            .count(),
        3
    );
    let ran = mimu(folder.path(), "accept good bad --limits limits.toml");
    assert_eq!(ran.status, Some(3), "{}{}", ran.stdout, ran.stderr);
}

#[test]
fn limits_with_a_wrong_name_unit_or_order_are_refused_before_anything_is_measured() {
    let folder = place();
    for (from, to, words) in [
        ("gyro_offset", "gyro_ofset", "no quantity has this name"),
        (
            "unit = \"deg/s\" },\n    { name = \"gravity",
            "unit = \"rad/s\" },\n    { name = \"gravity",
            "in deg/s",
        ),
        ("lower = -60", "lower = 70", "lower below upper"),
        ("mimu-limits/1", "mimu-limits/9", "mimu-limits"),
        ("product", "produkt", "produkt"),
    ] {
        std::fs::write(folder.path().join("wrong.toml"), LIMITS.replace(from, to)).unwrap();
        let ran = mimu(folder.path(), "accept good --limits wrong.toml");
        assert_eq!(ran.status, Some(1), "{to}: {}", ran.stdout);
        assert!(
            ran.stderr.contains(words) && ran.stderr.lines().count() == 1,
            "{to}: {}",
            ran.stderr
        );
    }
    let nothing = mimu(folder.path(), "accept good");
    says(&nothing.stderr, &["nothing says which values pass"]);
    let no_scale = mimu(folder.path(), "accept good --part mpu6050");
    assert_eq!(no_scale.status, Some(1));
    assert!(no_scale.stderr.contains("--range"), "{}", no_scale.stderr);
    let by_part = mimu(folder.path(), "accept good --part mpu6050 --range 2,500");
    assert_eq!(
        by_part.status,
        Some(0),
        "{}{}",
        by_part.stdout,
        by_part.stderr
    );
}

/// A board that writes lines to whoever connects, in real time from its first sample on.
fn board(rows: Vec<Row>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp://{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        let Ok((mut line, _)) = listener.accept() else {
            return;
        };
        let begun = Instant::now();
        for row in &rows {
            let [gx, gy, gz] = row.readings.gyro;
            let [ax, ay, az] = row.readings.accel;
            let due = Duration::from_secs_f64(row.stamp_s).saturating_sub(begun.elapsed());
            std::thread::sleep(due);
            let t_us = (1e6 * row.stamp_s).round();
            if writeln!(line, "{t_us},{ax},{ay},{az},{gx},{gy},{gz}").is_err() {
                return;
            }
        }
    });
    address
}

#[test]
fn boards_at_several_ports_are_measured_together() {
    let folder = place();
    let good = board(rows(&GOOD, &[UP], 120.0, 5));
    let bad = board(rows(&BAD, &[UP], 120.0, 6));
    let arguments = format!(
        "accept --port {good} --port {bad} --text t_us,ax,ay,az,gx,gy,gz --device line \
         --limits limits.toml --for 5s --gravity 9.80665 -o results"
    );
    let ran = mimu(folder.path(), &arguments);
    assert_eq!(ran.status, Some(3), "{}{}", ran.stdout, ran.stderr);
    let said = |name: &str, words: &str| {
        let line = ran.stdout.lines().find(|l| l.starts_with(name));
        assert!(line.is_some_and(|l| l.contains(words)), "{}", ran.stdout);
    };
    said("line-1", "passed");
    said("line-2", "gyro_z_offset");
    let nobody = mimu(
        folder.path(),
        "accept --port tcp://127.0.0.1:1 --text --limits limits.toml --gravity 9.8",
    );
    assert_eq!(nobody.status, Some(1), "{}", nobody.stdout);
}

#[test]
fn a_shift_is_measured_only_if_the_golden_unit_has_not_moved() {
    let folder = place();
    let unit = |name: &str, unit: &Unit, seed| {
        record(folder.path(), name, "golden", &rows(unit, &[UP], 6.0, seed));
    };
    let accept = |name: &str, more: &str| {
        let arguments = format!("accept {name} --limits limits.toml --golden golden.json{more}");
        mimu(folder.path(), &arguments)
    };
    let none = accept("good", "");
    assert!(none.stderr.contains("--new-golden"), "{}", none.stderr);
    for seed in 20..25 {
        unit("g", &GOOD, seed);
        let ran = accept("g", if seed == 20 { " --new-golden" } else { "" });
        assert_eq!(ran.status, Some(0), "{}{}", ran.stdout, ran.stderr);
    }
    unit("g", &GOOD, 30);
    let ran = accept("g", "");
    says(&ran.stderr, &["agrees with its history"]);
    assert_eq!(accept("good", "").status, Some(0));
    // Times are in whole seconds.
    std::thread::sleep(Duration::from_millis(1100));
    let late = accept("good", " --shift 1ms");
    assert_eq!(late.status, Some(1));
    assert!(late.stderr.contains("a check holds for"), "{}", late.stderr);
    // It aged: its offset moved by 0.8 deg/s, within the limits of the product.
    let aged = Unit {
        gyro_z_dps: 1.2,
        ..GOOD
    };
    unit("g", &aged, 31);
    let moved = accept("g", "");
    assert_eq!(moved.status, Some(1), "{}", moved.stdout);
    says(&moved.stderr, &["gyro_z_offset by 0.8"]);
    let refused = accept("good", "");
    assert_eq!(refused.status, Some(1), "{}", refused.stdout);
    assert!(refused.stderr.contains("had moved"), "{}", refused.stderr);
}

#[test]
fn a_unit_is_measured_as_found_and_as_left_on_the_same_samples() {
    let folder = place();
    let model = |gyro_z_dps: f64| {
        let (gyro, accel) = (65.5f64.to_degrees(), 16384.0 / 9.80665);
        let bias = Vector3::new(20.0, -31.0, 65.5 * gyro_z_dps);
        let force = Vector3::new(40.0, 16.384 * GOOD.accel_y_mg, -60.0);
        let models = [
            (Matrix3::identity() * gyro, bias),
            (Matrix3::identity() * accel, force),
        ];
        text_of(&models, "count", "")
    };
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    // Since its last calibration the offset of z has moved by 1.5 deg/s.
    write("old.toml", model(GOOD.gyro_z_dps - 1.5));
    write("new.toml", model(GOOD.gyro_z_dps));
    write(
        "recal.toml",
        LIMITS.replace("lower = -2, upper = 2", "lower = -0.1, upper = 0.1"),
    );
    let ran = mimu(
        folder.path(),
        "accept good --calibration new.toml --as-found old.toml --limits recal.toml --json -",
    );
    assert_eq!(ran.status, Some(0), "{}{}", ran.stdout, ran.stderr);
    let document: Value = serde_json::from_str(&ran.stdout).unwrap();
    let value = |of: &Value| measurement(of, "gyro_z_offset")["value"].as_f64().unwrap();
    let found = &document["as_found"];
    assert_eq!(
        (&document["verdict"], &found["verdict"]),
        (&"passed".into(), &"failed".into())
    );
    assert!(value(&document).abs() < 0.02, "{document}");
    assert!((value(found) - 1.5).abs() < 0.02, "{found}");
    let ran = mimu(
        folder.path(),
        "accept good --calibration old.toml --limits recal.toml",
    );
    assert_eq!(ran.status, Some(3), "{}{}", ran.stdout, ran.stderr);
}
