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

// Registers of the self-test (DS-000347, 14.60, 15.6 to 15.8, 16.4 to 16.6), which the emulator's chip stores without an effect.
const DEVICE_CONFIG: u8 = 0x11;
const REG_BANK_SEL: u8 = 0x76;
const SELF_TEST_CONFIG: u8 = 0x70;
/// Bank and first register of the factory's responses: gyro, accelerometer.
const FACTORY: [(u8, u8); 2] = [(1, 0x5f), (2, 0x3b)];

/// The factory's codes of the axes x, y, z, and the responses that they stand for: 2620 counts of 250 dps and of 2 g, and 1 % more for each code above
/// 1, as the maker's own driver has it.
const CODES: [[u8; 3]; 2] = [[134, 150, 141], [120, 110, 128]];

/// Response of an axis by its code, dps and g.
fn response(code: u8) -> [f64; 2] {
    let counts = 2620.0 * 1.01_f64.powi(i32::from(code) - 1);
    [250.0, 2.0].map(|range| counts * range / 32_768.0)
}

/// The self-test of the chip, by the transfers that reach it.
#[derive(Debug, Default)]
struct SelfTest {
    bank: u8,
    /// Address byte of the present transfer, and bytes since.
    address: Option<u8>,
    /// What deflects: bits 0 to 2 gyro x, y, z, bits 3 to 5 accelerometer x, y, z.
    deflects: u8,
}

impl SelfTest {
    /// A byte of a transfer. Returns what the chip answers in place of the emulator's.
    fn byte(&mut self, sent: u8) -> Option<u8> {
        let Some(address) = self.address else {
            self.address = Some(sent);
            return None;
        };
        let (reads, register) = (address & 0x80 != 0, address & 0x7f);
        // A burst goes on with the next register.
        self.address = Some((address & 0x80) | (register + 1) & 0x7f);
        if reads {
            let of = |(k, (bank, first)): (usize, (u8, u8))| {
                let axis = usize::from(register.checked_sub(first)?);
                (bank == self.bank).then(|| CODES[k].get(axis).copied())?
            };
            return FACTORY.into_iter().enumerate().find_map(of);
        }
        match (register, self.bank) {
            (REG_BANK_SEL, _) => self.bank = sent & 7,
            (SELF_TEST_CONFIG, 0) => self.deflects = sent,
            // A reset by software.
            (DEVICE_CONFIG, 0) if sent & 1 != 0 => self.deflects = 0,
            _ => {}
        }
        None
    }

    /// Adds the deflections.
    fn deflect(&self, sensed: &mut Sensed) {
        for axis in 0..3 {
            let on = |k: usize| f64::from(self.deflects >> (3 * k + axis) & 1);
            sensed.rate_dps[axis] += on(0) * response(CODES[0][axis])[0];
            sensed.force_g[axis] += on(1) * response(CODES[1][axis])[1];
        }
    }
}

/// Another part in place of the chip, or none: what a register, or each one, reads whatever was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Other {
    /// The register; `None`: all of them.
    pub register: Option<u8>,
    /// What it reads.
    pub reads: u8,
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
    /// What answers in place of it.
    pub(crate) other: Option<Other>,
    self_test: SelfTest,
    /// The next update of the grid, and its time, ns.
    due: Option<(EventId, u64)>,
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
            other: None,
            self_test: SelfTest::default(),
            due: None,
        }
    }

    /// The supply is back: the registers are as after power-on.
    pub(crate) fn power_on(&mut self) {
        self.chip = Icm42688p::new();
        self.self_test = SelfTest::default();
        self.selected = false;
        self.due = None;
    }

    /// Gives the chip what it senses now.
    fn sense(&mut self, now: VirtualNanos) {
        let mut sensed = (self.feed)((now.0 as f64 * self.crystal) as u64);
        self.self_test.deflect(&mut sensed);
        let Sensed {
            rate_dps,
            force_g,
            die_c,
        } = sensed;
        let [x, y, z] = rate_dps.map(|dps| (dps * 1e3).round() as i32);
        self.chip.set_rate(x, y, z);
        let [x, y, z] = force_g.map(|g| (g * 1e6).round() as i32);
        self.chip.set_acceleration(x, y, z);
        self.chip.set_temperature((die_c * 100.0).round() as i32);
    }

    fn schedule(&mut self, context: &mut Timeline<'_, '_>) {
        let next = (context.now().0 / GRID_NS + 1) * GRID_NS;
        self.due = Some((context.schedule(VirtualNanos(next)), next));
    }
}

// Snapshots are not used: every run starts from the beginning.
impl Store for Inertial {}

impl Peer for Inertial {
    fn select(&mut self, context: &mut Timeline<'_, '_>) {
        self.selected = true;
        self.self_test.address = None;
        // The emulator may lose what was scheduled in a reset by pin: the chip then gave the values from before it for ever.
        if self.due.is_none_or(|(_, at)| at < context.now().0) {
            self.sense(context.now());
            self.schedule(context);
        }
        self.chip.select(context);
    }

    fn deselect(&mut self, context: &mut Timeline<'_, '_>) {
        self.selected = false;
        self.chip.deselect(context);
    }

    fn transfer(&mut self, mosi: u32, bits: u8, context: &mut Timeline<'_, '_>) -> u32 {
        let answer = self.chip.transfer(mosi, bits, context);
        let read = self.self_test.address.filter(|address| address & 0x80 != 0);
        let other = self.other.filter(|other| {
            read.is_some_and(|read| other.register.is_none_or(|r| r == read & 0x7f))
        });
        let of_test = self.self_test.byte(mosi as u8);
        let answered = other.map(|other| other.reads).or(of_test);
        answered.map_or(answer, u32::from)
    }

    fn on_event(&mut self, event: EventId, context: &mut Timeline<'_, '_>) {
        if self.due.map(|(due, _)| due) != Some(event) {
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
