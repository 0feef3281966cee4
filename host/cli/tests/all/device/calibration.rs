//! A calibration file written by hand, from its forward model.

use std::fmt::Write as _;

use nalgebra::{Matrix3, Vector3};

/// Forward matrices (V per rad/s, V per m/s²) and biases (V) of gyro and accelerometer.
pub type Forward = [(Matrix3<f64>, Vector3<f64>); 2];

/// An arbitrary unit.
pub fn forward() -> Forward {
    let gyro = Matrix3::new(
        0.28, 0.002, -0.001, 0.003, 0.29, 0.001, -0.002, 0.001, 0.285,
    );
    let accel = Matrix3::new(
        0.081, 0.0002, 0.0001, -0.0003, 0.082, 0.0002, 0.0, 0.0001, 0.0815,
    );
    [
        (gyro, Vector3::new(2.49, 2.51, 2.505)),
        (accel, Vector3::new(1.64, 1.66, 1.65)),
    ]
}

fn rows(m: &Matrix3<f64>) -> String {
    let row = |i: usize| format!("[{:?}, {:?}, {:?}]", m[(i, 0)], m[(i, 1)], m[(i, 2)]);
    format!("[{}, {}, {}]", row(0), row(1), row(2))
}

fn significant(v: &Vector3<f64>) -> String {
    format!("[{:?}, {:?}, {:?}]", v[0], v[1], v[2])
}

/// Text of a calibration of both sensors, with the effects.
pub fn text(raw_unit: &str, effects: &str) -> String {
    text_of(&forward(), raw_unit, effects)
}

/// The same for a certain unit.
pub fn text_of(forward: &Forward, raw_unit: &str, effects: &str) -> String {
    let mut out = format!(
        "format = \"mimu-calibration/1\"\ndevice = \"unit-7\"\ncreated = \"2026-01-01T00:00:00Z\"\ntool = \"by hand\"\n\
         [recording]\nsha256 = \"00\"\nreference = \"table\"\nraw_unit = \"{raw_unit}\"\ngravity_mps2 = 9.81\ntemp_c = 26.5\n"
    );
    let zeros = |n: usize| format!("[{}]", vec!["0.0"; n].join(", "));
    let zero_matrix = format!("[{0}, {0}, {0}]", zeros(3));
    let covariance = format!("[{}]", vec![zeros(12); 12].join(", "));
    for ((name, unit), (p, b)) in [("gyro", "rad/s"), ("accel", "m/s^2")].iter().zip(forward) {
        let c = p.try_inverse().unwrap();
        let o = -(c * b);
        let (z3, zm) = (zeros(3), &zero_matrix);
        let _ = write!(
            out,
            "[{name}]\nformula = \"x = C u + o\"\ndirection = \"raw to SI\"\nraw_unit = \"{raw_unit}\"\nunit = \"{unit}\"\n\
             frame = \"body\"\nC = {}\no = {}\nsigma_C = {zm}\nsigma_o = {z3}\ninterval_C = {zm}\ninterval_o = {z3}\n\
             parameters = []\ncovariance = {covariance}\n\
             [{name}.judged]\nestimator = \"e\"\nfigure = \"f\"\nunit = \"{unit}\"\nrms = 0.0\nnoise_floor = 0.0\ndwells = 9\ncondition = 1.0\n\
             [{name}.forward]\nformula = \"u = P x + b\"\ndirection = \"SI to raw\"\nP = {}\nb = {}\n\
             [{name}.physical]\nformula = \"\"\nscale_factor = {z3}\nsigma_scale_factor = {z3}\nbias = {z3}\nsigma_bias = {z3}\n\
             misalignment_deg = {z3}\nsigma_misalignment_deg = {z3}\nnon_orthogonality_deg = {z3}\nsigma_non_orthogonality_deg = {z3}\n",
            rows(&c),
            significant(&o),
            rows(p),
            significant(b),
        );
    }
    out + effects
}

/// One coefficient of g-sensitivity, one of a quadratic scale factor, and a term.
pub const EFFECTS: &str = r#"
[[effect]]
id = "gyro_g_sensitivity"
sensor = "gyro"
about = ""
formula = "x = C (u - S e) + o, e_i = sum of coefficient * regressor"
direction = "raw to SI"
coefficients = [{ name = "xz", value = 0.0004, sigma = 1e-6, unit = "rad/s/(m/s^2)" }]

[[effect]]
id = "accel_scale_quadratic"
sensor = "accel"
about = ""
formula = "x = C (u - S e) + o, e_i = sum of coefficient * regressor"
direction = "raw to SI"
coefficients = [{ name = "z", value = 0.0002, sigma = 1e-6, unit = "1/(m/s^2)" }]

[[effect]]
id = "term:accel_y~rate_x*force_y"
sensor = "accel"
about = ""
formula = "x = C (u - S e) + o, e_i = sum of coefficient * regressor"
direction = "raw to SI"
coefficients = [{ name = "y", value = 0.001, sigma = 1e-6, unit = "m/s^2/((rad/s)*(m/s^2))" }]
"#;
