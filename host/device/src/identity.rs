//! The device's identity: an owned copy of its greeting.

use std::fmt;

use serde::{Serialize, Serializer};

use mimu_core::compensation::Affine;
use mimu_core::wire::{
    Capabilities, Compatibility, EFFECTS, Greeting, MAGIC, PROTOCOL, Slot, Start, Triad, Version,
    WrongRegister, compatibility,
};
use nalgebra::{Matrix3, Vector3};

use super::origin;
use super::reading::shortest;
use mimu::quantity::PerSensor;
use mimu_recording::{Error, RawUnit, Result, SensorSetting, SensorSettings};

/// An owned copy of a [`Greeting`]: the result of `mimu device info`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identity {
    /// Version of the protocol.
    pub protocol: Version,
    /// Version of the firmware.
    pub firmware: String,
    /// Name of the board.
    pub board: String,
    /// The microcontroller's own number, 24 hexadecimal digits.
    pub unit_id: String,
    /// Optional functions of the firmware; by name in JSON.
    #[serde(serialize_with = "named")]
    pub capabilities: Capabilities,
    /// Ids of the effects that the firmware compensates.
    pub effects: Vec<&'static str>,
    /// Largest calibration that it stores.
    pub room: Room,
    /// Samples per second by the board's crystal.
    pub sample_rate_hz: f64,
    /// Unit of a raw reading.
    pub raw_unit: String,
    /// The sensors.
    pub sensors: PerSensor<TriadInfo>,
    /// Places of the thermometers, in the order of their temperatures.
    pub thermometers: Vec<String>,
    /// The last reset cause.
    pub start: Started,
    /// Starts since the last power failure, including this one.
    pub starts: u32,
    /// The calibration in use.
    pub stored: Option<StoredCalibration>,
    /// Contents of the two slots for a calibration, in words.
    pub slots: [String; 2],
    /// Time since power-on at the start of sampling, ms; `None` if the device does not know it.
    pub powered_for_ms: Option<u32>,
    /// Level of the brown-out reset, 0 to 3, by the microcontroller's option bytes; `None` if the device does not tell.
    pub brown_out_level: Option<u8>,
    /// Whether the banks of its flash are swapped, so that it stores nothing.
    pub banks_swapped: bool,
    /// Register of the sensor that reads otherwise than it must, so that the device does not sample; `None` if there is none.
    pub wrong_register: Option<WrongRegister>,
    /// Samples per second by the data sheet; `None` if the device does not tell.
    pub nominal_rate_hz: Option<f64>,
    /// Whether [`Self::sample_rate_hz`] is measured; an older device does not tell, and counts as one that has.
    pub rate_measured: bool,
    /// Sentences: if the device is older or newer but compatible, on the places of its calibrations, if it cannot store.
    pub warnings: Vec<String>,
}

/// A triad of sensors: what its readings are, by the board.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TriadInfo {
    /// Name of the part.
    pub part: String,
    /// Unit of a raw reading.
    pub unit: String,
    /// Bits of a reading, with its sign.
    pub bits: u8,
    /// Largest input, rad/s or m/s².
    pub range: f64,
    /// Raw reading without an input.
    pub null: f64,
    /// Nominal scale factor: raw units per rad/s or per m/s².
    pub per_si: f64,
    /// Filters and rate as they are set.
    pub filter: String,
}

impl From<&Triad<'_>> for TriadInfo {
    fn from(triad: &Triad<'_>) -> Self {
        Self {
            part: triad.part.into(),
            unit: triad.unit.into(),
            bits: triad.bits,
            range: shortest(triad.range),
            null: shortest(triad.null),
            per_si: shortest(triad.per_si),
            filter: triad.filter.into(),
        }
    }
}

impl TriadInfo {
    /// Inverse model by the data sheet, raw to SI.
    pub fn nominal(&self) -> Affine<f64> {
        Affine {
            matrix: Matrix3::identity() / self.per_si,
            offset: Vector3::repeat(-self.null / self.per_si),
        }
    }

    fn setting(&self) -> SensorSetting {
        SensorSetting {
            part: self.part.clone(),
            bits: self.bits,
            range: self.range,
            filter: self.filter.clone(),
        }
    }
}

/// Largest calibration that a device stores.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Room {
    /// Effects of each triad that run with every sample, and as many slow ones.
    pub effects: u8,
    /// Number of temperature nodes.
    pub nodes: u8,
    /// Length of a calibration, bytes.
    pub bytes: u32,
}

/// The calibration in use, from the device's greeting.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StoredCalibration {
    /// Identifies the calibration.
    pub hash: Hash,
    /// Length, bytes.
    pub bytes: u32,
    /// Number of temperature nodes.
    pub nodes: u8,
    /// Number of effects.
    pub effects: u8,
    /// Number of the unit that it belongs to, if given.
    pub unit_id: Option<String>,
    /// When it was made, RFC 3339, if given.
    pub created: Option<String>,
}

/// Hash that identifies a calibration. In JSON it has 16 hexadecimal digits, because many programs read numbers with 53 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hash(pub u64);

impl fmt::Display for Hash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

impl Serialize for Hash {
    fn serialize<S: Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

/// The device's last reset cause: an owned copy of [`Start`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "reason", rename_all = "kebab-case")]
pub enum Started {
    /// Power was switched on, or had been too low.
    PowerOn,
    /// The reset pin.
    ResetPin,
    /// The watchdog.
    Watchdog,
    /// The firmware requested it.
    Software,
    /// A panic.
    Panic {
        /// End of the source file's path.
        file: String,
        /// Line.
        line: u32,
    },
    /// A fault of the processor.
    Fault {
        /// Address of the instruction.
        pc: u32,
        /// The fault status register CFSR.
        cfsr: u32,
    },
    /// Another cause.
    Other,
    /// A cause that this program does not know.
    NotKnown,
}

impl fmt::Display for Started {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PowerOn => f.write_str("power-on"),
            Self::ResetPin => f.write_str("reset pin"),
            Self::Watchdog => f.write_str("watchdog: the program stopped sampling"),
            Self::Software => f.write_str("restarted by the program"),
            Self::Panic { file, line } => write!(f, "panic in {file}, line {line}"),
            Self::Fault { pc, cfsr } => write!(f, "fault at {pc:#010x}, CFSR {cfsr:#010x}"),
            Self::Other => f.write_str("unknown"),
            Self::NotKnown => f.write_str("a cause that this program does not know"),
        }
    }
}

impl From<Start<'_>> for Started {
    fn from(start: Start<'_>) -> Self {
        match start {
            Start::PowerOn => Self::PowerOn,
            Start::ResetPin => Self::ResetPin,
            Start::Watchdog => Self::Watchdog,
            Start::Software => Self::Software,
            Start::Panic { file, line } => Self::Panic {
                file: file.into(),
                line,
            },
            Start::Fault { pc, cfsr } => Self::Fault { pc, cfsr },
            Start::Other => Self::Other,
            Start::NotKnown => Self::NotKnown,
        }
    }
}

impl From<&Greeting<'_>> for Identity {
    fn from(greeting: &Greeting<'_>) -> Self {
        Self {
            protocol: greeting.protocol,
            firmware: greeting.firmware.into(),
            board: greeting.board.into(),
            unit_id: origin::digits(&greeting.unit_id),
            capabilities: greeting.capabilities,
            effects: EFFECTS
                .iter()
                .enumerate()
                .filter(|(bit, _)| greeting.effects >> bit & 1 == 1)
                .map(|(_, id)| *id)
                .collect(),
            room: Room {
                effects: greeting.effects_room,
                nodes: greeting.nodes_room,
                bytes: greeting.stored_room,
            },
            sample_rate_hz: shortest(greeting.triads.gyro.rate_hz),
            raw_unit: greeting.triads.gyro.unit.into(),
            sensors: greeting.triads.as_ref().map(TriadInfo::from),
            thermometers: greeting
                .thermometers
                .split_terminator(',')
                .map(str::to_owned)
                .collect(),
            start: greeting.start.into(),
            starts: greeting.starts,
            stored: greeting.stored.map(|held| StoredCalibration {
                hash: Hash(held.hash),
                bytes: held.length,
                nodes: held.nodes,
                effects: held.effects,
                unit_id: Some(held.unit_id)
                    .filter(|id| *id != [0; 12])
                    .map(|id| origin::digits(&id)),
                created: Some(held.created_s)
                    .filter(|s| *s != 0)
                    .and_then(origin::date),
            }),
            slots: greeting.slots.each_ref().map(slot),
            powered_for_ms: greeting.powered_for_ms,
            brown_out_level: greeting.brown_out_level,
            banks_swapped: greeting.banks_swapped,
            wrong_register: greeting.wrong_register,
            nominal_rate_hz: nominal_hz(greeting),
            rate_measured: greeting.rate_measured || nominal_hz(greeting).is_none(),
            warnings: version_warning(greeting.protocol)
                .into_iter()
                .chain(slot_warnings(&greeting.slots))
                .chain(greeting.banks_swapped.then(|| SWAPPED.to_owned()))
                .chain(wrong_register(greeting))
                .chain(clock_off(greeting))
                .collect(),
        }
    }
}

impl Identity {
    /// Unit of the raw readings. Both triads have the same.
    ///
    /// # Errors
    /// A unit that this program does not know, or two; `place` names the device.
    pub fn raw_unit(&self, place: &str) -> Result<RawUnit> {
        let PerSensor { gyro, accel } = &self.sensors;
        match (gyro.unit.as_str(), accel.unit.as_str()) {
            ("V", "V") => Ok(RawUnit::Volt),
            ("count", "count") => Ok(RawUnit::Count),
            (gyro, accel) => Err(Error::device(
                place,
                format!(
                    "its gyro is in {gyro:?} and its accelerometer in {accel:?}, but a recording is in V or in counts"
                ),
                "update mimu on this computer",
            )),
        }
    }

    /// The sensors as they are set: what a calibration belongs to.
    pub fn settings(&self) -> SensorSettings {
        SensorSettings {
            gyro: self.sensors.gyro.setting(),
            accel: self.sensors.accel.setting(),
        }
    }

    /// Inverse models of gyro and accelerometer by the data sheets, raw to SI, for a board without a calibration.
    pub fn nominal(&self) -> [Affine<f64>; 2] {
        [self.sensors.gyro.nominal(), self.sensors.accel.nominal()]
    }

    /// Hash of the stored calibration.
    pub fn stored_hash(&self) -> Option<Hash> {
        self.stored.as_ref().map(|s| s.hash)
    }

    /// Names of the optional functions.
    pub fn capability_names(&self) -> Vec<&'static str> {
        names(self.capabilities).collect()
    }
}

fn named<S: Serializer>(of: &Capabilities, to: S) -> std::result::Result<S::Ok, S::Error> {
    to.collect_seq(names(*of))
}

fn names(of: Capabilities) -> impl Iterator<Item = &'static str> {
    [
        (Capabilities::TEMPERATURE_NODES, "temperature nodes"),
        (Capabilities::TERMS, "terms"),
        (Capabilities::KALMAN, "kalman"),
        (Capabilities::SELF_TEST, "self-test"),
        (Capabilities::USB, "native usb"),
    ]
    .into_iter()
    .filter(move |(bit, _)| of.contains(*bit))
    .map(|(_, name)| name)
}

/// Warning about an option byte.
const SWAPPED: &str = "the banks of the microcontroller's flash are swapped (option byte SWAP_BANK_OPT): it stores no calibration until a debugger clears it";

fn nominal_hz(greeting: &Greeting) -> Option<f64> {
    Some(shortest(greeting.nominal_hz)).filter(|hz| *hz > 0.0)
}

/// The firmware follows a sensor's clock by up to 5 %.
const FOLLOWED: f64 = 0.0495;

/// A sensor whose clock is further off than the device follows.
fn clock_off(greeting: &Greeting) -> Option<String> {
    let nominal = nominal_hz(greeting)?;
    let rate = shortest(greeting.triads.gyro.rate_hz);
    let off = nominal / rate - 1.0;
    (off.abs() > FOLLOWED).then(|| format!(
        "the sensor's clock is off by 5 % or more of its {nominal} Hz, which the device does not follow: times and rates are wrong; replace the sensor, or the board if its crystal is another one than the firmware's"
    ))
}

/// Why a digital sensor is not sampled.
fn wrong_register(greeting: &Greeting) -> Option<String> {
    let WrongRegister {
        register,
        identifies,
        found,
        expected,
    } = greeting.wrong_register?;
    let part = greeting.triads.gyro.part;
    let read = format!("reads {found:#04x}, and {expected:#04x} was expected");
    Some(match identifies {
        true => format!(
            "no samples: WHO_AM_I {read}: the {part} is missing, or another part is in its place; check the sensor and its wires"
        ),
        false => format!(
            "no samples: register {register:#04x} of the {part} {read} as it was written; check the wires to the sensor"
        ),
    })
}

fn version_warning(device: Version) -> Option<String> {
    let versions = versions(device);
    match device.minor.cmp(&PROTOCOL.minor) {
        std::cmp::Ordering::Equal => None,
        std::cmp::Ordering::Less => Some(format!(
            "the device is older than this program ({versions}): it refuses messages that it does not know"
        )),
        std::cmp::Ordering::Greater => Some(format!(
            "the device is newer than this program ({versions}): its additional functions are not used"
        )),
    }
}

/// Decodes the beginning of a greeting, the same since version 1: number of the call, first bytes, version.
///
/// Decoded separately: a device with another major version may send more than this program can read, but it still has to be identified.
pub(super) fn beginning(payload: &[u8]) -> Option<(u16, [u8; 4], Version)> {
    // The first variant of `Message`.
    let mut rest = payload.strip_prefix(&[0])?;
    let mut id = 0_u32;
    for shift in [0, 7, 14] {
        let (byte, after) = rest.split_first()?;
        rest = after;
        id |= u32::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            break;
        }
    }
    let (magic, rest) = rest.split_first_chunk::<4>()?;
    let [major, minor, ..] = *rest else {
        return None;
    };
    Some((u16::try_from(id).ok()?, *magic, Version { major, minor }))
}

/// Refuses an incompatible device by the beginning of its greeting.
pub(super) fn check(port: &str, magic: [u8; 4], protocol: Version) -> Result<()> {
    // Only `magic` and `protocol` are checked.
    let stub = Greeting {
        magic,
        protocol,
        ..Greeting::default()
    };
    let versions = versions(protocol);
    match compatibility(&stub) {
        Compatibility::NotMimu => Err(Error::device(
            port,
            format!(
                "wrong firmware: it greets as \"{}\" instead of \"{}\"",
                magic.escape_ascii(),
                MAGIC.escape_ascii()
            ),
            "flash mimu-firmware (docs/device/board.md), or choose another port",
        )),
        Compatibility::DeviceOlder { usable: false } => Err(Error::device(
            port,
            format!("the device is older than this program: {versions}"),
            "flash the firmware that belongs to this program (docs/device/board.md)",
        )),
        Compatibility::DeviceNewer { usable: false } => Err(Error::device(
            port,
            format!("the device is newer than this program: {versions}"),
            "update mimu on this computer",
        )),
        _ => Ok(()),
    }
}

fn versions(device: Version) -> String {
    format!(
        "it has protocol {}.{}, this program has protocol {}.{}",
        device.major, device.minor, PROTOCOL.major, PROTOCOL.minor
    )
}

/// Default name of a unit: its number.
pub fn unit_name(unit_id: &str) -> String {
    format!("mimu-{unit_id}")
}

/// A sentence for each calibration that the device cannot use. It uses the other one, which may be older.
fn slot_warnings(slots: &[Slot; 2]) -> impl Iterator<Item = String> {
    let of = |(k, is): (usize, &Slot)| {
        let why = match is {
            Slot::Damaged | Slot::Unfinished | Slot::NotUsable(_) => slot(is),
            Slot::Empty | Slot::Whole { .. } | Slot::NotKnown => return None,
        };
        let other = match slots[1 - k] {
            Slot::Whole { generation } => {
                format!("number {generation} is in use, which may be older")
            }
            _ => "none is in use".into(),
        };
        Some(format!(
            "the calibration in slot {} is {why}; {other}: upload the calibration again",
            k + 1
        ))
    };
    slots.iter().enumerate().filter_map(of)
}

/// Contents of a slot for a calibration, in words.
fn slot(slot: &Slot) -> String {
    match slot {
        Slot::Empty => "empty".into(),
        Slot::Whole { generation } => format!("whole, number {generation}"),
        Slot::Unfinished => "unfinished: writing or erasing was interrupted".into(),
        Slot::Damaged => "damaged: it was complete before".into(),
        Slot::NotKnown => "something that this program does not know".into(),
        Slot::NotUsable(refused) => format!("complete, but not usable: {}", refused),
    }
}
