//! Where samples come from: a mimu device, or a board of another maker that writes lines of text.

use mimu_core::compensation::Affine;
use mimu_device::Session;
use mimu_recording::RawUnit;
use mimu_recording::error::Result;

/// Who is at the port.
#[derive(Debug, Clone)]
pub struct Unit {
    /// What it is told apart by: the number of the microcontroller, or the name of the port.
    pub id: String,
    /// What a person calls it.
    pub name: String,
    /// Unit of its raw readings.
    pub raw_unit: RawUnit,
    /// Samples a second.
    pub rate_hz: f64,
    /// Data-sheet model of gyro and accelerometer, raw to SI: good enough to find which side is up. `None`: estimated from gravity.
    pub nominal: Option<[Affine<f64>; 2]>,
    /// Lines about itself: reset cause and stored calibration.
    pub told: Vec<String>,
    /// Whether it stores calibrations, tests itself and runs Kalman banks.
    pub is_device: bool,
    /// Why it started, if it was no power-on.
    pub start: Option<String>,
}

/// Consecutive samples.
#[derive(Debug, Clone)]
pub struct Chunk {
    /// Sample periods since the source began; never goes back.
    pub tick: u64,
    /// Raw readings, gyro x, y, z, accelerometer x, y, z.
    pub values: Vec<[f64; 6]>,
    /// °C, not a number where unknown.
    pub temp_c: f64,
    /// Whether one of the readings may be at the end of its range.
    pub saturated: bool,
    /// Whether a self-test deflected the sensors.
    pub self_test: bool,
    /// Time of the power-on on the clock of the ticks, s; `None` if unknown.
    pub power_on_s: Option<f64>,
}

/// What a source has to say.
#[derive(Debug)]
pub enum Heard {
    /// Samples.
    Samples(Chunk),
    /// The device has restarted, and why.
    Restarted(String),
    /// Something that a person should know.
    Note(String),
    /// Nothing, for a little while.
    Nothing,
}

/// Samples in order, from something that can vanish.
pub trait Source: Send {
    /// Who it is.
    fn unit(&self) -> &Unit;

    /// What comes next; waits for a few milliseconds at most. An error: it is gone, and has to be opened anew.
    fn next(&mut self) -> Result<Heard>;

    /// The session, where there is a mimu device. Whatever is asked of it, the stream begins again with the next [`Source::next`].
    fn device(&mut self) -> Option<&mut Session>;

    /// The same for short calls that do not disturb the stream: no sample is lost.
    fn aside(&mut self) -> Option<&mut Session>;
}

/// Opens a source: at the beginning, and after it was gone. The tick is the first that it may use.
pub type Opener = Box<dyn FnMut(u64) -> Result<Box<dyn Source>> + Send>;
