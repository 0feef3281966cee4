//! Rows, to which the curves are fitted: means of segments within a dwell.

use mimu::estimate::EarthShare;
use nalgebra::Vector3;

/// Mean of a segment within one dwell.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Middle of the segment, s.
    pub middle_s: f64,
    /// Number of samples.
    pub samples: f64,
    /// Raw reading.
    pub raw: Vector3<f64>,
    /// Known input, SI, for a gyro with the likeliest rate of the Earth; not a number where it is unknown.
    pub input: Vector3<f64>,
    /// The Earth's rate in it.
    pub earth: EarthShare,
    /// Direction up in body axes; not a number where no force is known.
    pub up: Vector3<f64>,
    /// Number of the dwell.
    pub step: i32,
}

impl Row {
    /// Adds the samples of `other`.
    pub(crate) fn join(&mut self, other: &Self) {
        let samples = self.samples + other.samples;
        let share = other.samples / samples;
        self.middle_s += share * (other.middle_s - self.middle_s);
        self.raw += share * (other.raw - self.raw);
        self.input += share * (other.input - self.input);
        self.earth.known += share * (other.earth.known - self.earth.known);
        self.earth.by += share * (other.earth.by - self.earth.by);
        self.samples = samples;
    }
}
