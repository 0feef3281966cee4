//! Parts: what data sheets promise. The file of a part is TOML, `mimu-part/1`; those of [`SHIPPED`] are in the program.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::quantity::{AXES, Sensor};
use mimu_recording::{Error, Result, check_kind, parse_toml, read_text};

/// Version of the file of a part.
const FORMAT: &str = "mimu-part/1";

/// Parts that the program knows, by the name on the command line.
pub const SHIPPED: [(&str, &str); 6] = [
    ("bmi088", include_str!("parts/bmi088.toml")),
    ("bmi270", include_str!("parts/bmi270.toml")),
    ("icm42688p", include_str!("parts/icm42688p.toml")),
    ("lsm6dso", include_str!("parts/lsm6dso.toml")),
    ("lsm6dsv16x", include_str!("parts/lsm6dsv16x.toml")),
    ("mpu6050", include_str!("parts/mpu6050.toml")),
];

/// What is compared, in the words of IEEE Std 2700.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Property {
    /// Deviation of the sensitivity from its nominal value, %.
    Sensitivity,
    /// Zero-rate or zero-g offset, deg/s or mg.
    Offset,
    /// What a sensor reads of the input of another axis, %.
    CrossAxis,
    /// Largest deviation from the best straight line, % of full scale.
    Nonlinearity,
    /// One-sided noise density, deg/s/√Hz or µg/√Hz.
    NoiseDensity,
}

impl Property {
    /// Its name for people.
    pub fn name(self, sensor: Sensor) -> &'static str {
        match (self, sensor) {
            (Self::Sensitivity, _) => "sensitivity",
            (Self::Offset, Sensor::Gyro) => "zero-rate offset",
            (Self::Offset, Sensor::Accel) => "zero-g offset",
            (Self::CrossAxis, _) => "cross-axis sensitivity",
            (Self::Nonlinearity, _) => "nonlinearity",
            (Self::NoiseDensity, _) => "noise density",
        }
    }

    /// Its unit, in files and for people.
    pub fn unit(self, sensor: Sensor) -> &'static str {
        match (self, sensor) {
            (Self::Sensitivity | Self::CrossAxis, _) => "%",
            (Self::Nonlinearity, _) => "% FS",
            (Self::Offset, Sensor::Gyro) => "deg/s",
            (Self::Offset, Sensor::Accel) => "mg",
            (Self::NoiseDensity, Sensor::Gyro) => "deg/s/√Hz",
            (Self::NoiseDensity, Sensor::Accel) => "µg/√Hz",
        }
    }
}

/// A limit of a data sheet. Signs do not count.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limit {
    /// What is limited.
    pub quantity: Property,
    /// Largest magnitude, in [`Self::unit`].
    pub at_most: f64,
    /// [`Property::unit`].
    pub unit: String,
    /// Axes that it is for: some of `xyz`; absent for all.
    pub axes: Option<String>,
    /// Range that it is for, deg/s or g; absent for all.
    pub full_scale: Option<f64>,
    /// Whether the data sheet calls it typical, and so does not guarantee it.
    #[serde(default)]
    pub typical: bool,
    /// Table or page, and conditions.
    pub source: String,
}

impl Limit {
    /// Whether it is for this axis, and for this range if one is known.
    pub fn is_for(&self, axis: usize, full_scale: Option<f64>) -> bool {
        let axes = self.axes.as_ref().is_none_or(|a| a.contains(AXES[axis]));
        let range = match (self.full_scale, full_scale) {
            (Some(of), Some(used)) => (of / used - 1.0).abs() < 0.01,
            (Some(_), None) => false,
            (None, _) => true,
        };
        axes && range
    }
}

/// One sensor of a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartSensor {
    /// Full scale (deg/s or g), and counts for one deg/s or g; empty for a part that is read in other ways.
    #[serde(default)]
    pub ranges: Vec<[f64; 2]>,
    /// Limits.
    pub limits: Vec<Limit>,
}

/// A part with its limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// `mimu-part/1`.
    pub format: String,
    /// Name.
    pub name: String,
    /// Maker, document and revision.
    pub source: String,
    /// Gyro.
    pub gyro: Option<PartSensor>,
    /// Accelerometer.
    pub accel: Option<PartSensor>,
}

impl Part {
    /// The part of this name, or of this file.
    ///
    /// # Errors
    /// No part has the name; the file cannot be read, or has another format or unit.
    pub fn find(name: &str) -> Result<Self> {
        let plain = |text: &str| text.to_lowercase().replace(['-', '_', ' '], "");
        let shipped = SHIPPED.iter().find(|(known, _)| *known == plain(name));
        if let Some((known, text)) = shipped {
            return Self::parse(text, known);
        }
        let path = Path::new(name);
        if path.extension().is_some_and(|e| e == "toml") {
            return Self::parse(&read_text(path)?, name);
        }
        let names: Vec<&str> = SHIPPED.iter().map(|(known, _)| *known).collect();
        let remedy = format!("use one of {}, or a file NAME.toml", names.join(", "));
        Err(Error::new(
            "--part",
            format!("no part is called {name}"),
            remedy,
        ))
    }

    /// Parses and checks the text of a file; `place` is its path.
    ///
    /// # Errors
    /// Another format, an unknown key, or a unit that the quantity does not have.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        check_kind(text, place, "mimu-part")?;
        let part: Self = parse_toml(text, place, None)?;
        if part.format != FORMAT {
            let problem = format!(
                "format is {:?}, and this program reads {FORMAT:?}",
                part.format
            );
            let remedy = "use the version of mimu that it was written for";
            return Err(Error::new(place, problem, remedy));
        }
        for sensor in Sensor::BOTH {
            for limit in part.sensor(sensor).iter().flat_map(|s| &s.limits) {
                let unit = limit.quantity.unit(sensor);
                if limit.unit != unit || !(limit.at_most > 0.0) {
                    let name = limit.quantity.name(sensor);
                    let problem = format!(
                        "{} {}, not a positive number in {unit}",
                        limit.at_most, limit.unit
                    );
                    let place = format!("{place}, {name} of the {sensor}");
                    return Err(Error::new(place, problem, format!("write it in {unit}")));
                }
            }
        }
        Ok(part)
    }

    /// Its limits for a sensor.
    pub fn sensor(&self, sensor: Sensor) -> Option<&PartSensor> {
        sensor.pick(self.gyro.as_ref(), self.accel.as_ref())
    }
}
