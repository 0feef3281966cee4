//! The part of the recordings that a sensor's curves use, in numbers and in words.

use serde::Serialize;

/// The part of the recordings that a sensor's curves use.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Used {
    /// Share of the samples.
    pub samples: f64,
    /// Share of the temperatures of the thermometer, in steps of a kelvin.
    pub temperatures: f64,
    /// Lowest and highest temperature of the thermometer in that part, °C.
    pub used_c: [f64; 2],
    /// Lowest and highest temperature of the thermometer, °C.
    pub recorded_c: [f64; 2],
}

impl Used {
    /// In one line.
    pub fn words(&self) -> String {
        let percent = |share: f64| match share {
            // Nearly all is not shown as all.
            share if share < 1.0 => (100.0 * share).min(99.9),
            _ => 100.0,
        };
        format!(
            "{:.1} % of the samples, {:.1} to {:.1} °C of {:.1} to {:.1} °C",
            percent(self.samples),
            self.used_c[0],
            self.used_c[1],
            self.recorded_c[0],
            self.recorded_c[1]
        )
    }
}
