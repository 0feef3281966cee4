//! The inertial unit of OAK cameras: `imuCalibrationParams` of DepthAI's calibration, as JSON.
//!
//! The camera computes `calibrated = Q uncalibrated + b` from the streams ACCELEROMETER_UNCALIBRATED and GYROSCOPE_UNCALIBRATED, SI to SI, in the
//! frame of the camera (x right, y down, z forward). Therefore Q = C and b = o: DepthAI's b is added, where most programs subtract their bias. Each
//! triad is a list of three rows `[q0, q1, q2, b]`.
//!
//! Source: luxonis/depthai-core 3.6, include/depthai/common/ImuParameters.hpp, `ImuCalibrationParams`; the test of the camera's streams, "runtime
//! calibration applies bias offsets" and `applyCalibration`; device/CalibrationHandler.hpp, `setAccelerometerCalibration` (2026-04).

use clap::Args;
use mimu::quantity::{AXES, PerSensor, Sensor};
use mimu_recording::error::Result;
use serde_json::{Map, Value, json};

use crate::convention::{Bias, Convention, Shape};
use crate::driver::Readings;
use crate::layout::{Entry, NoiseKey, Numbers, walk, white};
use crate::remaining::Places;
use crate::worst_axis::{self, WalkOptions};
use crate::{Export, Noise, Page, Sources, Target, driver, heading};

/// Options of the file.
#[derive(Debug, Clone, Default, Args)]
pub struct Options {
    /// Type of the inertial unit, as DepthAI names it, such as BMI270
    #[arg(long, value_name = "NAME", default_value = "")]
    pub imu: String,
    /// Random walks.
    #[command(flatten)]
    pub walks: WalkOptions,
    /// The driver's conversion.
    #[command(flatten)]
    pub driver: driver::Options,
}

/// The format.
pub struct DepthAi;

impl Target for DepthAi {
    type Options = Options;
    const NAME: &str = "depthai";
    const ABOUT: &str = "Both triads and noise for an OAK camera: imuCalibrationParams of DepthAI";
    const CONTENTS: &str = "C and o of both triads; with `--noise` also noise";
    const READERS: &str = "OAK cameras, DepthAI 3.6";
    const CONVENTION: Convention = Convention::to_input(Shape::Whole, Bias::AddedToInput);
    const NOISE: Noise = Noise::Optional;
    const LAYOUT: &[Entry] = &[
        Entry::of(
            Sensor::Accel,
            Numbers::LeftBesideBias,
            "imuCalibrationParams/accelerometer",
        ),
        Entry::of(
            Sensor::Gyro,
            Numbers::LeftBesideBias,
            "imuCalibrationParams/gyroscope",
        ),
    ];
    const NOISE_KEYS: &[NoiseKey] = &[
        white("noise/accelerometer/{axis}/noiseDensity", "", Sensor::Accel),
        walk("noise/accelerometer/{axis}/randomWalk", "", Sensor::Accel),
        white("noise/gyroscope/{axis}/noiseDensity", "", Sensor::Gyro),
        walk("noise/gyroscope/{axis}/randomWalk", "", Sensor::Gyro),
    ];
    const PAGES: &[Page] = &[Page::of("OAK cameras (DepthAI)", "imu.json")];

    /// # Errors
    /// The calibration or a triad of it is missing, C is singular, or an error of [`WalkOptions::axes`].
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let (calibration, readings) = options.driver.both(from)?;
        let mut export = Export::new::<Self>(from);
        export.formula("calibrated = Q uncalibrated + b, SI to SI, b is added; three rows [q0, q1, q2, b] for each triad");
        export.note(readings.accel.line());
        export.note(readings.gyro.line());
        export.note("Record the streams ACCELEROMETER_UNCALIBRATED and GYROSCOPE_UNCALIBRATED: they have the camera's axes, and no calibration.");
        export.note("Merge the file into the camera's calibration: update eepromToJson()[\"imuCalibrationParams\"] with it, then fromJson() and device.setCalibration() or flashCalibration().");
        export.temperature(calibration);
        export.leaves(calibration, Places::Matrix);
        let mut triads = json!({
            "accelerometer": rows(0, &readings.accel)?,
            "gyroscope": rows(1, &readings.gyro)?,
        });
        match from.noise {
            Some(_) => triads["noise"] = noise(from, options, &mut export)?,
            None => {
                export
                    .note("The file has no noise: the camera keeps its own. Add --noise for one.");
            }
        }
        let about = heading::of(&export, from);
        let value = json!({"about": about, "imuCalibrationParams": triads});
        Ok(export.with(format!("{value:#}\n")))
    }
}

fn rows(entry: usize, readings: &Readings) -> Result<Value> {
    let values = DepthAi::LAYOUT[entry].values(&DepthAi::CONVENTION.of(readings)?);
    Ok(values.chunks(4).map(|row| json!(row)).collect())
}

/// Noise of each axis of the calibrated readings.
fn noise(from: &Sources, options: &Options, export: &mut Export) -> Result<Value> {
    let noise = from.noise()?;
    let axes = options.walks.axes(noise, &PerSensor::both([1.0; 3]))?;
    export.formula("noiseDensity = N and randomWalk = K, continuous time, biasStability = B, of the calibrated readings in SI; 0 is not known");
    let triad = |sensor: Sensor| {
        let mut out = Map::new();
        for (axis, densities) in AXES.iter().zip(&axes[sensor]) {
            let instability = worst_axis::instability(noise, sensor, axis);
            if instability.is_none() {
                export.note(format!(
                    "{sensor}, {axis}: the record shows no bias instability, so biasStability is 0."
                ));
            }
            let value = json!({
                "noiseDensity": densities.white.value,
                "randomWalk": densities.walk.value,
                "biasStability": instability.unwrap_or(0.0),
            });
            out.insert((*axis).into(), value);
        }
        Value::from(out)
    };
    let [accel, gyro] = [Sensor::Accel, Sensor::Gyro].map(triad);
    Ok(json!({"name": options.imu, "accelerometer": accel, "gyroscope": gyro}))
}
