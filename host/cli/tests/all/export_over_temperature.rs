//! `mimu export px4` and `ardupilot` of a calibration over temperature: what remains, and what is refused. `tests/interop` evaluates the files as the two programs do.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};

use super::command;

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

#[test]
fn the_error_that_remains_is_that_of_scale_factors_cross_terms_and_lag() {
    let folder = tempfile::tempdir().unwrap();
    write_calibration(folder.path());
    let json = command::json(
        folder.path(),
        "export px4 -o out.param --calibration cal.toml --gyro-zero 2.5 --accel-zero 1.65",
    );
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
        "export px4 -o a.params --qgc --calibration cal.toml --gyro-zero 2.5 --accel-zero 1.65";
    command::done(folder.path(), arguments);
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
        let arguments = format!("export {arguments} --calibration cal.toml");
        let error = command::refused(folder.path(), &arguments);
        assert!(error.contains(says), "{error}");
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
