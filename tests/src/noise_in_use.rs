//! Noise in use on the virtual bench: a unit whose calibration, or whose noise in motion, is wrong in a known way.

use std::fmt::Write as _;

use mimu::calibration::Calibration;
use mimu::fit::{Options, fit};
use mimu::in_use::{Against, NoiseInUse, noise_in_use};
use mimu::noise::noise_file::NoiseFile;
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::Recording;
use mimu_rig::random::Random;
use mimu_rig::rig_file::{AffineFile, EffectFile, RigFile, RigTruth};
use nalgebra::{Matrix3, Vector3};

use crate::bench;
use crate::by_hand::{Grade, unit};

/// What is wrong with a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wrong {
    /// Nothing: the calibration is the truth.
    Nothing,
    /// Nothing, but the calibration is that of a session by hand of 30 poses.
    Calibrated,
    /// The calibration of the gyro has errors of 0.3 % in all elements of its matrix.
    Scale,
    /// The gyro senses 0.2 deg/s per g.
    GSensitivity,
    /// The unit is shaken, and the gyro's bias shifts by 0.5 deg/s per g².
    Vibration,
}

impl Wrong {
    /// All.
    pub const ALL: [Self; 5] = [
        Self::Nothing,
        Self::Calibrated,
        Self::Scale,
        Self::GSensitivity,
        Self::Vibration,
    ];
}

/// A session by hand: poses on a desk, and motions between them.
pub fn plan(poses: usize) -> String {
    format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = 200.0\ncarrier = \"hands\"\nlatitude_deg = 48.0\nlead_in_s = 5.0\n\
         [[step]]\nposes = {poses}\ndwell_s = 2.0\n"
    )
}

fn file(wrong: Wrong, seed: u64) -> RigFile {
    let mut file = unit(&[], Grade::Consumer, seed);
    let effect = |id: &str, parameters: &str| EffectFile {
        id: id.into(),
        parameters: toml::from_str(parameters).expect("parameters"),
    };
    match wrong {
        Wrong::GSensitivity => {
            let mut random = Random::new(seed, "g-sensitivity");
            let mut row = || [0; 3].map(|_| 0.2 * random.normal());
            let rows = [row(), row(), row()];
            let text = format!("matrix_dps_per_g = {rows:?}");
            file.effect = vec![effect("gyro_g_sensitivity", &text)];
        }
        Wrong::Vibration => {
            let text = "dps_per_g2 = [0.5, -0.4, 0.6]\ncorner_hz = 10.0";
            file.effect = vec![effect("x_gyro_vibration_rectification", text)];
            file.hands.tremor_hz = [20.0, 40.0];
            file.hands.tremor_mm = 0.3;
        }
        _ => {}
    }
    file
}

/// The noise at rest that the unit has in truth, of calibrated readings.
pub fn noise(file: &RigFile, seed: u64) -> NoiseFile {
    let truth = RigTruth::resolve(file, seed).expect("a rig");
    let mut text = String::from(
        "format = \"mimu-noise/1\"\ndevice = \"unit-007\"\nsample_rate_hz = 200.0\nduration_s = 10800.0\nconfidence = 0.95\n",
    );
    for (k, sensor) in [&truth.unit.gyro, &truth.unit.accel]
        .into_iter()
        .enumerate()
    {
        let unit = ["rad/s", "m/s^2"][k];
        for (axis, own) in ["x", "y", "z"].into_iter().zip(&sensor.axes) {
            let name = ["gyro", "accel"][k];
            let _ = writeln!(
                text,
                "[[channel]]\nname = \"{name}_{axis}\"\nunit = \"{unit}\"\nsamples = 1080000"
            );
            let noise = &own.noise;
            for (key, value) in [
                ("n", noise.white),
                ("b", noise.instability),
                ("k", noise.walk),
            ] {
                if value > 0.0 {
                    let _ = writeln!(
                        text,
                        "{key} = {{ value = {value:e}, sigma = 0.0, lower = {value:e}, upper = {value:e}, unit = \"{unit}\" }}"
                    );
                }
            }
        }
    }
    NoiseFile::parse(&text, "noise").expect("a noise file")
}

/// Writes `truth`, a model raw per SI, into the calibration, without uncertainty.
fn set(calibration: &mut Calibration, sensor: Sensor, truth: &AffineFile, error: &Matrix3<f64>) {
    let p = Matrix3::from_fn(|i, j| truth.matrix[i][j]);
    let c = (Matrix3::identity() + error) * p.try_inverse().expect("regular");
    let o = -(c * Vector3::from(truth.bias));
    let table = match sensor {
        Sensor::Gyro => calibration.gyro.as_mut(),
        Sensor::Accel => calibration.accel.as_mut(),
    };
    let table = table.expect("both sensors");
    table.C = std::array::from_fn(|i| std::array::from_fn(|j| c[(i, j)]));
    table.o = o.into();
    table.covariance = Vec::new();
}

/// The calibration of one session of a unit, used on another.
///
/// # Errors
/// Those of the command.
pub fn case(wrong: Wrong, poses: usize, seed: u64) -> mimu_recording::error::Result<NoiseInUse> {
    let file = file(wrong, seed);
    let clean = unit(&[], Grade::Consumer, seed);
    let first = bench::recorded(&plan(30), &clean, seed);
    let fitted = fit(first, Options::IN_SAMPLE)?;
    let mut calibration = Calibration::of(&fitted, &[], "2026-01-01T00:00:00Z")?;
    if wrong != Wrong::Calibrated {
        let mut random = Random::new(seed, "scale error");
        let error = match wrong {
            Wrong::Scale => Matrix3::from_fn(|_, _| 3e-3 * random.normal()),
            _ => Matrix3::zeros(),
        };
        let models = [&file.unit.gyro_affine, &file.unit.accel_affine];
        let models = models.map(|m| m.as_ref().expect("stated"));
        set(&mut calibration, Sensor::Gyro, models[0], &error);
        set(
            &mut calibration,
            Sensor::Accel,
            models[1],
            &Matrix3::zeros(),
        );
    }
    let folder = bench::written(&plan(poses), &file, seed + 1000);
    let recording = Recording::open(&folder.path().join("recording"))?;
    let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ())?;
    let noise = noise(&file, seed);
    noise_in_use(
        &recording,
        &calibration,
        &noise,
        Against::Rests(&prepared),
        |_| (),
    )
}

/// A row of a table: factors with their intervals, consistency, and the first cause of each sensor.
pub fn row(wrong: Wrong, seed: u64, found: &NoiseInUse) -> String {
    let mut out = format!("| {wrong:?} | {seed} | {} |", found.segments);
    for density in &found.densities {
        let _ = match (density.factor, density.factor_interval) {
            (Some(f), Some([a, b])) => write!(out, " {f:.2} ({a:.2} to {b:.2}) |"),
            _ => write!(out, " - |"),
        };
    }
    let nees = &found.nees;
    for n in [&nees.allan, &nees.with_calibration, &nees.in_use] {
        let _ = write!(out, " {:.2} |", n.value);
    }
    let causes: Vec<String> = found
        .causes
        .iter()
        .map(|c| {
            format!(
                "{:?} {:?} {:.2e} ({:.0} %, deviance {:.0})",
                c.sensor.map(|s| s.to_string()).unwrap_or_default(),
                c.cause,
                c.size,
                100.0 * c.share,
                c.deviance
            )
        })
        .collect();
    let _ = write!(out, " {} |", causes.join("; "));
    out
}
