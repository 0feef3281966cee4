//! The unit of these tests, a recording of it, and effects for it.

use std::fmt::Write as _;
use std::path::Path;

use mimu::calibration::Calibration;
use mimu::effects;
use mimu::effects::candidate::{Candidate, CandidateKind};
use mimu::effects::fitted::FittedEffect;
use mimu::fit::{Fit, Options, fit};
use mimu::prepared::Prepared;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::Recording;
use nalgebra::{Matrix3, Vector3};

use crate::random::congruential;

pub const DWELLS: usize = 72;
pub const RATE_HZ: f64 = 50.0;
pub const DWELL_S: f64 = 2.0;
pub const G: f64 = 9.80665;
/// Standard deviations of a sample, V.
pub const NOISE: [f64; 2] = [1e-4, 2e-4];

/// Forward model of the bench's unit, V per SI: rows are sensors.
pub fn forward(sensor: usize) -> (Matrix3<f64>, Vector3<f64>) {
    match sensor {
        0 => (
            Matrix3::new(0.4, 0.01, -0.02, 0.01, 0.5, 0.02, -0.01, 0.02, 0.3),
            Vector3::new(1.6, 1.7, 1.5),
        ),
        _ => (
            Matrix3::new(0.08, 0.001, 0.0, -0.001, 0.07, 0.002, 0.001, 0.0, 0.09),
            Vector3::new(1.65, 1.6, 1.7),
        ),
    }
}

/// Temperature of the bench, °C: a ramp.
pub fn temp_c(t: f64) -> f64 {
    22.0 + 0.15 * t
}

/// Sag of the gyros, rad/s per m/s².
pub const SAG: f64 = 4e-4;
/// Cubic of the accelerometer, per (m/s²)².
///
/// The effect is evaluated with the erroneous reading: of the cubic's error, at most 0.03 m/s², its slope of 0.9 % remains.
pub const CUBIC: f64 = 3e-5;
/// Thermal bias of gyro z, rad/s/K.
pub const THERMAL: f64 = 5e-4;

/// Records a unit on a table: `read` gives the readings of gyro (0) or accelerometer at a time, for the rate and the force then, V. Without `temp_c` no
/// temperature is recorded.
pub fn record_with(
    folder: &Path,
    seed: u64,
    temp_c: Option<&dyn Fn(f64) -> f64>,
    read: impl Fn(usize, f64, &[Vector3<f64>; 2]) -> Vector3<f64>,
) {
    std::fs::create_dir(folder).unwrap();
    let manifest = format!(
        "format = \"mimu-recording/1\"\ndevice = \"bench\"\nsample_rate_hz = {RATE_HZ:?}\n\
         gravity_mps2 = {G}\nraw_unit = \"V\"\nreference = \"table\"\n"
    );
    std::fs::write(folder.join("recording.toml"), manifest).unwrap();
    let mut out = String::from("t_s,step,");
    if temp_c.is_some() {
        out.push_str("temp_c,");
    }
    out.push_str("gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,");
    out.push_str("ref_rate_x_dps,ref_rate_y_dps,ref_rate_z_dps,");
    out.push_str("ref_force_x_mps2,ref_force_y_mps2,ref_force_z_mps2\n");
    let mut uniform = congruential(seed);
    // Sum of twelve uniform numbers: approximately normal.
    let mut normal = move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
    let rows = (DWELL_S * RATE_HZ) as usize;
    for k in 0..DWELLS * rows {
        let (t, step) = (k as f64 / RATE_HZ, k / rows);
        let s = step as f64;
        // Directions and rates that repeat late: 2.4 rad is nearly the golden angle.
        let force = Vector3::new((2.4 * s).sin(), (2.4 * s).cos(), (0.9 * s).sin()).normalize() * G;
        let rate_dps = Vector3::new((1.3 * s).sin(), (1.7 * s).cos(), (2.9 * s).sin()) * 60.0;
        let inputs = [rate_dps.map(f64::to_radians), force];
        write!(out, "{t:.4},{step}").unwrap();
        if let Some(temp_c) = temp_c {
            write!(out, ",{:.6}", temp_c(t)).unwrap();
        }
        for (sensor, noise) in NOISE.iter().enumerate() {
            for u in &read(sensor, t, &inputs) {
                write!(out, ",{:.9}", u + noise * normal()).unwrap();
            }
        }
        for v in rate_dps.iter().chain(force.iter()) {
            write!(out, ",{v:.9}").unwrap();
        }
        out.push('\n');
    }
    std::fs::write(folder.join("samples.csv"), out).unwrap();
}

/// Records the unit on a table, with or without its flaws; `temp` says whether temp_c is recorded.
pub fn record(folder: &Path, flawed: bool, temp: bool) {
    let shown: &dyn Fn(f64) -> f64 = &temp_c;
    let read = |sensor: usize, t: f64, inputs: &[Vector3<f64>; 2]| {
        let (p, b) = forward(sensor);
        let force = inputs[1];
        let scale = Vector3::from_fn(|i, _| p.row(i).norm());
        let error = match (flawed, sensor) {
            (false, _) => Vector3::zeros(),
            (_, 0) => Vector3::new(SAG * force.z, SAG * force.x, THERMAL * (temp_c(t) - 25.0)),
            _ => Vector3::from_fn(|i, _| {
                CUBIC * (p.row(i).transpose().dot(&force) / scale[i]).powi(3)
            }),
        };
        p * inputs[sensor] + b + scale.component_mul(&error)
    };
    record_with(folder, 7 + u64::from(flawed), temp.then_some(shown), read);
}

pub fn prepared(folder: &Path) -> Prepared {
    let recording = Recording::open(folder).unwrap();
    Prepared::read(&recording, STILL_FACTOR, |_| ()).unwrap()
}

pub fn fitted(folder: &Path) -> Fit {
    fit(prepared(folder), Options::IN_SAMPLE).unwrap()
}

/// The flaws of the unit of [`record`].
pub fn flaws() -> [FittedEffect; 3] {
    let sag = [0.0, 0.0, SAG, SAG, 0.0, 0.0, 0.0, 0.0, 0.0];
    [
        named("gyro_g_sensitivity", &sag),
        named("gyro_thermal_bias", &[0.0, 0.0, THERMAL, 0.0, 0.0, 0.0]),
        named("accel_scale_cubic", &[CUBIC; 3]),
    ]
}

/// Records the unit without and with its flaws, as `clean` and `flawed`, and writes its calibration with these effects as `cal.toml`.
pub fn calibrated(folder: &Path, effects: &[FittedEffect]) -> Calibration {
    record(&folder.join("clean"), false, true);
    record(&folder.join("flawed"), true, true);
    let fit = fitted(&folder.join("clean"));
    let made = Calibration::of(&fit, effects, "2026-01-01T00:00:00Z").unwrap();
    std::fs::write(folder.join("cal.toml"), made.to_toml()).unwrap();
    made
}

/// With an uncertainty of 1 %.
pub fn fitted_effect(candidate: Candidate, parameter: f64, values: &[f64]) -> FittedEffect {
    FittedEffect {
        sigmas: values.iter().map(|v| 0.01 * v.abs()).collect(),
        ..FittedEffect::new(candidate, parameter, values.to_vec())
    }
}

pub fn named(id: &str, values: &[f64]) -> FittedEffect {
    let effect = effects::by_id(id).unwrap();
    fitted_effect(
        Candidate::new(effect.sensor, CandidateKind::Effect(effect)),
        0.0,
        values,
    )
}
