//! A running board: executes an image for a given virtual time; between runs, the environment can act on the board.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use mimu_rig::random::Random;
use rigless::emulator::{self, Start, Watch};
use rigless::session::Session;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

pub use crate::driver::{Arrival, BoardState};
use crate::driver::{CommandedDriver, Order, Stopped};
use crate::findings::{Findings, findings};
use crate::flash::{BANK, BASE, Operation};
use crate::front::Front;
use crate::image::Image;
use crate::inertial::{Feed, Inertial, Other, Sensed};
use crate::line::{FarEnd, Line};
use crate::memory::{program, read};
use crate::part::{Machine, Wiring};
use crate::sampler::Conversions;
use crate::schematic::Volts;

/// First address of the bank without the program, where a device stores its data.
pub const STORE: u64 = BASE + BANK;

/// RAM that loses its content with the supply: first address and bytes.
const RAM: [(u64, u64); 6] = [
    (0x0000_0000, 64 << 10),
    (0x2000_0000, 128 << 10),
    (0x2400_0000, 512 << 10),
    (0x3000_0000, 288 << 10),
    (0x3800_0000, 64 << 10),
    // Its supply pin is wired to the board's own supply.
    (0x3880_0000, 4 << 10),
];

/// Cause and time of a restart.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Restart {
    /// The virtual clock, ns.
    pub ns: u64,
    /// `Pin`, `Core`, `PowerOn`, or the watchdog by its name.
    pub cause: String,
}

/// A board that runs an image.
///
/// It begins switched on at virtual time 0, before the first instruction, and advances only on request. The same image, front and sequence of calls
/// give the same run, instruction by instruction.
#[derive(Debug)]
pub struct Board {
    orders: Sender<Order>,
    reports: Receiver<BoardState>,
    thread: Option<JoinHandle<Result<(), String>>>,
    line: Line,
    state: BoardState,
    digital: bool,
}

impl Board {
    /// A board whose flash contains only an image. Its unit id is zero.
    ///
    /// Errors: the image does not fit into the part.
    pub fn new(image: &Image, front: Front) -> Result<Self, String> {
        Self::numbered(image, front, [0; 12])
    }

    /// The same with a unit id, the 96-bit number that the part's manufacturer gives to each part.
    ///
    /// Errors: as [`Board::new`].
    pub fn numbered(image: &Image, front: Front, unit_id: [u8; 12]) -> Result<Self, String> {
        Self::wired(image, front, None, Wiring::NUCLEO, unit_id)
    }

    /// The Matek H743 with its digital sensor, which senses what `feed` says. `crystal` is the frequency of the board's crystal over the nominal
    /// one. The sensor's clock keeps virtual time, and bench and firmware that of the crystal, so for both of them the sensor's clock is off by
    /// the inverse.
    ///
    /// Errors: as [`Board::new`].
    pub fn digital(
        image: &Image,
        feed: Feed,
        crystal: f64,
        unit_id: [u8; 12],
    ) -> Result<Self, String> {
        let sensor = Inertial::new(feed, crystal);
        let front = Front::Still(Volts::GROUND);
        Self::wired(image, front, Some(sensor), Wiring::matek(crystal), unit_id)
    }

    /// The Matek H743 whose sensor answers otherwise than its own: another part, or none.
    ///
    /// Errors: as [`Board::new`].
    pub fn other_sensor(image: &Image, other: Other, unit_id: [u8; 12]) -> Result<Self, String> {
        let still = Sensed {
            rate_dps: [0.0; 3],
            force_g: [0.0, 0.0, 1.0],
            die_c: 25.0,
        };
        let mut sensor = Inertial::new(Box::new(move |_| still), 1.0);
        sensor.other = Some(other);
        let front = Front::Still(Volts::GROUND);
        Self::wired(image, front, Some(sensor), Wiring::matek(1.0), unit_id)
    }

    /// The Matek H743 with the unit of [`Front::digital`] or [`Front::commanded_digital`]: its sensor senses what the unit does, with the unit's
    /// errors.
    ///
    /// Errors: as [`Board::new`], and a front without a digital sensor.
    pub fn matek(image: &Image, front: Front, unit_id: [u8; 12]) -> Result<Self, String> {
        let crystal = front.crystal().unwrap_or(1.0);
        let sensor = Inertial::new(front.feed()?, crystal);
        Self::wired(image, front, Some(sensor), Wiring::matek(crystal), unit_id)
    }

    fn wired(
        image: &Image,
        front: Front,
        sensor: Option<Inertial>,
        wiring: Wiring,
        unit_id: [u8; 12],
    ) -> Result<Self, String> {
        let digital = sensor.is_some();
        let line = Line::default();
        let machine = Machine::new(front, sensor, wiring, FarEnd(line.clone()), unit_id)
            .map_err(|e| e.to_string())?;
        let (orders, orders_in) = channel();
        let (reports_out, reports) = channel();
        let images = vec![image.placed.clone()];
        let thread = std::thread::Builder::new()
            .name("board".into())
            .spawn(move || {
                let driver = CommandedDriver {
                    orders: orders_in,
                    reports: reports_out,
                    arrivals: Vec::new(),
                };
                let session = Session::new(Box::new(machine), 0, VirtualNanos(0))
                    .map_err(|e| e.to_string())?;
                emulator::run(session, &Start::new(&images), driver)
                    .map(drop)
                    .map_err(|e| e.to_string())
            })
            .map_err(|e| format!("the board's thread: {e}"))?;
        let mut board = Self {
            orders,
            reports,
            thread: Some(thread),
            line,
            state: BoardState {
                ns: 0,
                instructions: 0,
            },
            digital,
        };
        board.wait()?;
        Ok(board)
    }

    fn wait(&mut self) -> Result<(), String> {
        match self.reports.recv() {
            Ok(state) => {
                self.state = state;
                Ok(())
            }
            Err(_) => Err(self.ended()),
        }
    }

    /// Why the emulator ended by itself.
    fn ended(&mut self) -> String {
        let why = match self.thread.take().map(JoinHandle::join) {
            Some(Ok(Err(error))) => error,
            Some(Err(panic)) => panic
                .downcast_ref::<String>()
                .map_or("it panicked".into(), Clone::clone),
            _ => "it has ended already".into(),
        };
        format!("the emulator: {why}")
    }

    /// Runs a function on the stopped board.
    pub(crate) fn with<T: Send + 'static>(
        &mut self,
        task: impl FnOnce(&mut Stopped<'_>) -> T + Send + 'static,
    ) -> Result<T, String> {
        let (back, answer) = channel();
        let task = Box::new(move |stopped: &mut Stopped<'_>| {
            // The receiver is missing only if the board is gone too.
            let _ = back.send(task(stopped));
        });
        let _ = self.orders.send(Order::Do(task));
        answer.recv().map_err(|_| self.ended())
    }

    /// Whether its sensor is digital.
    pub fn is_digital(&self) -> bool {
        self.digital
    }

    /// Its current state.
    pub fn state(&self) -> BoardState {
        self.state
    }

    /// Runs until a virtual time, ns. Bytes put on the line before arrive in the meantime.
    ///
    /// Errors: the emulator gave up.
    pub fn run_to(&mut self, ns: u64) -> Result<BoardState, String> {
        if ns > self.state.ns {
            let _ = self.orders.send(Order::To(ns));
            self.wait()?;
        }
        Ok(self.state)
    }

    /// Runs for a virtual duration, ns.
    ///
    /// Errors: as [`Board::run_to`].
    pub fn run_for(&mut self, ns: u64) -> Result<BoardState, String> {
        self.run_to(self.state.ns + ns)
    }

    /// Puts bytes on the serial line to the device, behind those that still wait. They arrive at the baud rate of the device's port.
    pub fn send(&mut self, bytes: &[u8]) {
        self.line.bytes().to_device.extend(bytes);
    }

    /// Bytes that still wait for the line.
    pub fn unsent(&self) -> usize {
        self.line.bytes().to_device.len()
    }

    /// Bytes that the device has sent since the last call, each with the end of its stop bit, ns.
    pub fn receive(&mut self) -> Vec<(u64, u8)> {
        std::mem::take(&mut self.line.bytes().from_device)
    }

    /// Garbles so many of a million bytes on their way to the device, like noise on the line.
    ///
    /// Errors: the emulator gave up, as for all that follow.
    pub fn garble(&mut self, per_million: u32) -> Result<(), String> {
        self.with(move |s| {
            let errors = s.session.board_mut().part.serial().errors_mut();
            errors.noise.name = "serial line";
            errors.noise.per_million = per_million;
        })
    }

    /// Conversions of ADC1 since the last call.
    pub fn conversions(&mut self) -> Result<Conversions, String> {
        self.with(|s| s.session.board_mut().part.sampler.take_conversions())
    }

    /// Reads memory, like a debugger.
    ///
    /// Errors: also an address without memory.
    pub fn memory(&mut self, address: u64, length: usize) -> Result<Vec<u8>, String> {
        self.with(move |s| read(s.host, address, length))?
    }

    /// Writes memory, like a debugger, or like a write that a reset interrupts.
    ///
    /// Errors: also an address without memory.
    pub fn set_memory(&mut self, address: u64, bytes: Vec<u8>) -> Result<(), String> {
        self.with(move |s| {
            (address..).zip(bytes).try_for_each(|(at, byte)| {
                s.host
                    .write(at, Width::W8, u64::from(byte))
                    .map_err(|e| e.to_string())
            })
        })?
    }

    /// Stops the converter ADC1 for good: conversions never end.
    pub fn stop_converter(&mut self) -> Result<(), String> {
        self.with(|s| s.session.board_mut().part.sampler.stopped = true)
    }

    /// Makes the flash interface hang for good: program and erase operations never end.
    pub fn stop_flash(&mut self) -> Result<(), String> {
        self.with(|s| s.session.board_mut().part.flash.stuck = true)
    }

    /// Sets the supply, mV; it begins with 3300.
    pub fn set_supply(&mut self, mv: u32) -> Result<(), String> {
        self.with(move |s| s.session.board_mut().part.set_supply(mv))
    }

    /// Sets the option byte that exchanges the addresses of the flash banks, for the next reset. The memory itself stays as it is.
    pub fn swap_banks(&mut self, swapped: bool) -> Result<(), String> {
        self.with(move |s| s.session.board_mut().part.set_options(swapped))
    }

    /// Holds the core, or lets it go: time and peripherals go on, and no instruction is executed.
    pub fn hold(&mut self, held: bool) -> Result<(), String> {
        self.with(move |s| s.host.hold(held))
    }

    /// Reads a peripheral's register, unnoticed by the firmware.
    ///
    /// Errors: also an address without a register.
    pub fn register(&mut self, address: u64) -> Result<u64, String> {
        self.with(move |s| {
            use rigless::mcu::Operate;
            let at = s.stop.at;
            let part = &mut s.session.board_mut().part;
            Operate::peek(part, at, address, Width::W32).map_err(|e| e.to_string())
        })?
    }

    /// The contents of bank 2, where the device stores its data.
    pub fn store(&mut self) -> Result<Vec<u8>, String> {
        self.memory(STORE, BANK as usize)
    }

    /// Replaces the contents of bank 2, like a debugger.
    ///
    /// Errors: also a length other than a whole bank's.
    pub fn set_store(&mut self, bytes: Vec<u8>) -> Result<(), String> {
        if bytes.len() as u64 != BANK {
            return Err(format!(
                "a stored bank of {} bytes; it has {BANK}",
                bytes.len()
            ));
        }
        self.with(move |s| program(s.host, STORE, &bytes))?
    }

    /// Ranges of flash memory (first address, bytes) that have changed since the last call.
    pub fn changed(&mut self) -> Result<Vec<(u64, u64)>, String> {
        self.with(|s| {
            let at = s.stop.at.0;
            s.session.board_mut().part.flash.take_landed(at)
        })
    }

    /// Flash operations in flight.
    pub fn in_flight(&mut self) -> Result<Vec<Operation>, String> {
        self.with(|s| s.session.board_mut().part.flash.in_flight(s.stop.at.0))
    }

    /// Contents of bank 2 if the supply were cut now: the present ones, except for the operation in flight.
    pub fn store_if_cut(&mut self, seed: u64) -> Result<Vec<u8>, String> {
        let mut bytes = self.store()?;
        let at = self.state.ns;
        let mut random = Random::new(seed, "cut supply");
        for o in self.in_flight()?.iter().filter(|o| o.address >= STORE) {
            let first = (o.address - STORE) as usize;
            let span = first..first + o.length as usize;
            let torn = o.torn(&bytes[span.clone()], at, &mut random);
            bytes[span].copy_from_slice(&torn);
        }
        Ok(bytes)
    }

    /// Cuts the supply now. A flash word or sector that is being written stays incomplete, RAM is lost, and nothing runs until the supply is back.
    pub fn cut_supply(&mut self, seed: u64) -> Result<(), String> {
        self.with(move |s| {
            let at = s.stop.at;
            let mut random = Random::new(seed, "cut supply");
            for o in s.session.board_mut().part.flash.in_flight(at.0) {
                let before = read(s.host, o.address, o.length as usize)?;
                program(s.host, o.address, &o.torn(&before, at.0, &mut random))?;
            }
            for (first, length) in RAM {
                for address in (first..first + length).step_by(8) {
                    let noise = random.word();
                    s.host
                        .write(address, Width::W64, noise)
                        .map_err(|e| e.to_string())?;
                }
            }
            s.session.board_mut().part.supply(at, false);
            Ok(())
        })?
    }

    /// Restores the supply: a power-on reset.
    pub fn restore_supply(&mut self) -> Result<(), String> {
        self.with(|s| {
            let at = s.stop.at;
            s.session.board_mut().part.supply(at, true);
        })
    }

    /// Pulls the reset pin. RAM and flash stay, except for flash operations in flight.
    pub fn reset_by_pin(&mut self, seed: u64) -> Result<(), String> {
        self.with(move |s| {
            let at = s.stop.at;
            let mut random = Random::new(seed, "reset pin");
            for o in s.session.board_mut().part.flash.in_flight(at.0) {
                let before = read(s.host, o.address, o.length as usize)?;
                program(s.host, o.address, &o.torn(&before, at.0, &mut random))?;
            }
            let instructions = s.stop.instruction_count;
            s.session.reset_by_pin(at, instructions, s.host);
            Ok(())
        })?
    }

    /// Restarts so far.
    pub fn restarts(&mut self) -> Result<Vec<Restart>, String> {
        self.with(|s| {
            let restart = |r: &rigless::session::Reset| Restart {
                ns: r.at.0,
                cause: format!("{:?}", r.cause),
            };
            s.session.resets().iter().map(restart).collect()
        })
    }

    /// Watches for arrivals at an instruction, until [`Board::unwatch`].
    pub fn watch(&mut self, address: u64) -> Result<(), String> {
        self.with(move |s| {
            s.session.watch(Watch::Instruction(address));
            s.session.settle_watches(s.host);
        })
    }

    /// Ends a watch.
    pub fn unwatch(&mut self, address: u64) -> Result<(), String> {
        self.with(move |s| {
            s.session.unwatch(Watch::Instruction(address));
            s.session.settle_watches(s.host);
        })
    }

    /// Arrivals at the watched instructions since the last call.
    pub fn arrivals(&mut self) -> Result<Vec<Arrival>, String> {
        self.with(|s| std::mem::take(&mut s.driver.arrivals))
    }

    /// The emulator's findings so far.
    pub fn findings(&mut self) -> Result<Findings, String> {
        self.with(|s| findings(s.session))
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        // Without orders the emulator ends.
        let (nobody, _) = channel();
        self.orders = nobody;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
