//! ADC1 with the bench at its pins: the emulator's converter, which gets the voltages at the time of each conversion.

use rigless::device::{Device, DeviceContext, RegisterFile, RequestChange};
use rigless::soc::stm32h743::generated::adc3::{Register, isr};
use rigless::soc::stm32h743::peripherals::adc::{Adc, Channel, Converter};
use rigless::time::{EventId, VirtualNanos};

use crate::front::Front;
use crate::schematic::{INPUTS, Volts};

/// Conversions since the last call, with the longest and the shortest time between successive ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Conversions {
    /// Number of conversions.
    pub count: u64,
    /// End of the first, ns.
    pub first_ns: u64,
    /// End of the last, ns.
    pub last_ns: u64,
    /// Shortest time between two, ns; `u64::MAX` if there are fewer than two.
    pub shortest_ns: u64,
    /// Longest time between two, ns.
    pub longest_ns: u64,
}

impl Conversions {
    const NONE: Self = Self {
        count: 0,
        first_ns: 0,
        last_ns: 0,
        shortest_ns: u64::MAX,
        longest_ns: 0,
    };

    fn add(&mut self, at: u64) {
        if self.count == 0 {
            self.first_ns = at;
        } else {
            self.shortest_ns = self.shortest_ns.min(at - self.last_ns);
            self.longest_ns = self.longest_ns.max(at - self.last_ns);
        }
        self.last_ns = at;
        self.count += 1;
    }
}

/// The converter and its front end.
#[derive(Debug)]
pub(crate) struct Sampler {
    adc: Adc,
    pub(crate) front: Front,
    /// Conversions never end.
    pub(crate) stopped: bool,
    /// VREF+ at the last conversion, mV.
    pub(crate) rail_mv: u32,
    conversions: Conversions,
}

impl Sampler {
    pub(crate) fn new(front: Front) -> Self {
        Self {
            // It has no clock until the firmware starts one.
            adc: Adc::new(Converter::Adc1, 0),
            front,
            stopped: false,
            rail_mv: 3300,
            conversions: Conversions::NONE,
        }
    }

    pub(crate) fn take_conversions(&mut self) -> Conversions {
        std::mem::replace(&mut self.conversions, Conversions::NONE)
    }

    fn show(&mut self, volts: &Volts) {
        // The model takes millivolts but uses only ratios. Microvolts are passed, because the converter's step, 50 µV, would be lost in millivolts.
        let microvolts = |v: f64| (v * 1e6).round() as u32;
        self.adc.set_reference(microvolts(volts.rail));
        self.rail_mv = (volts.rail * 1e3).round() as u32;
        for (number, &v) in (0..INPUTS as u8).zip(&volts.input) {
            let channel = Channel::new(number).expect("an input of the converter");
            self.adc.set_input(channel, microvolts(v));
        }
    }
}

impl Device for Sampler {
    type Register = Register;

    fn read(
        &mut self,
        register: Register,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        self.adc.read(register, registers, context)
    }

    fn peek(&self, register: Register, registers: &RegisterFile, now: VirtualNanos) -> Option<u64> {
        self.adc.peek(register, registers, now)
    }

    fn write(
        &mut self,
        register: Register,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        self.adc.write(register, value, registers, context);
    }

    fn on_event(
        &mut self,
        event: EventId,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if self.stopped {
            return;
        }
        let now = context.now().0;
        let volts = self.front.at(now);
        self.show(&volts);
        let converted = |registers: &RegisterFile| isr::EOC.is_set(registers.get(Register::Isr));
        let before = converted(registers);
        self.adc.on_event(event, registers, context);
        if converted(registers) && !before {
            self.conversions.add(now);
        }
    }

    fn on_request(
        &mut self,
        change: RequestChange,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        self.adc.on_request(change, registers, context);
    }

    fn on_clock(&mut self, hz: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.adc.on_clock(hz, registers, context);
    }

    fn reset(&mut self) {
        self.adc.reset();
    }

    fn reset_line(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.adc.reset_line(registers, context);
    }
}
