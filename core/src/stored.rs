//! A calibration as bytes: what is sent to the device, kept in its flash, and used.
//!
//! Little end first, `f32` as IEEE 754, matrices by rows:
//!
//! | bytes | what                                                                                              |
//! |-------|---------------------------------------------------------------------------------------------------|
//! | 4     | `mimc`                                                                                            |
//! | 2     | version of this layout, [`VERSION`]                                                               |
//! | 2     | length of everything                                                                              |
//! | 1, 1  | number of nodes (1 to [`NODES`]), of effects                                                      |
//! | 2     | zero                                                                                              |
//! | 52    | [`Origin`], zero where it is unknown: number of the unit, 12; when it was made, UTC seconds since 1970, 8; SHA-256 of the samples that it was made from, 32 |
//! | 144   | [`Directions`] of the gyro, D and R, then of the accelerometer: those of C that the effects were found with |
//! | 100   | each node: temperature, °C; C and o (rad/s) of the gyro; C and o (m/s²) of the accelerometer      |
//! | ...   | each effect, see below                                                                            |
//! | 4     | CRC-32/ISO-HDLC of everything before                                                              |
//!
//! A named effect: 0; length of the id, the id; number of coefficients, these, `f32`; its nonlinear constant (time constant, s), or 0 if
//! it has none.
//! A term: 1; triad (0 gyro, 1 accelerometer); axis; number of variables, these, a byte each as in [`Variable`]; coefficient.
//! A code: 2; triad; axis (0 to 2, or 3 for all); weight of the converter's first bit, V; reading of code 0, V; errors of nine bits in
//! units of the weight; `f32` each.
//!
//! Version 3 has no origin: it is read as a calibration of no known unit.
//!
//! Raw is volts at the sensor, as in [`RawBatch`](crate::wire::RawBatch). The noise of biases and the sigmas of the parameters are not
//! here: the device has no use for them.

mod bytes;
mod origin;

use crc::{CRC_32_ISO_HDLC, CRC_64_XZ, Crc, NoTable};
use heapless::Vec;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::compensation::{Affine, Compensation};
use crate::effects::{self, Directions, Effect, Effects, Sensor, Variable};
use crate::table::{self, Node, Table};
use bytes::{Reader, Writer};

pub use bytes::TooLong;
pub use origin::Origin;

/// Version of the layout that is written.
pub const VERSION: u16 = 4;
/// The oldest that is read.
pub const OLDEST: u16 = 3;
/// Most temperature nodes.
pub const NODES: usize = 16;
/// Most effects of a triad that run with every sample, and as many that do not.
pub const ROOM: usize = 8;
/// Most bytes of a calibration: all nodes and effects at their longest come to 4.1 kB.
pub const MAX_LENGTH: usize = 4096;

const MAGIC: [u8; 4] = *b"mimc";
const HEADER: usize = 12;
const CHECK: usize = 4;
/// Where the length stands.
const LENGTH_AT: usize = 6;
const NAMED: u8 = 0;
const TERM: u8 = 1;
const CODE: u8 = 2;
/// The axis of a code that is that of all three.
const ALL: u8 = 3;
/// Most coefficients of an effect.
const COEFFICIENTS: usize = 9;
/// Most variables of a term.
const FACTORS: usize = 3;

// Bit by bit: computed once in a while over some kB, which is not worth tables of 3 KiB.
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);
const HASH: Crc<u64, NoTable> = Crc::<u64, NoTable>::new(&CRC_64_XZ);

/// What a calibration is identified by: CRC-64/XZ over all of its bytes. Not the CRC-32 once more, which over anything that ends in its
/// own CRC-32 is always the same.
pub fn hash(bytes: &[u8]) -> u64 {
    HASH.checksum(bytes)
}

/// A calibration in use.
#[derive(Debug, Clone)]
pub struct Stored {
    /// Where it comes from.
    pub origin: Origin,
    /// Compensation over temperature.
    pub table: Table<f32, NODES>,
    /// What the affine model lacks; `None` if there are none, so that no sample pays for it.
    pub effects: Option<Effects<f32, ROOM>>,
    /// How many records of effects: errors by the code have one for each converter.
    pub effect_count: u8,
}

/// An effect as it is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Record<'a> {
    /// As in [`Effect::named`].
    Named {
        /// Public id.
        id: &'a str,
        /// All of its coefficients, SI.
        coefficients: &'a [f32],
        /// Nonlinear constant of an effect that has any: time constant, s.
        nonlinear: Option<f32>,
    },
    /// As in [`Effect::term`].
    Term {
        /// Triad.
        sensor: Sensor,
        /// 0 to 2.
        axis: u8,
        /// SI.
        coefficient: f32,
        /// One to three.
        variables: &'a [Variable],
    },
    /// As in [`Effect::code`].
    Code {
        /// Triad.
        sensor: Sensor,
        /// 0 to 2; `None`: all three alike.
        axis: Option<u8>,
        /// Of the first bit, V.
        weight: f32,
        /// Reading of code 0, V.
        zero: f32,
        /// Of nine bits, in units of the weight.
        errors: &'a [f32; COEFFICIENTS],
    },
}

/// Why bytes are not a calibration that this build can use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refused {
    /// They do not begin as a calibration does.
    NotACalibration,
    /// They end too early, or go on after the end.
    Length,
    /// Another version of the layout.
    Version {
        /// Theirs.
        found: u16,
    },
    /// The CRC does not hold.
    Check,
    /// A node is not finite or not warmer than the one before, or there are none or too many.
    Node {
        /// Which, from 0.
        at: u8,
    },
    /// C of the gyro or of the accelerometer is singular.
    Singular,
    /// An effect that this build does not know.
    EffectUnknown {
        /// Which, from 0, in the order that they were given in.
        at: u8,
    },
    /// An effect with numbers that make no sense.
    EffectValue {
        /// Which, from 0.
        at: u8,
    },
    /// More effects than there is room for.
    EffectsFull {
        /// The first that has none.
        at: u8,
    },
}

/// Writes a calibration to the beginning of `out`; returns its length. `found_with`: C of the gyro and of the accelerometer that the
/// effects were found with. What is written is not judged; [`decode`] does that.
pub fn encode(
    origin: &Origin,
    found_with: [&Matrix3<f32>; 2],
    nodes: &[Node<f32>],
    effects: &[Record<'_>],
    out: &mut [u8],
) -> Result<usize, TooLong> {
    let count = |n: usize| u8::try_from(n).map_err(|_| TooLong);
    let mut to = Writer::new(out);
    to.bytes(&MAGIC)?;
    to.u16(VERSION)?;
    to.u16(0)?;
    to.bytes(&[count(nodes.len())?, count(effects.len())?, 0, 0])?;
    origin.write(&mut to)?;
    for matrix in found_with {
        // The device inverts nothing, so a singular matrix is marked by what is no number.
        let nothing = Matrix3::repeat(f32::NAN);
        let none = Directions {
            sensed: nothing,
            to_body: nothing,
        };
        let found = Directions::of(&matrix.map(f64::from)).unwrap_or(none);
        to.matrix(&found.sensed)?;
        to.matrix(&found.to_body)?;
    }
    for node in nodes {
        to.f32(node.temp_c)?;
        for triad in [&node.model.gyro, &node.model.accel] {
            to.matrix(&triad.matrix)?;
            triad.offset.iter().try_for_each(|v| to.f32(*v))?;
        }
    }
    for effect in effects {
        match effect {
            Record::Named {
                id,
                coefficients,
                nonlinear,
            } => {
                to.bytes(&[NAMED, count(id.len())?])?;
                to.bytes(id.as_bytes())?;
                to.bytes(&[count(coefficients.len())?])?;
                coefficients.iter().try_for_each(|c| to.f32(*c))?;
                to.f32(nonlinear.unwrap_or(0.0))?;
            }
            Record::Term {
                sensor,
                axis,
                coefficient,
                variables,
            } => {
                to.bytes(&[TERM, triad(*sensor), *axis, count(variables.len())?])?;
                variables.iter().try_for_each(|v| to.bytes(&[*v as u8]))?;
                to.f32(*coefficient)?;
            }
            Record::Code {
                sensor,
                axis,
                weight,
                zero,
                errors,
            } => {
                let axis = match axis {
                    None => ALL,
                    // No axis, which must not be read as all of them.
                    Some(ALL) => u8::MAX,
                    Some(axis) => *axis,
                };
                to.bytes(&[CODE, triad(*sensor), axis])?;
                let mut numbers = [weight, zero].into_iter().chain(*errors);
                numbers.try_for_each(|v| to.f32(*v))?;
            }
        }
    }
    let length = to.length() + CHECK;
    let length_bytes = u16::try_from(length).map_err(|_| TooLong)?.to_le_bytes();
    if length > MAX_LENGTH {
        return Err(TooLong);
    }
    to.put_at(LENGTH_AT, &length_bytes)?;
    let check = CRC.checksum(to.written());
    to.bytes(&check.to_le_bytes())?;
    Ok(length)
}

fn triad(sensor: Sensor) -> u8 {
    match sensor {
        Sensor::Gyro => 0,
        Sensor::Accel => 1,
    }
}

fn sensor(triad: u8) -> Result<Sensor, effects::Refused> {
    match triad {
        0 => Ok(Sensor::Gyro),
        1 => Ok(Sensor::Accel),
        _ => Err(effects::Refused::Unknown),
    }
}

/// The calibration in `bytes`, all of them.
pub fn decode(bytes: &[u8]) -> Result<Stored, Refused> {
    read(bytes, |_| {}, |_| {})
}

/// The same, and shows each node and each effect as it is stored, which what the device computes with does not give back. Of what is
/// refused the beginning may have been shown.
pub fn read(
    bytes: &[u8],
    node: impl FnMut(&Node<f32>),
    record: impl FnMut(&Record<'_>),
) -> Result<Stored, Refused> {
    let mut from = Reader(bytes);
    if from.bytes::<4>() != Some(MAGIC) {
        return Err(Refused::NotACalibration);
    }
    let version = from.u16().ok_or(Refused::Length)?;
    if !(OLDEST..=VERSION).contains(&version) {
        return Err(Refused::Version { found: version });
    }
    let length = from.u16().ok_or(Refused::Length)?;
    if usize::from(length) != bytes.len() || bytes.len() < HEADER + CHECK {
        return Err(Refused::Length);
    }
    let (body, check) = bytes.split_last_chunk::<CHECK>().ok_or(Refused::Length)?;
    if CRC.checksum(body) != u32::from_le_bytes(*check) {
        return Err(Refused::Check);
    }
    let mut from = Reader(body.get(LENGTH_AT + 2..).ok_or(Refused::Length)?);
    let [nodes, effects, ..] = from.bytes::<4>().ok_or(Refused::Length)?;
    let origin = match version {
        OLDEST => Origin::UNKNOWN,
        _ => Origin::read(&mut from).ok_or(Refused::Length)?,
    };
    let contents = contents(&mut from, nodes, effects, node, record)?;
    Ok(Stored { origin, ..contents })
}

fn contents(
    from: &mut Reader<'_>,
    nodes: u8,
    effects: u8,
    mut show_node: impl FnMut(&Node<f32>),
    mut show_record: impl FnMut(&Record<'_>),
) -> Result<Stored, Refused> {
    let gyro = directions(from).ok_or(Refused::Length)?;
    let accel = directions(from).ok_or(Refused::Length)?;
    let mut short = false;
    let read = (0..nodes).map_while(|_| {
        let node = node(from);
        short |= node.is_none();
        node.inspect(&mut show_node)
    });
    let table = Table::new(read);
    if short {
        return Err(Refused::Length);
    }
    let table = table.map_err(|refused| Refused::Node {
        at: match refused {
            table::Refused::Count => nodes,
            table::Refused::Order(at) | table::Refused::NotFinite(at) => at as u8,
        },
    })?;

    let sum = |of: &Directions<f32>| of.sensed.iter().chain(&of.to_body).sum::<f32>();
    if !(sum(&gyro) + sum(&accel)).is_finite() {
        return Err(Refused::Singular);
    }
    let mut all = Effects::of(gyro, accel);
    for at in 0..effects {
        let effect = effect(from, &mut show_record).ok_or(Refused::Length)?;
        effect
            .and_then(|effect| all.push(effect))
            .map_err(|refused| match refused {
                effects::Refused::Unknown => Refused::EffectUnknown { at },
                effects::Refused::Full => Refused::EffectsFull { at },
                effects::Refused::Count { .. } | effects::Refused::Value => {
                    Refused::EffectValue { at }
                }
            })?;
    }
    match from.0.is_empty() {
        true => Ok(Stored {
            origin: Origin::UNKNOWN,
            table,
            effects: (effects > 0).then_some(all),
            effect_count: effects,
        }),
        false => Err(Refused::Length),
    }
}

fn directions(from: &mut Reader<'_>) -> Option<Directions<f32>> {
    Some(Directions {
        sensed: from.matrix()?,
        to_body: from.matrix()?,
    })
}

fn node(from: &mut Reader<'_>) -> Option<Node<f32>> {
    let affine = |from: &mut Reader<'_>| {
        Some(Affine {
            matrix: from.matrix()?,
            offset: Vector3::new(from.f32()?, from.f32()?, from.f32()?),
        })
    };
    Some(Node {
        temp_c: from.f32()?,
        model: Compensation {
            gyro: affine(from)?,
            accel: affine(from)?,
        },
    })
}

/// `None` if the bytes end in it.
fn effect(
    from: &mut Reader<'_>,
    mut show: impl FnMut(&Record<'_>),
) -> Option<Result<Effect<f32>, effects::Refused>> {
    let mut used = |record: Record<'_>| {
        show(&record);
        Some(record.effect())
    };
    match from.u8()? {
        NAMED => {
            let length = from.u8()?;
            let id = from.slice(usize::from(length))?;
            let count = usize::from(from.u8()?);
            let mut coefficients = Vec::<f32, COEFFICIENTS>::new();
            if coefficients.resize(count, 0.0).is_err() {
                return Some(Err(effects::Refused::Unknown));
            }
            for coefficient in &mut coefficients {
                *coefficient = from.f32()?;
            }
            let constant = from.f32()?;
            used(Record::Named {
                id: core::str::from_utf8(id).unwrap_or_default(),
                coefficients: &coefficients,
                nonlinear: (constant != 0.0).then_some(constant),
            })
        }
        TERM => {
            let [triad, axis, count] = from.bytes()?;
            let mut variables = Vec::<Variable, FACTORS>::new();
            if variables
                .resize(usize::from(count), Variable::Time)
                .is_err()
            {
                return Some(Err(effects::Refused::Count { needed: FACTORS }));
            }
            let mut known = true;
            for variable in &mut variables {
                let number = from.u8()?;
                match VARIABLES.iter().find(|v| **v as u8 == number) {
                    Some(found) => *variable = *found,
                    None => known = false,
                }
            }
            let coefficient = from.f32()?;
            match sensor(triad) {
                Ok(sensor) if known => used(Record::Term {
                    sensor,
                    axis,
                    coefficient,
                    variables: &variables,
                }),
                _ => Some(Err(effects::Refused::Unknown)),
            }
        }
        CODE => {
            let [triad, axis] = from.bytes()?;
            let (weight, zero) = (from.f32()?, from.f32()?);
            let mut errors = [0.0; COEFFICIENTS];
            for error in &mut errors {
                *error = from.f32()?;
            }
            match sensor(triad) {
                Ok(sensor) => used(Record::Code {
                    sensor,
                    axis: (axis != ALL).then_some(axis),
                    weight,
                    zero,
                    errors: &errors,
                }),
                Err(refused) => Some(Err(refused)),
            }
        }
        // Of a kind that a later version has.
        _ => Some(Err(effects::Refused::Unknown)),
    }
}

impl Record<'_> {
    /// What the device computes with.
    fn effect(&self) -> Result<Effect<f32>, effects::Refused> {
        match *self {
            Self::Named {
                id,
                coefficients,
                nonlinear,
            } => Effect::named(id, coefficients, nonlinear),
            Self::Term {
                sensor,
                axis,
                coefficient,
                variables,
            } => Effect::term(sensor, usize::from(axis), coefficient, variables),
            Self::Code {
                sensor,
                axis,
                weight,
                zero,
                errors,
            } => Effect::code(sensor, axis.map(usize::from), errors, weight, zero),
        }
    }
}

const VARIABLES: [Variable; 9] = [
    Variable::RateX,
    Variable::RateY,
    Variable::RateZ,
    Variable::ForceX,
    Variable::ForceY,
    Variable::ForceZ,
    Variable::Temperature,
    Variable::TemperatureRate,
    Variable::Time,
];
