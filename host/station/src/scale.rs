//! Readings in SI: by a calibration, by the board, or by the range that is set.

use mimu::data_sheet::Part;
use mimu::{Calibration, Forward, STANDARD_GRAVITY, Sensor};
use mimu_core::compensation::Affine;
use mimu_recording::{Error, RawUnit, Result};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::gather::Samples;

/// Codes of a converter of 16 bits on one side of zero.
const HALF_OF_16_BITS: f64 = 32_768.0;

/// Full scales that a unit is set to; absent for a sensor that it does not have.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ranges {
    /// Of the accelerometer, g.
    #[serde(default)]
    pub accel_g: Option<f64>,
    /// Of the gyro, deg/s.
    #[serde(default)]
    pub gyro_dps: Option<f64>,
}

impl Ranges {
    fn of(&self, sensor: Sensor) -> Option<f64> {
        sensor.pick(self.gyro_dps, self.accel_g)
    }
}

/// How readings become SI.
#[derive(Debug, Clone)]
pub struct Scale {
    /// Inverse models of gyro and accelerometer, raw to SI.
    pub models: [Affine<f64>; 2],
    /// Quantisation step of the readings of gyro and accelerometer, raw; `None` if it is not known.
    pub lsb: [Option<f64>; 2],
    /// Full scales, deg/s and g; `None` if they are not known.
    pub full_scale: [Option<f64>; 2],
    /// Where the models are from, in words.
    pub by: String,
}

/// SI for one deg/s or one g.
pub(crate) fn si_per_sheet(sensor: Sensor) -> f64 {
    sensor.pick(1f64.to_radians(), STANDARD_GRAVITY)
}

fn diagonal(si_per_raw: f64) -> Affine<f64> {
    Affine {
        matrix: Matrix3::identity() * si_per_raw,
        offset: Vector3::zeros(),
    }
}

impl Scale {
    /// The scale of `samples`: by `calibration`; as readings in SI; as the board says; by `ranges`, with the counts of `part` if it has this range; or by the
    /// range in the recording.
    ///
    /// # Errors
    /// The readings are in counts or volts and nothing says what one is.
    pub fn of(
        samples: &Samples,
        calibration: Option<&Calibration>,
        ranges: Option<&Ranges>,
        part: Option<&Part>,
    ) -> Result<Self> {
        let full_scale = Sensor::BOTH.map(|sensor| full_scale(samples, ranges, sensor));
        let counts = Sensor::BOTH.map(|sensor| {
            let full_scale = full_scale[sensor as usize]?;
            Some(counts_per_sheet(samples, part, sensor, full_scale))
        });
        let lsb = |sensor: Sensor| match samples.raw_unit {
            RawUnit::Count => Some(1.0),
            RawUnit::Volt => None,
            RawUnit::Si => counts[sensor as usize].map(|counts| si_per_sheet(sensor) / counts),
        };
        let made = |models, by: String| Self {
            models,
            lsb: Sensor::BOTH.map(lsb),
            full_scale,
            by,
        };
        if let Some(calibration) = calibration {
            return Ok(made(
                calibrated(samples, calibration)?,
                "calibration".into(),
            ));
        }
        if samples.raw_unit == RawUnit::Si {
            return Ok(made(
                [diagonal(1.0), diagonal(1.0)],
                "readings in SI".into(),
            ));
        }
        if let Some(models) = samples.nominal {
            return Ok(made(models, "the board's own figures".into()));
        }
        let model = |sensor: Sensor| match (counts[sensor as usize], samples.has(sensor as usize)) {
            (Some(counts), _) if samples.raw_unit == RawUnit::Count => {
                Ok(diagonal(si_per_sheet(sensor) / counts))
            }
            (_, false) => Ok(diagonal(1.0)),
            _ => Err(Error::new(
                &samples.place,
                format!(
                    "the {sensor} reads in {}, and nothing says how many are one {}",
                    samples.raw_unit,
                    sensor.unit()
                ),
                "give the ranges that are set, --range 16,2000 (g, deg/s), or a calibration, --calibration FILE",
            )),
        };
        let models = [model(Sensor::Gyro)?, model(Sensor::Accel)?];
        let words = |sensor: Sensor, unit: &str| {
            let range = full_scale[sensor as usize].filter(|_| samples.has(sensor as usize));
            range.map(|range| format!("±{range} {unit}"))
        };
        let ranges = [words(Sensor::Accel, "g"), words(Sensor::Gyro, "deg/s")];
        let ranges: Vec<String> = ranges.into_iter().flatten().collect();
        Ok(made(models, format!("ranges of {}", ranges.join(" and "))))
    }

    /// Raw readings of `sensor` in SI.
    pub fn apply(&self, sensor: Sensor, raw: &Vector3<f64>) -> Vector3<f64> {
        self.models[sensor as usize].apply(raw)
    }

    /// SI for one raw unit of each axis of `sensor`: inverse of its scale factor.
    pub fn si_per_raw(&self, sensor: Sensor) -> [f64; 3] {
        let model = &self.models[sensor as usize];
        let forward = Forward::of(model);
        [0, 1, 2].map(|axis| match &forward {
            Some(forward) => 1.0 / forward.matrix.row(axis).norm(),
            None => f64::NAN,
        })
    }
}

fn full_scale(samples: &Samples, ranges: Option<&Ranges>, sensor: Sensor) -> Option<f64> {
    let given = ranges.and_then(|ranges| ranges.of(sensor));
    let settings = samples
        .sensors
        .as_ref()
        .map(|sensors| sensor.pick(&sensors.gyro, &sensors.accel));
    let recorded = settings.map(|s| s.range / si_per_sheet(sensor));
    // A range in rad/s is a whole number of deg/s only to rounding.
    given.or(recorded.map(|range| (range * 1e6).round() / 1e6))
}

/// Counts for one deg/s or g in a range of `full_scale`.
fn counts_per_sheet(
    samples: &Samples,
    part: Option<&Part>,
    sensor: Sensor,
    full_scale: f64,
) -> f64 {
    let of_part = part.and_then(|part| part.sensor(sensor)).and_then(|own| {
        let near = |[range, _]: &&[f64; 2]| (range / full_scale - 1.0).abs() < 0.01;
        own.ranges.iter().find(near).map(|[_, counts]| *counts)
    });
    let bits = samples
        .sensors
        .as_ref()
        .map(|sensors| sensor.pick(sensors.gyro.bits, sensors.accel.bits));
    let half = bits.map_or(HALF_OF_16_BITS, |bits| 2f64.powi(i32::from(bits) - 1));
    of_part.unwrap_or(half / full_scale)
}

/// The models of a calibration for these samples.
fn calibrated(samples: &Samples, calibration: &Calibration) -> Result<[Affine<f64>; 2]> {
    let known = samples.batch.temp_c.iter().filter(|t| t.is_finite());
    let temp_c = known.clone().sum::<f64>() / known.count() as f64;
    let model = |sensor: Sensor| {
        let wrong = |problem: String| {
            Error::new(&samples.place, problem, "give the calibration of this unit")
        };
        let table = calibration.table(sensor);
        if let Some(table) = table.filter(|table| table.raw_unit != samples.raw_unit) {
            return Err(wrong(format!(
                "the calibration of the {sensor} is for readings in {}, and these are in {}",
                table.raw_unit, samples.raw_unit
            )));
        }
        let model = match temp_c.is_finite() {
            true => calibration.inverse_at(sensor, temp_c),
            false => calibration.inverse(sensor),
        };
        match (model, samples.has(sensor as usize)) {
            (Some(model), _) => Ok(model),
            (None, false) => Ok(diagonal(1.0)),
            (None, true) => Err(wrong(format!("the calibration has no {sensor}"))),
        }
    };
    Ok([model(Sensor::Gyro)?, model(Sensor::Accel)?])
}
