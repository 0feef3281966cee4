//! `mimu export px4` and `ardupilot`: the files are evaluated as the documentation of the two programs describes, and compared with the unit that the
//! calibration was written for.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

use nalgebra::{Matrix3, Vector3};

const G: f64 = 9.80665;
const RANGE_C: [f64; 2] = [-20.0, 60.0];
/// Temperature of the calibration's single model, °C.
const SETTLED_C: f64 = 20.0;
const LAG_S: f64 = 60.0;
/// Largest value of a fourth-power bias of the gyro's x axis over the range, rad/s.
const QUARTIC: f64 = 0.01;
/// Slope of the bias of the accelerometer's z axis, m/s²/K.
const STEADY_SLOPE: f64 = 2e-3;

/// A unit over temperature, SI to raw, in volts.
struct Unit {
    gain: f64,
    zero: f64,
    /// Relative change of the scale factor per kelvin.
    scale_per_k: f64,
    /// Bias in SI, by powers of T/40.
    bias: [[f64; 5]; 3],
}

fn gyro() -> Unit {
    Unit {
        gain: 0.344,
        zero: 2.5,
        scale_per_k: 4e-4,
        bias: [
            [0.01, -0.02, 0.004, 0.006, QUARTIC],
            [-0.02, 0.01, 0.0, -0.003, 0.0],
            [0.0, 0.03, -0.005, 0.0, 0.0],
        ],
    }
}

fn accel() -> Unit {
    Unit {
        gain: 0.0306,
        zero: 1.65,
        scale_per_k: -1.5e-4,
        bias: [
            [0.3, -0.1, 0.05, 0.02, 0.0],
            [-0.2, 0.2, 0.0, 0.03, 0.0],
            [0.1, 40.0 * STEADY_SLOPE, 0.0, 0.0, 0.0],
        ],
    }
}

impl Unit {
    /// Powers count from the middle of the range.
    fn bias_si(&self, temp_c: f64) -> Vector3<f64> {
        let x = (temp_c - 20.0) / 40.0;
        Vector3::from(
            self.bias
                .map(|b| (0..5).map(|k| b[k] * x.powi(k as i32)).sum()),
        )
    }

    fn matrix(&self, temp_c: f64) -> Matrix3<f64> {
        let across = Matrix3::new(0.0, 0.01, -0.004, 0.002, 0.0, 0.006, -0.003, 0.005, 0.0);
        let scale = 1.0 + self.scale_per_k * (temp_c - SETTLED_C);
        (Matrix3::identity() * scale + across) * self.gain
    }

    /// The bias as it enters the reading at the settled temperature, raw.
    fn raw_bias(&self, temp_c: f64) -> Vector3<f64> {
        self.bias_si(temp_c) * self.gain + Vector3::repeat(self.zero)
    }

    fn inverse(&self, temp_c: f64) -> (Matrix3<f64>, Vector3<f64>) {
        let c = self.matrix(temp_c).try_inverse().unwrap();
        (c, -(c * self.raw_bias(temp_c)))
    }

    fn node(&self, name: &str, temp_c: f64, text: &mut String) {
        let (c, o) = self.inverse(temp_c);
        let h = 1e-3;
        let ((cb, ob), (ca, oa)) = (self.inverse(temp_c + h), self.inverse(temp_c - h));
        let (slope_c, slope_o) = ((cb - ca) / (2.0 * h), (ob - oa) / (2.0 * h));
        let _ = writeln!(
            text,
            "[temperature.node.{name}]\nC = {}\no = {:?}\nslope_C = {}\nslope_o = {:?}",
            rows(&c),
            o.as_slice(),
            rows(&slope_c),
            slope_o.as_slice()
        );
    }

    fn table(&self, name: &str, unit: &str, text: &mut String) {
        let (c, o) = self.inverse(SETTLED_C);
        let _ = writeln!(
            text,
            "[{name}]\nformula = \"x = C u + o\"\ndirection = \"raw to SI\"\nraw_unit = \"V\"\nunit = \"{unit}\"\nframe = \"body\"\n\
             C = {}\no = {:?}\n[{name}.forward]\nformula = \"u = P x + b\"\ndirection = \"SI to raw\"\nP = {}\nb = {:?}\n\
             [{name}.physical]\nformula = \"\"\nscale_factor = [1.0, 1.0, 1.0]\nbias = [0.0, 0.0, 0.0]\n\
             misalignment_deg = [0.0, 0.0, 0.0]\nnon_orthogonality_deg = [0.0, 0.0, 0.0]",
            rows(&c),
            o.as_slice(),
            rows(&self.matrix(SETTLED_C)),
            self.raw_bias(SETTLED_C).as_slice()
        );
    }
}

fn rows(m: &Matrix3<f64>) -> String {
    let row = |i: usize| format!("[{:e}, {:e}, {:e}]", m[(i, 0)], m[(i, 1)], m[(i, 2)]);
    format!("[{}, {}, {}]", row(0), row(1), row(2))
}

fn write_calibration(folder: &Path) {
    let mut text = format!(
        "format = \"mimu-calibration/2\"\ndevice = \"unit\"\ntool = \"test\"\n[recording]\nraw_unit = \"V\"\ntemp_c = {SETTLED_C:?}\n"
    );
    gyro().table("gyro", "rad/s", &mut text);
    accel().table("accel", "m/s^2", &mut text);
    let _ = writeln!(
        text,
        "[temperature]\nrange_c = {RANGE_C:?}\ndies.gyro.lag_s = {LAG_S:?}\ndies.accel.lag_s = {LAG_S:?}"
    );
    for k in 0..9 {
        let temp_c = -20.0 + 10.0 * f64::from(k);
        let _ = writeln!(text, "[[temperature.node]]\ntemp_c = {temp_c:?}");
        gyro().node("gyro", temp_c, &mut text);
        accel().node("accel", temp_c, &mut text);
    }
    std::fs::write(folder.join("cal.toml"), text).unwrap();
}

fn export(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mimu"));
    command.current_dir(folder).arg("export");
    command.args(arguments.split(' ')).output().unwrap()
}

/// Exports with the driver's nominal conversion, and reads the output: the parameters and the JSON.
fn exported(folder: &Path, arguments: &str) -> (BTreeMap<String, f64>, serde_json::Value) {
    write_calibration(folder);
    let nominal = "--calibration cal.toml --gyro-zero 2.5 --accel-zero 1.65 --json e.json";
    let out = export(folder, &format!("{arguments} -o out.param {nominal}"));
    assert!(
        out.status.success(),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
    let text = std::fs::read_to_string(folder.join("out.param")).unwrap();
    let json = std::fs::read(folder.join("e.json")).unwrap();
    (parameters(&text), serde_json::from_slice(&json).unwrap())
}

/// As in pymavlink's mavparm: comments begin with a hash, a comma is a space, a line has two words, and the second is a number.
fn parameters(text: &str) -> BTreeMap<String, f64> {
    let lines = text.lines().map(str::trim);
    let lines = lines.filter(|l| !l.is_empty() && !l.starts_with('#'));
    let pairs = lines.map(|line| {
        let line = line.replace(',', " ");
        let words: Vec<&str> = line.split_whitespace().collect();
        assert_eq!(words.len(), 2, "{line}");
        assert!(
            words[0].len() <= 16,
            "MAVLink names have 16 characters: {line}"
        );
        let value: f32 = words[1].parse().unwrap();
        (words[0].to_owned(), f64::from(value))
    });
    pairs.collect()
}

/// PX4 User Guide, "Thermal Calibration and Compensation": subtracts a cubic of the temperature about TREF, which is clamped to TMIN to TMAX.
fn px4(
    p: &BTreeMap<String, f64>,
    prefix: &str,
    temp_c: f64,
    reading: Vector3<f64>,
) -> Vector3<f64> {
    let of = |name: &str| p[&format!("{prefix}_{name}")];
    let d = temp_c.clamp(of("TMIN"), of("TMAX")) - of("TREF");
    let offset = |axis: usize| -> f64 {
        (0..4)
            .map(|k| of(&format!("X{k}_{axis}")) * d.powi(k))
            .sum()
    };
    reading - Vector3::from_fn(|axis, _| offset(axis))
}

/// Copter documentation, "IMU Temperature Calibration", and the parameter list: subtracts a cubic without a constant about 35 °C, with coefficients
/// in millionths, relative to its value at the temperature where the offset was found; then the offset.
fn ardupilot(
    p: &BTreeMap<String, f64>,
    short: &str,
    temp_c: f64,
    reading: Vector3<f64>,
) -> Vector3<f64> {
    let cubic = |temp_c: f64, axis: &str| -> f64 {
        let d = temp_c.clamp(p["INS_TCAL1_TMIN"], p["INS_TCAL1_TMAX"]) - 35.0;
        let term = |k: i32| p[&format!("INS_TCAL1_{short}{k}_{axis}")] * d.powi(k);
        1e-6 * (1..4).map(term).sum::<f64>()
    };
    let settled = p[&format!("INS_{short}1_CALTEMP")];
    Vector3::from_fn(|k, _| {
        let axis = ["X", "Y", "Z"][k];
        let change = cubic(temp_c, axis) - cubic(settled, axis);
        reading[k] - change - p[&format!("INS_{short}OFFS_{axis}")]
    })
}

/// The driver's reading of a unit at rest without input, SI, as the export assumes it.
fn reading(unit: &Unit, temp_c: f64) -> Vector3<f64> {
    (unit.raw_bias(temp_c) - Vector3::repeat(unit.zero)) / unit.gain
}

/// The largest deviation from a cubic is the interpolation between nodes: a ten thousandth of the quartic; and single precision.
const INTERPOLATION: f64 = 1e-5;

fn assert_biases_go(corrected: impl Fn(usize, f64, Vector3<f64>) -> Vector3<f64>) {
    for (k, unit) in [gyro(), accel()].iter().enumerate() {
        for temp_c in [-20.0, -14.3, 0.0, 17.0, 33.0, 48.9, 60.0] {
            let left = corrected(k, temp_c, reading(unit, temp_c));
            // A fourth power minus its best cubic is 8/35 of a Legendre polynomial.
            let x = (temp_c - 20.0) / 40.0;
            let legendre = (35.0 * x.powi(4) - 30.0 * x * x + 3.0) / 8.0;
            let known = if k == 0 {
                QUARTIC * 8.0 / 35.0 * legendre
            } else {
                0.0
            };
            // Sums at equal distances differ slightly from integrals.
            let tolerance = INTERPOLATION + 0.01 * known.abs();
            assert!(
                (left[0] - known).abs() < tolerance,
                "{k} x {temp_c}: {left} {known}"
            );
            assert!(
                left[1].abs() < INTERPOLATION && left[2].abs() < INTERPOLATION,
                "{k} {temp_c}: {left}"
            );
        }
        // Outside the range the correction is constant.
        let [hot, hotter] = [61.0, 90.0].map(|t| corrected(k, t, Vector3::zeros()));
        assert_eq!(hot, hotter);
    }
}

#[test]
fn px4_subtracts_the_bias_of_the_unit_at_every_temperature() {
    let folder = tempfile::tempdir().unwrap();
    let (p, json) = exported(
        folder.path(),
        "px4 --imu 2 --gyro-id 2490378 --accel-id 2359306",
    );
    assert_eq!((p["TC_G_ENABLE"], p["TC_A_ENABLE"]), (1.0, 1.0));
    assert_eq!((p["TC_G1_ID"], p["TC_A1_ID"]), (2_490_378.0, 2_359_306.0));
    assert_eq!(
        (p["TC_G1_TMIN"], p["TC_G1_TMAX"], p["TC_G1_TREF"]),
        (-20.0, 60.0, 20.0)
    );
    assert_eq!(p.len(), 2 * (2 + 3 + 12));
    assert_biases_go(|k, t, v| px4(&p, ["TC_G1", "TC_A1"][k], t, v));
    assert_eq!(json["to"], "px4");
}

#[test]
fn ardupilot_subtracts_the_bias_of_the_unit_at_every_temperature() {
    let folder = tempfile::tempdir().unwrap();
    let (p, _) = exported(folder.path(), "ardupilot");
    assert_eq!(p["INS_TCAL1_ENABLE"], 1.0);
    assert_eq!(p.len(), 3 + 2 * (9 + 1 + 3));
    assert_biases_go(|k, t, v| ardupilot(&p, ["GYR", "ACC"][k], t, v));
}

#[test]
fn the_error_that_remains_is_that_of_scale_factors_cross_terms_and_lag() {
    let folder = tempfile::tempdir().unwrap();
    let (_, json) = exported(folder.path(), "px4");
    let figure = |k: usize, source: &str, key: &str| -> f64 {
        let all = json["remaining"].as_array().unwrap();
        let mut all = all.iter().filter(|r| r["sensor"] == ["gyro", "accel"][k]);
        let found = all.find(|r| r["source"].as_str().unwrap().starts_with(source));
        found.unwrap()[key].as_f64().unwrap()
    };
    let near = |found: f64, known: f64| {
        assert!((found / known - 1.0).abs() < 0.01, "{found} {known}");
    };
    // 40 K on either side of the calibration temperature of the program; the rms of a line is its largest value over √3.
    let most = 40.0 * 4e-4 * 100f64.to_radians();
    near(figure(0, "scale", "max"), most);
    near(figure(0, "scale", "rms"), most / 3f64.sqrt());
    near(figure(1, "scale", "max"), 40.0 * 1.5e-4 * G);
    // The row with the largest cross terms, 0.01 and -0.004.
    near(
        figure(1, "cross terms, constant", "max"),
        0.01f64.hypot(0.004) * G,
    );
    assert!(figure(1, "cross terms over", "max") < 1e-6 * G);
    // The fourth power of one of three axes.
    near(figure(0, "bias", "max"), QUARTIC * 8.0 / 35.0);
    near(
        figure(0, "bias", "rms"),
        QUARTIC * 8.0 / 35.0 / 3.0 / 3f64.sqrt(),
    );
    // A lag of a minute at 2 K/min: the largest slope of the accelerometer's biases, m/s²/K, is at the upper end of its y axis.
    let late = |t: f64| accel().bias_si(t)[1] - accel().bias_si(t - 2.0)[1];
    near(figure(1, "lag", "max"), late(60.0));
    let text = std::fs::read_to_string(folder.path().join("out.param")).unwrap();
    assert!(
        text.contains("# What this format adds") && text.contains("lag of the dies, at 2 K/min")
    );
}

#[test]
fn q_ground_control_gets_five_columns_with_the_types() {
    let folder = tempfile::tempdir().unwrap();
    write_calibration(folder.path());
    let arguments =
        "px4 -o a.params --qgc --calibration cal.toml --gyro-zero 2.5 --accel-zero 1.65";
    assert!(export(folder.path(), arguments).status.success());
    let text = std::fs::read_to_string(folder.path().join("a.params")).unwrap();
    let lines: Vec<&str> = text.lines().filter(|l| !l.starts_with('#')).collect();
    assert!(lines.contains(&"1\t1\tTC_G_ENABLE\t1\t6"), "{text}");
    assert!(lines.iter().all(|l| l.split('\t').count() == 5));
    assert!(lines.iter().filter(|l| l.ends_with("\t9")).count() == 30);
}

#[test]
fn what_cannot_be_exported_is_refused_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |arguments: &str, says: &str| {
        let out = export(
            folder.path(),
            &format!("{arguments} --calibration cal.toml"),
        );
        let error = String::from_utf8(out.stderr).unwrap();
        assert!(
            out.status.code() == Some(1) && error.contains(says),
            "{error}"
        );
        assert!(!folder.path().join("p.param").exists());
    };
    write_calibration(folder.path());
    // 1.65 V are 54 m/s², beyond the range of INS_ACCOFFS.
    refused("ardupilot -o p.param --gyro-zero 2.5", "--accel-zero");
    // Counts, but the sensor gives volts.
    refused(
        "px4 -o p.param --gyro-si-per-raw 0.001",
        "give its conversion",
    );
}
