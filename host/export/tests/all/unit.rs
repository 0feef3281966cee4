//! A made-up unit over temperature with effects of every kind, readings in volts or counts.

use std::fmt::Write as _;

use mimu::calibration::Calibration;
use nalgebra::{Matrix3, Vector3};

#[rustfmt::skip]
const EFFECTS: [(&str, &str, &str); 4] = [
    ("gyro_g_sensitivity", "", r#"{ name = "xz", value = 4e-4, unit = "rad/s/(m/s^2)" }"#),
    ("accel_scale_cubic", "", r#"{ name = "y", value = 4e-5, unit = "1/(m/s^2)^2" }"#),
    ("gyro_thermal_lag", r#"nonlinear_parameter = { name = "lag_s", value = 90.0 }"#, r#"{ name = "z", value = 2e-3, unit = "rad/s/K" }"#),
    ("term:gyro_y~rate_x*force_z^2", "", r#"{ name = "y", value = 1e-4, unit = "rad/s/((rad/s)*(m/s^2)*(m/s^2))" }"#),
];

fn rows(m: &Matrix3<f64>) -> String {
    let row = |i: usize| format!("[{:e}, {:e}, {:e}]", m[(i, 0)], m[(i, 1)], m[(i, 2)]);
    format!("[{}, {}, {}]", row(0), row(1), row(2))
}

/// Nominal scale and null by the sensor, raw per SI and raw: analog sensors, and a digital one of 2000 deg/s and 16 g in 19 bits.
fn nominal(raw_unit: &str, sensor: &str) -> (f64, f64) {
    match (raw_unit, sensor) {
        ("count", "gyro") => (7509.9, 40.0),
        ("count", _) => (835.35, -60.0),
        ("SI", _) => (1.0, 0.02),
        (_, "gyro") => (0.344, 2.5),
        _ => (0.0306, 1.65),
    }
}

/// P and b, SI to raw.
fn forward(raw_unit: &str, sensor: &str, temp_c: f64) -> (Matrix3<f64>, Vector3<f64>) {
    let across = Matrix3::new(0.0, 0.01, -0.004, 0.002, 0.0, 0.006, -0.003, 0.005, 0.0);
    let (gain, zero) = nominal(raw_unit, sensor);
    let per_k = if sensor == "gyro" { 4e-4 } else { -1.5e-4 };
    let scale = 1.0 + per_k * (temp_c - 20.0);
    let bias = Vector3::new(0.01, -0.02, 0.03) * (temp_c - 20.0) / 40.0;
    (
        (Matrix3::identity() * scale + across) * gain,
        bias * gain + Vector3::repeat(zero),
    )
}

fn inverse(raw_unit: &str, sensor: &str, temp_c: f64) -> (Matrix3<f64>, Vector3<f64>) {
    let (p, b) = forward(raw_unit, sensor, temp_c);
    let c = p.try_inverse().unwrap();
    (c, -(c * b))
}

/// Of readings in volts. Without its curves and its effects it is a unit at one temperature.
pub fn calibration(over_temperature: bool) -> Calibration {
    calibration_of("V", over_temperature)
}

/// Of readings in `V`, `count` or `SI`.
pub fn calibration_of(raw_unit: &str, over_temperature: bool) -> Calibration {
    let version = if over_temperature { 2 } else { 1 };
    let mut text = format!(
        "format = \"mimu-calibration/{version}\"\ndevice = \"unit\"\ncreated = \"2026-01-02T03:04:05Z\"\ntool = \"test\"\n[recording]\nraw_unit = \"{raw_unit}\"\ntemp_c = 20.0\n"
    );
    for (sensor, unit) in [("gyro", "rad/s"), ("accel", "m/s^2")] {
        let ((c, o), (p, b)) = (
            inverse(raw_unit, sensor, 20.0),
            forward(raw_unit, sensor, 20.0),
        );
        let _ = writeln!(
            text,
            "[{sensor}]\nformula = \"x = C u + o\"\ndirection = \"raw to SI\"\nraw_unit = \"{raw_unit}\"\nunit = \"{unit}\"\nframe = \"body\"\n\
             C = {}\no = {:?}\n[{sensor}.forward]\nformula = \"u = P x + b\"\ndirection = \"SI to raw\"\nP = {}\nb = {:?}\n\
             [{sensor}.physical]\nformula = \"\"\nscale_factor = [1.0, 1.0, 1.0]\nbias = [0.0, 0.0, 0.0]\n\
             misalignment_deg = [0.0, 0.0, 0.0]\nnon_orthogonality_deg = [0.0, 0.0, 0.0]",
            rows(&c),
            o.as_slice(),
            rows(&p),
            b.as_slice()
        );
    }
    if over_temperature {
        text += "[temperature]\nrange_c = [-20.0, 60.0]\ndies.gyro.lag_s = 60.0\ndies.accel.lag_s = -20.0\n";
        for temp_c in [-20.0, 10.0, 30.0, 60.0] {
            let _ = writeln!(text, "[[temperature.node]]\ntemp_c = {temp_c:?}");
            for sensor in ["gyro", "accel"] {
                let (c, o) = inverse(raw_unit, sensor, temp_c);
                let h = 1e-3;
                let ((ca, oa), (cb, ob)) = (
                    inverse(raw_unit, sensor, temp_c - h),
                    inverse(raw_unit, sensor, temp_c + h),
                );
                let slope_o = (ob - oa) / (2.0 * h);
                let _ = writeln!(
                    text,
                    "[temperature.node.{sensor}]\nC = {}\no = {:?}\nslope_C = {}\nslope_o = {:?}",
                    rows(&c),
                    o.as_slice(),
                    rows(&((cb - ca) / (2.0 * h))),
                    slope_o.as_slice()
                );
            }
        }
        for (id, more, coefficients) in EFFECTS {
            let sensor = if id.contains("gyro_") {
                "gyro"
            } else {
                "accel"
            };
            let _ = writeln!(
                text,
                "[[effect]]\nid = \"{id}\"\nsensor = \"{sensor}\"\nabout = \"\"\nformula = \"x = C (u - S e) + o, e_i = sum of coefficient * regressor\"\n\
                 direction = \"raw to SI\"\n{more}\ncoefficients = [{coefficients}]"
            );
        }
    }
    Calibration::parse(&text, "test").unwrap()
}
