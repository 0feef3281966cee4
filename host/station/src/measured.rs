//! One measured quantity.

use serde::Serialize;

/// A value with its standard uncertainty, in the unit of data sheets, before any limit is known.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// Stable name, such as `gyro_x_offset`.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Unit of all figures.
    pub unit: String,
    /// Standard uncertainty: type A and type B. 0 for a count.
    pub sigma: f64,
    /// Its part of type A: how another measurement in the same place differs, one standard deviation.
    pub repeatability: f64,
}

impl Measured {
    /// A quantity of which only noise makes the uncertainty.
    pub fn new(name: impl Into<String>, value: f64, unit: &str, sigma: f64) -> Self {
        Self {
            name: name.into(),
            value,
            unit: unit.into(),
            sigma,
            repeatability: sigma,
        }
    }

    /// With a further uncertainty that is the same in every measurement in this place: `type_b`, one standard deviation.
    pub fn with_common(mut self, type_b: f64) -> Self {
        self.sigma = self.sigma.hypot(type_b);
        self
    }
}
