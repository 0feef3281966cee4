//! Calibration of inertial units made of analog MEMS sensors.
//!
//! A recording ([`recording`]) is condensed in one pass ([`blocks`]), its dwells are found ([`dwell`])
//! and their noise measured ([`noise`]); an estimator ([`estimate`]) makes a calibration of each triad
//! ([`triad`]) of them, which is judged on data it has not seen ([`fit`]).

pub mod blocks;
pub mod calibration;
pub mod dwell;
pub mod error;
pub mod estimate;
pub mod fit;
pub mod noise;
mod plausible;
pub mod recording;
pub mod report;
pub mod triad;
pub mod verify;
