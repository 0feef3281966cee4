//! What a command found, as one type each: its JSON is that type, and text and page are views of it.
//!
//! SI throughout; what is not a number is null in JSON.

pub mod allan;
pub mod design;
pub mod diagnosis;
pub mod fit;
pub mod next_experiment;
pub mod verify;

use serde::Serialize;

/// Something for each sensor that there is.
#[derive(Debug, Clone, Serialize)]
pub struct Sensors<T> {
    /// Of the gyro.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro: Option<T>,
    /// Of the accelerometer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel: Option<T>,
}

impl<T> Sensors<T> {
    /// Those that there are with their names, the gyro first.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, &T)> {
        let gyro = self.gyro.as_ref().map(|s| ("gyro", s));
        let accel = self.accel.as_ref().map(|s| ("accel", s));
        gyro.into_iter().chain(accel)
    }
}

/// Program and version that a result is from.
const TOOL: &str = concat!("mimu ", env!("CARGO_PKG_VERSION"));
