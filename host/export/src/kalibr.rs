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

mod chain;

use std::fmt::Write as _;

use clap::Args;
use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::error::Result;
use nalgebra::{Matrix3, Matrix4};

use crate::convention::{Bias, Convention, Factors, Shape, Triangle};
use crate::driver::Readings;
use crate::intrinsics::Intrinsics;
use crate::layout::{Entry, NoiseKey, Numbers, walk, white};
use crate::worst_axis::{NoiseOptions, lines};
use crate::{Export, Noise, Page, Sources, Target, driver, yaml};

/// Options of Kalibr's file.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Topic of Kalibr's messages
    #[arg(long, value_name = "TOPIC", default_value = "/imu0")]
    pub rostopic: String,
    /// Layout of Kalibr's result (below imu0), for programs that read this layout
    #[arg(long)]
    pub result: bool,
    /// Options common to all noise files.
    #[command(flatten)]
    pub noise: NoiseOptions,
    /// The driver's conversion.
    #[command(flatten)]
    pub driver: driver::Options,
}

/// The format.
pub struct Kalibr;

impl Target for Kalibr {
    type Options = Options;
    const NAME: &str = "kalibr";
    const ABOUT: &str = "Noise and intrinsics for Kalibr: imu.yaml";
    const CONTENTS: &str = "noise; with `--calibration` also the scale-misalignment intrinsics, with `--result` also imu1 and so on";
    const READERS: &str = "Kalibr; programs that read Kalibr's result";
    const CONVENTION: Convention =
        Convention::to_reading(Shape::TriangleRotation(Triangle::Lower), Bias::Absent);
    const NOISE: Noise = Noise::Needed;
    const FURTHER_TRIADS: bool = true;
    const NOISE_KEYS: &[NoiseKey] = &KEYS;
    const NOISE_OF_READINGS: bool = true;
    const RATE_KEY: Option<&str> = Some("update_rate");
    // In the frame of the accelerometer, whose right factor is the identity.
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Accel, Numbers::Left, "accelerometers/M"),
        Entry::of(Sensor::Gyro, Numbers::Left, "gyroscopes/M"),
        Entry::of(Sensor::Gyro, Numbers::Right, "gyroscopes/C_gyro_i").optional(),
    ];
    const NOT_READ: &[&str] = &["gyroscopes/A", "accelerometers/rx_i", "imu1/accelerometers"];
    const PAGES: &[Page] = &[Page::of("Kalibr", "imu.yaml")];

    /// # Errors
    /// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::densities`] or [`Intrinsics::of`].
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let noise = from.noise()?;
        let mut export = Export::new::<Self>(from);
        export.continuous_densities(noise);
        let known = Intrinsics::of(from, &options.driver, Triangle::Lower, &mut export)?;
        let densities = options.noise.walks.densities(noise, &known.gain)?;
        let (mut body, indent) = match options.result {
            true => ("imu0:\n".to_owned(), "  "),
            false => (String::new(), ""),
        };
        body += &lines(indent, &KEYS, &densities, f64::NAN);
        let rate = options.noise.rate_hz(noise);
        let topic = serde_json::Value::from(options.rostopic.as_str());
        let _ = writeln!(
            body,
            "\n{indent}rostopic: {topic}\n{indent}update_rate: {rate:.3}  # Hz"
        );
        if from.calibration.is_some() {
            write_intrinsics(&mut body, indent, &known, &mut export);
            known.describe(from, &mut export);
            let r0 = known.factors.accel.rotation;
            chain::write(&mut body, from, options, &r0, &mut export)?;
        }
        let head = export.head("#", from);
        Ok(export.with(head + &body))
    }
}

/// The noise keys that Kalibr and OpenVINS share.
pub(crate) const KEYS: [NoiseKey; 4] = [
    white(
        "accelerometer_noise_density",
        "m/s^2/sqrt(Hz)",
        Sensor::Accel,
    ),
    walk("accelerometer_random_walk", "m/s^3/sqrt(Hz)", Sensor::Accel),
    white("gyroscope_noise_density", "rad/s/sqrt(Hz)", Sensor::Gyro),
    walk("gyroscope_random_walk", "rad/s^2/sqrt(Hz)", Sensor::Gyro),
];

impl Kalibr {
    /// M, and the rotation to the frame of the triad.
    fn factors(readings: &Readings) -> Result<Factors> {
        let parts = Self::CONVENTION.of(readings)?;
        Ok(Factors {
            triangle: parts.left,
            rotation: parts.right,
        })
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
    export.formula(
        "Intrinsics, SI to the program's readings in SI, a and w in the frame i of the accelerometer:",
    );
    export.formula("  accelerometer = M a + bias,  gyroscope = M C_gyro_i w + A C_gyro_i a + bias");
    export.formula(format!(
        "  x_i = R x_body, body the frame of the calibration, R = {}",
        rows(&accel.rotation)
    ));
    export.note("Kalibr estimates the intrinsics itself (--imu-models scale-misalignment) and does not start from these. They serve for comparison, and for programs that read Kalibr's result.");
}

/// A matrix in one line.
fn rows(matrix: &Matrix3<f64>) -> String {
    let rows = matrix.row_iter().map(|row| {
        let row: Vec<String> = row.iter().map(|v| format!("{v:.7}")).collect();
        format!("[{}]", row.join(", "))
    });
    format!("[{}]", rows.collect::<Vec<_>>().join(", "))
}
