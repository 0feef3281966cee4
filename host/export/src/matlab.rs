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

use std::f64::consts::{FRAC_1_SQRT_2 as ROOT_HALF, SQRT_2};

use clap::Args;
use mimu::quantity::Sensor;
use mimu_recording::error::Result;
use serde_json::{Value, json};

use crate::convention::{Bias, Convention, Shape};
use crate::driver::{self, Readings};
use crate::layout::{Entry, NoiseKey, Numbers, walk, white};
use crate::remaining::Places;
use crate::worst_axis::{Densities, WalkOptions};
use crate::{Export, Noise, Page, Sources, Target, heading};

/// Options of the file.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Name of the unit in the file, the third argument of loadparams: letters, digits and _
    #[arg(long, value_name = "NAME", default_value = "unit", value_parser = identifier)]
    pub name: String,
    /// Random walks.
    #[command(flatten)]
    pub walks: WalkOptions,
    /// The driver's conversion.
    #[command(flatten)]
    pub driver: driver::Options,
}

/// A name that MATLAB keeps as it is.
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

/// The format.
pub struct Matlab;

impl Target for Matlab {
    type Options = Options;
    const NAME: &str = "matlab";
    const ABOUT: &str = "Errors and noise for MATLAB's imuSensor: JSON for loadparams";
    const CONTENTS: &str = "errors and noise of the unit, to simulate it";
    const READERS: &str = "imuSensor of MATLAB";
    const CONVENTION: Convention = Convention::to_reading(Shape::Whole, Bias::AddedToReadings);
    const NOISE: Noise = Noise::Optional;
    // The accelerometer of imuSensor has the opposite sign of a real one.
    const LAYOUT: &[Entry] = &[
        Entry::of(
            Sensor::Accel,
            Numbers::Left,
            "Accelerometer/AxesMisalignment",
        )
        .scaled(0.0, 0.01),
        Entry::of(Sensor::Accel, Numbers::Bias, "Accelerometer/ConstantBias").scaled(0.0, -1.0),
        Entry::of(Sensor::Gyro, Numbers::Left, "Gyroscope/AxesMisalignment").scaled(0.0, 0.01),
        Entry::of(Sensor::Gyro, Numbers::Bias, "Gyroscope/ConstantBias"),
    ];
    const NOISE_OF_READINGS: bool = true;
    const NOISE_KEYS: &[NoiseKey] = &[
        white("Accelerometer/NoiseDensity", "", Sensor::Accel).in_si(ROOT_HALF),
        walk("Accelerometer/RandomWalk", "", Sensor::Accel).in_si(SQRT_2),
        white("Gyroscope/NoiseDensity", "", Sensor::Gyro).in_si(ROOT_HALF),
        walk("Gyroscope/RandomWalk", "", Sensor::Gyro).in_si(SQRT_2),
    ];
    const PAGES: &[Page] = &[Page::of("MATLAB imuSensor", "unit.json")];

    /// # Errors
    /// The calibration or a triad of it is missing, C is singular, or an error of [`WalkOptions::axes`].
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let (calibration, readings) = options.driver.both(from)?;
        let mut export = Export::new::<Self>(from);
        export.formula("reading = AxesMisalignment/100 input + ConstantBias + noise, SI to SI; the accelerometer of imuSensor has the opposite sign of a real one");
        export.note(readings.gyro.line());
        export.note(readings.accel.line());
        export.note(format!("In MATLAB: s = imuSensor; loadparams(s, file, '{}'), and SampleRate by hand. The release has to know AxesMisalignment as a matrix (gyroparams shows it as 3x3).", options.name));
        export.temperature(calibration);
        let noise = match from.noise {
            Some(noise) => {
                let gain = readings.as_ref().map(Readings::noise_gain);
                export.formula("NoiseDensity = sqrt(2) N, RandomWalk = K / sqrt(2): NoiseType is double-sided, MATLAB's default");
                export.note("BiasInstability is left at 0: releases of MATLAB shape it by different filters, so no number means B in all of them.");
                Some(options.walks.axes(noise, &gain)?)
            }
            None => {
                export.note("The file has no noise. Add --noise for NoiseDensity and RandomWalk.");
                None
            }
        };
        export.leaves(calibration, Places::Matrix);
        let triad = |s: Sensor| parameters(s, &readings[s], noise.as_ref().map(|axes| &axes[s]));
        let (accel, gyro) = (triad(Sensor::Accel)?, triad(Sensor::Gyro)?);
        let mut file = json!({"comment": heading::of(&export, from)});
        file[&options.name] = json!({"Accelerometer": accel, "Gyroscope": gyro});
        Ok(export.with(format!("{file:#}\n")))
    }
}

fn parameters(
    sensor: Sensor,
    readings: &Readings,
    noise: Option<&[Densities; 3]>,
) -> Result<Value> {
    let parts = Matlab::CONVENTION.of(readings)?;
    let mut out = json!({});
    let name = |key: &'static str| key.rsplit('/').next().unwrap_or(key);
    for entry in Matlab::LAYOUT.iter().filter(|entry| entry.sensor == sensor) {
        let values = entry.values(&parts);
        out[name(entry.key)] = match entry.numbers {
            Numbers::Bias => json!(values),
            _ => values.chunks(3).map(|row| json!(row)).collect(),
        };
    }
    for key in Matlab::NOISE_KEYS.iter().filter(|key| key.sensor == sensor) {
        if let Some(axes) = noise {
            let density = |axis: &Densities| key.number(axis.of(key.term).value, f64::NAN);
            out[name(key.key)] = json!(axes.each_ref().map(density));
        }
    }
    Ok(out)
}
