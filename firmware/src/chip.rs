//! A digital inertial sensor: what [`digital`](crate::digital) needs of its driver.
//!
//! A driver is one file, with the registers and their reasons, a [`Part`] and a [`Chip`]. The board's file names it.

use core::future::Future;

use mimu_core::PerSensor;
use mimu_core::wire::{Counts, Triad, WrongRegister};

/// The line to the chip, and time.
pub trait Bus {
    /// Reads successive registers.
    fn read(&mut self, register: u8, into: &mut [u8])
    -> impl Future<Output = Result<(), BusFault>>;
    /// Writes one register.
    fn write(&mut self, register: u8, value: u8) -> impl Future<Output = Result<(), BusFault>>;
    /// Waits.
    fn wait_us(&mut self, us: u32) -> impl Future<Output = ()>;
    /// The crystal's time, µs.
    fn now_us(&self) -> u64;
}

/// A transfer failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusFault;

/// What is wrong with the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Problem {
    /// A transfer failed.
    Bus,
    /// A register that does not read what it must: that of another chip or of none, or one that was not written.
    Register(WrongRegister),
    /// What comes is no packet: its first byte.
    Packet(u8),
}

impl From<BusFault> for Problem {
    fn from(_: BusFault) -> Self {
        Self::Bus
    }
}

/// A packet of the FIFO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet {
    /// Gyro and accelerometer; `None` where the chip says that it has no valid reading.
    pub counts: Option<Counts>,
    /// Temperature of the die in the chip's own steps, if it is valid.
    pub temperature: Option<i16>,
    /// Time stamp by the chip's clock, in its own steps.
    pub stamp: u32,
}

/// What the integers of a chip are, by its data sheet.
pub trait Part {
    /// The triads. The rate is that of the chip's nominal clock.
    const TRIADS: PerSensor<Triad<'static>>;

    /// Whether a reading is at the end of its range.
    fn is_saturated(counts: &Counts) -> bool;

    /// Temperature of a packet, or a mean of several, °C.
    fn celsius(temperature: f32) -> f32;

    /// Samples from one time stamp to the next, 1 if none was lost; `None` if the stamps are not those of samples. `elapsed_us` by the crystal
    /// resolves how often the stamp has wrapped.
    fn samples_between(before: u32, after: u32, elapsed_us: u64) -> Option<u32>;
}

/// The driver of a chip.
pub trait Chip: Part {
    /// The line to it.
    type Bus: Bus;

    /// The line to it.
    fn bus(&mut self) -> &mut Self::Bus;

    /// Resets the chip, checks its identity, and starts both triads with an empty FIFO.
    fn start(&mut self) -> impl Future<Output = Result<(), Problem>>;

    /// Gives the oldest packets in the FIFO to `take`, at most `most`. Returns how many were left when it looked.
    fn poll(
        &mut self,
        most: usize,
        take: impl FnMut(Packet),
    ) -> impl Future<Output = Result<usize, Problem>>;

    /// Deflects all axes of these triads, and of no other.
    fn deflect(&mut self, gyro: bool, accel: bool) -> impl Future<Output = Result<(), Problem>>;

    /// Responses to the deflection that the factory stored, dps and g; `None` where it stored none.
    fn factory_responses(
        &mut self,
    ) -> impl Future<Output = Result<PerSensor<[Option<f32>; 3]>, Problem>>;
}
