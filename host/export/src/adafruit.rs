//! Hard iron, soft iron and biases for Adafruit's sensor calibration, which many sketches use: lines in C, or its file `sensor_calib.json`.
//!
//! Of a magnetometer it computes `softiron (reading - hardiron)`, by rows, µT to µT; of a gyro `reading - zerorate` in rad/s and of an accelerometer
//! `reading - zerog` in m/s². MotionCal and sketches after it have the same names. mag_softiron is R C, so the field is in the frame of the gyro; MotionCal's
//! own is symmetric. mag_field, which the library does not use, is not written.
//!
//! Source: adafruit/Adafruit_Sensor_Calibration, Adafruit_Sensor_Calibration.cpp, `calibrate`; Adafruit_Sensor_Calibration_SDFat.cpp, `loadCalibration`
//! (2023-10).

use std::fmt::Write as _;

use clap::{Args, ValueEnum};
use mimu::{Calibration, Sensor};
use mimu_recording::error::Result;
use serde_json::{Map, Value, json};

use crate::biases::biases;
use crate::convention::{Bias, Convention, Shape};
use crate::layout::{Entry, Numbers};
use crate::remaining::Places;
use crate::{Export, Page, Sources, Target, body, driver};

/// How a magnetometer is written.
const MAGNETIC: Convention = Convention::to_input(Shape::Whole, Bias::SubtractedFromReadings);

/// What is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Layout {
    /// Arrays in C, for a sketch
    Lines,
    /// sensor_calib.json of Adafruit_Sensor_Calibration, without comments
    Json,
}

/// Options of the file.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Layout of the file
    #[arg(long, value_enum, default_value = "lines")]
    pub layout: Layout,
    /// The driver's conversion.
    #[command(flatten)]
    pub driver: driver::Options,
    /// That of magnetometers.
    #[command(flatten)]
    pub mag: body::Options,
}

/// The format.
pub struct Adafruit;

/// An array of the file: name, unit, and numbers, a matrix by rows.
type Array = (&'static str, &'static str, Vec<f64>);

impl Target for Adafruit {
    type Options = Options;
    const NAME: &str = "adafruit";
    const ABOUT: &str =
        "Hard iron, soft iron and biases for Adafruit's sensor calibration, MotionCal's names";
    const CONTENTS: &str =
        "C and o of a magnetometer (hard and soft iron), biases of gyro and accelerometer";
    const READERS: &str = "Adafruit_Sensor_Calibration and AHRS, sketches with MotionCal's names";
    const CONVENTION: Convention =
        Convention::to_input(Shape::Absent, Bias::SubtractedFromReadings);
    const FURTHER_TRIADS: bool = true;
    const LAYOUT: &[Entry] = &[
        Entry::of(Sensor::Gyro, Numbers::Bias, "gyro_zerorate"),
        Entry::of(Sensor::Accel, Numbers::Bias, "accel_zerog"),
    ];
    const NOT_READ: &[&str] = &["mag_softiron", "mag_hardiron"];
    const PAGES: &[Page] = &[Page::of("Adafruit (hard and soft iron)", "calibration.h")];

    /// # Errors
    /// The calibration is missing, C is singular, or those of `body::Options::microtesla`.
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let (calibration, place) = from.calibration()?;
        let mut export = Export::new::<Self>(from);
        export.leaves(calibration, Places::Axes);
        let mut all: Vec<Array> = Vec::new();
        all.extend(
            magnetometer(calibration, place, options, &mut export)?
                .into_iter()
                .flatten(),
        );
        let missing = "nothing is written for it";
        for (entry, parts) in biases::<Self>(&options.driver, from, missing, &mut export)? {
            let (sensor, name) = (entry.sensor, entry.key);
            let unit = sensor.unit();
            export.formula(format!("{sensor}: output = reading - {name}, {unit}"));
            all.push((name, unit, entry.values(&parts)));
        }
        export.temperature(calibration);
        if options.layout == Layout::Json {
            // Without comments: the library parses the file in 512 bytes of memory.
            let entries = all
                .iter()
                .map(|(name, _, values)| (name.to_string(), json!(values)));
            let file: Map<String, Value> = entries.collect();
            return Ok(export.with(format!("{:#}\n", Value::from(file))));
        }
        let mut out = export.head("//", from);
        for (name, unit, values) in &all {
            let count = values.len();
            let values: Vec<String> = values.iter().map(|v| format!("{:?}", *v as f32)).collect();
            let values = values.join(", ");
            let _ = writeln!(out, "float {name}[{count}] = {{{values}}}; // {unit}");
        }
        Ok(export.with(out))
    }
}

/// Hard iron and soft iron.
fn magnetometer(
    calibration: &Calibration,
    place: &str,
    options: &Options,
    export: &mut Export,
) -> Result<Option<[Array; 2]>> {
    let Some(mag) = body::only_mag(calibration, export) else {
        export.note("The calibration has no magnetometer, so nothing is written for it.");
        return Ok(None);
    };
    let readings = options.mag.microtesla((calibration, place), mag, export)?;
    let Some(readings) = readings else {
        return Ok(None);
    };
    let frame = match mag.rotation_deg {
        Some(_) => "in the frame of the gyro",
        None => "in its own frame",
    };
    export.formula(format!(
        "mag: output = mag_softiron (reading - mag_hardiron), uT to uT, mag_softiron by rows, {frame}"
    ));
    body::note_driver(&readings, mag, options.mag.mag_ut_per_raw.is_some(), export);
    let parts = MAGNETIC.of(&readings)?;
    let hard = parts.bias.as_slice().to_vec();
    let soft = parts.left.transpose().as_slice().to_vec();
    Ok(Some([
        ("mag_hardiron", "uT", hard),
        ("mag_softiron", "1, by rows", soft),
    ]))
}
