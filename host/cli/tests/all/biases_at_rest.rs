//! A file of biases over temperature from a recording at rest: the autopilots' formats accept it, and all other commands refuse it by name.

use std::fmt::Write as _;
use std::path::Path;

use super::command::{self, done, says};

/// Raw volts per SI of gyro and accelerometer, and their zeros.
const GAIN: [f64; 2] = [0.344, 0.0306];
const ZERO: [f64; 2] = [2.5, 1.65];
const MIDDLE_C: f64 = 20.0;

/// Biases in SI about 20 °C by powers of the temperature; the accelerometer's include gravity.
const BIAS: [[[f64; 4]; 3]; 2] = [
    [
        [0.01, -5e-4, 1e-6, 2e-7],
        [-0.02, 3e-4, 0.0, -1e-7],
        [0.0, 7e-4, -3e-6, 0.0],
    ],
    [
        [0.3, -2e-3, 3e-5, 3e-7],
        [-0.2, 5e-3, 0.0, 4e-7],
        [0.1 + 9.8, 2e-3, 0.0, 0.0],
    ],
];

/// Bias and its slope, SI.
fn bias(sensor: usize, axis: usize, temp_c: f64) -> [f64; 2] {
    let [a, b, c, d] = BIAS[sensor][axis];
    let t = temp_c - MIDDLE_C;
    [
        a + t * (b + t * (c + t * d)),
        b + t * (2.0 * c + t * 3.0 * d),
    ]
}

fn biases(range_c: [f64; 2], unit: &str) -> String {
    let [from, to] = range_c;
    let mut text = format!(
        "format = \"mimu-thermal-biases/1\"\ndevice = \"unit\"\ncreated = \"2026-01-02T03:04:05Z\"\ntool = \"test\"\n\
         range_c = {range_c:?}\n[judgement]\nkind = \"good\"\nreason = \"a test\"\n[recording]\nraw_unit = \"{unit}\"\n"
    );
    for k in 0..5 {
        let temp_c = from + (to - from) * f64::from(k) / 4.0;
        let _ = writeln!(text, "[[node]]\ntemp_c = {temp_c:?}");
        for (sensor, name) in ["gyro", "accel"].iter().enumerate() {
            let both = [0, 1].map(|k| {
                let zero = if k == 0 { ZERO[sensor] } else { 0.0 };
                [0, 1, 2].map(|axis| GAIN[sensor] * bias(sensor, axis, temp_c)[k] + zero)
            });
            let [u, slope] = both;
            let _ = writeln!(
                text,
                "[node.{name}]\nu = {u:?}\nslope_u = {slope:?}\nsigma_u = [1e-5, 1e-5, 1e-5]"
            );
        }
    }
    text
}

fn refused(folder: &Path, arguments: &str, words: &[&str]) {
    says(&command::refused(folder, arguments), words);
}

/// The driver's conversion, as arguments.
fn driver() -> String {
    let [gyro, accel] = GAIN.map(f64::recip);
    format!(
        "--gyro-si-per-raw {gyro} --accel-si-per-raw {accel} --gyro-zero {} --accel-zero {}",
        ZERO[0], ZERO[1]
    )
}

#[test]
fn everything_that_needs_a_calibration_refuses_the_file_by_its_name_and_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("biases.toml"), biases([-20.0, 60.0], "count")).unwrap();
    std::fs::write(folder.join("log.csv"), log()).unwrap();
    done(
        folder,
        "import log.csv --columns t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z --rate-hz 10 --raw-unit count \
         --gravity 9.80665 --reference gravity -o rec",
    );
    let formats = [
        "c",
        "rust",
        "json",
        "kalibr",
        "openvins",
        "imu-calib",
        "imu-tk --sensor accel",
        "fusion",
        "realsense",
        "depthai",
        "basalt",
        "autoware",
        "matlab",
        "betaflight",
        "inav --acc-1g 2048",
        "slimenrf",
        "pigeon",
        "iio",
        "core",
    ]
    .map(|format| format!("export {format} --calibration biases.toml -o out"));
    let commands = [
        "apply rec --calibration biases.toml -o out",
        "verify rec --calibration biases.toml",
        "diagnose rec --calibration biases.toml",
        "allan rec --calibration biases.toml -o out",
        "report --calibration biases.toml -o out",
        "compare biases.toml biases.toml",
        "thermal fit rec --base biases.toml -o out",
        "device upload biases.toml --port /dev/null",
        "device check --calibration biases.toml --port /dev/null",
    ];
    for arguments in formats.iter().map(String::as_str).chain(commands) {
        let says = [
            "biases.toml: it contains biases over temperature alone (mimu-thermal-biases/1)",
            "export it to px4 or ardupilot",
            "mimu thermal fit REC --base FILE",
        ];
        refused(folder, arguments, &says);
        assert!(!folder.join("out").exists(), "{arguments}");
    }
}

/// Half a minute of numbers.
fn log() -> String {
    let row = |k: u32| {
        format!(
            "{},{},2,3,4,5,{}\n",
            0.1 * f64::from(k),
            k % 3,
            1000 + k % 5
        )
    };
    (0..300).map(row).collect()
}

#[test]
fn a_file_that_was_edited_or_is_not_enough_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let good = biases([-20.0, 60.0], "V");
    let px4 = format!("export px4 --calibration biases.toml -o out {}", driver());
    #[rustfmt::skip]
    let edited: [(String, &[&str]); 9] = [
        (good.replace("biases/1", "biases/2"), &["biases.toml", "mimu-thermal-biases/2", "use the version"]),
        (good.replace("temp_c = 0.0", "temp_c = -30.0"), &["biases.toml", "not warmer"]),
        (good.replace("temp_c = 0.0", "temp_c = nan"), &["node 2", "NaN"]),
        (good.replace("[-20.0, 60.0]", "[60.0, -20.0]"), &["range_c", "increase"]),
        (good.replacen("sigma_u = [1e-5", "sigma_u = [-1.0", 1), &["node 1", "standard deviation"]),
        (good.replacen("[node.gyro]", "[node.gyros]", 1), &["biases.toml, line", "gyros"]),
        (good.replacen("slope_u", "slope", 1), &["biases.toml, line", "slope"]),
        (good[..good.find("[[node]]").unwrap()].into(), &["biases.toml", "no node"]),
        (good.replacen("u = [", "u = [inf, ", 1), &["biases.toml", "not a number"]),
    ];
    for (text, says) in edited {
        std::fs::write(folder.join("biases.toml"), text).unwrap();
        refused(folder, &px4, says);
    }
    // A cubic over less than 10 K.
    std::fs::write(folder.join("biases.toml"), biases([20.0, 28.0], "V")).unwrap();
    refused(folder, &px4, &["less than 10 K", "wider range"]);
    // Volts, without a conversion to rad/s.
    std::fs::write(folder.join("biases.toml"), &good).unwrap();
    for format in ["px4", "ardupilot"] {
        let without = format!("export {format} --calibration biases.toml -o out");
        refused(
            folder,
            &without,
            &["readings are in V", "--gyro-si-per-raw"],
        );
        let gyro = format!("{without} --gyro-si-per-raw 2.9");
        refused(folder, &gyro, &["readings are in V", "--accel-si-per-raw"]);
    }
    assert!(!folder.join("out").exists());
}
