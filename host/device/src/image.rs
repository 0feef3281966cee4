//! Encodes a calibration file as the device stores it, and refuses files that it cannot store.

use mimu_core::compensation::{Affine, Compensation};
use mimu_core::effects::{DeviceEffect, REFERENCE_C};
use mimu_core::stored::{self, Curves, MAX_LENGTH, NODES, Origin, ROOM, Stored};
use mimu_core::table::Node;
use mimu_core::wire::Capabilities;
use nalgebra::{Matrix3, Vector3};

use super::identity::{Hash, Identity};
use super::origin;
use mimu::calibration::{Calibration, OverTemperature, reference_node};
use mimu::effects::fitted::NotOnDevice;
use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::{Argument, Error, RawUnit, Result};

/// A calibration as the device stores it.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Encoded calibration ([`mimu_core::stored`]).
    pub bytes: Vec<u8>,
    /// Identifies the calibration.
    pub hash: Hash,
    /// Unit, time and recording of the calibration.
    pub origin: Origin,
    /// Temperatures of its nodes, °C. A single node applies at all temperatures.
    pub node_temp_c: Vec<f32>,
    /// Ids of its effects.
    pub effects: Vec<String>,
    /// One sentence for each assumption.
    pub warnings: Vec<String>,
}

impl Image {
    /// The image of a calibration; `place` is its file. Refuses raw readings in other units than V and counts, which devices have; a calibration of
    /// one triad alone; and effects that the device cannot remove.
    pub fn new(calibration: &Calibration, place: &str) -> Result<Self> {
        let model = Compensation {
            gyro: model(calibration, Sensor::Gyro, place)?,
            accel: model(calibration, Sensor::Accel, place)?,
        };
        let mut warnings = Vec::new();
        let nodes = nodes(calibration, model, place, &mut warnings);
        let origin = origin::of(calibration, place, &mut warnings);
        let effects = effects_of(calibration, place)?;
        let node_temp_c: Vec<f32> = nodes.iter().map(|node| node.temp_c).collect();
        let temperature = calibration.temperature.as_ref();
        let range_c = match temperature {
            Some(of) => Some(of.range_c),
            None => calibration.recording.temp_range_c,
        };
        let curves = Curves {
            nodes: &nodes,
            range_c: range_c.map(|range| range.map(|t| t as f32)),
            lags_s: temperature
                .and_then(OverTemperature::lags_s)
                .map(|lags| lags.map(|lag| lag as f32)),
        };
        let temperatures: Vec<f64> = node_temp_c.iter().map(|t| f64::from(*t)).collect();
        let reference = reference_node(&temperatures).map_or(model, |at| nodes[at].model);
        let found_with = reference.as_ref().map(|model| &model.matrix);
        let mut bytes = vec![0; MAX_LENGTH];
        let length = stored::encode(&origin, found_with, &curves, &effects, &mut bytes);
        let length = length.map_err(|_| {
            let problem = format!("it is longer than the {MAX_LENGTH} bytes that a device stores");
            Error::new(place, problem, "use fewer effects")
        })?;
        bytes.truncate(length);
        // Anything that the device would refuse is refused here, where the message can name it.
        check_room(&effects, ROOM, place)?;
        stored::decode(&bytes).map_err(|refused| {
            let problem = format!("the device could not use it: {}", refused);
            Error::new(place, problem, "fit the recording again")
        })?;
        Ok(Self {
            hash: Hash(stored::hash(&bytes)),
            bytes,
            origin,
            node_temp_c,
            effects: calibration
                .effects()
                .iter()
                .map(|e| e.candidate.id())
                .collect(),
            warnings,
        })
    }

    /// The image of bytes that were read from a device.
    pub(super) fn stored_before(bytes: Vec<u8>) -> std::result::Result<Self, stored::StoredError> {
        let (mut node_temp_c, mut effects) = (Vec::new(), Vec::new());
        let stored = stored::read(
            &bytes,
            |node| node_temp_c.push(node.temp_c),
            |effect| effects.push(effect.to_string()),
        )?;
        Ok(Self {
            hash: Hash(stored::hash(&bytes)),
            bytes,
            origin: stored.origin,
            node_temp_c,
            effects,
            warnings: Vec::new(),
        })
    }

    /// Refuses a calibration of another unit than the greeting's.
    pub fn check_unit(&self, who: &Identity, place: &str) -> Result<()> {
        let of = self.origin.unit_id.as_ref().map(origin::digits);
        match of.filter(|of| *of != who.unit_id) {
            None => Ok(()),
            Some(of) => Err(Error::new(
                place,
                format!(
                    "it belongs to unit {of}, but the device is unit {}",
                    who.unit_id
                ),
                "upload the calibration of this unit, or confirm that another one is meant",
            )
            .about(Argument::OtherUnit)),
        }
    }

    /// Refuses readings and settings other than the device's, and effects and sizes that it cannot use, by name, before anything is sent.
    pub fn check_device(
        &self,
        calibration: &Calibration,
        who: &Identity,
        place: &str,
    ) -> Result<()> {
        let refuse = |at: String, problem: String| {
            let remedy = "flash newer firmware, or diagnose without it";
            Err(Error::new(at, problem, remedy))
        };
        let of_device = |problem: String| {
            let remedy = "calibrate from a recording of the device (`mimu record`)";
            Err(Error::new(place, problem, remedy))
        };
        let (ours, unit) = (calibration.recording.raw_unit, who.raw_unit(place)?);
        if ours != unit {
            let problem =
                format!("it is for raw readings in {ours}, but the device's are in {unit}");
            return of_device(problem);
        }
        if let Some(problem) = calibration.other_setting(Some(&who.settings())) {
            return of_device(problem);
        }
        for id in &self.effects {
            let at = || format!("{place}, [[effect]] {id}");
            let removed = match id.starts_with("term:") {
                true => who.capabilities.contains(Capabilities::TERMS),
                false => who.effects.contains(&id.as_str()),
            };
            if !removed {
                let problem = format!("the device (firmware {}) cannot remove it", who.firmware);
                return refuse(at(), problem);
            }
        }
        let effects = effects_of(calibration, place)?;
        check_room(&effects, usize::from(who.room.effects), place)?;
        let (nodes, room) = (
            self.node_temp_c.len(),
            usize::from(who.room.nodes).min(NODES),
        );
        if nodes > room {
            return refuse(
                place.into(),
                format!("it has {nodes} temperature nodes, but the device has room for {room}"),
            );
        }
        let (length, room) = (self.bytes.len(), who.room.bytes);
        if length > room as usize {
            return refuse(
                place.into(),
                format!("it needs {length} bytes, but the device has room for {room}"),
            );
        }
        Ok(())
    }

    /// The calibration as the device decodes it.
    pub fn stored(&self) -> std::result::Result<Stored, stored::StoredError> {
        stored::decode(&self.bytes)
    }
}

/// The nodes of a calibration: those of its curves, or a single one with the model `at_all` for all temperatures.
fn nodes(
    calibration: &Calibration,
    at_all: Compensation<f32>,
    place: &str,
    warnings: &mut Vec<String>,
) -> Vec<Node<f32>> {
    let Some(temperature) = &calibration.temperature else {
        let temp_c = calibration.recording.temp_c.unwrap_or_else(|| {
            warnings.push(format!(
                "{place}: its temperature is unknown; the device uses it at all temperatures and lists it at {REFERENCE_C} °C"
            ));
            REFERENCE_C
        });
        return vec![Node::constant(temp_c as f32, at_all)];
    };
    let single = |model: Affine<f64>| Affine {
        matrix: model.matrix.map(|x| x as f32),
        offset: model.offset.map(|x| x as f32),
    };
    let nodes = temperature.nodes.iter().map(|node| {
        let mut all = Node::constant(node.temp_c as f32, at_all);
        for (table, model, slope) in [
            (&node.gyro, &mut all.model.gyro, &mut all.slope.gyro),
            (&node.accel, &mut all.model.accel, &mut all.slope.accel),
        ] {
            if let Some(table) = table {
                (*model, *slope) = (single(table.model()), single(table.slope()));
            }
        }
        all
    });
    nodes.collect()
}

/// Inverse model of a triad.
fn model(calibration: &Calibration, sensor: Sensor, place: &str) -> Result<Affine<f32>> {
    let at = || format!("{place}, [{sensor}]");
    let Some(table) = calibration.table(sensor) else {
        let problem = "it is missing, and the device needs both sensors";
        return Err(Error::new(at(), problem, "calibrate both sensors"));
    };
    if table.raw_unit == RawUnit::Si {
        return Err(Error::new(
            at(),
            format!(
                "raw_unit is \"{}\", but a device measures V or counts",
                table.raw_unit
            ),
            "calibrate from a recording of the device (`mimu record`)",
        ));
    }
    let single = |x: f64| x as f32;
    Ok(Affine {
        matrix: Matrix3::from_fn(|i, j| single(table.C[i][j])),
        offset: Vector3::from(table.o.map(single)),
    })
}

/// The effects of a calibration in the device's representation. Refuses, by name, an effect that the device cannot remove.
pub(super) fn effects_of(calibration: &Calibration, place: &str) -> Result<Vec<DeviceEffect<f32>>> {
    let parts = calibration.effects().iter().map(|effect| {
        effect.on_device().map_err(|why| {
            let at = format!("{place}, [[effect]] {}", effect.id());
            let remedy = match why {
                NotOnDevice::Numbers(_) => "diagnose the recording again",
                _ => "use a calibration without it, or apply it on the PC only",
            };
            Error::new(at, why.to_string(), remedy)
        })
    });
    parts.collect()
}

/// Refuses the first effect that does not fit into `room`, counted for each triad separately for effects with every sample and for slow ones.
fn check_room(effects: &[DeviceEffect<f32>], room: usize, place: &str) -> Result<()> {
    let mut taken = PerSensor::both([0; 2]);
    for effect in effects {
        let count = &mut taken[effect.sensor()][usize::from(effect.is_slow())];
        *count += 1;
        if *count > room {
            let at = format!("{place}, [[effect]] {effect}");
            let problem = format!("the device has room for {room} effects of a kind and triad");
            return Err(Error::new(at, problem, "use a calibration without it"));
        }
    }
    Ok(())
}
