//! Inputs with which all data agree although they are wrong: their results are judged suspect, in files and exports too.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::random::Random;

use super::command::{done, json, mimu};

fn kind(result: &Value) -> &str {
    result["judgement"]["kind"].as_str().unwrap()
}

const RATE_HZ: f64 = 100.0;
const ROWS: usize = 100_000;
const G: f64 = 9.80665;
/// White noise per sample of gyro and accelerometer, SI: N is a tenth.
const SIGMA: [f64; 2] = [2e-3, 2e-2];

/// A unit at rest with readings in SI times `gain` of gyro and accelerometer, as the recording `name` in `unit`.
fn at_rest(folder: &Path, name: &str, gain: [f64; 2], unit: &str) {
    let mut random = Random(7);
    let mut rows = String::from("t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n");
    for k in 0..ROWS {
        let _ = write!(rows, "{:.2}", k as f64 / RATE_HZ);
        for (sensor, mean) in [(0, [1e-3, -2e-3, 5e-4]), (1, [0.1, -0.2, G])] {
            for mean in mean {
                let reading = gain[sensor] * (mean + SIGMA[sensor] * random.normal());
                let _ = write!(rows, ",{reading}");
            }
        }
        rows.push('\n');
    }
    let directory = folder.join(name);
    std::fs::create_dir(&directory).unwrap();
    std::fs::write(directory.join("samples.csv"), rows).unwrap();
    let manifest = format!(
        "format = \"mimu-recording/1\"\ndevice = \"{name}\"\nsample_rate_hz = {RATE_HZ:?}\ngravity_mps2 = {G}\nraw_unit = \"{unit}\"\nreference = \"gravity\"\n"
    );
    std::fs::write(directory.join("recording.toml"), manifest).unwrap();
}

/// A calibration of a unit without errors, with readings in counts of `gain` per SI.
fn calibration(folder: &Path, name: &str, gain: [f64; 2]) {
    let mut text = format!(
        "format = \"mimu-calibration/1\"\ndevice = \"{name}\"\ntool = \"test\"\n[recording]\nraw_unit = \"count\"\n"
    );
    let diagonal = |x: f64| format!("[[{x:e}, 0.0, 0.0], [0.0, {x:e}, 0.0], [0.0, 0.0, {x:e}]]");
    for (sensor, unit, gain) in [("gyro", "rad/s", gain[0]), ("accel", "m/s^2", gain[1])] {
        let _ = writeln!(
            text,
            "[{sensor}]\nformula = \"x = C u + o\"\ndirection = \"raw to SI\"\nraw_unit = \"count\"\nunit = \"{unit}\"\nframe = \"body\"\n\
             C = {}\no = [0.0, 0.0, 0.0]\n[{sensor}.forward]\nformula = \"u = P x + b\"\ndirection = \"SI to raw\"\nP = {}\nb = [0.0, 0.0, 0.0]\n\
             [{sensor}.physical]\nformula = \"\"\nscale_factor = [{gain:e}, {gain:e}, {gain:e}]\nbias = [0.0, 0.0, 0.0]\n\
             misalignment_deg = [0.0, 0.0, 0.0]\nnon_orthogonality_deg = [0.0, 0.0, 0.0]",
            diagonal(1.0 / gain),
            diagonal(gain)
        );
    }
    std::fs::write(folder.join(format!("{name}.toml")), text).unwrap();
}

/// N of the worst axis of the accelerometer in Kalibr's file, m/s²/√Hz.
fn density(folder: &Path, file: &str) -> f64 {
    let text = std::fs::read_to_string(folder.join(file)).unwrap();
    let mut lines = text.lines();
    let line = lines.find_map(|l| l.strip_prefix("accelerometer_noise_density: "));
    let number = line.unwrap().split(' ').next().unwrap();
    number.parse().unwrap()
}

const WALKS: &str = "--gyro-walk 1e-5 --accel-walk 1e-4";

#[test]
fn noise_of_readings_in_another_unit_than_declared_is_suspect_down_to_the_files_of_other_programs()
{
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    at_rest(folder, "good", [1.0, 1.0], "SI");
    at_rest(folder, "g", [1f64.to_degrees(), 1.0 / G], "SI");
    for (name, expected) in [("good", "good"), ("g", "suspect")] {
        assert_eq!(kind(&json(folder, &format!("allan {name}"))), expected);
        done(folder, &format!("allan {name} -o {name}.toml"));
        let said = done(
            folder,
            &format!("export kalibr --noise {name}.toml {WALKS} -o {name}.yaml"),
        );
        let comments = std::fs::read_to_string(folder.join(format!("{name}.yaml"))).unwrap();
        for text in [said, comments] {
            assert!(text.contains(&format!("noise: {expected}")), "{text}");
        }
    }
    let strict = mimu(folder, "allan g --strict");
    assert_eq!(strict.status, Some(3));
    assert_eq!(mimu(folder, "allan good --strict").status, Some(0));
    // A gyro alone in deg/s is quiet in its own unit, but noisier than any part in rad/s.
    at_rest(folder, "turns", [1f64.to_degrees(), 1.0], "SI");
    let found = json(folder, "allan turns");
    assert_eq!(kind(&found), "suspect", "{}", found["judgement"]);
}

#[test]
fn noise_by_the_calibration_of_another_unit_is_suspect_and_is_not_exported_with_the_right_one() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // 131 counts for 1 deg/s, 16384 for 1 g; and a unit of 26 and 4096.
    let [ours, other] = [[7505.75, 1670.7], [1490.0, 417.7]];
    at_rest(folder, "rest", ours, "count");
    calibration(folder, "ours", ours);
    calibration(folder, "other", other);
    for (by, expected) in [("ours", "good"), ("other", "suspect")] {
        let found = json(folder, &format!("allan rest --calibration {by}.toml"));
        assert_eq!(kind(&found), expected, "{}", found["judgement"]);
        done(
            folder,
            &format!("allan rest --calibration {by}.toml -o by-{by}.toml"),
        );
    }
    let driver = "--gyro-si-per-raw 1.3323e-4 --accel-si-per-raw 5.9855e-4";
    let export = |noise: &str| {
        format!(
            "export kalibr --calibration ours.toml --noise {noise}.toml {driver} {WALKS} -o imu.yaml"
        )
    };
    let refused = mimu(folder, &export("by-other"));
    refused.refused(&["by-other.toml"]);
    assert_eq!(refused.stderr.lines().count(), 1);
    assert!(!folder.join("imu.yaml").exists());
    // The names of recording and calibration differ, and the file says so.
    assert!(done(folder, &export("by-ours")).contains("\"rest\""));
    let found = density(folder, "imu.yaml");
    assert!((found / (0.1 * SIGMA[1]) - 1.0).abs() < 0.05, "{found}");
}

#[test]
fn times_in_ms_taken_as_seconds_make_every_result_suspect() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let example = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/example");
    for (name, rate) in [("right", "50"), ("ms", "0.05")] {
        let [accel, gyro] = ["accel.txt", "gyro.txt"].map(|file| example.join(file));
        let columns = "--columns -,accel_x,accel_y,accel_z --columns -,gyro_x,gyro_y,gyro_z";
        done(
            folder,
            &format!(
                "import {} {} {columns} --rate-hz {rate} --gravity 9.80665 --raw-unit count --reference gravity --device unit -o {name}",
                accel.display(),
                gyro.display()
            ),
        );
    }
    done(folder, "fit right -o right.toml");
    for name in ["right", "ms"] {
        let ids = |result: &Value| {
            let problems = result["recording_problems"].as_array().unwrap().iter();
            let ids = problems.map(|p| p["id"].as_str().unwrap().to_owned());
            ids.collect::<Vec<_>>()
        };
        let fitted = json(folder, &format!("fit {name}"));
        let suspect = name == "ms";
        assert_eq!(
            kind(&fitted) == "suspect",
            suspect,
            "{}",
            fitted["judgement"]
        );
        assert_eq!(ids(&fitted).contains(&"sample_rate".to_owned()), suspect);
        let diagnosed = json(folder, &format!("diagnose {name}"));
        assert_eq!(
            kind(&diagnosed) == "suspect",
            suspect,
            "{}",
            diagnosed["judgement"]
        );
    }
    // The scale factors are those of the other rate, a thousand times as large.
    let verified = json(folder, "verify ms --calibration right.toml");
    assert!(
        ["suspect", "misfit"].contains(&kind(&verified)),
        "{}",
        verified["judgement"]
    );
    let warnings = verified["warnings"].to_string();
    assert!(warnings.contains("sample rate"), "{warnings}");
}
