//! A digital inertial sensor at the emulated microcontroller: the emulator's ICM-42688-P, which gets the unit's state at the time of each sample.
//!
//! The emulator's chip makes its samples when it is selected, from the signals it has then. A reader that comes late would get one value many times.
//! The bench therefore brings the chip up to date on a grid of its own.

use std::fmt;

use mimu_rig::rig_file::{Parts, RigFile};
use rigless::chip::Timeline;
use rigless::chip::icm42688p::Icm42688p;
use rigless::chip::spi::Peer;
use rigless::device::Level;
use rigless::snapshot::Store;
use rigless::soc::stm32h743::peripherals::gpio::Pin;
use rigless::soc::stm32h743::peripherals::spi::Select;
use rigless::time::{EventId, VirtualNanos};

/// The rig with an ICM-42688-P where it names no parts.
pub fn with_digital_parts(mut rig: RigFile) -> RigFile {
    let part = |name: &str| Some(Parts::One(name.into()));
    rig.unit.gyro = rig.unit.gyro.or(part("ICM-42688-P-gyro"));
    rig.unit.accel = rig.unit.accel.or(part("ICM-42688-P-accel"));
    rig
}

/// Number of its interface among SPI1 to SPI6.
pub(crate) const INTERFACE: usize = 0;

/// Its chip select (hwdef.dat of ArduPilot's MatekH743: PC15 IMU1_CS).
pub(crate) fn select() -> Select {
    Select {
        port: "GPIOC",
        pin: Pin::new(15).expect("a port has sixteen pins"),
        active: Level::Low,
    }
}

/// Time between two updates of the chip, ns: a sample is at most this much older than its values.
pub const GRID_NS: u64 = 100_000;

/// What the sensor senses, errors of the unit included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensed {
    /// Reading of the gyro on its axes, degrees per second.
    pub rate_dps: [f64; 3],
    /// Reading of the accelerometer, g.
    pub force_g: [f64; 3],
    /// Temperature of the die, °C.
    pub die_c: f64,
}

/// What is sensed at a time, ns by the board's crystal. Times do not decrease.
pub type Feed = Box<dyn FnMut(u64) -> Sensed + Send>;

/// The chip with the bench in front of it.
pub(crate) struct Inertial {
    chip: Icm42688p,
    feed: Feed,
    /// The board's crystal relative to its nominal frequency: virtual time is the chip's, and the bench's is the crystal's.
    crystal: f64,
    selected: bool,
    /// The next update of the grid.
    due: Option<EventId>,
}

impl fmt::Debug for Inertial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Inertial").field(&self.chip).finish()
    }
}

impl Inertial {
    pub(crate) fn new(feed: Feed, crystal: f64) -> Self {
        Self {
            chip: Icm42688p::new(),
            feed,
            crystal,
            selected: false,
            due: None,
        }
    }

    /// The supply is back: the registers are as after power-on.
    pub(crate) fn power_on(&mut self) {
        self.chip = Icm42688p::new();
        self.selected = false;
        self.due = None;
    }

    /// Gives the chip what it senses now.
    fn sense(&mut self, now: VirtualNanos) {
        let Sensed {
            rate_dps,
            force_g,
            die_c,
        } = (self.feed)((now.0 as f64 * self.crystal) as u64);
        let [x, y, z] = rate_dps.map(|dps| (dps * 1e3).round() as i32);
        self.chip.set_rate(x, y, z);
        let [x, y, z] = force_g.map(|g| (g * 1e6).round() as i32);
        self.chip.set_acceleration(x, y, z);
        self.chip.set_temperature((die_c * 100.0).round() as i32);
    }

    fn schedule(&mut self, context: &mut Timeline<'_, '_>) {
        let next = (context.now().0 / GRID_NS + 1) * GRID_NS;
        self.due = Some(context.schedule(VirtualNanos(next)));
    }
}

// Snapshots are not used: every run starts from the beginning.
impl Store for Inertial {}

impl Peer for Inertial {
    fn select(&mut self, context: &mut Timeline<'_, '_>) {
        self.selected = true;
        if self.due.is_none() {
            self.schedule(context);
        }
        self.chip.select(context);
    }

    fn deselect(&mut self, context: &mut Timeline<'_, '_>) {
        self.selected = false;
        self.chip.deselect(context);
    }

    fn transfer(&mut self, mosi: u32, bits: u8, context: &mut Timeline<'_, '_>) -> u32 {
        self.chip.transfer(mosi, bits, context)
    }

    fn on_event(&mut self, event: EventId, context: &mut Timeline<'_, '_>) {
        if self.due != Some(event) {
            return;
        }
        self.sense(context.now());
        // In a transfer the samples wait for the next select, which follows within a transfer's length.
        if !self.selected {
            self.chip.select(context);
            self.chip.deselect(context);
        }
        self.schedule(context);
    }

    fn restarted(&mut self, context: &mut Timeline<'_, '_>) {
        self.selected = false;
        self.schedule(context);
    }
}
