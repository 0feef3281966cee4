//! The microcontroller of the board: the emulator's STM32H743 with three of its models replaced by the bench's, and a reset by the supply.

use std::path::Path;

use rigless::device::{ErasedDevice, Level, ResetCause};
use rigless::emulator::CoreSpec;
use rigless::image::Image;
use rigless::machine::stm32h743_bench::Stm32h743Bench;
use rigless::machine::{Board, Target};
use rigless::mcu::{Mcu, Operate};
use rigless::snapshot::Store;
use rigless::soc::stm32h743::Stm32h743;
use rigless::soc::stm32h743::peripherals::gpio::{PORTS, Pin};
use rigless::soc::stm32h743::peripherals::usart::{self, Usart};
use rigless::soc::{Bus, Error};
use rigless::time::VirtualNanos;

use crate::flash::Watched;
use crate::front::Front;
use crate::inertial::{INTERFACE, Inertial, select};
use crate::line::FarEnd;
use crate::sampler::Sampler;
use crate::schematic::{DRIVEN, Drives, HSE_HZ, LSE_HZ};
use crate::watchdog::Watchdog;

/// What differs between the boards.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wiring {
    /// Name of the board.
    pub(crate) name: &'static str,
    /// The serial port that is wired to the host.
    serial: &'static str,
    /// Frequency of the crystal, Hz.
    hse_hz: u64,
}

impl Wiring {
    /// The NUCLEO-H743ZI2, whose debugger's USB bridge is at USART3.
    pub(crate) const NUCLEO: Self = Self {
        name: "nucleo-h743zi2",
        serial: "USART3",
        hse_hz: HSE_HZ,
    };

    /// The Matek H743, whose telemetry port is UART7, with a crystal at this fraction of its nominal frequency.
    pub(crate) fn matek(crystal: f64) -> Self {
        Self {
            name: "matek-h743",
            serial: "UART7",
            hse_hz: (HSE_HZ as f64 * crystal).round() as u64,
        }
    }
}

/// Address of the part's 96-bit unique number (RM0433, section 61.1).
const UNIT_ID_AT: u64 = 0x1FF1_E800;

/// The microcontroller.
#[derive(Debug)]
pub(crate) struct Part {
    mcu: Stm32h743,
    wiring: Wiring,
    pub(crate) sampler: Sampler,
    pub(crate) flash: Watched,
    watchdog: Watchdog,
    slots: Slots,
}

/// Bus slots of the bench's own models.
#[derive(Debug, Clone, Copy)]
struct Slots {
    adc1: usize,
    flash: usize,
    watchdog: usize,
    serial: usize,
    /// The ports of [`DRIVEN`].
    ports: [usize; DRIVEN.len()],
}

/// The part when its supply comes up.
fn powered_up(wiring: &Wiring) -> Result<Stm32h743, Error> {
    let mut mcu = Stm32h743::new()?;
    mcu.rcc.attach_crystals(wiring.hse_hz, LSE_HZ);
    mcu.set_supply(3300);
    mcu.set_analog_supply(3300);
    Ok(mcu)
}

/// The serial port that is wired to the host.
fn serial_port<'a>(mcu: &'a mut Stm32h743, wiring: &Wiring) -> &'a mut Usart {
    let nth = usart::INSTANCES
        .iter()
        .position(|&name| name == wiring.serial);
    &mut mcu.usart[nth.expect("the part has the port")]
}

impl Part {
    fn new(
        front: Front,
        sensor: Option<Inertial>,
        wiring: Wiring,
        far_end: FarEnd,
    ) -> Result<Self, Error> {
        let mut mcu = powered_up(&wiring)?;
        serial_port(&mut mcu, &wiring).attach(far_end);
        if let Some(sensor) = sensor {
            mcu.spi[INTERFACE].attach_selected(sensor, select());
        }
        let mut ports = [0; DRIVEN.len()];
        for (slot, (port, _)) in ports.iter_mut().zip(DRIVEN) {
            *slot = mcu.bus().slot(PORTS[port])?;
        }
        let slots = Slots {
            ports,
            adc1: mcu.bus().slot("ADC1")?,
            flash: mcu.bus().slot("Flash")?,
            watchdog: mcu.bus().slot("IWDG")?,
            serial: mcu.bus().slot(wiring.serial)?,
        };
        let mut part = Self {
            mcu,
            wiring,
            sampler: Sampler::new(front),
            flash: Watched::new(),
            watchdog: Watchdog::new(),
            slots,
        };
        part.set_options(false);
        part.check()?;
        Ok(part)
    }

    /// The serial port, to garble its line.
    pub(crate) fn serial(&mut self) -> &mut Usart {
        serial_port(&mut self.mcu, &self.wiring)
    }

    /// See [`Watched::set_options`].
    pub(crate) fn set_options(&mut self, swapped: bool) {
        let slot = self.slots.flash;
        let registers = self.mcu.bus_mut().slot_mut(slot).registers_mut();
        self.flash.set_options(swapped, registers);
    }

    /// Sets the supply, mV. The part goes on at any voltage: its brown-out reset is not modelled.
    pub(crate) fn set_supply(&mut self, mv: u32) {
        self.mcu.set_supply(mv);
    }

    /// Cuts or restores the supply when the run continues from this stop.
    pub(crate) fn supply(&mut self, at: VirtualNanos, on: bool) {
        // Any model's context can request this; the part lends that of a port.
        self.mcu
            .drive_port(at, 0, |_, _, context| context.request_power(on));
    }
}

impl Mcu for Part {
    fn bus(&self) -> &Bus {
        self.mcu.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.mcu.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        if cause == ResetCause::PowerOn {
            // The emulator's part keeps what a system reset keeps, and refuses a power-on reset.
            let wiring = self.wiring;
            let mut fresh = powered_up(&wiring).expect("built once already");
            serial_port(&mut fresh, &wiring).inherit(serial_port(&mut self.mcu, &wiring));
            fresh.spi[INTERFACE].inherit(&mut self.mcu.spi[INTERFACE]);
            if let Some(sensor) = fresh.spi[INTERFACE].chip_mut::<Inertial>(0) {
                sensor.power_on();
            }
            self.mcu = fresh;
        } else {
            self.mcu.reset(at, cause);
        }
        self.sampler_reset();
        let slot = self.slots.flash;
        self.flash
            .restart(self.mcu.bus_mut().slot_mut(slot).registers_mut());
        self.watchdog = Watchdog::new();
    }

    fn poll(&mut self, now: VirtualNanos) {
        // Only the serial line has anything outside. Polling all of the 122 models at each of 20 000 conversions a second takes longer than the
        // conversions.
        let slot = self.slots.serial;
        let (bus, model) = self.mcu.split(slot);
        if let Some(model) = model {
            let (registers, mut context) = bus.drive(now, slot);
            model.poll(registers, &mut context);
        }
        let drives = self.drives();
        self.sampler.front.drive(drives);
        // All converters share one VREF+; this one uses the part's own reference, in mV.
        let [.., adc3] = &mut self.mcu.adc;
        adc3.set_reference(self.sampler.rail_mv);
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        let (bus, model) = self.mcu.split(slot);
        let model: Option<&mut dyn ErasedDevice> = match slot {
            s if s == self.slots.adc1 => Some(&mut self.sampler),
            s if s == self.slots.flash => Some(&mut self.flash),
            s if s == self.slots.watchdog => Some(&mut self.watchdog),
            _ => model,
        };
        (bus, model)
    }
}

impl Part {
    /// The levels that the firmware drives at the sensors' own inputs.
    fn drives(&self) -> Drives {
        let [st1, st2, low, high] = std::array::from_fn(|k| {
            let (port, pin) = DRIVEN[k];
            let registers = self.mcu.bus().slots()[self.slots.ports[k]].registers();
            let pin = Pin::new(pin).expect("a port has sixteen pins");
            self.mcu.gpio[port].level(pin, registers) == Level::High
        });
        Drives {
            st1,
            st2,
            g_select: [low, high],
        }
    }

    fn sampler_reset(&mut self) {
        rigless::device::Device::reset(&mut self.sampler);
    }
}

/// The board as the emulator sees it.
#[derive(Debug)]
pub(crate) struct Machine {
    pub(crate) part: Part,
    core: CoreSpec,
}

impl Machine {
    /// `unit_id`: the number programmed by the part's manufacturer.
    pub(crate) fn new(
        front: Front,
        sensor: Option<Inertial>,
        wiring: Wiring,
        far_end: FarEnd,
        unit_id: [u8; 12],
    ) -> Result<Self, Error> {
        // The emulator describes this part's core only here.
        let mut core = Stm32h743Bench::new()?.targets().swap_remove(0).core;
        let written = Image::new(Path::new("unit id"), unit_id.to_vec(), Some(UNIT_ID_AT));
        core.factory_images
            .push(written.expect("bytes that are no ELF file have an address"));
        Ok(Self {
            part: Part::new(front, sensor, wiring, far_end)?,
            core,
        })
    }
}

// Snapshots are not used: every run starts from the beginning.
impl Store for Machine {}

impl Board for Machine {
    fn name(&self) -> &'static str {
        self.part.wiring.name
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let core = self.core.clone();
        vec![Target::new("stm32h743", &mut self.part, core)]
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec!["stm32h743"]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut self.part)
    }
}
