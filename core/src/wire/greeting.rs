//! Identity of the device. The layout of version 3 never changes; later versions append fields. A field that the device does not send is
//! read as zero (none or unknown); one that this build does not know is ignored.

use serde::{Deserialize, Serialize};

use super::extensible;
use crate::PerSensor;
use crate::effects::{DeviceEffect, EffectError};
use crate::stored;
use crate::triad::Triad;

/// First bytes of every greeting.
pub const MAGIC: [u8; 4] = *b"mimu";

/// The protocol of this build.
pub const PROTOCOL: Version = Version { major: 3, minor: 2 };

/// Version of a protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub struct Version {
    /// Another major version is incompatible.
    pub major: u8,
    /// A higher minor version knows more messages.
    pub minor: u8,
}

/// Identity, abilities and stored calibration of the device.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Greeting<'a> {
    /// [`MAGIC`].
    pub magic: [u8; 4],
    /// Its protocol.
    pub protocol: Version,
    /// Version of the firmware, and the commit that it was built from: `0.1.0-1a2b3c4`, followed by `-dirty` if the sources were changed.
    pub firmware: &'a str,
    /// Name of the board.
    pub board: &'a str,
    /// The microcontroller's own 96-bit number, as it is in memory.
    pub unit_id: [u8; 12],
    /// What it can do.
    pub capabilities: Capabilities,
    /// The effects that it can remove: bit k means [`EFFECTS`]`[k]`.
    pub effects: u32,
    /// Most effects of each triad that run with every sample, and as many that do not.
    pub effects_room: u8,
    /// Most temperature nodes.
    pub nodes_room: u8,
    /// Most bytes of a stored calibration.
    pub stored_room: u32,
    /// The sensors. All three axes of both triads are one sample.
    #[serde(borrow)]
    pub triads: PerSensor<Triad<'a>>,
    /// Places of the thermometers in the order of their temperatures, separated by commas.
    pub thermometers: &'a str,
    /// Reset cause.
    #[serde(borrow, with = "extensible")]
    pub start: Start<'a>,
    /// Number of starts since the last power failure, including this one.
    pub starts: u32,
    /// The calibration in use.
    pub stored: Option<StoredInfo>,
    /// Contents of the two places for a calibration.
    #[serde(with = "extensible::pair")]
    pub slots: [Slot; 2],
    /// Time since power-on at the start of sampling, ms; `None` if unknown.
    pub powered_for_ms: Option<u32>,
    /// Supply below which the microcontroller is reset, by its option bytes: 0 (the lowest that it has) to 3; `None` if unknown. From 3.1 on.
    pub brown_out_level: Option<u8>,
    /// Whether the banks of its flash have exchanged their addresses, so that it cannot store. From 3.1 on.
    pub banks_swapped: bool,
    /// Register of the digital sensor that reads otherwise than it must, so that nothing is sampled. From 3.2 on.
    pub wrong_register: Option<WrongRegister>,
    /// Samples per second by the data sheet, of which a digital sensor's own clock differs. From 3.2 on.
    pub nominal_hz: f32,
    /// Whether the rate of the triads is measured by the crystal. From 3.2 on; before the first samples it is the nominal one.
    pub rate_measured: bool,
}

/// A register of a digital sensor that does not read what it must.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct WrongRegister {
    /// Its address.
    pub register: u8,
    /// Whether it identifies the part: the sensor is missing, or another one.
    pub identifies: bool,
    /// What it reads.
    pub found: u8,
    /// What it must read.
    pub expected: u8,
}

/// Bits of [`Greeting::capabilities`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Capabilities(pub u32);

impl Capabilities {
    /// Compensates with temperature nodes.
    pub const TEMPERATURE_NODES: Self = Self(1);
    /// Removes products that were found from the data (`term:`).
    pub const TERMS: Self = Self(1 << 1);
    /// Runs Kalman banks.
    pub const KALMAN: Self = Self(1 << 2);
    /// Has a self-test.
    pub const SELF_TEST: Self = Self(1 << 3);
    /// Is connected by its own USB and not by a serial line.
    pub const USB: Self = Self(1 << 4);

    /// Whether all of `those` are among them.
    pub const fn contains(self, those: Self) -> bool {
        self.0 & those.0 == those.0
    }

    /// Those of both.
    pub const fn and(self, those: Self) -> Self {
        Self(self.0 | those.0)
    }
}

/// Ids of effects by the bits of [`Greeting::effects`]. Append only.
pub const EFFECTS: &[&str] = &[
    "gyro_g_sensitivity",
    "gyro_scale_quadratic",
    "gyro_scale_cubic",
    "gyro_scale_asymmetry",
    "accel_scale_quadratic",
    "accel_scale_cubic",
    "accel_cross_axis_product",
    "accel_size_effect",
    "gyro_warm_up",
    "accel_warm_up",
    "gyro_thermal_bias",
    "accel_thermal_bias",
    "gyro_thermal_scale",
    "accel_thermal_scale",
    "gyro_thermal_misalignment",
    "accel_thermal_misalignment",
    "gyro_thermal_lag",
    "accel_thermal_lag",
    "gyro_g_squared",
];

/// Bits of the effects that this build removes. Each named one is tried, so the bits cannot be out of date.
pub fn effects_of_this_build() -> u32 {
    // Every effect needs coefficients, so a known one is refused for their number.
    let known = |id| {
        !matches!(
            DeviceEffect::<f32>::named(id, &[], None),
            Err(EffectError::Unknown)
        )
    };
    let bits = EFFECTS.iter().enumerate();
    bits.fold(0, |bits, (bit, id)| bits | u32::from(known(id)) << bit)
}

/// Reset cause of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Start<'a> {
    /// Power-on, or the supply was too low.
    PowerOn,
    /// The reset pin: the button, or the debugger.
    ResetPin,
    /// The watchdog: the program stopped sampling for too long.
    Watchdog,
    /// The program requested it.
    Software,
    /// The program stopped at a panic.
    Panic {
        /// End of the path of the source file.
        file: &'a str,
        /// Line in it.
        line: u32,
    },
    /// The processor stopped at a fault.
    Fault {
        /// Address of the instruction.
        pc: u32,
        /// Configurable fault status register.
        cfsr: u32,
    },
    /// None of these.
    Other,
    /// A cause that this build does not know, or none was given; never sent.
    #[default]
    #[serde(skip)]
    NotKnown,
}

/// A stored calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredInfo {
    /// Bytes.
    pub length: u32,
    /// [`stored::hash`] over them.
    pub hash: u64,
    /// Temperature nodes.
    pub nodes: u8,
    /// Effects.
    pub effects: u8,
    /// Number of the unit that it belongs to; zero if unknown.
    pub unit_id: [u8; 12],
    /// When it was made, UTC seconds since 1970; zero if unknown.
    pub created_s: u64,
}

/// Contents of one of the two places for a calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Slot {
    /// Nothing.
    Empty,
    /// A complete calibration.
    Whole {
        /// Counts the calibrations; the higher one is in use.
        generation: u32,
    },
    /// A calibration whose writing did not end, or the remains of one being erased.
    Unfinished,
    /// A calibration that was complete before and is damaged now.
    Damaged,
    /// A complete calibration that this version of the firmware cannot use.
    NotUsable(stored::StoredError),
    /// Something that this build does not know; never sent.
    #[default]
    #[serde(skip)]
    NotKnown,
}

/// How a device compares with this build.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compatibility {
    /// It has the same protocol.
    Same,
    /// It has an older protocol: update the device.
    DeviceOlder {
        /// Whether the common part is compatible; otherwise only the greeting can be relied on.
        usable: bool,
    },
    /// It has a newer protocol: update the host.
    DeviceNewer {
        /// As above.
        usable: bool,
    },
    /// It is not a mimu device.
    NotMimu,
}

/// How the device of a greeting compares with this build.
pub fn compatibility(greeting: &Greeting<'_>) -> Compatibility {
    let usable = greeting.protocol.major == PROTOCOL.major;
    match greeting.protocol.cmp(&PROTOCOL) {
        _ if greeting.magic != MAGIC => Compatibility::NotMimu,
        core::cmp::Ordering::Equal => Compatibility::Same,
        core::cmp::Ordering::Less => Compatibility::DeviceOlder { usable },
        core::cmp::Ordering::Greater => Compatibility::DeviceNewer { usable },
    }
}
