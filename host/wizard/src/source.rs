//! Sources of samples: a mimu device, or a board of another maker that writes lines of text.

use mimu_core::compensation::Affine;
use mimu_device::Session;
use mimu_recording::{ClockRate, Error, RawUnit, Result, SensorSettings};

/// The unit at a port.
#[derive(Debug, Clone)]
pub struct Unit {
    /// Identifies the unit: the number of the microcontroller, or the name of the port.
    pub id: String,
    /// Name for the user.
    pub name: String,
    /// Unit of its raw readings.
    pub raw_unit: RawUnit,
    /// Its sensors as they are set, if it says so.
    pub sensors: Option<SensorSettings>,
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Whether it has a magnetometer.
    pub has_mag: bool,
    /// Model of gyro and accelerometer from the data sheets, raw to SI; accurate enough to find which side is up. `None`: estimated from gravity.
    pub nominal: Option<[Affine<f64>; 2]>,
    /// Its reset cause and stored calibration, in words.
    pub told: Vec<String>,
    /// Whether it stores calibrations, and runs self-tests.
    pub is_device: bool,
    /// Last reset cause, unless it was a power-on.
    pub start: Option<String>,
}

/// Consecutive samples.
#[derive(Debug, Clone)]
pub struct Chunk {
    /// Tick of the first sample: sample periods since the source began. Never decreases.
    pub tick: u64,
    /// Raw readings, gyro x, y, z, accelerometer x, y, z.
    pub values: Vec<[f64; 6]>,
    /// Raw readings of the magnetometer beside them; empty without one.
    pub mag: Vec<[f64; 3]>,
    /// Temperature, °C; NaN if unknown.
    pub temp_c: f64,
    /// Whether one of the readings may be at a rail.
    pub saturated: bool,
    /// Whether a self-test deflected the sensors.
    pub self_test: bool,
    /// Time of the first sample and time between samples, ns, by a better clock than the one that takes them: an oscillator on a sensor's chip warms and
    /// drifts by 0.1 %. `None`: a period of the nominal rate per tick.
    pub crystal_ns: Option<[u64; 2]>,
    /// Time of the power-on by the clock of the times, s; `None` if unknown.
    pub power_on_s: Option<f64>,
}

impl Chunk {
    /// Tick after its last sample.
    pub fn end(&self) -> u64 {
        self.tick + self.values.len() as u64
    }

    /// Time of each sample, s, at this nominal rate.
    pub fn times(&self, rate_hz: f64) -> impl Iterator<Item = f64> {
        let (tick, crystal_ns) = (self.tick, self.crystal_ns);
        (0..self.values.len() as u64).map(move |k| match crystal_ns {
            // In whole ns, so that samples that are milliseconds apart get the nearest number.
            Some([first, period]) => (first + k * period) as f64 / 1e9,
            None => (tick + k) as f64 / rate_hz,
        })
    }
}

/// An event of a source, or of the line to it, which may be lost.
#[derive(Debug)]
pub enum SourceEvent {
    /// Samples.
    Samples(Chunk),
    /// The device restarted, with its reset cause.
    Restarted(String),
    /// Information for the user.
    Note(String),
    /// The clock of the samples, compared with this computer's once more.
    Clock(ClockRate),
    /// Nothing came for a short while.
    Nothing,
    /// The line was lost, and why.
    Lost(Error),
    /// Another unit is at the port.
    Other(Error),
    /// The line is back.
    Back(Box<Unit>),
}

/// Samples in order from a unit that may vanish.
pub trait Source: Send {
    /// The unit.
    fn unit(&self) -> &Unit;

    /// The next event; waits at most a few milliseconds. After an error the source is gone, and has to be opened again.
    fn next(&mut self) -> Result<SourceEvent>;

    /// The session, if this is a mimu device. The stream restarts with the next [`Source::next`], whatever was requested.
    fn device(&mut self) -> Option<&mut Session> {
        None
    }
}

/// Opens a source: at the beginning, and again after it was lost. The argument is the first tick that it may use.
pub type Opener = Box<dyn FnMut(u64) -> Result<Box<dyn Source>> + Send>;
