//! A file of biases over temperature from a recording at rest: the autopilots' formats accept it, and all other commands refuse it by name.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

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

fn mimu(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mimu"));
    command.current_dir(folder);
    command.args(arguments.split(' ')).output().unwrap()
}

/// The refusal, which must be one line.
fn refused(folder: &Path, arguments: &str, says: &[&str]) {
    let out = mimu(folder, arguments);
    let line = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(1), "{arguments}: {line}");
    for word in says {
        assert!(
            line.contains(word),
            "{arguments}: {word:?} is not in {line}"
        );
    }
}

/// The driver's conversion, as arguments.
fn driver() -> String {
    let [gyro, accel] = GAIN.map(f64::recip);
    format!(
        "--gyro-si-per-raw {gyro} --accel-si-per-raw {accel} --gyro-zero {} --accel-zero {}",
        ZERO[0], ZERO[1]
    )
}

fn exported(folder: &Path, format: &str) -> (BTreeMap<String, f64>, String) {
    std::fs::write(folder.join("biases.toml"), biases([-20.0, 60.0], "V")).unwrap();
    let arguments = format!(
        "export {format} --calibration biases.toml -o out.param {}",
        driver()
    );
    let out = mimu(folder, &arguments);
    assert!(
        out.status.success(),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
    let text = std::fs::read_to_string(folder.join("out.param")).unwrap();
    let (comments, lines): (Vec<&str>, Vec<&str>) = text.lines().partition(|l| l.starts_with('#'));
    let pairs = lines.iter().map(|line| {
        let (name, value) = line.split_once(',').unwrap();
        (name.to_owned(), value.parse().unwrap())
    });
    (pairs.collect(), comments.join("\n"))
}

/// Rounding of single precision: 1e-7 of the largest value.
const ROUNDING: f64 = 2e-6;

#[test]
fn px4_gets_the_whole_bias_of_the_gyro_and_the_change_of_the_accelerometers() {
    let folder = tempfile::tempdir().unwrap();
    let (p, comments) = exported(folder.path(), "px4 --imu 2 --gyro-id 7 --accel-id 8");
    assert_eq!(p.len(), 2 * (2 + 3 + 12));
    for (sensor, prefix) in ["TC_G1", "TC_A1"].iter().enumerate() {
        assert_eq!(p[&format!("{prefix}_TREF")], MIDDLE_C);
        for axis in 0..3 {
            let x = [0, 1, 2, 3].map(|k| p[&format!("{prefix}_X{k}_{axis}")]);
            for temp_c in [-20.0, 3.0, 20.0, 60.0] {
                let d = temp_c - MIDDLE_C;
                let offset = x[0] + d * (x[1] + d * (x[2] + d * x[3]));
                let at_reference = if sensor == 1 {
                    bias(1, axis, MIDDLE_C)[0]
                } else {
                    0.0
                };
                let truth = bias(sensor, axis, temp_c)[0] - at_reference;
                assert!(
                    (offset - truth).abs() < ROUNDING,
                    "{prefix} {axis} {temp_c}: {offset} {truth}"
                );
            }
            assert!(sensor == 0 || x[0] == 0.0);
        }
    }
    for says in [
        "Scale factors stay the flight controller's own (CAL_ACC1_XSCALE",
        "X0 is 0 at TREF",
        "scale factors and cross terms: unknown",
        "Earth's rate in the bias",
        "from a recording at rest",
    ] {
        assert!(comments.contains(says), "{says}: {comments}");
    }
}

#[test]
fn ardupilot_gets_changes_alone_and_keeps_its_offsets() {
    let folder = tempfile::tempdir().unwrap();
    let (p, comments) = exported(folder.path(), "ardupilot --imu 2");
    assert_eq!(p.len(), 3 + 2 * 9, "{:?}", p.keys());
    for (sensor, short) in ["GYR", "ACC"].iter().enumerate() {
        for (axis, letter) in ["X", "Y", "Z"].iter().enumerate() {
            let k = [1, 2, 3].map(|k| 1e-6 * p[&format!("INS_TCAL2_{short}{k}_{letter}")]);
            let cubic = |temp_c: f64| {
                let d = temp_c - 35.0;
                d * (k[0] + d * (k[1] + d * k[2]))
            };
            // By its own calibration at 25 °C.
            for temp_c in [-20.0, 3.0, 60.0] {
                let change = cubic(temp_c) - cubic(25.0);
                let truth = bias(sensor, axis, temp_c)[0] - bias(sensor, axis, 25.0)[0];
                assert!(
                    (change - truth).abs() < ROUNDING,
                    "{short} {letter} {temp_c}: {change} {truth}"
                );
            }
        }
    }
    for says in [
        "Scale factors and offsets stay the flight controller's own (INS_ACC2SCAL, INS_ACC2OFFS)",
        "INS_ACC2_CALTEMP",
    ] {
        assert!(comments.contains(says), "{says}: {comments}");
    }
}

#[test]
fn everything_that_needs_a_calibration_refuses_the_file_by_its_name_and_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("biases.toml"), biases([-20.0, 60.0], "count")).unwrap();
    std::fs::write(folder.join("log.csv"), log()).unwrap();
    let imported = mimu(
        folder,
        "import log.csv --columns t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z --rate-hz 10 --raw-unit count \
         --gravity 9.80665 --reference gravity -o rec",
    );
    assert!(imported.status.success(), "{imported:?}");
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
        "thermal compare biases.toml biases.toml",
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
    let edited: [(String, &[&str]); 9] = [
        (
            good.replace("biases/1", "biases/2"),
            &["biases.toml", "mimu-thermal-biases/2", "use the version"],
        ),
        (
            good.replace("temp_c = 0.0", "temp_c = -30.0"),
            &["biases.toml", "not warmer"],
        ),
        (
            good.replace("temp_c = 0.0", "temp_c = nan"),
            &["node 2", "NaN"],
        ),
        (
            good.replace("[-20.0, 60.0]", "[60.0, -20.0]"),
            &["range_c", "increase"],
        ),
        (
            good.replacen("sigma_u = [1e-5", "sigma_u = [-1.0", 1),
            &["node 1", "standard deviation"],
        ),
        (
            good.replacen("[node.gyro]", "[node.gyros]", 1),
            &["biases.toml, line", "gyros"],
        ),
        (
            good.replacen("slope_u", "slope", 1),
            &["biases.toml, line", "slope"],
        ),
        (
            good[..good.find("[[node]]").unwrap()].into(),
            &["biases.toml", "no node"],
        ),
        (
            good.replacen("u = [", "u = [inf, ", 1),
            &["biases.toml", "not a number"],
        ),
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
