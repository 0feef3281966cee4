//! What a board measures with. A source gives integers; what they mean, the source says beside them.
//!
//! | part        | where it runs                                  | what it does                                                     |
//! |-------------|------------------------------------------------|------------------------------------------------------------------|
//! | `Acquire`   | the sampling task, on the target only          | takes scans, and reports why it had to begin anew                |
//! | [`Source`]  | the pipeline, also on the PC                   | scale, temperatures and faults of a batch, from its scans        |
//!
//! The two halves run at different priorities, so only [`Scan`]s pass between them.

use core::ops::AddAssign;

use heapless::Vec;
use mimu_core::PerSensor;
use mimu_core::compensation::Sample;
use mimu_core::stored::{self, Stored, StoredError};
use mimu_core::wire::{Triad, WrongRegister};

use crate::board;
use crate::front_end::FrontEnd;

/// Most thermometers of a source.
pub const THERMOMETERS: usize = 3;

/// Integers of both triads, x, y, z: at most 24 bits with their sign.
pub use mimu_core::wire::Counts;

/// A sample as a source gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scan<Slow> {
    /// Number of the sample since sampling began. Lost samples have numbers too.
    pub number: u32,
    /// When it was taken, µs since sampling began, by the crystal.
    pub tick_us: u64,
    /// True time between samples, ns, by the crystal.
    pub period_ns: u32,
    /// Readings of both triads.
    pub counts: Counts,
    /// What the source needs only once per batch: references, temperatures.
    pub slow: Slow,
}

/// The calibration in `bytes`, if it is one for the sensors of [`board::Source`] as they are set: with another range or filter the same
/// motion makes other readings.
pub fn usable(bytes: &[u8]) -> Result<Stored, StoredError> {
    let stored = stored::decode(bytes)?;
    stored.origin.check_sensors(&board::Source::TRIADS)?;
    Ok(stored)
}

/// Why a source had to begin anew. Samples were lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The reader was late: the sample was being overwritten.
    Late,
    /// The buffer of the converter or sensor overflowed.
    Overrun,
    /// No data, and no flag that gives the reason.
    Stalled,
    /// The sensor is missing, another one, or set otherwise than it must be.
    Wrong(WrongRegister),
}

/// The meaning of a source's integers, followed batch by batch.
pub trait Source {
    /// Slow quantities of a scan; the pipeline adds up those of a batch.
    type Slow: Copy + Default + AddAssign;

    /// The triads by their data sheets. The rate is the nominal one; the greeting has the measured one.
    const TRIADS: PerSensor<Triad<'static>>;

    /// Places of the thermometers, separated by commas.
    const PLACES: &'static str;

    /// Before the first scan, with what was stored with the calibration in use.
    fn new(kept: &FrontEnd) -> Self;

    /// Updates what is to be stored with the next calibration.
    fn keep(&self, kept: &mut FrontEnd);

    /// Processes the end of a batch of `count` scans: the total of their slow quantities.
    fn update(&mut self, total: &Self::Slow, count: u32);

    /// Whether any scan was processed.
    fn begun(&self) -> bool;

    /// Raw units (V or count) per unit of the integers.
    fn scale(&self) -> PerSensor<f32>;

    /// Whether a sensor is at the end of its range: its integers, and the same in raw units.
    fn is_saturated(counts: &Counts, raw: &Sample<f32>) -> bool;

    /// Temperature of the sensors, °C; the last good one if there is none now, and 25 °C before the first.
    fn temp_c(&self) -> f32;

    /// Whether there has been a good temperature.
    fn has_known_temperature(&self) -> bool;

    /// Reading of each thermometer, °C, including those that are left out.
    fn temperatures_c(&self) -> Vec<f32, THERMOMETERS>;

    /// Faults, as [`flags`](mimu_core::wire::flags).
    fn flags(&self) -> u16;
}
