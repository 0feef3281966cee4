//! Noise and intrinsics for Kalibr: imu.yaml.
//!
//! Noise: continuous-time densities of the worst axis ([`crate::worst_axis`]).
//!
//! Intrinsics, if a calibration is given: those of `--imu-models scale-misalignment`, true input to reading, SI to SI,
//!
//! ```text
//! accelerometer = M a + b,   gyroscope = M C_gyro_i w + A C_gyro_i a + b
//! ```
//!
//! with M lower triangular. The accelerometer's matrix includes no rotation, so it defines the frame i of a and w: with `P = M R` for the
//! accelerometer, `x_i = R x_body`. With `P = M Q` for the gyro, `C_gyro_i = Q Rᵀ`. A g-sensitivity G in the body frame gives `A = G Qᵀ`.
//!
//! Kalibr estimates these itself and starts from the identity. It passes keys that it does not read on to its result, whose layout has everything
//! below `imu0`. Source: ethz-asl/kalibr, kalibr_imu_camera_calibration/IccSensors.py, `IccScaledMisalignedImu`; kalibr_common/ConfigReader.py,
//! `ImuParameters` (2024-03).

use std::fmt::Write as _;

use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::error::Result;
use nalgebra::{Matrix3, Matrix4};

use crate::intrinsics::{Intrinsics, Triangle};
use crate::worst_axis::{Densities, NoiseOptions, line};
use crate::{Export, Sources, driver, heading, yaml};

/// Options of Kalibr's file.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Topic of Kalibr's messages
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "TOPIC", default_value = "/imu0")
    )]
    pub rostopic: String,
    /// Layout of Kalibr's result (below imu0), for programs that read this layout
    #[cfg_attr(feature = "clap", arg(long))]
    pub result: bool,
    /// Options common to all noise files.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub noise: NoiseOptions,
    /// The driver's conversion.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub driver: driver::Options,
}

/// Text of `imu.yaml`.
///
/// # Errors
/// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::densities`] or [`Intrinsics::of`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let noise = from.noise()?;
    let mut export = Export::new("kalibr", from);
    export.notes.extend(from.other_device());
    export.formulas.push(format!(
        "Continuous-time densities of the worst axis; {} % interval behind each.",
        100.0 * noise.confidence
    ));
    let intrinsics = match from.calibration {
        Some((calibration, place)) => {
            let half = Triangle::Lower;
            Some((
                calibration,
                Intrinsics::of(calibration, place, &options.driver, half)?,
            ))
        }
        None => {
            options.driver.unused()?;
            None
        }
    };
    let gain = match &intrinsics {
        Some((_, known)) => known.readings.as_ref().map(driver::Readings::noise_gain),
        None => PerSensor::both([1.0; 3]),
    };
    let densities = options.noise.walks.densities(noise, &gain)?;
    let indent = if options.result { "  " } else { "" };
    let mut body = String::new();
    if options.result {
        body.push_str("imu0:\n");
    }
    write_densities(&mut body, indent, &densities);
    let rate = options.noise.rate_hz(noise);
    let topic = serde_json::Value::from(options.rostopic.as_str());
    let _ = writeln!(
        body,
        "\n{indent}rostopic: {topic}\n{indent}update_rate: {rate:.3}  # Hz"
    );
    let comments = match intrinsics {
        None => heading::of_noise(noise, &export),
        Some((calibration, known)) => {
            write_intrinsics(&mut body, indent, &known, &mut export);
            known.describe(calibration, &mut export);
            let mut comments = heading::of_calibration(calibration, &export);
            comments.insert(2, heading::noise_from(noise));
            comments
        }
    };
    export.content = (heading::comments("#", &comments) + &body).into_bytes();
    Ok(export)
}

/// The four noise keys that Kalibr and OpenVINS share.
pub fn write_densities(out: &mut String, indent: &str, densities: &PerSensor<Densities>) {
    for sensor in [Sensor::Accel, Sensor::Gyro] {
        let (prefix, units) = match sensor {
            Sensor::Accel => ("accelerometer", ["m/s^2/sqrt(Hz)", "m/s^3/sqrt(Hz)"]),
            Sensor::Gyro => ("gyroscope", ["rad/s/sqrt(Hz)", "rad/s^2/sqrt(Hz)"]),
        };
        let Densities { white, walk } = &densities[sensor];
        let key = format!("{prefix}_noise_density");
        out.push_str(&line(indent, &key, |density| density, units[0], white));
        let key = format!("{prefix}_random_walk");
        out.push_str(&line(indent, &key, |density| density, units[1], walk));
    }
}

fn write_intrinsics(out: &mut String, indent: &str, known: &Intrinsics, export: &mut Export) {
    let PerSensor { gyro, accel } = known.factors;
    let inner = format!("{indent}  ");
    let _ = writeln!(
        out,
        "\n{indent}model: scale-misalignment\n{indent}accelerometers:"
    );
    yaml::matrix(out, &inner, "M", &accel.triangle);
    let _ = writeln!(out, "{indent}gyroscopes:");
    yaml::matrix(out, &inner, "M", &gyro.triangle);
    let sag = known.g_sensitivity * gyro.rotation.transpose();
    yaml::matrix(out, &inner, "A", &sag);
    let between = gyro.rotation * accel.rotation.transpose();
    yaml::matrix(out, &inner, "C_gyro_i", &between);
    yaml::matrix(out, indent, "T_i_b", &Matrix4::identity());
    let _ = writeln!(out, "{indent}time_offset: 0.0");
    let models = [
        "Intrinsics, SI to the program's readings in SI, a and w in the frame i of the accelerometer:",
        "  accelerometer = M a + bias,  gyroscope = M C_gyro_i w + A C_gyro_i a + bias",
    ];
    export.formulas.extend(models.map(String::from));
    export.formulas.push(format!(
        "  x_i = R x_body, body the frame of the calibration, R = {}",
        rows(&accel.rotation)
    ));
    export.notes.push("Kalibr estimates the intrinsics itself (--imu-models scale-misalignment) and does not start from these. They serve for comparison, and for programs that read Kalibr's result.".into());
}

/// A matrix in one line.
fn rows(matrix: &Matrix3<f64>) -> String {
    let rows = matrix.row_iter().map(|row| {
        let row: Vec<String> = row.iter().map(|v| format!("{v:.7}")).collect();
        format!("[{}]", row.join(", "))
    });
    format!("[{}]", rows.collect::<Vec<_>>().join(", "))
}
