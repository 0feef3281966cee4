//! A calibration file as the bytes that the device stores, and what stands in the way of it.

use mimu_core::compensation::{Affine, Compensation};
use mimu_core::effects::{Effect, REFERENCE_C, Sensor as DeviceSensor};
use mimu_core::stored::{self, MAX_LENGTH, NODES, ROOM, Record, Stored};
use mimu_core::table::Node;
use mimu_core::wire::{Capabilities, EFFECTS};
use nalgebra::{Matrix3, Vector3};

use super::who::{Who, unusable};
use crate::calibration::{Calibration, device_variable};
use crate::diagnose::candidate::{Kind, OfConverter};
use crate::diagnose::library::readout::BITS;
use crate::diagnose::removal::Removed;
use crate::dwell::Sensor;
use crate::error::{Error, Result};
use crate::recording::RawUnit;

/// A calibration as the device stores it.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// What is sent: see [`mimu_core::stored`].
    pub bytes: Vec<u8>,
    /// What it is told apart by.
    pub hash: u64,
    /// Temperatures of its nodes, °C. A single one is for all temperatures.
    pub node_temp_c: Vec<f32>,
    /// Ids of its effects.
    pub effects: Vec<String>,
    /// One sentence for each thing that had to be assumed.
    pub warnings: Vec<String>,
}

/// An effect, or a converter of one, in the words of the device.
#[derive(Debug, Clone)]
struct OnDevice {
    id: String,
    sensor: DeviceSensor,
    /// All coefficients of a named effect, or the one of a term; none of a converter.
    numbers: Vec<f32>,
    what: What,
}

#[derive(Debug, Clone)]
enum What {
    Named(Option<f32>),
    Code(Code),
    Term(u8, Vec<mimu_core::effects::Variable>),
}

/// Errors of a converter.
#[derive(Debug, Clone)]
struct Code {
    axis: Option<u8>,
    /// Weight of its first bit, V.
    weight: f32,
    /// Reading of its code 0, V.
    zero: f32,
    /// Of its bits, in units of the weight.
    errors: [f32; BITS],
}

impl Image {
    /// The image of a calibration of one temperature; `place` is its file. Refused: raw readings in anything but volts, which are
    /// what the device measures, one triad alone, and effects that no device removes.
    pub fn new(calibration: &Calibration, place: &str) -> Result<Self> {
        let models = [Sensor::Gyro, Sensor::Accel].map(|sensor| model(calibration, sensor, place));
        let [gyro, accel] = models;
        let model = Compensation {
            gyro: gyro?,
            accel: accel?,
        };
        let mut warnings = Vec::new();
        let temp_c = calibration.recording.temp_c.unwrap_or_else(|| {
            warnings.push(format!(
                "{place}: the temperature is not known; the device uses the calibration at all of them, and lists it at {REFERENCE_C} °C"
            ));
            REFERENCE_C
        });
        let effects: Vec<OnDevice> = calibration
            .effects()
            .iter()
            .map(|removed| on_device(removed, place))
            .collect::<Result<Vec<_>>>()?
            .concat();
        let records: Vec<Record<'_>> = effects.iter().map(OnDevice::record).collect();
        let node = Node {
            temp_c: temp_c as f32,
            model,
        };
        let mut bytes = vec![0; MAX_LENGTH];
        let found_with = [&model.gyro.matrix, &model.accel.matrix];
        let length = stored::encode(found_with, &[node], &records, &mut bytes).map_err(|_| {
            let problem = format!("it is longer than the {MAX_LENGTH} bytes that a device stores");
            Error::new(place, problem, "use fewer effects")
        })?;
        bytes.truncate(length);
        // What would be refused over there is refused here, and by its name.
        check_room(&effects, ROOM, place)?;
        stored::decode(&bytes).map_err(|refused| {
            let problem = format!("the device could not use it: {}", unusable(&refused));
            Error::new(place, problem, "fit the recording again")
        })?;
        Ok(Self {
            hash: stored::hash(&bytes),
            bytes,
            node_temp_c: vec![node.temp_c],
            effects: calibration
                .effects()
                .iter()
                .map(|e| e.candidate.id())
                .collect(),
            warnings,
        })
    }

    /// Refuses what the device of this greeting could not use, by the name of the effect: before anything is sent.
    pub fn check_device(&self, calibration: &Calibration, who: &Who, place: &str) -> Result<()> {
        let refuse = |at: String, problem: String| {
            let remedy = "flash newer firmware, or diagnose without it";
            Err(Error::new(at, problem, remedy))
        };
        if who.raw_unit != "V" {
            let unit = &who.raw_unit;
            let problem = format!("it is for raw readings in V, and the device's are in {unit}");
            return refuse(place.into(), problem);
        }
        for id in &self.effects {
            let at = || format!("{place}, [[effect]] {id}");
            let removed = match id.starts_with("term:") {
                true => who.capabilities.contains(Capabilities::TERMS),
                false => who.effect_ids().contains(&id.as_str()),
            };
            if !removed {
                let problem = format!("the device (firmware {}) cannot remove it", who.firmware);
                return refuse(at(), problem);
            }
        }
        let effects: Vec<OnDevice> = calibration
            .effects()
            .iter()
            .map(|removed| on_device(removed, place))
            .collect::<Result<Vec<_>>>()?
            .concat();
        check_room(&effects, usize::from(who.effects_room), place)?;
        let (nodes, room) = (
            self.node_temp_c.len(),
            usize::from(who.nodes_room).min(NODES),
        );
        if nodes > room {
            return refuse(
                place.into(),
                format!("it has {nodes} temperature nodes, and the device has room for {room}"),
            );
        }
        let (length, room) = (self.bytes.len(), who.stored_room);
        if length > room as usize {
            return refuse(
                place.into(),
                format!("it takes {length} bytes, and the device has room for {room}"),
            );
        }
        Ok(())
    }

    /// The same calibration as the device computes with it.
    pub fn stored(&self) -> std::result::Result<Stored, stored::Refused> {
        stored::decode(&self.bytes)
    }
}

/// Inverse model of a triad, raw in V.
fn model(calibration: &Calibration, sensor: Sensor, place: &str) -> Result<Affine<f32>> {
    let at = || format!("{place}, [{sensor}]");
    let Some(table) = calibration.table(sensor) else {
        let problem = "it is not there, and the device needs both sensors";
        return Err(Error::new(at(), problem, "calibrate both sensors"));
    };
    if table.raw_unit != RawUnit::Volt {
        return Err(Error::new(
            at(),
            format!(
                "raw_unit is \"{}\", and the device measures V",
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

fn on_device(removed: &Removed, place: &str) -> Result<Vec<OnDevice>> {
    let candidate = &removed.candidate;
    let id = candidate.id();
    let none = |problem: &str| {
        Err(Error::new(
            format!("{place}, [[effect]] {id}"),
            problem,
            "use the calibration without it, on the PC alone",
        ))
    };
    let sensor = match candidate.sensor {
        Sensor::Gyro => DeviceSensor::Gyro,
        Sensor::Accel => DeviceSensor::Accel,
    };
    let (numbers, what) = match &candidate.kind {
        Kind::Effect(effect) => {
            if !EFFECTS.contains(&effect.id) {
                return none("no device removes this effect");
            }
            if candidate.reads_code() {
                let of = |c: OfConverter| OnDevice {
                    id: id.clone(),
                    sensor,
                    numbers: Vec::new(),
                    what: What::Code(Code {
                        axis: c.axis.map(|axis| axis as u8),
                        weight: c.converter.weight as f32,
                        zero: c.converter.zero as f32,
                        errors: c.errors.map(|e| e as f32),
                    }),
                };
                let all = candidate.by_converter(&removed.values);
                return Ok(all.into_iter().map(of).collect());
            }
            let mut all = vec![0.0; effect.coefficients.len()];
            for (k, value) in candidate.active.iter().zip(&removed.values) {
                all[*k] = *value as f32;
            }
            let form = effect.form.map(|_| removed.form as f32);
            (all, What::Named(form))
        }
        Kind::Term(axis, monomial) => {
            let variables = monomial.0.iter().map(|v| device_variable(*v)).collect();
            let value = removed.values.first().copied().unwrap_or_default();
            (vec![value as f32], What::Term(*axis as u8, variables))
        }
        Kind::Jump { .. } => {
            return none("a bias that has jumped once says nothing of the time after it");
        }
    };
    Ok(vec![OnDevice {
        id,
        sensor,
        numbers,
        what,
    }])
}

impl OnDevice {
    fn record(&self) -> Record<'_> {
        match &self.what {
            What::Named(form) => Record::Named {
                id: &self.id,
                coefficients: &self.numbers,
                form: *form,
            },
            What::Code(code) => Record::Code {
                sensor: self.sensor,
                axis: code.axis,
                weight: code.weight,
                zero: code.zero,
                errors: &code.errors,
            },
            What::Term(axis, variables) => Record::Term {
                sensor: self.sensor,
                axis: *axis,
                coefficient: self.numbers[0],
                variables,
            },
        }
    }

    fn effect(&self) -> std::result::Result<Effect<f32>, mimu_core::effects::Refused> {
        match &self.what {
            What::Named(form) => Effect::named(&self.id, &self.numbers, *form),
            What::Code(code) => Effect::code(
                self.sensor,
                code.axis.map(usize::from),
                &code.errors,
                code.weight,
                code.zero,
            ),
            What::Term(axis, variables) => {
                Effect::term(self.sensor, usize::from(*axis), self.numbers[0], variables)
            }
        }
    }
}

/// Refuses the first effect that has no room among `room` of its triad and kind: with every sample, or with temperature and time only.
fn check_room(effects: &[OnDevice], room: usize, place: &str) -> Result<()> {
    let mut taken = [[0; 2]; 2];
    for effect in effects {
        let at = format!("{place}, [[effect]] {}", effect.id);
        let Ok(compiled) = effect.effect() else {
            let problem = "its numbers make no sense to the device";
            return Err(Error::new(at, problem, "diagnose the recording again"));
        };
        // Of these each axis has room for one, and a file that has two for an axis was refused.
        if matches!(effect.what, What::Code(..)) {
            continue;
        }
        let triad = usize::from(effect.sensor == DeviceSensor::Accel);
        let count = &mut taken[triad][usize::from(compiled.is_slow())];
        *count += 1;
        if *count > room {
            let problem = format!("the device has room for {room} effects of a kind and triad");
            return Err(Error::new(at, problem, "use the calibration without it"));
        }
    }
    Ok(())
}

/// Whether the effects of these ids remember what was before, so that a comparison that begins in the middle cannot know it: the
/// temperature of some minutes ago, in lags and in its rate of change.
pub fn remembers(id: &str) -> bool {
    id.ends_with("_thermal_lag") || id.contains("temp_rate")
}
