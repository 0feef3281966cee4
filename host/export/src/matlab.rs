//! A unit for MATLAB's simulation `imuSensor`, as JSON for `loadparams`.
//!
//! `imuSensor` computes `reading = AxesMisalignment/100 input + ConstantBias + noise`. Therefore AxesMisalignment = 100 P, 3x3, and ConstantBias = b of
//! the gyro. The input of its accelerometer is gravity minus acceleration, the opposite of the specific force that the sensor measures, in NED and in
//! ENU alike. Its reading has the opposite sign too, so ConstantBias of the accelerometer is -b.
//!
//! White noise has the standard deviation `NoiseDensity √(rate/2)` in one sample, and the bias takes steps of `RandomWalk / √(rate/2)`: MATLAB's
//! default, NoiseType "double-sided", which a JSON file cannot change. N and K of a sample at that rate are `N √rate` and `K / √rate`, so
//! NoiseDensity = √2 N and RandomWalk = K / √2.
//!
//! Source: Navigation Toolbox, `+fusion/+internal/IMUSensorSimulator.m` (`stepBulkModel`, `setStdDevWhiteNoise`, `setStdDevRandWalk`),
//! `AccelerometerSimulator.m` (`stepImpl`), `+frames/NED.m` and `ENU.m` (`LinAccelSign`), `SensorParamLoader.m`, `IMUSensorParameters.m`.

use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::error::Result;
use serde_json::{Map, Value, json};

use crate::driver::Readings;
use crate::remaining::{self, Places};
use crate::worst_axis::{Densities, WalkOptions};
use crate::{Export, Sources, driver, heading};

/// Options of the file.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Name of the unit in the file, the third argument of loadparams: letters, digits and _
    #[cfg_attr(feature = "clap", arg(long, value_name = "NAME", default_value = "unit", value_parser = identifier))]
    pub name: String,
    /// Random walks.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub walks: WalkOptions,
    /// The driver's conversion.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub driver: driver::Options,
}

/// A name that MATLAB keeps as it is.
#[cfg(feature = "clap")]
fn identifier(text: &str) -> std::result::Result<String, String> {
    let mut chars = text.chars();
    let first = chars.next().is_some_and(|c| c.is_ascii_alphabetic());
    match first && chars.all(|c| c.is_ascii_alphanumeric() || c == '_') {
        true => Ok(text.into()),
        false => {
            Err("it has to begin with a letter, and contain letters, digits and _ only".into())
        }
    }
}

/// Text of the file.
///
/// # Errors
/// The calibration or a triad of it is missing, C is singular, or an error of [`WalkOptions::axes`].
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let readings = PerSensor {
        gyro: options.driver.readings(calibration, place, Sensor::Gyro)?,
        accel: options.driver.readings(calibration, place, Sensor::Accel)?,
    };
    let mut export = Export::new("matlab", from);
    export.notes.extend(from.other_device());
    export.formulas.push("reading = AxesMisalignment/100 input + ConstantBias + noise, SI to SI; the accelerometer of imuSensor has the opposite sign of a real one".into());
    export
        .notes
        .extend([readings.gyro.line(), readings.accel.line()]);
    export.notes.push(format!("In MATLAB: s = imuSensor; loadparams(s, file, '{}'), and SampleRate by hand. The release has to know AxesMisalignment as a matrix (gyroparams shows it as 3x3).", options.name));
    export.notes.extend(heading::temperature(calibration));
    let noise = match from.noise {
        Some(noise) => {
            let gain = readings.as_ref().map(Readings::noise_gain);
            export.formulas.push("NoiseDensity = sqrt(2) N, RandomWalk = K / sqrt(2): NoiseType is double-sided, MATLAB's default".into());
            export.notes.push("BiasInstability is left at 0: releases of MATLAB shape it by different filters, so no number means B in all of them.".into());
            Some(options.walks.axes(noise, &gain)?)
        }
        None => {
            export
                .notes
                .push("The file has no noise. Add --noise for NoiseDensity and RandomWalk.".into());
            None
        }
    };
    let places = Places {
        cross_terms: true,
        temperature: false,
        effects: false,
    };
    export.remaining = remaining::of(calibration, places)?;
    let triad =
        |sensor: Sensor| parameters(&readings[sensor], noise.as_ref().map(|axes| &axes[sensor]));
    let unit = json!({"Accelerometer": triad(Sensor::Accel), "Gyroscope": triad(Sensor::Gyro)});
    let mut file = Map::new();
    file.insert(
        "comment".into(),
        heading::of_calibration(calibration, &export).into(),
    );
    file.insert(options.name.clone(), unit);
    export.content = (format!("{:#}", Value::from(file)) + "\n").into_bytes();
    Ok(export)
}

fn parameters(readings: &Readings, noise: Option<&[Densities; 3]>) -> Value {
    let p = 100.0 * readings.forward.matrix;
    let rows: Vec<[f64; 3]> = p.row_iter().map(|row| [row[0], row[1], row[2]]).collect();
    let bias = match readings.sensor {
        Sensor::Gyro => readings.forward.bias,
        Sensor::Accel => -readings.forward.bias,
    };
    let mut out = Map::new();
    out.insert("AxesMisalignment".into(), json!(rows));
    out.insert("ConstantBias".into(), json!(bias.as_slice()));
    if let Some(axes) = noise {
        let root = f64::sqrt(2.0);
        let list = |of: &dyn Fn(&Densities) -> f64| json!(axes.each_ref().map(of));
        out.insert("NoiseDensity".into(), list(&|axis| root * axis.white.value));
        out.insert("RandomWalk".into(), list(&|axis| axis.walk.value / root));
    }
    out.into()
}
