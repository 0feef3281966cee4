//! Biases over temperature of a unit that was recorded at rest only: the change of its readings, without the scale factors of a calibration.
//!
//! The file has its own `format` instead of being a calibration with a mark. Without C nothing can be applied, and whoever overlooks the mark would
//! apply a C of ones. Every command that reads a calibration refuses the file by its name ([`refusal`]). The formats of autopilots, which compensate
//! only the bias over temperature, accept it.

use mimu_core::compensation::{Affine, Compensation};
use mimu_core::stored::NODES;
use mimu_core::table::{Node, Table};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::check::{problem_of_range, problem_of_temperature};
use super::{DieTable, Origin};
use crate::judgement::Judgement;
use crate::quantity::{PerSensor, Sensor};
use mimu_recording::{Error, Result, parse_toml};

/// Version of the layout.
pub const FORMAT: &str = "mimu-thermal-biases/1";

const HEADER: &str = "\
# Biases over temperature of a unit at rest, and nothing else: scale factors and misalignments were not estimated, so this is no calibration.
# `mimu export px4` and `mimu export ardupilot` take it; with the unit's calibration at one temperature, `mimu thermal fit --base` makes one.
# u is the raw reading at rest, by the temperature of the dies: the bias, with the Earth's rate or with gravity in the pose of the recording.
# Between two nodes, h apart, with w from 0 to 1, a reading and its slope s (per kelvin) are
#   (1+2w)(1-w)^2 u0 + w^2(3-2w) u1 + h w(1-w)^2 s0 - h w^2(1-w) s1.
# sigma_u is a standard deviation. hysteresis: rms and largest of what heating and cooling differ by, raw.
";

/// A file of biases over temperature.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThermalBiases {
    /// `mimu-thermal-biases/1`.
    pub format: String,
    /// Unit that it is for.
    pub device: String,
    /// The unit's own number, if it is known.
    pub unit_id: Option<String>,
    /// When it was made, RFC 3339.
    pub created: String,
    /// Program and version that made it.
    pub tool: String,
    /// The judgement of the curves.
    pub judgement: Judgement,
    /// Rms error of the curves, raw: of unseen data, or of the fitted ones where nothing was held out.
    #[serde(default)]
    pub rms: PerSensor<Option<f64>>,
    /// Dies' temperatures in the recordings that it was fitted to, °C.
    pub range_c: [f64; 2],
    /// The recording that it was made from.
    pub recording: Origin,
    /// What is known of the dies of each triad. Its hysteresis is raw.
    #[serde(default)]
    pub dies: PerSensor<DieTable>,
    /// One to sixteen, the coldest first.
    #[serde(rename = "node", default)]
    pub nodes: Vec<BiasNode>,
}

/// Readings at rest at one temperature of the dies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BiasNode {
    /// °C.
    pub temp_c: f64,
    /// Of the gyro.
    pub gyro: Option<RestReading>,
    /// Of the accelerometer.
    pub accel: Option<RestReading>,
}

/// Reading of a triad at rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RestReading {
    /// Raw.
    pub u: [f64; 3],
    /// Derivatives by the temperature, raw per kelvin.
    pub slope_u: [f64; 3],
    /// Standard deviations of u.
    pub sigma_u: [f64; 3],
}

/// The readings at all temperatures, to be evaluated many times.
#[derive(Debug, Clone)]
pub struct RestCurves(Table<f64, NODES>);

impl RestCurves {
    /// Reading of `sensor` at this temperature of the dies, °C: raw.
    pub fn reading(&self, sensor: Sensor, die_c: f64) -> Vector3<f64> {
        let mut state = self.0.state();
        self.0.follow(&mut state, PerSensor::both(die_c));
        state.model[sensor].offset
    }
}

/// The error if a calibration is expected and the file at `place` is one of biases.
pub fn refusal(place: &str) -> Error {
    Error::new(
        place,
        format!(
            "it contains biases over temperature alone ({FORMAT}), without scale factors and misalignments"
        ),
        "export it to px4 or ardupilot, or make a calibration of the recording: mimu thermal fit REC --base FILE",
    )
}

/// Whether `text` is such a file, of any version.
pub fn is_one(text: &str) -> bool {
    #[derive(Deserialize)]
    struct Format {
        format: String,
    }
    let read: std::result::Result<Format, _> = toml::from_str(text);
    let name = FORMAT.split('/').next().unwrap_or(FORMAT);
    read.is_ok_and(|r| r.format.split('/').next() == Some(name))
}

impl BiasNode {
    /// The reading of `sensor`.
    pub fn reading(&self, sensor: Sensor) -> Option<&RestReading> {
        sensor.pick(self.gyro.as_ref(), self.accel.as_ref())
    }
}

impl ThermalBiases {
    /// Parses and checks the text of a file; `place` is its path.
    ///
    /// # Errors
    /// Another version; what is no file of biases; numbers that cannot be evaluated.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        let read: Self = parse_toml(text, place, Some("fit the recordings again"))?;
        read.checked(place)
    }

    /// Text of the file, for programs and for people.
    pub fn to_toml(&self) -> String {
        crate::toml_layout::to_toml(HEADER, self)
    }

    /// Whether it has readings of `sensor`.
    pub fn has(&self, sensor: Sensor) -> bool {
        self.nodes.iter().any(|node| node.reading(sensor).is_some())
    }

    /// The readings over temperature. A sensor without any reads zero.
    ///
    /// # Errors
    /// Nodes that cannot be evaluated; those of a [parsed](Self::parse) file always can.
    pub fn curves(&self) -> Result<RestCurves> {
        self.table().map_err(|problem| wrong("nodes", problem))
    }

    fn table(&self) -> std::result::Result<RestCurves, String> {
        let offset = |offset: [f64; 3]| Affine {
            matrix: Matrix3::zeros(),
            offset: Vector3::from(offset),
        };
        let both = |node: &BiasNode, of: fn(&RestReading) -> [f64; 3]| {
            Compensation::from_fn(|sensor| offset(node.reading(sensor).map_or([0.0; 3], of)))
        };
        let nodes = self.nodes.iter().map(|node| Node {
            temp_c: node.temp_c,
            model: both(node, |r| r.u),
            slope: both(node, |r| r.slope_u),
        });
        let table = Table::new(nodes).and_then(|table| table.with_range(self.range_c));
        table.map(RestCurves).map_err(|refused| refused.to_string())
    }

    /// This file, if it can be evaluated; `place` is its path.
    ///
    /// # Errors
    /// Another version; numbers that cannot be evaluated.
    pub fn checked(self, place: &str) -> Result<Self> {
        let refuse = |problem: String| Err(wrong(place, problem));
        if self.format != FORMAT {
            let problem = format!(
                "format is {:?}, and this program reads {FORMAT:?}",
                self.format
            );
            let remedy = "use the version of mimu that wrote it";
            return Err(Error::new(place, problem, remedy));
        }
        if let Some(problem) = problem_of_range("range_c", self.range_c) {
            return refuse(problem);
        }
        if !(self.has(Sensor::Gyro) || self.has(Sensor::Accel)) {
            return refuse("no node has a reading of gyro or accel".into());
        }
        for (k, node) in self.nodes.iter().enumerate() {
            let number = k + 1;
            if let Some(problem) = problem_of_temperature(node.temp_c) {
                return refuse(format!("node {number}: {problem}"));
            }
            for sensor in Sensor::BOTH {
                let reading = node.reading(sensor);
                if self.has(sensor) && reading.is_none() {
                    return refuse(format!(
                        "node {number} has no [{sensor}], and another node has"
                    ));
                }
                let mut sigmas = reading.iter().flat_map(|r| r.sigma_u);
                if !sigmas.all(|s| s.is_finite() && s >= 0.0) {
                    return refuse(format!(
                        "sigma_u of {sensor} in node {number} has an entry that cannot be a standard deviation"
                    ));
                }
            }
        }
        match self.table() {
            Ok(_) => Ok(self),
            Err(problem) => refuse(problem),
        }
    }
}

fn wrong(place: &str, problem: String) -> Error {
    Error::new(place, problem, "fit the recordings again")
}
