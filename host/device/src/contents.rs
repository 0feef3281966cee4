//! Contents of a stored calibration: nodes and effects as [`mimu_core::stored`] reads them, as text and as a calibration file.

use mimu_core::compensation::Affine;
use mimu_core::effects::DeviceEffect;
use mimu_core::stored;
use mimu_core::table::Node;
use serde::Serialize;

use super::identity::{Hash, Identity};
use super::origin;
use mimu::calibration::{Calibration, DeviceCalibration};
use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::{Error, RawUnit, Result};

/// A stored calibration, number by number: the result of `mimu device download`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contents {
    /// Calibration file that it was written to, if any.
    pub file: Option<String>,
    /// File that the stored bytes were written to, if any.
    pub bytes_file: Option<String>,
    /// Length of the stored calibration.
    pub bytes: usize,
    /// Identifies the calibration.
    pub hash: Hash,
    /// Number of the unit that it belongs to, if given.
    pub unit_id: Option<String>,
    /// When it was made, RFC 3339, if given.
    pub created: Option<String>,
    /// SHA-256 of the samples that it was made from, if given.
    pub samples_sha256: Option<String>,
    /// When its offsets were trimmed on the device, RFC 3339, if they were.
    pub trimmed: Option<String>,
    /// `x = C u + o`.
    pub formula: &'static str,
    /// `raw to SI`.
    pub direction: &'static str,
    /// Unit of u at the sensors, if given.
    pub raw_unit: Option<&'static str>,
    /// Frame of x.
    pub frame: &'static str,
    /// Temperatures of the dies that the calibration covers, °C, if known.
    pub range_c: Option<[f32; 2]>,
    /// Lag of the dies behind the thermometer, s, if known. If the accelerometer has a separate lag, this one is the gyros'.
    pub lag_s: Option<f32>,
    /// Lag of the accelerometer's die, s, if it is separate.
    pub accel_lag_s: Option<f32>,
    /// Interpolation between the nodes: `cubic`, or `straight` in the layouts of earlier versions.
    pub between_nodes: &'static str,
    /// Temperature nodes, the coldest first.
    pub nodes: Vec<NodeContents>,
    /// Errors that the affine model lacks.
    pub effects: Vec<DeviceEffect<f32>>,
}

/// A temperature node.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NodeContents {
    /// Temperature of the dies, °C.
    pub temp_c: f32,
    /// Inverse model of the gyro.
    pub gyro: Inverse,
    /// Inverse model of the accelerometer.
    pub accel: Inverse,
    /// Slopes of the gyro's coefficients, per kelvin.
    pub gyro_slope: Inverse,
    /// Slopes of the accelerometer's coefficients, per kelvin.
    pub accel_slope: Inverse,
}

/// `x = C u + o` of a triad, raw to SI, x in the body frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[allow(non_snake_case)]
pub struct Inverse {
    /// By rows, [`Self::unit`] per raw unit.
    pub C: [[f32; 3]; 3],
    /// In [`Self::unit`].
    pub o: [f32; 3],
    /// Unit of x: rad/s or m/s^2.
    pub unit: &'static str,
}

/// Contents of `bytes`; refused if the device would refuse them.
pub fn contents(bytes: &[u8]) -> std::result::Result<Contents, stored::StoredError> {
    let (mut nodes, mut effects) = (Vec::new(), Vec::new());
    let stored = stored::read(
        bytes,
        |stored| nodes.push(node(stored)),
        |effect| effects.push(*effect),
    )?;
    let origin = stored.origin;
    let (lag_s, accel_lag_s) = lags(stored.lags_s);
    Ok(Contents {
        file: None,
        bytes_file: None,
        bytes: bytes.len(),
        hash: Hash(stored::hash(bytes)),
        unit_id: origin.unit_id.as_ref().map(origin::digits),
        created: origin.created_s.and_then(origin::date),
        samples_sha256: origin.samples_sha256.as_ref().map(origin::digits),
        trimmed: origin.trimmed_s.and_then(origin::date),
        formula: "x = C u + o",
        direction: "raw to SI",
        raw_unit: origin.raw_unit.map(stored::RawUnit::name),
        frame: "body",
        range_c: stored.compensator.table.range_c(),
        lag_s,
        accel_lag_s,
        between_nodes: "cubic",
        nodes,
        effects,
    })
}

/// The calibration file of `bytes` that [`contents`] has read, for the unit named `device`; `place` names their origin in errors. `who`: the device
/// that stores them; it names the sensors, and the raw unit if the bytes do not.
///
/// # Errors
/// Bytes that the device would refuse.
pub fn calibration(
    bytes: &[u8],
    who: Option<&Identity>,
    device: &str,
    place: &str,
) -> Result<Calibration> {
    let (mut nodes, mut effects) = (Vec::new(), Vec::new());
    let stored = stored::read(
        bytes,
        |node| nodes.push(*node),
        |effect| effects.push(*effect),
    );
    let stored = stored.map_err(|refused| {
        let problem = format!("it cannot be used: {}", refused);
        Error::device(place, problem, "upload a calibration again")
    })?;
    let origin = stored.origin;
    let stored = DeviceCalibration {
        device: device.to_owned(),
        unit_id: origin.unit_id.as_ref().map(origin::digits),
        // The device uses no calibration of other settings than its own.
        sensors: origin.settings.and(who).map(Identity::settings),
        raw_unit: match origin.raw_unit {
            Some(stored::RawUnit::Volt) => RawUnit::Volt,
            Some(stored::RawUnit::Count) => RawUnit::Count,
            None => who.map_or(Ok(RawUnit::Volt), |who| who.raw_unit(place))?,
        },
        created: origin.created_s.and_then(origin::date),
        trimmed: origin.trimmed_s.and_then(origin::date),
        sha256: origin.samples_sha256.as_ref().map(origin::digits),
        nodes,
        range_c: stored.compensator.table.range_c(),
        lags_s: stored.lags_s,
        effects,
    };
    Calibration::of_device(&stored, place)
}

/// The lag of the gyros' dies, and that of the accelerometer's if it differs, s.
fn lags(stored: Option<PerSensor<f32>>) -> (Option<f32>, Option<f32>) {
    let apart = stored.filter(|lags_s| lags_s.gyro != lags_s.accel);
    (stored.map(|s| s.gyro), apart.map(|s| s.accel))
}

fn node(node: &Node<f32>) -> NodeContents {
    let inverse = |model: &Affine<f32>, sensor: Sensor| Inverse {
        C: std::array::from_fn(|i| std::array::from_fn(|j| model.matrix[(i, j)])),
        o: model.offset.into(),
        unit: sensor.unit(),
    };
    NodeContents {
        temp_c: node.temp_c,
        gyro: inverse(&node.model.gyro, Sensor::Gyro),
        accel: inverse(&node.model.accel, Sensor::Accel),
        gyro_slope: inverse(&node.slope.gyro, Sensor::Gyro),
        accel_slope: inverse(&node.slope.accel, Sensor::Accel),
    }
}
