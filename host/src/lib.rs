//! Calibration of inertial units made of analog MEMS sensors.
pub mod error;
pub mod recording;
