//! Who the device is: its greeting, kept.

use std::fmt;

use mimu_core::stored::{Refused, VERSION};
use mimu_core::wire::{
    Capabilities, Compatibility, EFFECTS, Greeting, MAGIC, PROTOCOL, Slot, Start, StoredInfo,
    Version, compatibility,
};

use mimu_recording::error::{Error, Result};

/// A [`Greeting`], kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Who {
    /// What it speaks.
    pub protocol: Version,
    /// Version of the firmware.
    pub firmware: String,
    /// Name of the board.
    pub board: String,
    /// The microcontroller's own number, 24 hexadecimal digits.
    pub unit_id: String,
    /// What it can do.
    pub capabilities: Capabilities,
    /// The effects that it removes, bit by bit as in [`EFFECTS`].
    pub effects: u32,
    /// Most effects of each triad that run with every sample, and as many that do not.
    pub effects_room: u8,
    /// Most temperature nodes.
    pub nodes_room: u8,
    /// Most bytes of a stored calibration.
    pub stored_room: u32,
    /// Samples per second.
    pub sample_rate_hz: u32,
    /// Channels of a sample in their order.
    pub channels: Vec<String>,
    /// Unit of a raw reading.
    pub raw_unit: String,
    /// Why it started.
    pub start: Started,
    /// Starts without a power failure in between, this one counted.
    pub starts: u32,
    /// The calibration in use.
    pub stored: Option<StoredInfo>,
    /// What is in the two places for a calibration.
    pub slots: [Slot; 2],
}

/// Why the device started: [`Start`], kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Started {
    /// Power came, or was too low in between.
    PowerOn,
    /// The reset pin.
    ResetPin,
    /// The watchdog.
    Watchdog,
    /// The program asked for it.
    Software,
    /// A panic: end of the source file's path, and line.
    Panic(String, u32),
    /// A fault of the processor: address of the instruction, and the fault status register CFSR.
    Fault(u32, u32),
    /// None of these.
    Other,
}

impl Started {
    /// Name for programs.
    pub fn name(&self) -> &'static str {
        match self {
            Self::PowerOn => "power-on",
            Self::ResetPin => "reset-pin",
            Self::Watchdog => "watchdog",
            Self::Software => "software",
            Self::Panic(..) => "panic",
            Self::Fault(..) => "fault",
            Self::Other => "other",
        }
    }
}

impl fmt::Display for Started {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PowerOn => f.write_str("power-on"),
            Self::ResetPin => f.write_str("reset pin"),
            Self::Watchdog => f.write_str("watchdog: the program did not come round"),
            Self::Software => f.write_str("restarted by the program"),
            Self::Panic(file, line) => write!(f, "panic in {file}, line {line}"),
            Self::Fault(pc, cfsr) => write!(f, "fault at {pc:#010x}, CFSR {cfsr:#010x}"),
            Self::Other => f.write_str("unknown"),
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
            Start::Panic { file, line } => Self::Panic(file.into(), line),
            Start::Fault { pc, cfsr } => Self::Fault(pc, cfsr),
            Start::Other => Self::Other,
        }
    }
}

impl From<&Greeting<'_>> for Who {
    fn from(greeting: &Greeting<'_>) -> Self {
        Self {
            protocol: greeting.protocol,
            firmware: greeting.firmware.into(),
            board: greeting.board.into(),
            unit_id: greeting
                .unit_id
                .iter()
                .map(|b| format!("{b:02x}"))
                .collect(),
            capabilities: greeting.capabilities,
            effects: greeting.effects,
            effects_room: greeting.effects_room,
            nodes_room: greeting.nodes_room,
            stored_room: greeting.stored_room,
            sample_rate_hz: greeting.sample_rate_hz,
            channels: greeting.channels.split(',').map(str::to_owned).collect(),
            raw_unit: greeting.raw_unit.into(),
            start: greeting.start.into(),
            starts: greeting.starts,
            stored: greeting.stored,
            slots: greeting.slots,
        }
    }
}

impl Who {
    /// Ids of the effects that it removes.
    pub fn effect_ids(&self) -> Vec<&'static str> {
        let bits = EFFECTS.iter().enumerate();
        bits.filter(|(bit, _)| self.effects >> bit & 1 == 1)
            .map(|(_, id)| *id)
            .collect()
    }

    /// Names of what it can do.
    pub fn capability_names(&self) -> Vec<&'static str> {
        [
            (Capabilities::TEMPERATURE_NODES, "temperature nodes"),
            (Capabilities::TERMS, "terms"),
            (Capabilities::KALMAN, "kalman"),
            (Capabilities::SELF_TEST, "self-test"),
            (Capabilities::USB, "native usb"),
        ]
        .into_iter()
        .filter(|(bit, _)| self.capabilities.contains(*bit))
        .map(|(_, name)| name)
        .collect()
    }

    /// One sentence if the device is older or newer and can be talked to all the same.
    pub fn version_warning(&self) -> Option<String> {
        let versions = versions(self.protocol);
        match self.protocol.minor.cmp(&PROTOCOL.minor) {
            std::cmp::Ordering::Equal => None,
            std::cmp::Ordering::Less => Some(format!(
                "the device is older than this program ({versions}): it refuses what it does not know yet"
            )),
            std::cmp::Ordering::Greater => Some(format!(
                "the device is newer than this program ({versions}): what it has learned since is not used"
            )),
        }
    }
}

/// The beginning of a greeting, which is that of version 1 for ever: number of the call, first bytes, version.
///
/// Read by itself, because a device of another major version may put things behind it that this program cannot read, and
/// is to be told apart all the same.
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

/// Refuses a device that cannot be talked to, by the beginning of its greeting.
pub(super) fn check(port: &str, magic: [u8; 4], protocol: Version) -> Result<()> {
    // Of the greeting only these two are looked at.
    let stub = Greeting {
        magic,
        protocol,
        firmware: "",
        board: "",
        unit_id: [0; 12],
        capabilities: Capabilities(0),
        effects: 0,
        effects_room: 0,
        nodes_room: 0,
        stored_room: 0,
        sample_rate_hz: 0,
        channels: "",
        raw_unit: "",
        start: Start::Other,
        starts: 0,
        stored: None,
        slots: [Slot::Empty; 2],
    };
    let versions = versions(protocol);
    match compatibility(&stub) {
        Compatibility::NotMimu => Err(Error::new(
            port,
            format!(
                "wrong firmware: it greets as \"{}\", and not as \"{}\"",
                magic.escape_ascii(),
                MAGIC.escape_ascii()
            ),
            "flash mimu-firmware (README, flashing), or choose another port",
        )),
        Compatibility::DeviceOlder { usable: false } => Err(Error::new(
            port,
            format!("the device is older than this program: {versions}"),
            "flash the firmware that belongs to this program (README, flashing)",
        )),
        Compatibility::DeviceNewer { usable: false } => Err(Error::new(
            port,
            format!("the device is newer than this program: {versions}"),
            "update mimu on this computer",
        )),
        _ => Ok(()),
    }
}

fn versions(device: Version) -> String {
    format!(
        "it speaks protocol {}.{}, and this program {}.{}",
        device.major, device.minor, PROTOCOL.major, PROTOCOL.minor
    )
}

/// Why bytes are not a calibration, in words.
pub fn unusable(refused: &Refused) -> String {
    match refused {
        Refused::NotACalibration => "they do not begin as a calibration does".into(),
        Refused::Length => "their length is not the one that they state".into(),
        Refused::Version { found } => {
            format!("their layout is of version {found}, and this program's of version {VERSION}")
        }
        Refused::Check => "their CRC does not hold".into(),
        Refused::Node { at } => format!(
            "temperature node {at} is not finite, or not warmer than the one before, or one too many"
        ),
        Refused::Singular => "C is singular".into(),
        Refused::EffectUnknown { at } => format!("effect {at} is not known"),
        Refused::EffectValue { at } => format!("effect {at} has numbers that make no sense"),
        Refused::EffectsFull { at } => format!("there is no room for effect {at}"),
    }
}

/// What is in a place for a calibration, in words.
pub fn slot(slot: &Slot) -> String {
    match slot {
        Slot::Empty => "empty".into(),
        Slot::Whole { generation } => format!("whole, number {generation}"),
        Slot::Unfinished => "unfinished: its writing, or its erasing, was cut off".into(),
        Slot::Damaged => "damaged: it was whole once".into(),
        Slot::NotUsable(refused) => format!("whole, and not usable: {}", unusable(refused)),
    }
}
