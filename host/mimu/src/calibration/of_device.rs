//! The calibration that a device stores, converted back to a file.

use mimu_core::compensation::Affine;
use mimu_core::effects::DeviceEffect;
use mimu_core::table::Node;

use super::of_fit::{by_rows, exact_table};
use super::{
    Calibration, DieTable, NodeTable, Origin, OverTemperature, TemperatureNode, TriadTable,
    reference_node,
};
use crate::effects::fitted::FittedEffect;
use crate::quantity::{PerSensor, Sensor};
use crate::triad::Triad;
use mimu_recording::{Error, Manifest, RawUnit, Result, SensorSettings};

/// The part of a calibration that a device stores: unrounded numbers of single precision.
#[derive(Debug, Clone)]
pub struct DeviceCalibration {
    /// Name of the unit.
    pub device: String,
    /// As in [`Calibration::unit_id`].
    pub unit_id: Option<String>,
    /// As in [`Calibration::sensors`].
    pub sensors: Option<SensorSettings>,
    /// Unit of the raw readings.
    pub raw_unit: RawUnit,
    /// As in [`Calibration::created`].
    pub created: Option<String>,
    /// As in [`Calibration::trimmed`].
    pub trimmed: Option<String>,
    /// As in [`Origin::sha256`].
    pub sha256: Option<String>,
    /// Temperature nodes, the coldest first: rad/s and m/s² from raw units.
    pub nodes: Vec<Node<f32>>,
    /// As in [`OverTemperature::range_c`]; for one node, as in [`Origin::temp_range_c`].
    pub range_c: Option<[f32; 2]>,
    /// As in [`OverTemperature::lags_s`].
    pub lags_s: Option<PerSensor<f32>>,
    /// Effects. The converters of a triad's three axes are parts of one effect.
    pub effects: Vec<DeviceEffect<f32>>,
}

impl Calibration {
    /// The calibration that a device stores. It lacks what a device does not store: the uncertainty of the numbers, the reference and local gravity.
    /// The device makes the same bytes of it.
    ///
    /// # Errors
    /// An effect that this program does not know; `place` names its source.
    pub fn of_device(stored: &DeviceCalibration, place: &str) -> Result<Self> {
        let singular = || Error::new(place, "C is singular", "upload a calibration again");
        let temperatures: Vec<f64> = stored.nodes.iter().map(|n| f64::from(n.temp_c)).collect();
        let reference = reference_node(&temperatures).map(|at| stored.nodes[at]);
        let empty = || Error::new(place, "it stores no node", "upload a calibration again");
        let node = reference.ok_or_else(empty)?;
        let unknown = |effect| {
            let problem =
                format!("it stores the effect \"{effect}\", which this program does not know");
            Error::new(place, problem, "update mimu on this computer")
        };
        let triad = |model: &Affine<f32>, sensor| {
            let exact = Affine {
                matrix: model.matrix.map(f64::from),
                offset: model.offset.map(f64::from),
            };
            triad_table(&exact, sensor, stored.raw_unit, "body").ok_or_else(singular)
        };
        let temperature = over_temperature(stored);
        let range_c = stored.range_c.map(|range| range.map(f64::from));
        let recording = Origin {
            sha256: stored.sha256.clone(),
            temp_c: Some(f64::from(node.temp_c)),
            temp_range_c: range_c.filter(|_| temperature.is_none()),
            ..Origin::of(stored.raw_unit)
        };
        let calibration = Self {
            format: Self::format_of(temperature.is_some()).into(),
            unit_id: stored.unit_id.clone(),
            created: stored.created.clone(),
            trimmed: stored.trimmed.clone(),
            sensors: stored.sensors.clone(),
            gyro: Some(triad(&node.model.gyro, Sensor::Gyro)?),
            accel: Some(triad(&node.model.accel, Sensor::Accel)?),
            temperature,
            effects: FittedEffect::all_of_device(&stored.effects).map_err(unknown)?,
            ..Self::empty(&stored.device, recording)
        };
        calibration.checked(place)
    }

    /// The calibration in another program's file, whose numbers are `models`, raw to SI in the axes that `frame` names. It has no uncertainty, no date and no
    /// judgement, as the file has none.
    ///
    /// # Errors
    /// No program could apply it; `place` names the file.
    pub fn of_program(
        models: &PerSensor<Option<Affine<f64>>>,
        (device, raw_unit, frame): (&str, RawUnit, &str),
        place: &str,
    ) -> Result<Self> {
        let singular = || Error::new(place, "C is singular", "check the numbers of the file");
        let triad = |sensor: Sensor| {
            let table = |model| triad_table(model, sensor, raw_unit, frame).ok_or_else(singular);
            models[sensor].as_ref().map(table).transpose()
        };
        let calibration = Self {
            gyro: triad(Sensor::Gyro)?,
            accel: triad(Sensor::Accel)?,
            ..Self::empty(device, Origin::of(raw_unit))
        };
        calibration.checked(place)
    }

    /// The calibration that leaves readings in SI as they are.
    ///
    /// # Errors
    /// The readings are in another unit.
    pub fn of_si(manifest: &Manifest) -> Result<Self> {
        let place = format!("calibration of {}", manifest.device);
        if manifest.raw_unit != RawUnit::Si {
            let problem = format!(
                "none is given, and the readings are in {}",
                manifest.raw_unit
            );
            let remedy = "give the unit's calibration; readings in rad/s and m/s² need none";
            return Err(Error::new(place, problem, remedy));
        }
        let as_it_is = PerSensor::both(Some(Affine::identity()));
        Self::of_program(&as_it_is, (&manifest.device, RawUnit::Si, "body"), &place).map(|own| {
            Self {
                unit_id: manifest.unit_id().map(str::to_owned),
                ..own
            }
        })
    }
}

/// The nodes; `None` if there is a single one without slope and lag, which is a calibration at one temperature.
fn over_temperature(stored: &DeviceCalibration) -> Option<OverTemperature> {
    let plain = |node: &Node<f32>| *node == Node::constant(node.temp_c, node.model);
    if let ([node], None) = (stored.nodes.as_slice(), stored.lags_s)
        && plain(node)
    {
        return None;
    }
    let ends = [stored.nodes.first()?.temp_c, stored.nodes.last()?.temp_c];
    let table = |model: &Affine<f32>, slope: &Affine<f32>| NodeTable {
        C: by_rows(&model.matrix.map(f64::from)),
        o: model.offset.map(f64::from).into(),
        slope_C: by_rows(&slope.matrix.map(f64::from)),
        slope_o: slope.offset.map(f64::from).into(),
        sigma_C: None,
        sigma_o: None,
        sigma_scale_factor: None,
        sigma_bias: None,
    };
    let nodes = stored.nodes.iter().map(|node| TemperatureNode {
        temp_c: f64::from(node.temp_c),
        gyro: Some(table(&node.model.gyro, &node.slope.gyro)),
        accel: Some(table(&node.model.accel, &node.slope.accel)),
    });
    Some(OverTemperature {
        range_c: stored.range_c.unwrap_or(ends).map(f64::from),
        biases_only: false,
        dies: PerSensor::from_fn(|sensor| DieTable {
            lag_s: stored.lags_s.map(|lags_s| f64::from(lags_s[sensor])),
            ..DieTable::default()
        }),
        nodes: nodes.collect(),
    })
}

/// `None` if the matrix is singular.
fn triad_table(
    inverse: &Affine<f64>,
    sensor: Sensor,
    raw_unit: RawUnit,
    frame: &str,
) -> Option<TriadTable> {
    // Without a covariance its sigmas mean nothing, so they are left out.
    let triad = Triad::from_inverse(*inverse, Vec::new())?;
    Some(exact_table(&triad, sensor, raw_unit, frame))
}
